"""The second gear of the splitting: semismooth Newton steps for hard walls, where it is slow.

Where a small contact carries the load, or moduli differ a thousandfold, the splitting takes
thousands of steps to settle which points touch. A Newton step takes that set A as known, and
solves for the pressures on it,

    K σ - h + c = 0 on A,   σ = 0 elsewhere,   mean σ as prescribed,      K = ρM,

by generalised conjugate residuals, preconditioned by the inverse kernel on A: two FFT pairs a
direction, a few directions a step. The next A is where σ exceeds the gap. Far from the solution
such steps may go round in circles. Then they solve a contact coated by springs, whose compliance λ
makes that easier and whose rest is at the last pressure that was accepted, σ' (the proximal point
method):

    (K + λ) σ - (h + λ σ') + c = 0 on A.

Every such contact is nearer to the solution than the last; λ falls tenfold after each, to 0, and
rises tenfold where the number of points that change sides does not fall.

M. Hintermüller, K. Ito & K. Kunisch, SIAM J. Optim. 13 (2002) 865,
doi:10.1137/S1052623401383558; S. C. Eisenstat, H. C. Elman & M. H. Schultz, SIAM J. Numer. Anal. 20
(1983) 345, doi:10.1137/0720023; R. T. Rockafellar, SIAM J. Control Optim. 14 (1976) 877,
doi:10.1137/0314056.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Inexact

from ..grid import to_field, to_spectrum
from .law import AbstractLaw, HardWall
from .solver import least_compliance
from .splitting import DRAFTED_FROM

_REDUCTION = 0.1  # of the residual by one step
_COATED_ERROR = 1e-3  # of a coated contact
_FACTOR = 10.0  # from one coat to the next
_THINNEST = 0.01  # coat, over the least compliance of any wave
_CLOSER = 3e-3  # than the wanted error, which the splitting is to confirm
_NUM_DIRECTIONS, _NUM_DIRECTIONS_OF_LARGE = 24, 8  # those of large grids in single precision


def takes_newton_steps(law: AbstractLaw) -> bool:
    """Returns whether the steps know a law: a hard wall of no hardness."""
    return isinstance(law, HardWall) and law.hardness is None


class Round(eqx.Module):
    """State of the steps.

    **Fields:**

    - `pressure`, `gap`: of the last step, σ and (K + λ)σ - h - λσ' + c.
    - `centre`, `centre_gap`: the pressure accepted last, and K σ' - h + c.
    - `coat`: λ over the least |K|.
    - `changes`: points that changed sides in the last three steps with this λ.
    - `count`: steps with this λ.
    - `pairs`: FFT pairs so far.
    - `found`: whether the contact itself was found.
    """

    pressure: Float[Array, "*shape"]
    gap: Float[Array, "*shape"]
    centre: Float[Array, "*shape"]
    centre_gap: Float[Array, "*shape"]
    coat: Float[Array, ""]
    changes: Float[Array, "3"]
    count: Array
    pairs: Array
    found: Bool[Array, ""]


def newton_round(
    kernel: Inexact[Array, "*half"],
    heights: Float[Array, "*shape"],
    load: Float[Array, ""],
    z: Float[Array, "*shape"],
    x: Float[Array, "*shape"],
    coat: Float[Array, ""],
    *,
    rtol: Float[Array, ""],
    budget: Array,
) -> tuple[Float[Array, "*shape"], Float[Array, ""], Array, Bool[Array, ""]]:
    """Returns z = σ + u, the coat to go on with, the FFT pairs, and if the contact was found.

    **Arguments:**

    - `kernel`, `heights`: K and h in units of pressure, 0 at q = 0.
    - `load`: mean of the pressure.
    - `z`, `x`: of the splitting, and the pressure of the solid there.
    - `coat`: λ to begin with, over the least |K|.
    - `budget`: FFT pairs after which no step is begun.
    """
    least = least_compliance(kernel)
    unchanged = jnp.full(3, jnp.inf, z.dtype)
    none = jnp.asarray(0)
    state = Round(x, z - x, x, z - x, coat, unchanged, none, none, jnp.asarray(False))

    def running(state):
        return (state.pairs < budget) & ~state.found

    def body(state):
        lam = state.coat * least
        wanted = jnp.where(lam > 0, jnp.maximum(rtol, _COATED_ERROR), rtol * _CLOSER)
        held = state.pressure * (1 + lam) > state.gap
        settled = state.changes[0] == 0
        rest = lam * (state.centre - load)
        pressure, gap, off, pairs = _step(
            kernel,
            lam,
            heights + rest,
            load,
            state.pressure,
            held,
            wanted,
            settled,
            (budget - state.pairs) // 2,
        )
        changed = jnp.sum((pressure * (1 + lam) > gap) != held).astype(z.dtype)
        accepted = (changed == 0) & (settled | (off * _REDUCTION <= wanted))
        stuck = (state.count > 2) & (changed > 0) & (changed >= jnp.max(state.changes))
        thinner = jnp.where(state.coat > _THINNEST, state.coat / _FACTOR, 0)
        thicker = jnp.maximum(state.coat * _FACTOR, 1)
        bare = gap - lam * (pressure - state.centre)
        fresh = accepted | stuck
        centre = jnp.where(accepted, pressure, state.centre)
        centre_gap = jnp.where(accepted, bare, state.centre_gap)
        return Round(
            pressure=jnp.where(fresh, centre, pressure),
            gap=jnp.where(fresh, centre_gap, gap),
            centre=centre,
            centre_gap=centre_gap,
            coat=jnp.where(accepted, thinner, jnp.where(stuck, thicker, state.coat)),
            changes=jnp.where(fresh, unchanged, jnp.roll(state.changes, 1).at[0].set(changed)),
            count=jnp.where(fresh, 0, state.count + 1),
            pairs=state.pairs + pairs,
            found=accepted & (lam == 0),
        )

    last = jax.lax.while_loop(running, body, state)
    return last.centre + last.centre_gap, last.coat, last.pairs, last.found


def _step(kernel, lam, heights, load, pressure, held, wanted, settled, most):
    """One Newton step: pressure, gap, relative residual before, and FFT pairs."""
    mean = (0,) * kernel.ndim
    coated = (kernel + lam).at[mean].set(0)
    inverse = (1 / coated.at[mean].set(1)).at[mean].set(0)
    mask = held.astype(pressure.dtype)
    points = jnp.maximum(jnp.sum(mask), 1)

    def project(field):
        return mask * (field - jnp.sum(mask * field) / points)

    def press(field):
        return to_field(coated * to_spectrum(field), field.shape)

    def solve(field):
        return project(to_field(inverse * to_spectrum(project(field)), field.shape))

    pressure = mask * (pressure + (load * mask.size - jnp.sum(mask * pressure)) / points)
    residual = solve(heights - press(pressure))
    size, begun = _norm(pressure), _norm(residual)
    close = wanted * size
    goal = jnp.where(settled, close, jnp.maximum(_REDUCTION * begun, close))
    change, num = _conjugate_residuals(lambda field: solve(press(field)), residual, goal, most)
    pressure = pressure + change
    gap = press(pressure) - heights
    gap = gap - jnp.sum(mask * gap) / points
    return pressure, gap, begun / size, 3 + 2 * num


def _conjugate_residuals(operate, residual, goal, most):
    """The change that brings a residual's norm below a goal, and the number of directions."""
    large = residual.size >= DRAFTED_FROM
    kept = _NUM_DIRECTIONS_OF_LARGE if large else _NUM_DIRECTIONS
    fields = jnp.zeros((kept, *residual.shape), jnp.float32 if large else residual.dtype)
    axes = tuple(range(1, fields.ndim))

    def running(state):
        _, residual, _, _, num = state
        return (_norm(residual) > goal) & (num < most)

    def body(state):
        change, residual, directions, images, num = state
        image = operate(residual)
        weights = jnp.sum(images * image, axis=axes, keepdims=True)
        image = image - jnp.sum(weights * images, axis=0)
        direction = residual - jnp.sum(weights * directions, axis=0)
        size = _norm(image)
        scale = 1 / jnp.where(size > 0, size, 1)
        image, direction = image * scale, direction * scale
        along = jnp.sum(image * residual)
        slot = num % kept
        return (
            change + along * direction,
            residual - along * image,
            directions.at[slot].set(direction.astype(fields.dtype)),
            images.at[slot].set(image.astype(fields.dtype)),
            num + 1,
        )

    start = (jnp.zeros_like(residual), residual, fields, fields, jnp.asarray(0))
    change, *_, num = jax.lax.while_loop(running, body, start)
    return change, num


def _norm(field):
    return jnp.sqrt(jnp.sum(field * field))
