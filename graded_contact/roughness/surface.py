"""Rough surfaces: random ones of a given spectrum, statistics, resampling.

Heights h [m] point into the solid. Fourier amplitudes are h(x) = Σ_q h_q exp(i q·x), so that
|h_q|² = C(q) Π 2π/L. Slopes, curvatures and spectra ignore the mean height; slopes are those of the
trigonometric interpolant, and a component at its Nyquist number has none (see `grid`).
"""

from functools import partial
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Complex, Float, PRNGKeyArray, ScalarLike

from ..core.checks import (
    Numbers,
    as_float,
    check_positive,
    check_shape,
    check_type,
    check_types,
    check_values,
    check_whole,
    is_concrete,
    short,
)
from ..core.compilation import compiled
from ..core.display import shown
from ..core.memory import check_memory, surface_memory
from ..core.warnings import caveats_of_steps
from ..fields.devices import binned, num_devices, spread
from ..fields.grid import (
    Grid,
    mode_numbers,
    multiplicity,
    nyquist_lines,
    resample_spectrum,
    rings,
    to_field,
    to_spectrum,
    wavenumber,
    wavevector,
    zero_mode,
)
from .spectrum import (
    SelfAffine,
    check_square,
    narrowing,
    one_of_height_and_slope,
    relative_density,
    rms_height_of,
)


@shown()
class Step(NamedTuple):
    """The roughness after one step of reading a measured surface, see `step`.

    **Fields:**

    - `name`: of the step.
    - `rms_height`: about the mean [m].
    - `rms_slope`: between neighbouring measured points [1].
    - `peak`: the largest distance from the mean over the rms height [1].
    - `missing`: the share of points without a height [1].
    """

    name: str
    rms_height: float
    rms_slope: float
    peak: float
    missing: float


@shown("grid", "heights", "measured", "history", "caveats")
class Surface(eqx.Module):
    """Heights of a rough surface: periodic, or on a window with no pressure around it.

    **Fields:**

    - `heights`: h [m], shape `grid.shape`. The mean need not be zero; contact ignores it.
    - `grid`: the periodic cell, or the window.
    - `history`: the changes of the heights, one sentence each. Static.
    - `measured`: how much of each height was measured [1], shape `grid.shape`: 1 as measured, 0
      invented to fill a hole, the factor of the window where tapered; None: all alike.
    - `steps`: the roughness after every step of reading. Static.
    - `periodic`: whether the surface repeats. If not, as an indenter or the edge of a block, the
      block's surface around the window is free of load. Static.
    """

    heights: Float[Array, "*shape"]
    grid: Grid
    history: tuple[str, ...] = eqx.field(static=True)
    # Not Boolean: `jax.grad` by a surface needs numbers in every leaf.
    measured: Float[Array, "*shape"] | None
    steps: tuple[Step, ...] = eqx.field(static=True)
    periodic: bool = eqx.field(static=True)

    def __init__(
        self,
        heights: Numbers,
        grid: Grid,
        history: tuple[str, ...] = (),
        measured: Numbers | None = None,
        steps: tuple[Step, ...] = (),
        periodic: bool = True,
    ):
        check_type("grid", grid, Grid)
        check_type("periodic", periodic, bool)
        check_type("history", history, tuple)
        self.grid, self.history, self.steps, self.periodic = grid, history, steps, periodic
        self.heights = _on_grid("heights", heights, grid)
        check_values("heights", self.heights, "heights must be finite numbers [m]")
        self.measured = None if measured is None else _on_grid("measured", measured, grid)
        if self.measured is not None:
            reason = "a share lies between 0 and 1"
            check_values("measured", self.measured, reason, at_least=0, at_most=1)

    @property
    def caveats(self) -> tuple[str, ...]:
        """Warnings about contact on this surface, one sentence each."""
        return caveats_of_steps(self.steps, np.asarray(self.grid.size).tolist())


def check_periodic(surface: Surface) -> None:
    """Raises `ValueError` for a surface on a window."""
    if not surface.periodic:
        raise ValueError("`surface` is on a window (`periodic=False`); a periodic one is needed.")


def _on_grid(name: str, field: Numbers, grid: Grid) -> Array:
    """A field of the grid, on its devices."""
    field = as_float(field, name)
    check_shape(name, field, grid.shape)
    return spread(field, grid.size)


