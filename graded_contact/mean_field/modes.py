"""The mean field of one surface: a sum over its modes, isotropic or not."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..fields.devices import binned
from ..fields.grid import direction_and_speed, multiplicity, rings, to_spectrum, wave_frequencies
from ..materials.coverage import is_unknown
from ..surfaces.surface import Surface
from .diffusion import Correction, area, mean_square_growth, slowed, slowing


@eqx.filter_jit
def add_up(
    kernel: Inexact[Array, "*half"],
    surface: Surface,
    pressure: Float[Array, ""],
    velocity: Float[Array, "..."],
    correction: Correction,
    known: tuple[Float[Array, ""], Float[Array, ""]] | None,
) -> tuple[
    Float[Array, " rings"], Float[Array, " rings"], Float[Array, " rings"], Float[Array, ""]
]:
    """Returns wavenumbers [rad/m], diffusion x [1] and friction [1] up to them.

    At last the share of friction [1] from frequencies outside `known` [rad/s]. The modes of a ring
    of |q|, up to its outer edge, come into view at once.
    """
    grid = surface.grid
    modes = to_spectrum(surface.heights - jnp.mean(surface.heights)) / np.prod(grid.shape)
    zero = np.zeros(kernel.shape, bool)
    zero[(0,) * kernel.ndim] = True
    relative = jnp.where(zero, 0, modes) / (pressure * jnp.where(zero, 1, kernel))
    power = (relative.real**2 + relative.imag**2) * multiplicity(grid.shape)
    along = -wave_frequencies(grid, direction_and_speed(velocity)[0])
    loss = power * along * jnp.imag(kernel) * pressure

    edges, ring = rings(grid)
    step, complete = (binned(ring, a, len(edges)) for a in (power, loss))
    v = jnp.cumsum(step)
    before = v - step
    x = slowed(correction, jnp.stack([before, before + step / 2, v]))
    # Of the mean square pressure of complete contact, the share that a ring adds: d⟨σ²⟩/dv on
    # average over the ring.
    growth = mean_square_growth(x)
    thin = step <= 1e-4 * v
    share = jnp.where(
        thin,
        area(x[1]) * slowing(correction, x[1]),
        (growth[2] - growth[0]) / jnp.where(thin, 1, step),
    )
    friction = jnp.cumsum(complete * share)
    extrapolated = jnp.zeros_like(edges[0])
    if known is not None:
        lost = jnp.where(is_unknown(wave_frequencies(grid, velocity), known), loss, 0)
        lost = binned(ring, lost, len(edges))
        extrapolated = jnp.sum(lost * share) / jnp.where(friction[-1] == 0, 1, friction[-1])
    return edges, x[2], friction, extrapolated
