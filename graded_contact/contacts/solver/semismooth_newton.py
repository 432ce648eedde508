"""Semismooth Newton steps for hard walls, where the splitting is slow.

If a small contact carries the load, or moduli differ by a factor of a thousand, the splitting
takes thousands of steps to find the points in contact. A Newton step assumes a set A of points in
contact and solves for the pressures on A,

    K σ - h + c = 0 on A,   σ = 0 elsewhere,   mean σ as prescribed,      K = ρM,

see `active_set.py`. The next A is where σ exceeds the gap. Far from the solution such steps may
cycle. Then they solve a contact coated by springs of compliance λ, which is easier. The springs
rest at the last accepted pressure σ' (the proximal point method):

    (K + λ) σ - (h + λ σ') + c = 0 on A.

Each such contact is nearer to the solution than the last. λ falls by a factor of ten after each, to
0, and rises by a factor of ten if the number of points that change sides does not fall.

M. Hintermüller, K. Ito & K. Kunisch, SIAM J. Optim. 13 (2002) 865,
doi:10.1137/S1052623401383558; R. T. Rockafellar, SIAM J. Control Optim. 14 (1976) 877,
doi:10.1137/0314056.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ...core.compilation import varying
from ..law import AbstractLaw, Windowed, never_overlaps
from ..operators.operator import AbstractOperator, Field, Scalar
from .active_set import REDUCTION, Coated, green_of, pressure_on

_COATED_ERROR = 1e-3  # tolerance of a coated contact
_FACTOR = 10.0  # from one coat to the next
_THINNEST = 0.01  # coat, over the least compliance of any wave
_CLOSER = 3e-3  # tolerance of the steps over `rtol`, which the splitting confirms


def takes_newton_steps(law: AbstractLaw) -> bool:
    """Returns whether the steps can solve a law: a hard wall without hardness."""
    law = law.law if isinstance(law, Windowed) else law
    return never_overlaps(law)


class Round(eqx.Module):
    """State of the steps.

    **Fields:**

    - `pressure`, `gap`: of the last step, σ and (K + λ)σ - h - λσ' + c.
    - `centre`, `centre_gap`: the pressure accepted last, and K σ' - h + c.
    - `coat`: λ over the least |K|.
    - `changes`: points that changed sides in the last three steps with this λ.
    - `count`: steps with this λ.
    - `pairs`: FFT pairs so far.
    - `found`: whether the contact without a coat converged.
    """

    pressure: Field
    gap: Field
    centre: Field
    centre_gap: Field
    coat: Scalar
    changes: Float[Array, "3"]
    count: Array
    pairs: Array
    found: Bool[Array, ""]


def newton_round(operator: AbstractOperator, heights, load, z, x, coat, *, allowed, rtol, budget):
    """Returns z = σ + u, the next coat, the FFT pairs, and whether the contact was found.

    **Arguments:**

    - `operator`, `heights`: K and h in units of pressure, h of zero mean.
    - `load`: mean of the pressure.
    - `z`, `x`: of the splitting, and the pressure of the solid there.
    - `coat`: λ to begin with, over the least |K|.
    - `allowed`: where the law allows a pressure.
    - `budget`: FFT pairs after which no step is begun.
    """
    least, green = operator.least, green_of(operator, z.shape)
    unknown = jnp.full(3, jnp.inf, z.dtype)
    none = jnp.asarray(0)
    state = Round(x, z - x, x, z - x, coat, unknown, none, none, jnp.asarray(False))

    def touching(pressure, gap, lam):
        return allowed & (pressure * (1 + lam) > gap)

    def running(state):
        return (state.pairs < budget) & ~state.found

    def body(state):
        lam = state.coat * least
        tolerance = jnp.where(lam > 0, jnp.maximum(rtol, _COATED_ERROR), rtol * _CLOSER)
        contact = touching(state.pressure, state.gap, lam)
        unchanged = state.changes[0] == 0
        solid = Coated(operator, green, lam, heights + lam * (state.centre - load), load)
        pressure, gap, off, pairs = pressure_on(
            contact, solid, state.pressure, tolerance, unchanged, budget - state.pairs
        )
        changed = jnp.sum(touching(pressure, gap, lam) != contact).astype(z.dtype)
        # Pressures that were iterated count only if they were close before the step.
        accepted = (changed == 0) & (unchanged | (off * REDUCTION <= tolerance))
        stuck = (state.count > 2) & (changed > 0) & (changed >= jnp.max(state.changes))
        # The coat ends at 0: below `_THINNEST` it hardly differs from the bare solid.
        thinner = jnp.where(state.coat > _THINNEST, state.coat / _FACTOR, 0)
        thicker = jnp.maximum(state.coat * _FACTOR, 1)
        bare = gap - lam * (pressure - state.centre)
        fresh = accepted | stuck  # either way the next steps begin at the accepted contact
        centre = jnp.where(accepted, pressure, state.centre)
        centre_gap = jnp.where(accepted, bare, state.centre_gap)
        return Round(
            pressure=jnp.where(fresh, centre, pressure), gap=jnp.where(fresh, centre_gap, gap),
            centre=centre, centre_gap=centre_gap,
            coat=jnp.where(accepted, thinner, jnp.where(stuck, thicker, state.coat)),
            changes=jnp.where(fresh, unknown, jnp.roll(state.changes, 1).at[0].set(changed)),
            count=jnp.where(fresh, 0, state.count + 1), pairs=state.pairs + pairs,
            found=accepted & (lam == 0),
        )  # fmt: skip

    last = jax.lax.while_loop(running, body, varying(state))
    return last.centre + last.centre_gap, last.coat, last.pairs, last.found