def step(name: str, heights: Numbers, spacing: Numbers) -> Step:
    """Returns the roughness of heights [m], NaN where missing, at distances `spacing` [m]."""
    values = np.asarray(heights, float)
    deviation = values - np.nanmean(values)
    rms = float(np.sqrt(np.nanmean(deviation**2)))
    slopes = (np.diff(values, axis=axis) / apart for axis, apart in enumerate(np.asarray(spacing)))
    squares = [np.mean(slope[np.isfinite(slope)] ** 2) for slope in slopes]
    peak = float(np.nanmax(np.abs(deviation)) / rms) if rms > 0 else 0.0
    missing = float(np.mean(np.isnan(values)))
    return Step(name, rms, float(np.sqrt(np.sum(squares))), peak, missing)


def memory_in(grid: Grid):
    """Bytes that a surface of a shape takes, in the dtype of the grid."""
    return lambda shape: surface_memory(shape, grid.size.dtype.itemsize)


@check_types
def random_surface(
    spectrum: SelfAffine,
    grid: Grid,
    key: PRNGKeyArray,
    *,
    amplitudes: Literal["exact", "gaussian"] = "exact",
) -> Surface:
    """Returns a random surface (on a 1-D grid, a profile) with the given spectrum and zero mean.

    Each mode (kx, ky) draws from its own random stream, so a refined grid of the same size gives
    the same surface, and a 1-D grid the phases of the modes (kx, 0). Sums over modes replace
    integrals over q: the statistics agree with those of the spectrum up to the coarseness of the
    lattice at `q_low`; `rescale` makes one of them exact.

    **Arguments:**

    - `spectrum`: the spectrum C(q); its whole band must fit between 2π/L and the Nyquist
      wavenumber.
    - `grid`: the periodic cell.
    - `key`: a JAX random key (of the default kind, threefry).
    - `amplitudes`: `"exact"` gives every mode its expected amplitude and a uniformly random phase;
      `"gaussian"` a complex normal amplitude, as a piece of an infinite Gaussian surface has.

    **Returns:** the surface; differentiable in `spectrum`, usable under `vmap` over keys.
    """
    if not isinstance(key, jax.Array | np.ndarray) or key.dtype in (np.float32, np.float64):
        seed = key if isinstance(key, int) else 0
        raise ValueError(f"`key={short(key)}` must be a random key: `jax.random.key({seed})`.")
    parts = num_devices(grid.size)
    check_memory("grid", grid.shape, memory_in(grid), "a random surface", parts)
    _check_band(spectrum, grid)
    return Surface(_synthesise(spectrum, grid, key, amplitudes == "gaussian"), grid)


def _check_band(spectrum: SelfAffine, grid: Grid) -> None:
    """Refuses a spectrum that the modes of the grid do not cover."""
    if not all(map(is_concrete, (grid.size, spectrum.q_low, spectrum.q_high))):
        return
    rounding = 1e-5  # a size in float32 times a wavenumber in float32
    q_low, q_high = float(spectrum.q_low), float(spectrum.q_high)
    size = np.asarray(grid.size, float)  # NumPy: under `jit` JAX would trace even known numbers
    nyquist = np.pi * np.min(np.array(grid.shape) / size)
    fundamental = 2 * np.pi / np.max(size)
    if q_high > nyquist * (1 + rounding):
        raise ValueError(
            f"`q_high={q_high:g}` is refused: the grid's Nyquist wavenumber is {nyquist:g} rad/m. "
            f"Use at least {q_high / nyquist:.3g} times as many points, or a smaller `q_high`."
        )
    if q_low < fundamental * (1 - rounding):
        raise ValueError(
            f"`q_low={q_low:g}` is refused: the smallest wavenumber of the cell is "
            f"2π/L = {fundamental:g} rad/m. Use a larger cell, or a larger `q_low`."
        )
    lay = spectrum.anisotropy
    if lay is not None and is_concrete(lay) and is_concrete(spectrum.q_roll):
        longest = float(spectrum.q_roll) / fundamental
        if float(lay) > max(longest, 1) * (1 + rounding):
            raise ValueError(
                f"`anisotropy={float(lay):g}` is refused: the correlation length along the lay, "
                f"γ/q_roll, must be at most that of the cell, L/2π, otherwise the modes do not "
                f"resolve the spectrum. This cell takes up to {max(longest, 1):.3g}. For a longer "
                "lay use a larger cell; for an endless lay a profile, on a 1-D grid."
            )
    if q_high < 2 * fundamental * (1 + rounding) or q_high < 2 * q_low:
        modes = zip(mode_numbers(grid.shape), size, strict=True)
        q = np.sqrt(sum((2 * np.pi * k / length) ** 2 for k, length in modes))
        if not np.any((q >= q_low * (1 - rounding)) & (q <= q_high * (1 + rounding))):
            raise ValueError(
                f"`q_low={q_low:g}` to `q_high={q_high:g}` is refused: no mode of the grid lies in "
                "this band. Use a larger cell, or a wider band."
            )


