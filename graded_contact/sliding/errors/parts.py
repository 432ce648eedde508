"""The errors of observables: totals, and the parts that each is the sum of.

`add_errors` gives a number its error. What the solver left follows from the estimated change of the
pressure (`contacts/estimates.py`), the errors by the grid and by the times from neighbours
(`resolution.py`).
"""

from collections.abc import Callable, Collection
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...contacts.estimates import error_of
from ...contacts.operators.window import Window
from ...core.caveats import DOUBTFUL
from ...core.quantities import KINDS, OBSERVABLES, Above, NumberOf
from ...fields.grid import interpolate
from ..facts import HEATED, WINDOW
from ..formulas import frictions, indicator_of, loaded, shared, slopes, touching
from ..result import CyclicSliding, Found, Sliding
from .neighbours import neighbours_of

# The causes of errors in words, and the facts of the contacts that have them.
CAUSES: dict[str, tuple[str, list[str]]] = {
    "solver": ("the solver", []),
    "grid": ("the grid", []),
    "time": ("the number of times", []),
    "memory": ("the memory of the block", []),
    "temperature": ("the temperatures of the contact", [HEATED]),
    "kernel": ("the kernel of the window", [WINDOW]),
}
UNRESOLVED = {
    "grid": "The grid does not resolve the contact: the NUMBER has an error of about {value:.0%}. "
    "Take more points, or a smoother surface.",
    "time": "The times do not resolve the motion: the NUMBER has an error of about {value:.0%}. "
    "Take more times.",
    "kernel": "The kernel of the window is not known well, as where the block recovers slowly "
    "behind the body: the NUMBER has an error of about {value:.0%}. Compare with a larger window.",
    "memory": "The memory of the block is not known well: the NUMBER has an error of about "
    "{value:.0%}. Take a shorter motion, or under an indenter a larger window.",
    "temperature": "The temperatures of the contact did not settle: the NUMBER has an error of "
    "about {value:.0%}. Take a smaller `rtol`.",
}
NO_FRICTION = 1e-12  # of the slope: friction below it is rounding
_IDLE = 1e-3  # friction over slope below which a contact counts as without friction
_MEANINGLESS = 10.0  # share of an error above which a number means nothing


def add_errors(
    name: str,
    kind: Any,
    column: tuple[str, str] | None = None,
    needs: Collection[str] = (),
    over: Callable[[str, str], Callable[[NumberOf], Any]] | None = None,
    beside: Callable[[Any], Any] = neighbours_of,
    over_time: bool = False,
    doubted: Collection[str] = KINDS,
    **parts: Callable[[Any], Any],
) -> None:
    """Registers `NAME_error`, the sum of its parts, and each part as `NAME_PART_error`.

    **Arguments:**

    - `name`: of the observable.
    - `kind`: `of_steady` or `of_cycle`.
    - `column`: of the total, see `Observable`.
    - `needs`: facts of the contacts that have the errors.
    - `over`: what an error is compared with: `over_number` or `over_friction`. A part above a share
      of `DOUBTFUL` is a caveat, if `UNRESOLVED` has its cause; None: no part is.
    - `beside`: returns the neighbours of a contact.
    - `over_time`: whether there is an error at each time.
    - `doubted`: kinds of contacts that have these caveats.
    - `parts`: the formulas by their causes, see `CAUSES`.
    """
    symbol, unit, meaning = OBSERVABLES[name].quantity[1:4]
    for part, formula in parts.items():
        cause, fact = CAUSES[part]

        def of_part(found, formula=formula):
            return formula(found)

        of_part.__name__ = f"{name}_{part}_error"
        of_part.__doc__ = f"The part of `{name}_error` by {cause} [{unit}]."
        warns = None
        if over is not None and part in UNRESOLVED:
            sentence = UNRESOLVED[part].replace("NUMBER", name.replace("_", " "))
            warns = Above(DOUBTFUL, sentence, over(name, of_part.__name__), doubted)
        kind(
            "", unit, f"error of the {meaning} by {cause}", needs=(*needs, *fact), warns=warns,
            beside=beside if part in ("grid", "time") else None, over_time=over_time,
        )(of_part)  # fmt: skip

    def total(found):
        known = (n for n in parts if {*CAUSES[n][1]} <= found.facts)
        return sum(parts[n](found) for n in known)

    total.__name__ = f"{name}_error"
    total.__doc__ = f"Estimated error of `{name}`, the sum of its parts [{unit}]."
    kind(
        rf"\delta {symbol}", unit, f"estimated error of the {meaning}", column=column, needs=needs,
        beside=beside, over_time=over_time,
    )(total)  # fmt: skip


def by_times(
    name: str, trace: Callable[[CyclicSliding], Array]
) -> Callable[[CyclicSliding], Array]:
    """Returns the formula of the error by the times, from the contact with half as many.

    `trace` is what the number is a mean or a peak of, at each time: its changes may cancel in the
    number by chance, so that their mean size counts, too.
    """

    def of_times(found):
        formula, fewer = OBSERVABLES[name].formula, neighbours_of(found).fewer
        if not isinstance(fewer, CyclicSliding):  # too few times to be halved
            return jnp.abs(formula(found))
        before, after = trace(found), trace(fewer)
        moved = jnp.abs(interpolate(before, (len(after), *before.shape[1:])) - after)
        moved = jnp.mean(jnp.where(jnp.isfinite(moved), moved, 0))  # no friction without contact
        return jnp.abs(formula(found) - formula(fewer)) / 2 + 0.15 * moved

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


def changes_by_kernel(found: Sliding) -> list[Array]:
    """What the errors of a window's kernel change in the pressure."""
    if found.problem.kernel_error is None:
        return []
    assert isinstance(found.operator, Window)
    given = found.pressure, touching(found), found.at_approach
    return [found.operator.change_by(error, *given) for error in found.problem.kernel_error]


def with_chance(part: Array) -> Array:
    """The sum of contributions of points, some of which may cancel by chance."""
    return jnp.abs(jnp.sum(part)) + jnp.sqrt(jnp.sum(part**2))


def gap_by_solver(found: Found) -> Array:
    """The error of the gap, and of an approach, that the solver left [m]."""
    return found.contact.gap_error * jnp.std(found.problem.between)


def over_friction(name: str, error: str) -> Callable[[NumberOf], Any]:
    """Returns the function of an error over the friction [1]; 0 where nothing is dissipated."""

    def share(number):
        friction, wrong, slope = map(number, (name, error, "slope_in_contact"))
        scale = np.maximum(np.abs(friction), _IDLE * slope)
        idle = np.abs(friction) <= NO_FRICTION * slope
        return np.where(idle, 0.0, np.minimum(wrong / np.where(scale == 0, 1, scale), _MEANINGLESS))

    return share


def over_number(name: str, error: str) -> Callable[[NumberOf], Any]:
    """Returns the function of an error over its number [1]; 0 where the number is 0."""

    def share(number):
        size, wrong = np.abs(number(name)), number(error)
        part = np.minimum(wrong / np.where(size > 0, size, 1), _MEANINGLESS)
        return np.where(size > 0, part, 0.0)

    return share
