"""A step of Newton's method from a contact that a solver left: its errors, and a better contact.

The solver leaves a pressure y that the law has at the gap u_y. Its own displacement M y leaves the
gap M y - h + c, so that y and u_y solve exactly the contact of the heights h + δ with

    δ = M y - h + c - u_y    where the law holds the gap,

and any δ >= 0 elsewhere. The derivative of the contact by its heights (`implicit.py`) therefore
tells what δ has done to pressure and gap, and so to every number that follows from them: the
difference of a number before and after this step is its error before. This is the dual-weighted
residual of R. Becker & R. Rannacher, Acta Numerica 10 (2001) 1, doi:10.1017/S0962492901000010, for
all numbers at once: one linear solve for the change of the contact stands in for one adjoint solve
to a number.

The numbers after the step are better than those before, by more than they would be with the FFT
pairs of the step spent on the solver where that has not yet settled the points in contact.
"""

import equinox as eqx
import jax.numpy as jnp

from .implicit import Inputs, displace, root_of, without_mean
from .linear import LinearSplitting
from .solver import Iterated, penalty_for, slope, to_mean

# Of the linear solve: numbers after the step are off by a few hundredths of what it changed.
_RTOL = 0.3


@eqx.filter_jit
def newton_step(inputs: Inputs, found: Iterated) -> Iterated:
    """Returns the contact after one step from what a solver found.

    Its `error` and `gap_error` are those of the latter.
    """
    kernel, law = inputs.kernel, inputs.law
    load, mean_gap = inputs.prescribed
    loaded = jnp.mean(law.margin(found.pressure, found.gap, 1.0) > 0, dtype=found.pressure.dtype)
    penalty = penalty_for(kernel, jnp.maximum(loaded, 1 / found.pressure.size), law)
    law = law.in_units(1.0, 1 / penalty)
    y, missing = found.pressure, jnp.zeros_like(penalty)
    if load is not None:
        # As the law had it, before it was scaled to the load.
        missing = jnp.mean(found.mismatch)
        y = to_mean(y, load - missing, law.bounds)
    v = y - penalty * found.gap
    s = slope(law, v)
    held = s != 0
    apart = displace(kernel, y) - inputs.heights + jnp.mean(inputs.heights) - found.gap
    offset = -jnp.sum(s * apart) / jnp.sum(s) if mean_gap is None else mean_gap
    residual = jnp.where(held, penalty * (apart + offset), 0)
    kernel = penalty * kernel
    change, by_solid, pairs = _response(kernel, s, residual, None if load is None else missing)
    # What the law holds moves along it, and what it does not stays as it is.
    v = v + jnp.where(held, change / jnp.where(held, s, 1), 0)
    after = law.proximal(v)
    pressure = after if load is None else to_mean(after, load, law.bounds)
    # The soft waves are the solid's, as in what the solver leaves.
    x = y + by_solid
    stiff = displace(kernel / (1 + kernel), pressure - x)
    return Iterated(
        pressure=pressure,
        gap=(after - v) / penalty,
        mismatch=x - after,
        displacement=(displace(kernel, x) + stiff) / penalty,
        error=found.error,
        gap_error=found.gap_error,
        ended=found.ended,
        num_steps=found.num_steps,
        num_fft_pairs=found.num_fft_pairs + pairs + 4,
    )


def _response(kernel, s, residual, missing):
    """dσ of (1 - s) dσ + s (ρM dσ + ρ dū) = -s `residual`, and the solid's.

    Of the mean `missing` if that is given.
    """
    known, rhs, root = jnp.zeros_like(s), -residual, root_of(s)
    if missing is not None:
        share = missing / jnp.mean(s)
        known = share * s
        rhs = without_mean(root * (rhs - share * (1 - s) - displace(kernel, known)), root)
    else:
        rhs = root * rhs
    tau, x, _, pairs = LinearSplitting().solve(
        kernel, s, rhs, free_mean=missing is None, rtol=jnp.asarray(_RTOL, s.dtype)
    )
    change = root * (tau if missing is None else without_mean(tau, root))
    return known + change, known + x, pairs