@compiled
def _synthesise(spectrum: SelfAffine, grid: Grid, key: Array, gaussian: bool) -> Array:
    x = wavenumber(grid) / spectrum.q_roll
    density = relative_density(spectrum, x, grid.ndim)
    if spectrum.angle is not None:
        qx, qy = wavevector(grid)
        # The angle of q = 0, which is empty, is that of an arbitrary other one.
        direction = jnp.arctan2(qy, jnp.where(zero_mode(grid.shape), 1, qx))
        density *= narrowing(spectrum, x, direction - spectrum.angle - np.pi / 2)
    density *= jnp.prod(2 * np.pi / (grid.size * spectrum.q_roll))
    occupied = (density > 0) & ~nyquist_lines(grid.shape)
    magnitude = jnp.sqrt(jnp.where(occupied, density, 1)) * occupied
    phase_bits, magnitude_bits, sign = _mode_bits(key, grid.shape)
    angle = phase_bits.astype(density.dtype) * sign * (2 * np.pi / 2**32)
    if gaussian:
        magnitude *= jnp.sqrt(-jnp.log((magnitude_bits.astype(density.dtype) + 0.5) / 2**32))
    modes = jax.lax.complex(magnitude * jnp.cos(angle), magnitude * jnp.sin(angle))
    return rms_height_of(spectrum, grid.ndim) * to_field(modes * np.prod(grid.shape), grid.shape)


