"""A periodic cell and its wavevectors; fields between grids.

Axis 0 is x (the default direction of sliding), axis 1 is y. A field of shape `(nx, ny)` has the
half spectrum `(nx, ny//2 + 1)` of `rfftn`; a one-dimensional cell `(nx,)` has `(nx//2 + 1,)`.
Wavevectors are angular, q = 2π k/L [rad/m]. On a Nyquist line both signs of that component of q are
the same mode, so what is odd in it (a derivative) vanishes there. Of a response that depends on the
direction the real part of the mean of both signs is taken: then the half spectrum is
Hermitian, it belongs to a real operator, and its resolvent to the resolvent of this operator.
"""

import functools
import math
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import NamedSharding
from jaxtyping import Bool, Float, Inexact

from ..core.checks import Numbers, as_float, check_positive, short
from ..core.display import shown
from .devices import num_devices, put_on, sharding_on, whole_along
from .transforms import to_field, to_spectrum

Waves = Inexact[Array, "*half"]  # one number for each wave of a half spectrum


@shown(units=False)
class Grid(eqx.Module):
    """A rectangular periodic cell sampled at equally spaced points.

    **Fields:**

    - `shape`: number of points `(nx, ny)`, or `(nx,)` in one dimension. Static.
    - `size`: edge lengths [m], shape `(ndim,)`; one number means a square.

    With `devices`, such as `jax.devices()`, each holds its share of the rows of every field of this
    grid and of what is computed from it: surfaces, kernels, contacts, derivatives. `size` lies on
    all of them, which its type shows.
    """

    shape: tuple[int, ...] = eqx.field(static=True)
    size: Float[Array, " ndim"]

    def __init__(
        self,
        shape: int | tuple[int, ...],
        size: Numbers,
        devices: Sequence[jax.Device] | None = None,
    ):
        counts = tuple(shape) if isinstance(shape, Sequence | np.ndarray) else (shape,)
        whole = (isinstance(n, int | np.integer) and not isinstance(n, bool) for n in counts)
        if not (0 < len(counts) < 3 and all(whole) and 4 <= min(counts) <= max(counts) < 2**48):
            raise ValueError(
                f"`shape={short(shape)}` is refused: one or two whole numbers from 4 to 2^48."
            )
        self.shape = tuple(int(n) for n in counts)
        edges = as_float(size, "size")
        if edges.shape not in ((), (len(counts),)):
            raise ValueError(
                f"`size` has shape {edges.shape}; one length, or as many as `shape={self.shape}` "
                "has entries, are needed."
            )
        check_positive("size", edges, "[m]")
        size = jnp.broadcast_to(edges, (len(counts),))
        self.size = size if devices is None else put_on(devices, size)
        parts = num_devices(self.size)
        if parts > 1 and (self.ndim == 1 or self.shape[0] % parts):
            raise ValueError(
                f"`shape={self.shape}` is refused on {parts} `devices`: two axes are needed, and "
                f"{parts} must divide the first."
            )

    @property
    def ndim(self) -> int:
        return len(self.shape)

    @property
    def spacing(self) -> Float[Array, " ndim"]:
        """Distance between neighbouring points along each axis [m]."""
        return self.size / np.array(self.shape)

    @property
    def sharding(self) -> NamedSharding | None:
        """How fields lie on the devices, for `jax.make_array_from_callback`; None for one device.

        Not under `jit`.
        """
        return sharding_on(self.size)


