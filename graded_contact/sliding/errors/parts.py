"""The parts of the errors of numbers: by the solver, by the times, and by a window's kernel.

What the solver left follows from the estimated change of the pressure (`contacts/estimates.py`),
the errors by the grid and by the times from neighbours (`neighbours.py`).
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...contacts.estimates import error_of
from ...contacts.operators.window import Window
from ...fields.grid import interpolate
from ..formulas import frictions, indicator_of, loaded, shared, slopes, touching
from ..limits import NumberOf
from ..number import Found, value_of

NO_FRICTION = 1e-12  # of the slope: friction below it is rounding
_IDLE = 1e-3  # friction over slope below which a contact counts as without friction
_MEANINGLESS = 10.0  # share of an error above which a number means nothing


def by_times(name: str, trace: Callable[[Found], Array]) -> Callable[[Found], Array]:
    """Returns the formula of the error by the times, from the contact with half as many.

    `trace` is what the number is a mean or a peak of, at each time, or the number itself: its
    changes may cancel in the number by chance, so that their mean size counts, too.
    """

    def of_times(found):
        own, fewer = value_of(name, found), found.near.fewer
        if fewer is None:  # too few times to be halved
            return jnp.abs(own)
        before, after = trace(found), trace(fewer)
        moved = jnp.abs(interpolate(before, (len(after), *before.shape[1:])) - after)
        moved = jnp.where(jnp.isfinite(moved), moved, 0)  # no friction without contact
        if own.ndim:
            change = moved[np.arange(len(own)) * len(after) // len(own)]
        else:
            change = jnp.abs(own - value_of(name, fewer))
        return change / 2 + 0.15 * jnp.mean(moved)

    return of_times


# By the solver, and by the kernel of a window.


@shared
def solver_errors(found: Found) -> Array:
    """The errors of `frictions` that the solver left."""
    pressure, moved = loaded(found)
    change = found.operator.on_cell(found.contact.correction)
    touches = found.operator.on_cell(indicator_of(found))
    of = lambda change: frictions(found, pressure + change, touches + change)  # noqa: E731
    steepest = jnp.max(slopes(found, pressure, moved))
    return error_of(of, of(jnp.zeros_like(change)), change, steepest)


def changes_by_kernel(found: Found) -> list[Array]:
    """The changes of the pressure by the errors of a window's kernel."""
    if found.problem.kernel_error is None:
        return []
    assert isinstance(found.operator, Window)
    given = found.pressure, touching(found), found.problem.prescribed == "approach"
    return [found.operator.change_by(error, *given) for error in found.problem.kernel_error]


def with_chance(part: Array) -> Array:
    """The sum of contributions of points, some of which may cancel by chance."""
    return jnp.abs(jnp.sum(part)) + jnp.sqrt(jnp.sum(part**2))


def gap_by_solver(found: Found) -> Array:
    """The error of the gap, and of an approach, that the solver left [m]."""
    return found.contact.gap_error * jnp.std(found.problem.between)


def over_friction(name: str, number: NumberOf):
    """Returns the relative error of a friction [1]; 0 where nothing is dissipated."""
    friction, wrong, slope = map(number, (name, f"{name}_error", "slope_in_contact"))
    scale = np.maximum(np.abs(friction), _IDLE * slope)
    idle = np.abs(friction) <= NO_FRICTION * slope
    return np.where(idle, 0.0, np.minimum(wrong / np.where(scale == 0, 1, scale), _MEANINGLESS))


def over_number(name: str, number: NumberOf):
    """Returns the relative error of a number [1]; 0 where the number is 0."""
    size, wrong = np.abs(number(name)), number(f"{name}_error")
    part = np.minimum(wrong / np.where(size > 0, size, 1), _MEANINGLESS)
    return np.where(size > 0, part, 0.0)