def _mode_bits(key: Array, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """Two random words for each mode of the half spectrum, and the sign of its phase.

    On the column ky = 0 both +kx and -kx are stored: they share a stream, with opposite phases.
    """
    numbers = mode_numbers(shape)
    rows, columns = numbers if len(shape) == 2 else (numbers[0], np.zeros(1, int))

    def words(row, column):
        row = jnp.where(column == 0, jnp.abs(row), row)
        stream = jax.random.fold_in(jax.random.fold_in(key, row), column)
        return jax.random.bits(stream, (2,), "uint32")

    across = jax.vmap(words, (None, 0))
    bits = jax.vmap(across, (0, None))(rows.ravel(), columns.ravel())
    bits = bits.reshape(*np.broadcast_shapes(*(k.shape for k in numbers)), 2)
    # Combined by XLA: otherwise a constant as large as the grid would be compiled in.
    mirrored = jnp.asarray(rows < 0) & jnp.asarray(columns == 0)
    sign = jnp.where(mirrored, -1, 1) if len(shape) == 2 else jnp.ones(1, int)
    return bits[..., 0], bits[..., 1], sign


@shown()
class Statistics(eqx.Module):
    """Statistics of a surface about its mean.

    **Fields:**

    - `rms_height`: of the heights [m].
    - `rms_slope`: of the gradient's length [1].
    - `rms_slope_along`: along each axis [1], shape `(ndim,)`.
    - `slope_ratio`: largest over smallest rms slope of all directions [1], the square root of the
      ratio of the principal values of <∂ih ∂jh>; None for a profile.
    - `lay`: the direction of the smallest rms slope [rad], from the x axis, between -π/2 and π/2;
      0 where all directions are equal, None for a profile.
    - `rms_curvature`: of ∇²h/2 on a surface and h'' on a profile [1/m].
    - `peak_to_valley`: from the highest point to the lowest [m].
    - `skewness`, `kurtosis`: of the heights [1], 0 and 3 for Gaussian ones.
    """

    rms_height: Float[Array, ""]
    rms_slope: Float[Array, ""]
    rms_slope_along: Float[Array, " ndim"]
    slope_ratio: Float[Array, ""] | None
    lay: Float[Array, ""] | None
    rms_curvature: Float[Array, ""]
    peak_to_valley: Float[Array, ""]
    skewness: Float[Array, ""]
    kurtosis: Float[Array, ""]


@check_types
@compiled
def statistics(surface: Surface) -> Statistics:
    """Returns the statistics of a surface, differentiable unless it is flat.

    **Arguments:**

    - `surface`: any.

    **Returns:** the root mean squares of height, slope and curvature and more, see `Statistics`.
    """
    grid = surface.grid
    power, scale = _modal_power(surface)
    unit = 2 * np.pi / grid.size[0]
    squares = [
        (k * grid.size[0] / length) ** 2
        for k, length in zip(mode_numbers(grid.shape), grid.size, strict=True)
    ]
    inner = [
        jnp.where(2 * np.abs(k) == n, 0, square)
        for k, n, square in zip(mode_numbers(grid.shape), grid.shape, squares, strict=True)
    ]
    along = jnp.stack([jnp.sum(square * power) for square in inner])
    bent = jnp.sum(sum(squares) ** 2 * power)
    height = _root(jnp.sum(power))
    ratio, lay = None, None
    if grid.ndim == 2:
        kx, ky = (
            jnp.where(2 * np.abs(k) == n, 0, k * grid.size[0] / length)
            for k, n, length in zip(mode_numbers(grid.shape), grid.shape, grid.size, strict=True)
        )
        ratio, lay = _principal(along, jnp.sum(kx * ky * power))
    relative = (surface.heights - jnp.mean(surface.heights)) / scale
    standard = relative / jnp.where(height == 0, 1, height)
    return Statistics(
        rms_height=scale * height,
        rms_slope=scale * unit * _root(jnp.sum(along)),
        rms_slope_along=scale * unit * _root(along),
        slope_ratio=ratio,
        lay=lay,
        rms_curvature=scale * unit * unit * _root(bent) / grid.ndim,
        peak_to_valley=jnp.max(surface.heights) - jnp.min(surface.heights),
        skewness=jnp.mean(standard**3),
        kurtosis=jnp.mean(standard**4),
    )


def _principal(squares: Array, mixed: Array) -> tuple[Array, Array]:
    """The ratio of the principal rms slopes [1], and the direction of the smaller one [rad]."""
    mean, half = jnp.sum(squares) / 2, (squares[0] - squares[1]) / 2
    equal = half**2 + mixed**2 <= (8 * jnp.finfo(mean.dtype).eps * mean) ** 2
    half, mixed = jnp.where(equal, -1, half), jnp.where(equal, 0, mixed)
    away = jnp.where(equal, 0, jnp.sqrt(half**2 + mixed**2))
    least = mean - away
    # A ridged surface has no slope along its lay.
    ratio = jnp.sqrt((mean + away) / jnp.where(least > 0, least, jnp.finfo(mean.dtype).tiny))
    return jnp.where(equal, 1, ratio), jnp.arctan2(-mixed, -half) / 2


def _modal_power(surface: Surface) -> tuple[Array, Array]:
    """|h_q|² of every mode but q = 0, counted with its multiplicity, in units of scale² [m²]."""
    heights = surface.heights - jnp.mean(surface.heights)
    peak = jnp.max(jnp.abs(jax.lax.stop_gradient(heights)))
    scale = jnp.where(peak == 0, 1, peak)
    modes = to_spectrum(heights / scale) / np.prod(surface.grid.shape)
    return _abs_squared(modes) * multiplicity(surface.grid.shape), scale


def _abs_squared(values: Complex[Array, "..."]) -> Array:
    return values.real**2 + values.imag**2


def _root(square: Array) -> Array:
    """The square root, with derivative 0 at 0."""
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1)), 0)


@check_types
def radial_spectrum(
    surface: Surface, num_bins: int = 40
) -> tuple[Float[Array, " bins"], Float[Array, " bins"]]:
    """Returns wavenumbers [rad/m] and the radially averaged C(q) of a surface.

    C has the normalisation of `SelfAffine.density` for the grid's `ndim`: [m⁴], or [m³] of a
    profile. Bins are equally wide in log q between 2π/L of the longest axis and the smallest
    Nyquist wavenumber. A bin without modes has C = NaN at its geometric centre.

    **Arguments:**

    - `surface`: any.
    - `num_bins`: rings, equally spaced in the logarithm of q.

    **Returns:** q [rad/m] and C(q), each of shape `(num_bins,)`; C is NaN in an empty ring.
    """
    check_whole("num_bins", num_bins, 1)
    return _radial_spectrum(surface, num_bins)