def half_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Returns the shape of the half spectrum of a field of this shape."""
    return (*shape[:-1], shape[-1] // 2 + 1)


def mode_numbers(shape: tuple[int, ...]) -> tuple[np.ndarray, ...]:
    """Returns the integers k of q = 2π k/L on the half spectrum, broadcastable; Nyquist is +n/2."""
    # 0, 1, ..., n//2 and then the negative ones.
    axes = [(np.arange(n) + (n - 1) // 2) % n - (n - 1) // 2 for n in shape]
    axes[-1] = np.arange(shape[-1] // 2 + 1)
    return tuple(np.meshgrid(*axes, indexing="ij", sparse=True))


def wavevector(
    grid: Grid, numbers: tuple[np.ndarray, ...] | None = None
) -> tuple[Float[Array, "..."], ...]:
    """Returns the components (qx, qy) [rad/m] on the half spectrum, each broadcastable to it.

    Or at other mode `numbers`.
    """
    pairs = zip(numbers or mode_numbers(grid.shape), grid.size, strict=True)
    return tuple(2 * np.pi * jnp.asarray(k, grid.size.dtype) / length for k, length in pairs)


@jax.jit
def odd_wavevector(grid: Grid) -> tuple[Float[Array, "..."], ...]:
    """Returns the components of `wavevector`, each 0 on its Nyquist line."""
    return tuple(
        jnp.where(2 * np.abs(k) == n, 0, q)
        for k, n, q in zip(mode_numbers(grid.shape), grid.shape, wavevector(grid), strict=True)
    )


@jax.jit
def wavenumber(grid: Grid) -> Float[Array, "..."]:
    """Returns |q| [rad/m] on the half spectrum; the q = 0 entry is 0 and has derivative 0."""
    components = wavevector(grid)
    squared = sum(component**2 for component in components)
    # The root has no derivative at 0, so the mean is 1 before it and 0 after it.
    zero = zero_mode(grid.shape)
    return jnp.where(zero, 0, jnp.sqrt(jnp.where(zero, 1, squared)))


def nyquist_lines(shape: tuple[int, ...]) -> Bool[Array, "*half"]:
    """Returns where any component of the half spectrum is at its Nyquist number, as a mask."""
    return _any(2 * np.abs(k) == n for k, n in zip(mode_numbers(shape), shape, strict=True))


def both_signs(shape: tuple[int, ...]) -> tuple[np.ndarray, ...]:
    """Returns mode numbers as `mode_numbers`, with both signs of the Nyquist number of an axis x.

    In two dimensions kx is 0 ... nx//2, -(nx//2) ... -1: with a response at these numbers both
    signs of each component are known, for R(-q) is the conjugate of R(q). See `even_on_nyquist`.
    """
    *rows, columns = (np.arange(n // 2 + 1) for n in shape)
    if not rows:
        return (columns,)
    kx = np.concatenate([rows[0], -rows[0][:0:-1]])
    return kx[:, None], columns[None, :]


def even_on_nyquist(response: Inexact[Array, "..."], shape: tuple[int, ...]) -> Array:
    """Returns the half spectrum of a response given at the numbers of `both_signs`.

    On Nyquist lines it is the real part of the mean over both signs of that component.
    """
    if shape[-1] % 2 == 0:
        # R(kx, -ky) is the conjugate of R(-kx, ky).
        column = response[..., -1]
        mirrored = jnp.roll(column[::-1], 1) if column.ndim else column
        response = response.at[..., -1].set((column.real + mirrored.real) / 2)
    if len(shape) == 1 or shape[0] % 2 == 1:
        return response
    half = shape[0] // 2
    line = ((response[half] + response[half + 1]).real / 2)[None].astype(response.dtype)
    return jnp.concatenate([response[:half], line, response[half + 2 :]])


def multiplicity(shape: tuple[int, ...]) -> np.ndarray:
    """Returns how often each entry of the half spectrum occurs in the full one: 1 or 2."""
    columns = np.arange(shape[-1] // 2 + 1)
    return np.where((columns == 0) | (2 * columns == shape[-1]), 1, 2)


def zero_mode(shape: tuple[int, ...]) -> Bool[Array, "*half"]:
    """Returns where the half spectrum has its mean, q = 0, as a mask."""
    return ~_any(k != 0 for k in mode_numbers(shape))


def _any(masks):
    """Combined by XLA: otherwise a constant as large as the grid would be compiled in."""
    return functools.reduce(jnp.logical_or, map(jnp.asarray, masks))


def derivative(field: Float[Array, "*shape"], grid: Grid, axis: int) -> Float[Array, "*shape"]:
    """Returns the spectral derivative of a periodic field along one axis [field/m]."""
    return to_field(1j * odd_wavevector(grid)[axis] * to_spectrum(field), grid.shape)


@functools.partial(jax.jit, static_argnums=(1, 2))
def resample_spectrum(spectrum: Array, shape: tuple[int, ...], new_shape: tuple[int, ...]) -> Array:
    """Returns a half spectrum cut or zero-padded to the modes of another grid on the same cell.

    Values are copied, not rescaled. On the Nyquist lines of a coarser axis the even part is taken,
    see `even_on_nyquist`; the Nyquist lines of a finer axis stay empty.
    """
    if new_shape == shape:
        return spectrum
    numbers = mode_numbers(new_shape)
    known, lines, last = [], [], len(shape) - 1
    mirrored = spectrum
    for axis, (n, m, k) in enumerate(zip(shape, new_shape, numbers, strict=True)):
        kept = (2 * np.abs(k) < min(n, m)) | ((2 * np.abs(k) == m) & (m <= n))
        known.append(kept)
        lines.append((2 * np.abs(k) == m) & (m < n))
        # Modes that are not known take another's place, to be masked.
        k = np.where(kept, k, 0).ravel()
        spectrum, mirrored = (whole_along(modes, axis) for modes in (spectrum, mirrored))
        spectrum = jnp.take(spectrum, k % n, axis, mode="clip")
        mirrored = jnp.take(mirrored, (k if axis == last else -k) % n, axis, mode="clip")
    even = spectrum.real if last == 0 else (spectrum.real + mirrored.real) / 2
    spectrum = jnp.where(_any(lines), even, spectrum)
    return jnp.where(~_any(~kept for kept in known), spectrum, 0)


def resampled(field: Float[Array, "*shape"], shape: tuple[int, ...]) -> Float[Array, "*new"]:
    """Returns a periodic field on another grid, with the waves that both resolve."""
    waves = resample_spectrum(to_spectrum(field), field.shape, shape)
    return to_field(waves, shape) * (math.prod(shape) / field.size)


def interpolate(field: Float[Array, "..."], shape: tuple[int, ...]) -> Float[Array, "*shape"]:
    """Returns a periodic field linearly interpolated on a finer grid of the same cell."""
    for axis, (n, m) in enumerate(zip(field.shape, shape, strict=True)):
        if n == m:
            continue
        # Places of the new points in spacings of the old grid.
        position = np.arange(m) * (n / m)
        left = np.floor(position).astype(int)
        weight = (position - left).reshape([-1 if i == axis else 1 for i in range(field.ndim)])
        weight = jnp.asarray(weight, field.dtype)
        field = whole_along(field, axis)
        right = jnp.take(field, (left + 1) % n, axis, mode="clip")
        field = jnp.take(field, left, axis, mode="clip") * (1 - weight) + right * weight
    return field
