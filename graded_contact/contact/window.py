"""Contacts on a window, with no pressure around it: indenters, spheres, edges of blocks.

A kernel of a cell of twice the window's length gives the displacement of a pressure on the window
(`response/window.py`). The window is the first half of each axis of that cell. The contact on the
cell is solved as usual, with a law that allows no pressure outside the window. The heights outside
do not matter; mirrored ones have the mean and the rms of the window, and no steps.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Inexact, Shaped

from ..fields.grid import Grid, half_shape, to_spectrum
from .adjoint import Inputs
from .area import edge_stiffness
from .law import AbstractLaw
from .operator import Steady, first_mode
from .solution import ContactSolution
from .solver import Loading


def is_window(kernel: Inexact[Array, "*half"], shape: tuple[int, ...]) -> bool:
    """Returns whether a kernel is that of a window with fields of this shape."""
    return kernel.shape == half_shape(_doubled(shape))


def stiffness_at_edges(
    kernel: Inexact[Array, "*half"], cell: Grid, shape: tuple[int, ...]
) -> Float[Array, ""]:
    """Returns the `edge_stiffness` [Pa/m] of fields of this shape, on a window or not."""
    if is_window(kernel, shape):
        # The wake of sliding ends there with a step, of opposite sign in every other wave along x.
        kernel = kernel / 2 + (jnp.roll(kernel, 1, 0) + jnp.roll(kernel, -1, 0)) / 4
    return edge_stiffness(kernel, cell)


class Windowed(AbstractLaw):
    """A law on a window, and no pressure elsewhere: see `inside`."""

    law: AbstractLaw

    @property
    def attracts(self):  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.law.attracts

    @property
    def bounds(self):
        return self.law.bounds

    @property
    def steepest_rise(self):
        return self.law.steepest_rise

    def in_units(self, pressure, length):
        return Windowed(self.law.in_units(pressure, length))

    def proximal(self, v):
        return jnp.where(inside(v.shape), self.law.proximal(v), 0)

    def contact_indicator(self, pressure, gap, stiffness):
        found = self.law.contact_indicator(pressure, gap, stiffness)
        return jnp.where(inside(gap.shape), found, -stiffness * jnp.abs(gap))


def inside(shape: tuple[int, ...]) -> Bool[Array, "*shape"]:
    """Returns where the window is in a cell of this shape: in the first half of each axis."""
    numbers = [jax.lax.broadcasted_iota(jnp.int32, shape, axis) for axis in range(len(shape))]
    first = [2 * number < n for number, n in zip(numbers, shape, strict=True)]
    return first[0] if len(shape) == 1 else first[0] & first[1]


def on_cell(
    field: Shaped[Array, "..."], kernel: Inexact[Array, "*half"], mode: str = "constant"
) -> Shaped[Array, "..."]:
    """Returns a field on the cell of a kernel: with zeros around if it is that of a window."""
    if not is_window(kernel, field.shape):
        return field
    return jnp.pad(field, [(0, n) for n in field.shape], mode=mode)


def on_window(field: Float[Array, "..."]) -> Float[Array, "..."]:
    """Returns the part of a field on a window's cell that is on the window."""
    return field[tuple(slice(0, n // 2) for n in field.shape)]


def solve_on_window(
    solve: Callable[..., ContactSolution],
    kernel: Inexact[Array, "*half"],
    heights: Float[Array, "*shape"],
    loading: Loading,
    *,
    law: AbstractLaw,
    target: Callable | None,
    start: Float[Array, "*shape"] | None,
    solution: ContactSolution | None,
) -> ContactSolution:
    """Returns the contact on a window, by a solver of contacts on its cell.

    Arguments as in `solve_contact`; `solve` already has the remaining ones. The gap of the loading
    is that of the undeformed block. The mean pressure and the mean gap of the contact are those of
    the window.
    """
    grounded = loading.gap is not None
    if not grounded:
        loading = Loading(loading.pressure / 2**heights.ndim, None)
    operator = Steady(_with_ground(kernel, heights.shape) if grounded else kernel, grounded)
    inputs = Inputs(operator, on_cell(heights, kernel, "symmetric"), Windowed(law), loading)
    on_part = None if target is None else lambda found: target(_on_part(found))
    start = None if start is None else on_cell(start, kernel)
    solution = None if solution is None else _on_whole(solution, inputs)
    return _on_part(solve(inputs, target=on_part, start=start, solution=solution))


def _with_ground(kernel: Inexact[Array, "*half"], shape: tuple[int, ...]):
    """The kernel with an entry for the mean above 0; NaN if it has none.

    An incompressible slab has none to speak of. A constant where two points are one window apart
    along an axis, which no two points of the window are, raises it without another effect.
    """
    mean, sizes = first_mode(kernel.shape), jnp.where(first_mode(kernel.shape), jnp.inf, kernel)
    entry = jnp.real(kernel[(0,) * len(shape)])
    missing = jax.lax.stop_gradient(jnp.maximum(jnp.min(jnp.abs(sizes)) / 4 - entry, 0))
    whole = _doubled(shape)
    near = [jax.lax.broadcasted_iota(jnp.int32, whole, a) != n for a, n in enumerate(shape)]
    apart = 1 - jnp.prod(jnp.stack(near), axis=0, dtype=entry.dtype)
    unused = to_spectrum(apart).real / jnp.sum(apart)
    return jnp.where(mean & (entry == 0), jnp.nan, kernel + missing * unused)


def change_by_kernel(
    kernel: Inexact[Array, "*half"],
    error: Inexact[Array, "*half"],
    pressure: Float[Array, "*shape"],
    touching: Bool[Array, "*shape"],
    at_approach: bool,
) -> Float[Array, "*shape"]:
    """Returns the change of the pressure by an error of the kernel, at a given approach or load.

    In Pa. As in `estimates.py`, by the inverse of M on the whole cell instead of on the contact.
    """
    operator = Steady(_with_ground(kernel, pressure.shape) if at_approach else kernel, at_approach)

    def in_contact(field):
        mean = 0 if at_approach else jnp.sum(jnp.where(touching, field, 0)) / jnp.sum(touching)
        return jnp.where(touching, field - mean, 0)

    moved = on_window(operator.with_kernel(error).displace(on_cell(pressure, kernel)))
    lifted = on_cell(in_contact(moved), kernel)
    return -in_contact(on_window(operator.filtered(operator.inverse, lifted)))


@eqx.filter_jit
def _on_part(found: ContactSolution) -> ContactSolution:
    """The contact of a cell on its window."""
    pressure, gap, moved = map(on_window, (found.pressure, found.gap, found.displacement))
    return dataclasses.replace(
        found,
        pressure=pressure,
        gap=gap,
        displacement=moved - jnp.mean(moved),
        correction=on_window(found.correction),
        mean_pressure=jnp.mean(pressure),
        mean_gap=jnp.mean(gap),
    )


@eqx.filter_jit
def _on_whole(known: ContactSolution, inputs: Inputs) -> ContactSolution:
    """The contact on the cell of a window's contact: around it, its pressure's displacement."""
    operator, kernel = inputs.operator, inputs.operator.kernel
    heights, pressure = inputs.heights - jnp.mean(inputs.heights), on_cell(known.pressure, kernel)
    own, offset = operator.displace(pressure), inputs.loading.gap
    if offset is None:
        offset = known.mean_gap - jnp.mean(on_window(own))
    within = inside(pressure.shape)
    gap = jnp.where(within, on_cell(known.gap, kernel), own - heights + offset)
    return dataclasses.replace(
        known,
        pressure=pressure,
        gap=gap,
        displacement=gap + heights - offset,
        correction=on_cell(known.correction, kernel),
    )


def _doubled(shape: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(2 * n for n in shape)
