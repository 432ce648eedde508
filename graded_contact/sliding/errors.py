"""The errors of observables: totals, and the parts that each is the sum of.

An entry of `errors_of` at the end of this file gives a number its error. What the solver left
follows from the estimated change of the pressure (`contacts/estimates.py`), the errors by the grid
and by the times from neighbours (`resolution.py`).
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..contacts import area
from ..contacts.estimates import error_of
from ..contacts.operator import nonzero
from ..contacts.window import Window
from ..core.quantities import OBSERVABLES
from ..fields.grid import interpolate
from .observables import (
    contact_area,
    contact_area_pixels,
    contact_indicator,
    dissipation_of_waves,
    friction,
    frictions,
    geometric_friction,
    load,
    loaded,
    mean_gap,
    moved_where_loaded,
    of_cycle,
    of_steady,
    shared,
    shear_friction,
    slopes,
    touching,
    traction,
    tractions_of,
)
from .resolution import neighbours_of
from .result import CyclicSliding, Found, Sliding
from .shear import shear_over_load


def errors_of(
    name: str,
    kind: Any,
    column: tuple[str, str] | None = None,
    needs: tuple[str, ...] = (),
    **parts: Callable[[Any], Any],
) -> None:
    """Registers `NAME_error`, the sum of its parts, and each part as `NAME_PART_error`."""
    symbol, unit, meaning = OBSERVABLES[name].quantity[1:4]
    for part, formula in parts.items():
        cause, fact = CAUSES[part]

        def of_part(found, formula=formula):
            return formula(found)

        of_part.__name__ = f"{name}_{part}_error"
        of_part.__doc__ = f"The part of `{name}_error` by {cause} [{unit}]."
        kind(
            "", unit, f"error of the {meaning} by {cause}",
            needs=(*needs, *fact), beside=neighbours_of if part in ("grid", "time") else None,
        )(of_part)  # fmt: skip

    def total(found):
        known = (n for n in parts if {*CAUSES[n][1]} <= found.facts)
        return sum(parts[n](found) for n in known)

    total.__name__ = f"{name}_error"
    total.__doc__ = f"Estimated error of `{name}`, the sum of its parts [{unit}]."
    kind(
        rf"\delta {symbol}", unit, f"estimated error of the {meaning}", column=column, needs=needs,
        beside=neighbours_of,
    )(total)  # fmt: skip


# The causes of errors in words, and the facts of the contacts that have them.
CAUSES: dict[str, tuple[str, list[str]]] = {
    "solver": ("the solver", []),
    "grid": ("the grid", []),
    "time": ("the number of times", []),
    "temperature": ("the temperatures of the contact", ["heated"]),
    "kernel": ("the kernel of the window", ["window"]),
}


def change_by_grid(name: str) -> Callable[[Found], Array]:
    """Returns the formula of the change of a number from half the grid, see `resolution.py`."""

    def change(found):
        formula, near = OBSERVABLES[name].formula, neighbours_of(found)
        own, same, half = map(formula, (found, near.same, near.half))
        # Without its shortest waves a surface has less friction, of about the same relative error.
        less = jnp.maximum(jnp.abs(own) / nonzero(jnp.abs(same)), 1)
        moved = jnp.abs(same - half) * less
        # Half the grid may lose a contact of few points, and with it the friction.
        lost = jnp.isnan(moved) & ~jnp.isnan(near.factor)
        return near.factor * jnp.where(lost, jnp.abs(own), moved)

    return change


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


def _work_over_time(found: CyclicSliding) -> Array:
    """The power of friction at each time over a period [J/m²]."""
    moved = traction(found).reshape(len(found.displacement), -1) * found.motion_of_surface[0]
    return jnp.sum(moved, axis=1) * found.period


def _power_over_time(found: CyclicSliding) -> Array:
    return _work_over_time(found) / found.period


# By the solver, and by the kernel of a window.


@shared
def _solver_errors(found: Found) -> Array:
    """The errors of `frictions` that the solver left."""
    pressure, moved = loaded(found)
    change = found.operator.on_cell(found.contact.correction)
    touches = found.operator.on_cell(contact_indicator(found))
    of = lambda change: frictions(found, pressure + change, touches + change)  # noqa: E731
    steepest = jnp.max(slopes(found, pressure, moved))
    return error_of(of, of(jnp.zeros_like(change)), change, steepest)


def _changes_by_kernel(found: Sliding) -> list[Array]:
    """What the errors of a window's kernel change in the pressure."""
    if found.problem.kernel_error is None:
        return []
    assert isinstance(found.operator, Window)
    given = found.pressure, touching(found), found.at_approach
    return [found.operator.change_by(error, *given) for error in found.problem.kernel_error]


