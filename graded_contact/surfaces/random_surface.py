"""Random surfaces of a given spectrum.

Fourier amplitudes are h(x) = Σ_q h_q exp(i q·x), so that |h_q|² = C(q) Π 2π/L.
"""

from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import PRNGKeyArray

from ..core.checks import check_values, is_concrete, short
from ..core.compilation import compiled
from ..fields.grid import Grid, mode_numbers, nyquist_lines, wavenumber, wavevector, zero_mode
from ..fields.transforms import to_field
from .spectrum import narrowing, relative_density, rms_height_of
from .spectrum_table import Spectrum, SpectrumTable
from .surface import Surface

# Modes as near as this to an edge of a band are on it: sizes in float32, and π with six digits.
_EDGE = 1e-5


def random_surface(
    spectrum: Spectrum,
    grid: Grid,
    key: PRNGKeyArray,
    *,
    amplitudes: Literal["exact", "gaussian"] = "exact",
) -> Surface:
    """Returns a random surface (on a 1-D grid, a profile) with the given spectrum and zero mean.

    Each mode (kx, ky) draws from its own random stream, so a refined grid of the same size gives
    the same surface, and a 1-D grid the phases of the modes (kx, 0). Sums over modes replace
    integrals over q: the statistics agree with the spectrum up to the coarseness of the
    lattice at `q_low`; `rescale` makes one of them exact.

    **Arguments:**

    - `spectrum`: the spectrum C(q); its whole band must fit between 2π/L and the Nyquist
      wavenumber. A `SpectrumTable` is of surfaces, and is cut by its method `between`.
    - `grid`: the periodic cell.
    - `key`: a JAX random key (of the default kind, threefry).
    - `amplitudes`: `"exact"` gives every mode its expected amplitude and a uniformly random phase;
      `"gaussian"` a complex normal amplitude, as a piece of an infinite Gaussian surface has.

    **Returns:** the surface; differentiable in `spectrum`, usable under `vmap` over keys.
    """
    if not isinstance(key, jax.Array | np.ndarray) or key.dtype in (np.float32, np.float64):
        seed = key if isinstance(key, int) else 0  # the remedy repeats the user's own number
        raise ValueError(f"`key={short(key)}` must be a random key: `jax.random.key({seed})`.")
    _check_band(spectrum, grid)
    heights = _synthesise(spectrum, grid, key, amplitudes == "gaussian")
    if not isinstance(spectrum, SpectrumTable):
        return Surface(heights, grid)
    return Surface(heights, grid, spectrum.history, warnings=spectrum.warnings)


def _check_band(spectrum: Spectrum, grid: Grid) -> None:
    """Refuses a spectrum that the modes of the grid do not cover."""
    table = isinstance(spectrum, SpectrumTable)
    if table and grid.ndim == 1:
        raise ValueError("`grid` must have two dimensions: a table of C is of surfaces.")
    if not all(map(is_concrete, (grid.size, spectrum.q_low, spectrum.q_high))):
        return
    rounding = _EDGE
    q_low, q_high = float(spectrum.q_low), float(spectrum.q_high)
    size = np.asarray(grid.size, float)  # NumPy: under `jit` JAX would trace even known numbers
    nyquist = np.pi * np.min(np.array(grid.shape) / size)
    fundamental = 2 * np.pi / np.max(size)
    allowed = f"the grid's Nyquist wavenumber is {nyquist:g} rad/m. Use more points, at least "
    allowed += f"{q_high / nyquist:.3g} times as many, or a lower `q_high`"
    check_values("q_high", q_high, allowed, at_most=nyquist * (1 + rounding))
    allowed = f"the smallest wavenumber of the cell is 2π/L = {fundamental:g} rad/m"
    check_values("q_low", q_low, allowed, at_least=fundamental * (1 - rounding))
    if not table and spectrum.anisotropy is not None and is_concrete(spectrum.q_roll):
        # A correlation length along the lay beyond the cell has too few modes.
        longest = max(float(spectrum.q_roll) / fundamental, 1)
        allowed = f"γ/q_roll must be at most L/2π. This cell takes up to {longest:.3g}; for a "
        allowed += "longer lay use a larger cell, for an endless one a profile"
        check_values("anisotropy", spectrum.anisotropy, allowed, at_most=longest * (1 + rounding))
    # Only a narrow band can lie between two modes of the lattice.
    if q_high < 2 * fundamental * (1 + rounding) or q_high < 2 * q_low:
        modes = zip(mode_numbers(grid.shape), size, strict=True)
        q = np.sqrt(sum((2 * np.pi * k / length) ** 2 for k, length in modes))
        if not np.any((q >= q_low * (1 - rounding)) & (q <= q_high * (1 + rounding))):
            band = (
                f"`q_low={q_low:g}` to `q_high={q_high:g}` is refused: no mode of the grid is in it"
            )
            raise ValueError(f"{band}. Use a larger cell, or a wider band.")


@compiled
def _synthesise(spectrum: Spectrum, grid: Grid, key: Array, gaussian: bool) -> Array:
    # The density is relative: in units of a wavenumber, and of <h²> = 1.
    if isinstance(spectrum, SpectrumTable):
        unit, height = spectrum.q_low, spectrum.rms_height
        density = spectrum.density(wavenumber(grid)) / (height / unit) ** 2
    else:
        unit, height = spectrum.q_roll, rms_height_of(spectrum, grid.ndim)
        x = wavenumber(grid) / unit
        for edge in (spectrum.q_low / unit, spectrum.q_high / unit):
            moved = jnp.where(jnp.abs(x - edge) <= _EDGE * edge, edge - x, 0)
            x = x + jax.lax.stop_gradient(moved)
        density = relative_density(spectrum, x, grid.ndim)
        if spectrum.angle is not None:
            qx, qy = wavevector(grid)
            # The angle of q = 0, which is empty, is taken from another one.
            direction = jnp.arctan2(qy, jnp.where(zero_mode(grid.shape), 1, qx))
            density *= narrowing(spectrum, x, direction - spectrum.angle - np.pi / 2)
    # What one mode has of <h²>: C times its cell in the plane of wavevectors.
    density *= jnp.prod(2 * np.pi / (grid.size * unit))
    occupied = (density > 0) & ~nyquist_lines(grid.shape)
    magnitude = jnp.sqrt(jnp.where(occupied, density, 1)) * occupied
    phase_bits, magnitude_bits, sign = _mode_bits(key, grid.shape)
    angle = phase_bits.astype(density.dtype) * sign * (2 * np.pi / 2**32)
    if gaussian:
        magnitude *= jnp.sqrt(-jnp.log((magnitude_bits.astype(density.dtype) + 0.5) / 2**32))
    modes = jax.lax.complex(magnitude * jnp.cos(angle), magnitude * jnp.sin(angle))
    return height * to_field(modes * np.prod(grid.shape), grid.shape)


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

    of_all = jax.vmap(jax.vmap(words, (None, 0)), (0, None))
    bits = of_all(rows.ravel(), columns.ravel())
    bits = bits.reshape(*np.broadcast_shapes(*(k.shape for k in numbers)), 2)
    # Combined by XLA: otherwise a constant as large as the grid would be compiled in.
    mirrored = jnp.asarray(rows < 0) & jnp.asarray(columns == 0)
    sign = jnp.where(mirrored, -1, 1) if len(shape) == 2 else jnp.ones(1, int)
    return bits[..., 0], bits[..., 1], sign
