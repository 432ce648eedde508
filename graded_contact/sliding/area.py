"""Contact area and gap."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..contacts.area import area_in_doubt, counted_area, sub_pixel_area
from ..contacts.estimates import error_of
from ..core.quantities import TOTAL, observable, of_cycle, of_steady
from .errors import (
    add_errors,
    change_by_grid,
    changes_by_kernel,
    gap_by_solver,
    over_number,
    with_chance,
)
from .formulas import indicator_of, share_of, touching
from .resolution import neighbours_of
from .result import CyclicSliding, Found, Sliding


@observable("A/A_0", "1", "contact area fraction", over_time=True, column=("contact\narea", ".5f"))
def contact_area(found: Found) -> Array:
    """Fraction of the surface in contact [1], with edges between the points."""

    def share(indicator, pressure):
        # Where the body flows, the pressure ends at its edge at once: its load needs this area.
        return jnp.maximum(sub_pixel_area(indicator), jnp.mean(pressure) / found.law.bounds[1])

    return share_of(found, share, indicator_of(found), found.pressure)


@observable("A/A_0", "1", "share of points in contact", over_time=True)
def contact_area_pixels(found: Found) -> Array:
    """Fraction of the points in contact [1]: 4 to 20 % more than the area, without a derivative."""
    return share_of(found, counted_area, touching(found))


@of_cycle("t_c/T", "1", "share of the times at which the surfaces touch")
def time_in_contact(found: CyclicSliding) -> Array:
    """Share of the times at which the surfaces touch [1]."""
    return jnp.mean(contact_area_pixels(found) > 0, dtype=found.pressure.dtype)


@observable(r"\bar u", "m", "mean gap", over_time=True, column=("mean gap\n[m]", ".3e"))
def mean_gap(found: Found) -> Array:
    """Mean of the gap [m]."""
    gap = found.contact.mean_gap
    return gap.reshape(gap.shape[: -found.grid.ndim]) if isinstance(found, CyclicSliding) else gap


@observable("", "Pa", "how far points are inside contact or outside", stored=False)
def contact_indicator(found: Found) -> Array:
    """How far points are inside contact or outside [Pa], see `AbstractLaw.contact_indicator`."""
    return indicator_of(found)


def _area_by_grid(found: Found) -> Array:
    edges = jnp.abs(contact_area_pixels(found) - contact_area(found))
    error = change_by_grid("contact_area")(found) + 0.4 * neighbours_of(found).factor * edges
    if found.law.attracts:
        error = error + _edges_by_chance(found)
    return jnp.minimum(error, jnp.maximum(contact_area(found), 1 - contact_area(found)))


def _edges_by_chance(found: Found) -> Array:
    """The area by edges, each half a spacing off: tension around them is not that of Hertz."""
    inside = touching(found)
    axes = tuple(range(-found.grid.ndim, 0))
    crossed = sum(jnp.sum(inside != jnp.roll(inside, 1, axis), axis=axes) for axis in axes)
    size = jnp.asarray(found.grid.ndim * np.prod(found.grid.shape), found.pressure.dtype)
    return 0.5 * jnp.sqrt(crossed) / size


def _gap_by_grid(found: Found) -> Array:
    # Two changes of both signs may cancel in the gap; they do not in the area.
    by_area = jnp.abs(mean_gap(found)) * _area_by_grid(found)
    return change_by_grid("mean_gap")(found) + 0.15 * by_area


def _area_in_doubt(found: Found, change: Array) -> Array:
    """The share of points that a change of the pressure may have put on the wrong side."""
    return area_in_doubt(indicator_of(found), jnp.abs(change))


def _area_by_solver(found: Found) -> Array:
    indicator, value = indicator_of(found), contact_area(found)
    of = lambda change: sub_pixel_area(indicator + change)[None]  # noqa: E731
    moved = error_of(of, value[None], found.contact.correction, value)[0]
    return moved + _area_in_doubt(found, found.contact.correction)


def _area_by_kernel(found: Sliding) -> Array:
    inside, change = touching(found), jnp.zeros_like(found.pressure)
    for moved in changes_by_kernel(found):  # 0 outside contact, where points may join it
        in_contact = jnp.sqrt(jnp.sum(moved**2) / jnp.maximum(jnp.sum(inside), 1))
        change += jnp.where(inside, jnp.abs(moved), in_contact)
    # Edges move between the points, too; what a change of both signs moves may cancel by chance.
    pull = jax.grad(sub_pixel_area)(indicator_of(found))
    return _area_in_doubt(found, change) + with_chance(pull * change)


add_errors(
    "contact_area", of_steady, TOTAL, over=over_number,
    solver=_area_by_solver, grid=_area_by_grid, kernel=_area_by_kernel,
    temperature=lambda found: found.heated.area_error,
)  # fmt: skip
add_errors("mean_gap", of_steady, solver=gap_by_solver, grid=_gap_by_grid)
