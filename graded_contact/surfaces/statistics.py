"""Statistics and spectra of surfaces.

All ignore the mean height. Slopes are of the trigonometric interpolant, and a component at
its Nyquist number has none (see `grid`).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from ..core.checks import check_whole
from ..core.compilation import compiled
from ..core.derivative import largest, root_or_zero
from ..core.display import shown
from ..fields.devices import binned
from ..fields.grid import multiplicity, nyquist_lines, odd_wavevector, to_spectrum, wavenumber
from .spectrum_table import SpectrumTable
from .surface import Surface, check_periodic


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
    """

    rms_height: Float[Array, ""]
    rms_slope: Float[Array, ""]
    rms_slope_along: Float[Array, " ndim"]
    slope_ratio: Float[Array, ""] | None
    lay: Float[Array, ""] | None
    rms_curvature: Float[Array, ""]


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
    slopes = [component / unit for component in odd_wavevector(grid)]
    along = jnp.stack([jnp.sum(slope**2 * power) for slope in slopes])
    bent = jnp.sum((wavenumber(grid) / unit) ** 4 * power)
    ratio, lay = None, None
    if grid.ndim == 2:
        ratio, lay = _principal(along, jnp.sum(slopes[0] * slopes[1] * power))
    return Statistics(
        rms_height=scale * root_or_zero(jnp.sum(power)),
        rms_slope=scale * unit * root_or_zero(jnp.sum(along)),
        rms_slope_along=scale * unit * root_or_zero(along),
        slope_ratio=ratio,
        lay=lay,
        rms_curvature=scale * unit * unit * root_or_zero(bent) / grid.ndim,
    )


def _principal(squares: Array, mixed: Array) -> tuple[Array, Array]:
    """The ratio of the principal rms slopes [1], and the direction of the smaller one [rad]."""
    mean, half = jnp.sum(squares) / 2, (squares[0] - squares[1]) / 2
    # The lay of an isotropic surface would be made of rounding.
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
    # Relative to the peak: squares of nanometres would leave the range of float32.
    peak = jnp.max(jnp.abs(jax.lax.stop_gradient(heights)))
    scale = jnp.where(peak == 0, 1, peak)
    modes = to_spectrum(heights / scale) / np.prod(surface.grid.shape)
    return (modes.real**2 + modes.imag**2) * multiplicity(surface.grid.shape), scale


@compiled
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

    # The last bin takes the modes that are not used.
    def total(values):
        return binned(bins, values, num_bins + 1)[:num_bins]

    count = total(weight.astype(power.dtype))
    filled = jnp.where(count > 0, count, 1)
    centre = jnp.exp(span * (jnp.arange(num_bins, dtype=power.dtype) + 0.5) / num_bins)
    q = fundamental * jnp.where(count > 0, total(weight * x) / filled, centre)
    density = (scale * jnp.prod(jnp.sqrt(grid.size / (2 * np.pi)))) ** 2 * total(power) / filled
    return q, jnp.where(count > 0, density, jnp.nan)


def isotropic_spectrum(surface: Surface, num_bins: int = 40) -> SpectrumTable:
    """Returns the spectrum of a periodic surface, averaged over directions, as a table.

    **Arguments:**

    - `surface`: of two dimensions, with concrete heights.
    - `num_bins`: rings, equally spaced in the logarithm of q; those without modes are left out.

    **Returns:** C(q) [m⁴], see `SpectrumTable`.
    """
    check_periodic(surface)
    if surface.grid.ndim == 1:
        raise ValueError("`surface` must have two dimensions: a profile has no isotropic C(q).")
    q, density = map(np.asarray, radial_spectrum(surface, num_bins))
    filled = density > 0  # not where it is NaN
    return SpectrumTable(q[filled], density[filled], surface.history, surface.warnings)


@compiled
def slope_up_to(surface: Surface) -> tuple[Float[Array, " rings"], Float[Array, " rings"]]:
    """Returns wavenumbers [rad/m] and the rms slope [1] of the waves up to each of them."""
    grid = surface.grid
    power, scale = _modal_power(surface)
    q = wavenumber(grid)
    # Rings of |q|, of which the first holds the longest waves alone. Modes on an outer edge belong
    # to the ring inside it: rounding must not expel them.
    edges = jnp.linspace(2 * np.pi / jnp.max(grid.size), largest(q), max(grid.shape))
    ring = jnp.ceil((q - edges[0]) / (edges[1] - edges[0]) - 1e-4).astype(int)
    ring = jnp.clip(ring, 0, len(edges) - 1)
    x = jnp.where(nyquist_lines(grid.shape), 0, q / edges[0])
    squares = jnp.cumsum(binned(ring, x**2 * power, len(edges)))
    return edges, scale * edges[0] * root_or_zero(squares)