@compiled
def _radial_spectrum(surface: Surface, num_bins: int) -> tuple[Array, Array]:
    grid = surface.grid
    power, scale = _modal_power(surface)
    fundamental = 2 * np.pi / jnp.max(grid.size)
    x = wavenumber(grid) / fundamental
    span = jnp.log(jnp.min(np.pi / grid.spacing) / fundamental)
    # The lowest modes lie on the edge of the first bin: rounding must not expel them.
    position = jnp.log(jnp.where(x > 0, x, 1)) / span * num_bins + 1e-4
    used = (x > 0) & (position < num_bins) & ~nyquist_lines(grid.shape)
    bins = jnp.where(used, jnp.floor(position).astype(int), num_bins)
    weight = used * multiplicity(grid.shape)

    def total(values):
        return binned(bins, values, num_bins + 1)[:num_bins]

    count = total(weight.astype(power.dtype))
    filled = jnp.where(count > 0, count, 1)
    centre = jnp.exp(span * (jnp.arange(num_bins, dtype=power.dtype) + 0.5) / num_bins)
    q = fundamental * jnp.where(count > 0, total(weight * x) / filled, centre)
    density = (scale * jnp.prod(jnp.sqrt(grid.size / (2 * np.pi)))) ** 2 * total(power) / filled
    return q, jnp.where(count > 0, density, jnp.nan)


@compiled
def slope_up_to(surface: Surface) -> tuple[Float[Array, " rings"], Float[Array, " rings"]]:
    """Returns wavenumbers [rad/m] and the rms slope [1] of the waves up to each of them."""
    grid = surface.grid
    power, scale = _modal_power(surface)
    edges, ring = rings(grid)
    x = jnp.where(nyquist_lines(grid.shape), 0, wavenumber(grid) / edges[0])
    squares = jnp.cumsum(binned(ring, x**2 * power, len(edges)))
    return edges, scale * edges[0] * _root(squares)


@check_types
def rescale(
    surface: Surface, *, rms_height: ScalarLike | None = None, rms_slope: ScalarLike | None = None
) -> Surface:
    """Returns the surface with its heights multiplied to have this rms height [m] or slope [1].

    **Arguments:**

    - `surface`: not flat.
    - `rms_height` [m] or `rms_slope` [1]: the new value.

    **Returns:** the surface of other heights.
    """
    name, target = one_of_height_and_slope(rms_height, rms_slope)
    check_square(name, target)
    actual = getattr(statistics(surface), name)
    check_positive(f"statistics(surface).{name}", actual, "(a flat surface cannot be rescaled)")
    return _changed(
        surface,
        "rescaled",
        surface.heights * (target / actual),
        surface.grid,
        f"Heights were multiplied to prescribe the {name}.",
        surface.measured,
    )


@check_types
def resample(surface: Surface, shape: int | tuple[int, ...]) -> Surface:
    """Returns the surface on another number of points of the same cell, by its Fourier modes.

    A finer grid interpolates (modes on the old Nyquist lines are dropped); a coarser one loses the
    waves that it cannot hold.

    **Arguments:**

    - `surface`: any.
    - `shape`: number of points along each edge.

    **Returns:** the surface on the other grid, of the same size.
    """
    check_periodic(surface)
    old = surface.grid.shape
    if np.size(shape) != len(old):
        raise ValueError(f"`shape={shape}` is refused: {len(old)} whole numbers are needed.")
    grid = Grid(shape, surface.grid.size)
    if grid.shape == old:
        return surface
    check_memory("shape", grid.shape, memory_in(grid), "a surface", num_devices(grid.size))
    nearest = np.ix_(
        *(np.rint(np.arange(m) * (n / m)).astype(int) % n
          for n, m in zip(old, grid.shape, strict=True))
    )  # fmt: skip
    return _changed(
        surface,
        "resampled",
        _resampled(surface.heights, grid.shape),
        grid,
        f"Resampled from {old} to {grid.shape} points by Fourier modes.",
        None if surface.measured is None else surface.measured[nearest],
    )


@partial(jax.jit, static_argnums=1)
def _resampled(heights: Array, shape: tuple[int, ...]) -> Array:
    modes = resample_spectrum(to_spectrum(heights), heights.shape, shape)
    return to_field(modes, shape) * (np.prod(shape) / heights.size)


def _changed(
    surface: Surface,
    name: str,
    heights: Array,
    grid: Grid,
    sentence: str,
    measured: Array | None,
) -> Surface:
    """The surface after a step, which its history and its steps (if recorded) get too."""
    steps = surface.steps
    if steps and is_concrete(heights):
        steps = (*steps, step(name, np.asarray(heights), np.asarray(grid.spacing)))
    history = (*surface.history, sentence)
    return Surface(heights, grid, history, measured, steps, surface.periodic)
