"""Contact area, gap, load and approach."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ...contacts.area import area_in_doubt, cuts_of, sub_pixel_area
from ...contacts.estimates import error_of
from ...core.derivative import largest
from ..case import GIVEN_LOAD, GROUND, LOAD_FOLLOWS, WINDOW
from ..errors.grid import OF_PLACE, area_by_grid, by_grid
from ..errors.parts import by_times, changes_by_kernel, gap_by_solver, over_number, with_chance
from ..formulas import edges_of, indicator_of, touching
from ..number import Found, observable
from ..problem import CycleProblem


def _share_of(found: Found, formula: Callable[..., Array], *fields: Array) -> Array:
    """An area at each time, in the dtype of the pressure."""
    return found.operator.at_each_time(formula, *fields).astype(found.pressure.dtype)


@observable("contact area fraction")
def contact_area(found: Found) -> Array:
    """Fraction of the surface in contact [1], with edges between the points."""

    edges = edges_of(found)

    def share(indicator, pressure):
        # Where the body flows, the pressure ends at its edge at once: its load needs this area.
        flown = jnp.mean(pressure) / found.law.bounds[1]
        return jnp.maximum(sub_pixel_area(indicator, edges), flown)

    return _share_of(found, share, indicator_of(found), found.pressure)


@observable("share of points in contact")
def contact_area_pixels(found: Found) -> Array:
    """Fraction of the points in contact [1]: 4 to 20 % more than the area, without a derivative."""
    return _share_of(found, jnp.mean, touching(found))


@observable("mean gap", "m")
def mean_gap(found: Found) -> Array:
    """Mean of the gap [m]."""
    gap = found.contact.mean_gap
    if isinstance(found.problem, CycleProblem):
        return gap.reshape(gap.shape[: -found.grid.ndim])
    return gap


# The solver's change of the gap also moves edges, but only its change of the pressure is known at
# each point. Without this factor 22 of 314 claims of `bench_contact.py random` were too small.
_BY_GAP = 3.0
_AT_CUTS = 4.0  # the errors of the gap around 12 punches were up to 5 times the claims without it


def _area_by_solver(found: Found) -> Array:
    edges = edges_of(found)

    def error(indicator, change):
        of = lambda change: sub_pixel_area(indicator + change, edges)[None]  # noqa: E731
        value = of(jnp.zeros_like(change))
        # Some points may be on the wrong side.
        moved = error_of(of, value, change, value)[0]
        return _BY_GAP * moved + area_in_doubt(indicator, change)

    return _share_of(found, error, indicator_of(found), found.contact.correction)


def _area_by_kernel(found: Found) -> Array:
    inside, change = touching(found), jnp.zeros_like(found.pressure)
    for moved in changes_by_kernel(found):  # 0 outside contact, where points may join it
        in_contact = jnp.sqrt(jnp.sum(moved**2) / jnp.maximum(jnp.sum(inside), 1))
        change += jnp.where(inside, jnp.abs(moved), in_contact)
    # Edges move between the points, too; what a change of both signs moves may cancel by chance.
    pull = jax.grad(sub_pixel_area)(indicator_of(found), edges_of(found))
    return area_in_doubt(indicator_of(found), change) + with_chance(pull * change)


_gap_by_grid = by_grid("mean_gap", OF_PLACE)


def _gap_beside_cuts(found: Found) -> Array:
    """The error of the gap by the grid, larger if the body ends within it, as a punch does."""
    error = _gap_by_grid(found)
    if WINDOW not in found.facts:
        return error
    cut = jnp.max(jnp.stack(cuts_of(found.heights, True)))
    return error * (1 + _AT_CUTS * cut)


_ERRORS = {
    "solver": _area_by_solver,
    "grid": area_by_grid,
    "kernel": _area_by_kernel,
    "temperature": lambda found: found.heated.area_error,
}
contact_area_error = contact_area.error(_ERRORS, over=over_number)
area_error_of_cycle = contact_area.error(_ERRORS | {"time": by_times("contact_area", contact_area)})
mean_gap_error = mean_gap.error({"solver": gap_by_solver, "grid": _gap_beside_cuts})


# Load and approach.


def _moved_where_loaded(found: Found, operator: Any, field: Array | float = 0.0) -> Array:
    """How far a window moves where it is loaded, less a field; and the block's mean part of it."""
    pressure, weight = operator.on_cell(found.pressure), jnp.abs(found.pressure)
    weight = jax.lax.stop_gradient(jnp.where(jnp.sum(weight) > 0, weight, 1))
    moved = operator.on_surface(operator.displace(pressure)) - field
    mean = operator.kernel[(0,) * operator.kernel.ndim].real * jnp.mean(pressure)
    return jnp.stack([jnp.sum(weight * moved) / jnp.sum(weight), mean])


@observable("mean contact pressure", "Pa", needs=[LOAD_FOLLOWS])
def mean_pressure(found: Found) -> Array:
    """Mean pressure [Pa]."""
    return found.contact.mean_pressure


@observable("approach", "m", needs=[GROUND])
def approach(found: Found) -> Array:
    """How far a body on a window moved into the block after its first touch [m].

    Relative to the block far away; NaN if that displacement has no limit, see `solve_contact`.
    Negative if nothing touches.
    """
    if WINDOW not in found.facts:
        raise AttributeError("Only a body on a window has an `approach`; use `mean_gap`.")
    moved, mean = _moved_where_loaded(found, found.operator, found.heights + found.gap)
    ground = found.kernel[(0,) * found.kernel.ndim] != 0
    return moved + jnp.where(ground, mean, jnp.nan) + largest(found.heights)


def _pressure_by_solver(found: Found) -> Array:
    if found.problem.prescribed == "pressure":
        raise AttributeError("A contact at a given `pressure` has no `mean_pressure_error`.")
    of = lambda change: jnp.mean(found.pressure + change)[None]  # noqa: E731
    mean = found.contact.mean_pressure
    return error_of(of, mean[None], found.contact.correction, mean)[0]


def _approach_by_kernel(found: Found) -> Array:
    assert found.problem.kernel_error is not None
    operators = map(found.operator.with_kernel, found.problem.kernel_error)
    moved = [_moved_where_loaded(found, operator) for operator in operators]
    return jnp.sum(jnp.abs(jnp.stack(moved)))


def _pressure_by_kernel(found: Found) -> Array:
    return sum(map(with_chance, changes_by_kernel(found))) / found.pressure.size


mean_pressure_error = mean_pressure.error(
    {
        "solver": _pressure_by_solver,
        "grid": by_grid("mean_pressure", OF_PLACE),
        "kernel": _pressure_by_kernel,
    }
)
approach_error = approach.error(
    {"solver": gap_by_solver, "grid": by_grid("approach", OF_PLACE), "kernel": _approach_by_kernel},
    needs=[GIVEN_LOAD],
)
