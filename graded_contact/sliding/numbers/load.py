"""Load and approach."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ...contacts.estimates import error_of
from ...core.derivative import largest
from ..case import GIVEN_LOAD, GROUND, LOAD_FOLLOWS, WINDOW
from ..errors.grid import OF_PLACE, by_grid
from ..errors.parts import changes_by_kernel, gap_by_solver, with_chance
from ..number import Found, observable


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
