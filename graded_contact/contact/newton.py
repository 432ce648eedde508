"""A step of Newton's method from a contact that a solver left: its errors, and a better contact.

The solver leaves a pressure y that the law has at the gap u_y. Its own displacement M y leaves the
gap M y - h + c, so that y and u_y solve exactly the contact of the heights h + δ with

    δ = M y - h + c - u_y    where the law holds the gap,

and any δ >= 0 elsewhere. The derivative of the contact by its heights (`implicit.py`) therefore
tells what δ has done to pressure and gap, and so to every number that follows from them. This is
the dual-weighted residual of R. Becker & R. Rannacher, Acta Numerica 10 (2001) 1,
doi:10.1017/S0962492901000010, for all numbers at once: one linear solve for the change of the
contact replaces one adjoint solve for each number.

The numbers after the step are better than those before, by more than they would be with the FFT
pairs of the step spent on the solver where that has not yet settled the points in contact.
"""

import equinox as eqx
import jax.numpy as jnp

from .implicit import Inputs, displace, root_of, without_mean
from .linear import LinearSplitting
from .solver import Iterated, nonzero, penalty_for, root_mean_square, slope, to_mean

# Error of the linear solve: numbers after the step are off by a few hundredths of their change.
_RTOL = 0.3


@eqx.filter_jit
def newton_step(inputs: Inputs, found: Iterated) -> Iterated:
    """Returns the contact under a given load after one step from what a solver found."""
    kernel, law = inputs.kernel, inputs.law
    load = inputs.prescribed.pressure
    assert load is not None
    loaded = jnp.mean(law.margin(found.pressure, found.gap, 1.0) > 0, dtype=found.pressure.dtype)
    penalty = penalty_for(kernel, jnp.maximum(loaded, 1 / found.pressure.size), law)
    law = law.in_units(1.0, 1 / penalty)
    # As the law had it, before it was scaled to the load.
    missing = jnp.mean(found.mismatch)
    y = to_mean(found.pressure, load - missing, law.bounds)
    v = y - penalty * found.gap
    s = slope(law, v)
    held = s != 0
    apart = displace(kernel, y) - inputs.heights + jnp.mean(inputs.heights) - found.gap
    offset = -jnp.sum(s * apart) / nonzero(jnp.sum(s))
    residual = jnp.where(held, penalty * (apart + offset), 0)
    kernel = penalty * kernel
    change, by_solid, pairs = _response(kernel, s, residual, missing)
    # What the law holds moves along it, and what it does not stays as it is.
    v = v + jnp.where(held, change / jnp.where(held, s, 1), 0)
    after = law.proximal(v)
    pressure = to_mean(after, load, law.bounds)
    size = root_mean_square(pressure)
    left = 2 * (_RTOL * root_mean_square(change) + root_mean_square(after - y - change))
    # The soft waves are the solid's, as in what the solver leaves.
    x = y + by_solid
    stiff = displace(kernel / (1 + kernel), pressure - x)
    return Iterated(
        pressure=pressure,
        gap=(after - v) / penalty,
        mismatch=x - after,
        displacement=(displace(kernel, x) + stiff) / penalty,
        error=left / nonzero(size),
        ended=found.ended,
        num_steps=found.num_steps,
        num_fft_pairs=found.num_fft_pairs + pairs + 4,
    )


def _response(kernel, s, residual, missing):
    """dσ of (1 - s) dσ + s (ρM dσ + ρ dū) = -s `residual`, the solid's, and FFT pairs.

    The mean of dσ is `missing`.
    """
    root, share = root_of(s), missing / nonzero(jnp.mean(s))
    known = share * s
    rhs = without_mean(root * (-residual - share * (1 - s) - displace(kernel, known)), root)
    tau, x, _, pairs = LinearSplitting().solve(kernel, s, rhs, rtol=jnp.asarray(_RTOL, s.dtype))
    return known + root * without_mean(tau, root), known + x, pairs