def _with_chance(part: Array) -> Array:
    """The sum of contributions of points, some of which may cancel by chance."""
    return jnp.abs(jnp.sum(part)) + jnp.sqrt(jnp.sum(part**2))


def _image_error(found: Sliding) -> Array:
    """What the errors of a window's kernel change in friction, under this pressure and by the load.

    Contributions of single points may cancel in the estimate by chance: so twice their root sum of
    squares is added (`docs/theory/contact.md`).
    """
    assert found.problem.kernel_error is not None
    pressure = loaded(found)[0]
    moved = [found.operator.with_kernel(k).displace(pressure) for k in found.problem.kernel_error]
    sums = sum(jnp.abs(jnp.sum(tractions_of(found, pressure, w)) / load(found)) for w in moved)
    steep = sum(slopes(found, pressure, w) for w in moved)
    by_kernel = sums + 2 * steep / jnp.sqrt(jnp.sum(pressure != 0))
    if not found.at_approach:
        return by_kernel
    indicator = contact_indicator(found)

    def friction_under(p):
        own = frictions(found, found.operator.on_cell(p), indicator)[0]
        return own + shear_over_load(p, indicator + p - found.pressure, found.shear)

    pull = jax.grad(friction_under)(found.pressure)
    return by_kernel + sum(_with_chance(pull * change) for change in _changes_by_kernel(found))


def _friction_by_solver(found: Sliding) -> Array:
    error = _solver_errors(found)[0]
    if found.shear is None:
        return error
    indicator, value = contact_indicator(found), jnp.abs(shear_friction(found))

    def of(change):  # in contact the indicator of a hard wall is the pressure
        return shear_over_load(found.pressure + change, indicator + change, found.shear)[None]

    return error + error_of(of, of(jnp.zeros_like(indicator)), found.contact.correction, value)[0]


# `bench_contact.py grid` has how often these are below the true error, and how far above it.


def _friction_by_grid(found: Found) -> Array:
    # Each alone is sometimes far too small. Without losses friction is 0 on every grid.
    by_slopes = jnp.abs(geometric_friction(found) - friction(found))
    by_slopes = jnp.where(jnp.any(dissipation_of_waves(found) != 0), by_slopes, 0)
    return (2 * change_by_grid("friction")(found) + by_slopes) / 3


def _area_by_grid(found: Found) -> Array:
    edges = jnp.abs(contact_area_pixels(found) - contact_area(found))
    error = change_by_grid("contact_area")(found) + 0.4 * neighbours_of(found).factor * edges
    return jnp.minimum(error, jnp.maximum(contact_area(found), 1 - contact_area(found)))


def _gap_by_grid(found: Found) -> Array:
    # Two changes of both signs may cancel in the gap; they do not in the area.
    by_area = jnp.abs(mean_gap(found)) * _area_by_grid(found)
    return change_by_grid("mean_gap")(found) + 0.15 * by_area


def _area_in_doubt(found: Found, change: Array) -> Array:
    """The share of points that a change of the pressure may have put on the wrong side."""
    return area.area_in_doubt(contact_indicator(found), jnp.abs(change))


