"""The errors of a contact: of pressure, gap and every number computed from them.

A solver returns a pressure y of the law. The solid under y has the gap u = M y - h + c. Let P be
the proximal map of the law at the penalty ρ. The contact is exact where the residual
R = P(y - ρu) - y vanishes. Otherwise Newton's method gives the change

    (1 - s) dσ + ρ s (M dσ + dc) = R,        s = P'(y - ρu): at a hard wall 1 in contact, else 0.

Its solution predicts the true errors within a few per cent, but costs a fifth of the solve. The
inverse of M on the whole surface, instead of on the contact only, costs one FFT pair:

    dσ = (1 - s) R + √s (ρM)⁻¹ √s R        with the prescribed mean.

For a positive M this is at least as large as the solution, P M⁻¹ P >= (P M P)⁻¹, and mostly less
than three times as large (`bench_contact.py random`). The error of a number is its change by dσ,
see `error_of`.

This is no bound for laws that attract (s < 0); the equation is then solved to one digit. Its slopes
s are taken at the law's own pressure and gap, where R is -ρs times the mismatch of the gaps. At the
solid's gap, errors of the soft waves would switch points in and out of contact. Points that do
switch are not in the equation, so the error is never smaller than the error of the solver.

At a prescribed mean gap the error of the mean pressure is dp/dū times the error of the mean gap,
see `stiffness_bound`.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..core.compilation import varying
from .adjoint import State, response
from .operators.operator import Field, Scalar, nonzero, root_mean_square, stiffness_bound
from .solver.abstract_solver import Inputs, SolverOutput, slope

# With these factors 12 of 8,552 claims were broken (`bench_contact.py random --count 1000 --seed
# 30`).
_SAFETY, _BY_CHANCE, _SAFETY_OF_GAP, _SPREAD = 2.5, 5.0, 8.0, 0.3
_ROUNDING, _ROUNDING_OF_GAP = 8, 100  # units in the last place
_LINEAR_RTOL, _LINEAR_STEPS = 0.1, 4000


def penalty_at(inputs: Inputs, found: SolverOutput) -> Scalar:
    """Returns the penalty for the area of a contact [Pa/m]."""
    pressure = found.pressure
    touching = inputs.law.contact_indicator(pressure, found.gap, 1.0) > 0
    loaded = jnp.maximum(jnp.mean(touching, dtype=pressure.dtype), 1 / pressure.size)
    return inputs.operator.penalty_for(loaded, inputs.law.steepest_rise)


def contact_state(inputs: Inputs, found: SolverOutput) -> State:
    """Returns pressure, displacement of zero mean and mean gap of a contact."""
    mean = inputs.operator.mean
    displacement = found.displacement - mean(found.displacement)
    if inputs.loading.gap is not None:
        return State(found.pressure, displacement, inputs.loading.gap)
    # Weighed with the pressure, gaps of the solid and of the law agree.
    weight = jnp.abs(found.pressure)
    offset = found.gap - displacement + inputs.heights - jnp.mean(inputs.heights)
    return State(found.pressure, displacement, mean(weight * offset) / mean(weight))


def _change_of(inputs: Inputs, found: SolverOutput):
    """The estimated change of the pressure to the exact contact [Pa]."""
    operator, law, penalty = _scaled(inputs, found)
    y, law_gap, (load, gap) = found.pressure, penalty * found.gap, inputs.loading
    solid_gap = operator.displace(y) - penalty * (inputs.heights - jnp.mean(inputs.heights))
    s = _share_of_gap(law, y - law_gap)
    # The mean gap at which solid and law agree under this pressure.
    offset = _offset(operator, s, solid_gap - law_gap, 0.0 if gap is None else penalty * gap)
    v = y - solid_gap - offset
    residual, s = law.proximal(v) - y, _share_of_gap(law, v)
    mean, root = operator.mean, jnp.sqrt(s)
    share = s / nonzero(mean(s))
    change = (1 - s) * residual + root * operator.filtered(operator.inverse, root * residual)
    change = change + share * ((0.0 if load is None else load - mean(y)) - mean(change))
    if gap is not None:
        solid_gap = solid_gap + operator.displace(change)
        offset = _offset(operator, s, solid_gap - law_gap, penalty * gap)
        # Points of contact weigh the gap unevenly, so what it varies by counts, too.
        spread = jnp.sqrt(mean(share * (solid_gap - law_gap + offset) ** 2))
        digits = _ROUNDING_OF_GAP * jnp.finfo(y.dtype).eps * root_mean_square(solid_gap)
        closing = offset - penalty * gap
        closing = closing + jnp.where(closing < 0, -1, 1) * (_SPREAD * spread + digits)
        change = change + share * closing * stiffness_bound(operator, law_gap, s)
    low, high = law.bounds
    return jnp.clip(y + change, low, high) - y


def _response_of(inputs: Inputs, found: SolverOutput):
    """The change of the pressure [Pa] of the contact linearised at the pressure and gap of the law.

    NaN if the linear solve does not converge.
    """
    operator, law, penalty = _scaled(inputs, found)
    y, law_gap, (load, gap) = found.pressure, penalty * found.gap, inputs.loading
    solid_gap = operator.displace(y) - penalty * (inputs.heights - jnp.mean(inputs.heights))
    mismatch = solid_gap - law_gap + (0.0 if gap is None else penalty * gap)
    missing = None if load is None else load - operator.mean(y)
    rtol = jnp.asarray(_LINEAR_RTOL, y.dtype)
    s = slope(law.proximal, y - law_gap)
    return response(operator, s, jnp.zeros_like(y), -mismatch, missing, rtol, _LINEAR_STEPS)


def _offset(operator, s, solid_gap, otherwise):
    """The offset for a mean of 0 of `solid_gap` where the law fixes the gap; else `otherwise`."""
    fixed = operator.mean(s)
    return jnp.where(fixed > 0, -operator.mean(s * solid_gap) / nonzero(fixed), otherwise)


def assess(inputs: Inputs, found: SolverOutput) -> tuple[Array, Array, Array]:
    """Returns the change of the pressure to the exact contact [Pa], and the errors of a contact.

    These are of the pressure, relative [1], and of the gap [m], both as root mean square. The
    change is limited to the error that the solver claims. Under a law that attracts the change and
    the error are at least as large as that.
    """
    attracts, size = inputs.law.attracts, root_mean_square(found.pressure)
    change = _change_of(inputs, found)
    if attracts:
        linear = _response_of(inputs, found)
        # Near a jump the linear solve does not converge, and the solver's error alone remains.
        change = jnp.where(jnp.all(jnp.isfinite(linear)), linear, change)
    relative = root_mean_square(change) / nonzero(size)
    rounding = _ROUNDING * jnp.finfo(size.dtype).eps
    if attracts:
        # A claim of the change itself is the error: `error_of` has the same factor.
        known = jnp.where(jnp.all(jnp.isfinite(linear)), _SAFETY * relative + rounding, 0)
        error = jnp.maximum(inputs.law.softness * found.error, known)
        change = change * (error / (_SAFETY * nonzero(relative)))
    else:
        error = jnp.minimum(found.error, _SAFETY * relative + rounding)
        change = change * jnp.minimum(found.error / nonzero(relative), 1)
    state = contact_state(inputs, found)
    gap = state.displacement - inputs.heights + jnp.mean(inputs.heights) + state.mean_gap
    moved = root_mean_square(_changed_gap(inputs, found, change) - gap)
    return change, error, _SAFETY_OF_GAP * moved + rounding * jnp.std(inputs.heights)


def error_of(numbers: Callable[[Array], Array], value: Array, change: Field, size: Array) -> Array:
    """Returns the errors of numbers of this value, with the change to the exact contact.

    `numbers(change)` are those after a change of the pressure. Contributions of parts of the change
    may cancel in the estimate by chance: so their root sum of squares is added. `size` is the size
    of the terms whose differences the numbers are, which limits their digits.
    """
    after, pull = jax.vjp(numbers, change)

    def chance_of(row):
        # Where nothing touches, a derivative may be no number.
        return jnp.sqrt(jnp.sum(jnp.where(change != 0, pull(row)[0] * change, 0) ** 2))

    chance = jax.vmap(chance_of)(varying(jnp.eye(after.size, dtype=after.dtype)))
    rounding = _ROUNDING * jnp.finfo(after.dtype).eps * size
    return _SAFETY * jnp.abs(after - value) + _BY_CHANCE * chance + rounding


def _changed_gap(inputs: Inputs, found: SolverOutput, change: Field):
    """The gap [m] after a change of the pressure.

    The approximate inverse makes long waves of the change too large. So springs support the solid
    between the points of contact. They are as stiff as the solid in the shape of the gap,
    times the share of points in contact.
    """
    operator, law, penalty = _scaled(inputs, found)
    pressure, law_gap = found.pressure + change, penalty * found.gap
    before = penalty * found.displacement
    s = _share_of_gap(law, pressure - law_gap)
    bent = jnp.mean(operator.bending_energy(law_gap))
    fixed = jnp.mean(s) * bent / nonzero(jnp.mean(law_gap**2))
    free = jnp.where(operator.is_mean, 0, 1 / (1 + fixed * jnp.abs(operator.kernel)))
    # The waves of the pressure before the change follow from its displacement, computed above.
    waves = operator.to_waves(found.pressure) + operator.to_waves(change)
    waves = operator.compliance * waves - operator.to_waves(before)
    moved = operator.to_field(free * waves, before.shape)
    solid_gap = before - operator.mean(before) + moved
    solid_gap = solid_gap - penalty * (inputs.heights - jnp.mean(inputs.heights))
    gap = inputs.loading.gap
    offset = _offset(operator, s, solid_gap - law_gap, 0.0) if gap is None else penalty * gap
    v = pressure - solid_gap - offset
    return (law.proximal(v) - v) / penalty


def _share_of_gap(law, v):
    """The slope of the law between 0, where it fixes the pressure, and 1, where the gap."""
    return jnp.clip(jnp.abs(slope(law.proximal, v)), 0, 1)


def _scaled(inputs: Inputs, found: SolverOutput):
    """The operator and the law in units of pressure, and the penalty."""
    penalty = penalty_at(inputs, found)
    return inputs.operator.scaled(penalty), inputs.law.in_units(1.0, 1 / penalty), penalty