def _area_by_solver(found: Found) -> Array:
    indicator, value = contact_indicator(found), contact_area(found)
    of = lambda change: area.sub_pixel_area(indicator + change)[None]  # noqa: E731
    moved = error_of(of, value[None], found.contact.correction, value)[0]
    return moved + _area_in_doubt(found, found.contact.correction)


def _area_by_kernel(found: Sliding) -> Array:
    inside, change = touching(found), jnp.zeros_like(found.pressure)
    for moved in _changes_by_kernel(found):  # 0 outside contact, where points may join it
        in_contact = jnp.sqrt(jnp.sum(moved**2) / jnp.maximum(jnp.sum(inside), 1))
        change += jnp.where(inside, jnp.abs(moved), in_contact)
    # Edges move between the points, too; what a change of both signs moves may cancel by chance.
    pull = jax.grad(area.sub_pixel_area)(contact_indicator(found))
    return _area_in_doubt(found, change) + _with_chance(pull * change)


def _pressure_by_solver(found: Found) -> Array:
    if found.problem.prescribed == "pressure":
        raise ValueError("A contact at a given `pressure` has no `mean_pressure_error`.")
    of = lambda change: jnp.mean(found.pressure + change)[None]  # noqa: E731
    mean = found.contact.mean_pressure
    return error_of(of, mean[None], found.contact.correction, mean)[0]


def _approach_by_kernel(found: Sliding) -> Array:
    assert found.problem.kernel_error is not None
    operators = map(found.operator.with_kernel, found.problem.kernel_error)
    moved = [moved_where_loaded(found, operator) for operator in operators]
    return jnp.sum(jnp.abs(jnp.stack(moved)))


def _by_temperature(found: Found, index: int) -> Array:
    """The error of mean or peak friction by the temperatures; known is that of the mean."""
    both = frictions(found, loaded(found)[0], contact_indicator(found))
    assert found.heated is not None
    return found.heated.friction_error * jnp.abs(both[index]) / nonzero(jnp.abs(both[0]))


def _gap_by_solver(found: Found) -> Array:
    return found.contact.gap_error * jnp.std(found.heights)


TOTAL = ("±", ".1e")  # a column of tables
errors_of(
    "friction", of_steady, TOTAL,
    solver=_friction_by_solver, grid=_friction_by_grid,
    kernel=_image_error, temperature=lambda found: found.heated.friction_error,
)  # fmt: skip
errors_of(
    "contact_area", of_steady, TOTAL,
    solver=_area_by_solver, grid=_area_by_grid, kernel=_area_by_kernel,
    temperature=lambda found: found.heated.area_error,
)  # fmt: skip
errors_of("mean_gap", of_steady, solver=_gap_by_solver, grid=_gap_by_grid)
errors_of(
    "mean_pressure", of_steady, needs=("load follows",),
    solver=_pressure_by_solver, grid=change_by_grid("mean_pressure"),
    kernel=lambda f: sum(map(_with_chance, _changes_by_kernel(f))) / f.pressure.size,
)  # fmt: skip
errors_of(
    "approach", of_steady, needs=("ground", "given load"),
    solver=_gap_by_solver, grid=change_by_grid("approach"), kernel=_approach_by_kernel,
)  # fmt: skip
for _number, _index in (("mean_friction", 0), ("peak_friction", 1)):
    errors_of(
        _number, of_cycle, TOTAL, grid=change_by_grid(_number), time=by_times(_number, friction),
        solver=lambda found, index=_index: _solver_errors(found)[index],
        temperature=lambda found, index=_index: _by_temperature(found, index),
    )  # fmt: skip
for _number, _trace in (
    ("work", _work_over_time), ("load_work", _work_over_time),
    ("dissipated_power", _power_over_time),
):  # fmt: skip
    errors_of(_number, of_cycle, grid=change_by_grid(_number), time=by_times(_number, _trace))
