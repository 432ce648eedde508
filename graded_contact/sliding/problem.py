"""What decides a contact under sliding on one grid: both bodies as an operator, surface, and law.

A `SteadyProblem` is solved once, a `CycleProblem` at all times of a period together, a
`TransientProblem` step by step. The first two give the contact at a load, by `contact`; on another
grid of the cell, by `on`, they have the waves of block and traction that both grids resolve.
"""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..blocks.stack import Stack
from ..contacts.inputs import as_start, loading_of
from ..contacts.law import AbstractLaw
from ..contacts.operators.operator import AbstractOperator, Field
from ..contacts.operators.space_time import SpaceTime, at_rest, in_motion
from ..contacts.operators.window import Window, operator_of
from ..contacts.solution import ContactSolution
from ..contacts.solve import contact_of, solve_contact
from ..contacts.solver.abstract_solver import Inputs
from ..core.checks import Numbers
from ..fields.grid import (
    Grid,
    Waves,
    mode_numbers,
    resample_spectrum,
    to_field,
    to_spectrum,
    wavevector,
)
from ..kernels.memory import Creep
from ..kernels.periodic import quadrant
from ..kernels.window import doubled, long_cell, without_images
from .bodies import Counterface, Coupling, coupling_on, of_block
from .case import GROUND
from .half_grid import resampled
from .motion.over_period import components, rate_of
from .numerics import Numerics
from .shear import ShearStress

Range = tuple[Float[Array, "..."], Float[Array, "..."]]
Prescribed = Mapping[str, Any]  # "pressure" [Pa], "mean_gap" or "approach" [m]; the others are None


class AbstractProblem(eqx.Module):
    """What decides each contact under sliding.

    **Fields:**

    - `heights`: h of the surface [m].
    - `grid`, `law`: of the surface and of the contact.
    - `shear`: shear stress [Pa] as a function of the pressure, or None; in a motion its speed is
      that of each time.
    - `block_heights`: of the block's own surface [m], out of the block, or None.
    - `coupling`: how the traction moves the surface of the block, or None.
    - `counterface`: how the counterface deforms, or None if it is rigid.
    - `prescribed`: what is given: "pressure", "mean_gap" or "approach". Static.
    - `facts`: of the contact, see `facts_of`. Static.
    """

    operator: eqx.AbstractVar[AbstractOperator]
    heights: Field
    grid: Grid
    law: AbstractLaw
    shear: ShearStress | None = eqx.field(default=None, kw_only=True)
    block_heights: Field | None = eqx.field(default=None, kw_only=True)
    coupling: Coupling | None = eqx.field(default=None, kw_only=True)
    counterface: Counterface | None = eqx.field(default=None, kw_only=True)
    prescribed: str = eqx.field(default="pressure", static=True, kw_only=True)
    facts: frozenset[str] = eqx.field(default=frozenset(), static=True, kw_only=True)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the fields."""
        return self.grid.shape

    @property
    def block(self) -> AbstractOperator:
        """The operator of the block alone."""
        return of_block(self.operator, self.counterface)

    @property
    def roughness(self) -> tuple[Field, ...]:
        """The heights of the bodies that are rough: of the surface, and of the block."""
        both = self.heights, self.block_heights
        return tuple(heights for heights in both if heights is not None)

    def with_roughness(self, *heights: Field):
        """Returns the problem with other heights."""
        rough = lambda one: [one.heights, one.block_heights][: len(heights)]  # noqa: E731
        return eqx.tree_at(rough, self, heights)


class SteadyProblem(AbstractProblem):
    """A surface that slides steadily on a block.

    **Fields:**

    - `operator`: block and counterface; `.kernel` is their M [m/Pa].
    - `velocity`: of the surface over the block [m/s].
    - `measured`: share of each height that was measured [1], or None, see `Surface`.
    - `measured_range`: lowest and highest ω at which all materials were measured [rad/s], or None.
    - `kernel_error`: two estimated errors of the kernel of a window [m/Pa]; None if periodic.
    - `thickness`: of the layers between a window and a rigid base [m], else None.
    """

    operator: AbstractOperator
    velocity: Float[Array, "..."]
    measured: Float[Array, "..."] | None = None
    measured_range: Range | None = None
    kernel_error: Inexact[Array, "..."] | None = None
    thickness: Float[Array, "..."] | None = None

    @property
    def between(self) -> Field:
        """The heights of both bodies together [m]."""
        return self.heights

    def contact(
        self,
        load: Prescribed,
        shift: Field | None,
        how: Numerics,
        start: Numbers | None,
        solution: ContactSolution | None = None,
    ) -> ContactSolution:
        """Returns the contact of the heights less a shift [m]; see `solve_contact`."""
        heights = self.heights if shift is None else self.heights - shift
        return solve_contact(
            self.operator.kernel, heights, **load, law=self.law, solver=how.solver,
            adjoint=how.adjoint, rtol=how.rtol, start=start, solution=solution, throw=how.throw,
        )  # fmt: skip

    def on(self, shape: tuple[int, ...], num_times: int | None = None) -> "SteadyProblem":
        """Returns the problem on another grid, without heights; its errors are not known."""
        grid, none = Grid(shape, self.grid.size), jnp.zeros((), self.heights.dtype)
        old, new = self.operator.cell(self.grid).shape, self.operator.cell(grid).shape
        on_grid = lambda one: operator_of(resample_spectrum(one.kernel, old, new), shape)  # noqa: E731
        counterface = self.counterface
        if counterface is not None:
            counterface = counterface.on(on_grid(counterface.operator), old, new)
        return dataclasses.replace(
            self,
            operator=on_grid(self.operator),
            heights=none,
            grid=grid,
            measured=None,
            kernel_error=None,
            coupling=coupling_on(self.coupling, old, new),
            counterface=counterface,
        )


class CycleProblem(AbstractProblem):
    """A surface in periodic motion on a block.

    **Fields:**

    - `operator`: the block in space and time, and what `counterface.in_kernel` has of the
      counterface.
    - `displacement`: s(t) of the surface [m], shape `(nt,)` or `(nt, 2)`.
    - `period`: T [s].
    - `measured_range`: as in `SteadyProblem`.
    """

    operator: SpaceTime
    displacement: Float[Array, "nt ..."]
    period: Float[Array, ""]
    measured_range: Range | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the fields over time."""
        return (len(self.displacement), *self.grid.shape)

    @property
    def passing(self) -> Field:
        """The heights of the block's own surface under the surface at each time [m]."""
        assert self.block_heights is not None
        return self.operator.carried(self.block_heights)

    @property
    def between(self) -> Field:
        """The heights of both bodies together [m], at each time if both are rough."""
        return self.heights if self.block_heights is None else self.heights + self.passing

    @property
    def times(self) -> Float[Array, " nt"]:
        """The times of all arrays over time [s]."""
        count = len(self.displacement)
        return self.period * jnp.arange(count, dtype=self.period.dtype) / count

    @property
    def moved(self) -> Float[Array, "nt components"]:
        """The displacement, its components on the second axis [m]."""
        return components(self.displacement)

    @property
    def motion_of_surface(self) -> tuple[Float[Array, "nt axes"], Float[Array, "nt axes"]]:
        """ds/dt [m/s], and the part of s [m] that comes back after each period.

        The surface advances by the number of cells that closes the period with a step like its
        neighbours.
        """
        moved, size = self.moved, self.grid.size[: self.moved.shape[1]]
        closing = (moved[-1] - moved[-2] + moved[1] - moved[0]) / 2
        drift = size * jnp.round(jax.lax.stop_gradient((moved[-1] + closing - moved[0]) / size))
        # The velocity is periodic, the displacement only up to whole cells.
        back = moved - drift * (self.times / self.period)[:, None]
        return rate_of(back, self.period) + drift / self.period, back

    def contact(
        self,
        load: Prescribed,
        shift: Field | None,
        how: Numerics,
        start: Numbers | None,
        solution: ContactSolution | None = None,
    ) -> ContactSolution:
        """Returns the contact at all times of the heights less a shift [m]."""
        heights = jnp.broadcast_to(self.between, self.shape)
        start = as_start(start, heights, self.law)
        loading = loading_of(self.law, heights, self.shape[0], **load)
        heights = heights if shift is None else heights - shift
        inputs = Inputs(self.operator, heights, self.law, loading)
        return contact_of(inputs, how.solver, how.adjoint, how.rtol, start, solution, how.throw)

    def on(self, shape: tuple[int, ...], num_times: int) -> "CycleProblem":
        """Returns the problem on another grid, with other times and without heights."""
        old, new, grid = self.shape, (num_times, *shape), Grid(shape, self.grid.size)
        none = jnp.zeros((), self.heights.dtype)
        rate, back = self.motion_of_surface
        moved = resampled(back, (num_times, back.shape[1]))
        drift = jnp.mean(rate, axis=0) * self.period
        moved = moved + drift * (np.arange(num_times) / num_times)[:, None]
        kernel = resample_spectrum(self.block.compliance, old, new)
        still = [(0, 0), (0, len(shape) - moved.shape[1])]
        operator, counterface = in_motion(kernel, jnp.pad(moved, still), grid), self.counterface
        if counterface is not None:
            kernel = resample_spectrum(counterface.operator.compliance, old, new)
            counterface = counterface.on(at_rest(kernel), old, new)
            operator = counterface.beside(operator)
        return dataclasses.replace(
            self,
            operator=operator,
            heights=none,
            block_heights=None if self.block_heights is None else none,
            grid=grid,
            displacement=moved.reshape(num_times, *self.displacement.shape[1:]),
            coupling=coupling_on(self.coupling, old, new),
            counterface=counterface,
        )


class OneStep(AbstractOperator):
    """The bodies in one step of a transient motion.

    **Fields:**

    - `kernel`: I(Δ)/Δ [m/Pa], see `Creep`.
    - `aged`: J(t) of a pressure that acts since t = 0 [m/Pa]: edges of contact that rest are soft.
    """

    kernel: Waves
    aged: Waves

    def at_edges(self, load):
        return jnp.stack([self.kernel, self.aged])


class OneStepOnWindow(OneStep, Window):
    """The bodies in one step of a transient motion, on a window."""


class TransientProblem(AbstractProblem):
    """A surface in a transient motion, on a block.

    **Fields:**

    - `bodies`, `creeps`: the block and the counterface, unless it is rigid, and their memories.
    - `times`: ends of the steps [s], shape `(nt,)`.
    - `displacement`: s of the surface at these times [m], since t = 0, shape `(nt,)` or `(nt, 2)`.
    - `given`: at these times the pressure [Pa] or the mean gap [m], or of an approach the place of
      the block's undeformed surface in the frame of the heights [m].
    - `path`: points of the part of the block over which a window moves, or None. Static.
    """

    bodies: tuple[Stack, ...]
    creeps: tuple[Creep, ...]
    times: Float[Array, " nt"]
    displacement: Float[Array, "nt ..."]
    given: Float[Array, " nt"]
    path: tuple[int, ...] | None = eqx.field(default=None, static=True)

    @property
    def operator(self) -> OneStep:
        """The bodies in the last step."""
        last = (jnp.stack([creep.now[0, -1], creep.aged[-1]]) for creep in self.creeps)
        found = functools.reduce(jnp.add, map(self.responses, self.creeps, last))
        return self.operator_of(*on_half(found, mode_numbers(self.memory_grid.shape)))

    def operator_of(self, kernel: Waves, aged: Waves) -> OneStep:
        """Returns the operator of kernels on `memory_grid`; a window has it on twice its length."""
        if self.path is None:
            return OneStep(kernel, aged)
        window = self.grid.shape
        places = np.ix_(*((np.arange(2 * n) + n) % (2 * n) - n for n in window))

        def cut(kernel):
            if self.path == window:
                return kernel
            waves = to_spectrum(to_field(kernel + 0j, self.memory_grid.shape)[places])
            return waves if jnp.iscomplexobj(kernel) else waves.real

        return OneStepOnWindow(cut(kernel), cut(aged))

    @property
    def memory_grid(self) -> Grid:
        """The cell of what the bodies remember: around a window's path, without its copies."""
        return self.grid if self.path is None else doubled(self._all_of_path)

    @property
    def waves_between(self) -> Float[Array, "2"]:
        """The lowest and the highest wavenumber at which responses are needed [rad/m]."""
        grid, of_path = self.memory_grid, self.path is not None
        cells = [long_cell(self._all_of_path), grid] if of_path else [grid]
        highest = [jnp.pi * jnp.sqrt(jnp.sum(cell.spacing**-2)) for cell in cells]
        lowest = 2 * jnp.pi / jnp.max(cells[0].size)
        return jnp.stack([lowest, functools.reduce(jnp.maximum, highest)])

    @property
    def _all_of_path(self) -> Grid:
        assert self.path is not None
        return Grid(self.path, self.grid.spacing * np.array(self.path))

    def responses(self, creep: Creep, tables: Array, axis: int | None = None) -> Array:
        """Returns the responses to tables of `Creep` at the positive numbers of `memory_grid`.

        They are those to a pressure, or but for i and a sign to a traction along an axis.
        """
        if self.path is None:
            return _at_positive(creep, self.grid, tables, axis)
        positive = slice(0, self.path[0] + 1)

        def on_window(table):
            kernel = self.around_path(creep, table, axis)[0][positive]
            return kernel if axis is None else kernel.imag

        return jax.lax.map(on_window, tables)

    def around_path(self, creep: Creep, table: Array, axis: int | None = None) -> tuple[Array, ...]:
        """Returns the kernel of a table on `memory_grid` around a window's path, and its errors."""
        path = self._all_of_path
        cells = doubled(path), long_cell(path)
        near, far = (
            on_half(_at_positive(creep, cell, table, axis), mode_numbers(cell.shape), axis)
            for cell in cells
        )
        if axis is None:
            return without_images(near, far, path, GROUND in self.facts)
        return without_images(1j * near, 1j * far, path, False)

    @property
    def moved(self) -> Float[Array, "nt components"]:
        """The displacement, its components on the second axis [m]."""
        return components(self.displacement)

    @property
    def steps(self) -> tuple[Float[Array, " nt"], Float[Array, "nt components"]]:
        """The lengths of the steps [s], and how far the surface moves in them [m]."""
        before = jnp.zeros((1, self.moved.shape[1]), self.moved.dtype)
        way = jnp.diff(self.moved, axis=0, prepend=before)
        # What a sum or a turn leaves of a rest by rounding is no motion, and has no direction.
        least = 16 * jnp.finfo(way.dtype).eps * jnp.max(jnp.abs(self.moved))
        return steps_of(self.times), jnp.where(jnp.abs(way) > least, way, 0)


def steps_of(times: Float[Array, " nt"]) -> Float[Array, " nt"]:
    """Returns the lengths of the steps that end at these times [s]."""
    return jnp.diff(times, prepend=jnp.zeros((1,), times.dtype))


def _at_positive(creep: Creep, cell: Grid, tables: Array, axis: int | None) -> Array:
    """The responses to tables at a cell's positive numbers; of traction but for i and a sign."""
    q, is_wave = quadrant(cell)
    found = (tables @ creep.shares(q)).reshape(*tables.shape[:-1], *is_wave.shape)
    found = jnp.where(is_wave, found, 0)
    if axis is None:
        return found
    numbers = np.ix_(*map(np.arange, is_wave.shape))
    along = jnp.where(2 * numbers[axis] < cell.shape[axis], wavevector(cell, numbers)[axis], 0)
    return found * along / q.reshape(is_wave.shape)


def on_half(found: Array, numbers: tuple[np.ndarray, ...], axis: int | None = None) -> Array:
    """Responses at mode numbers from those at positive ones; to traction but for a factor i."""
    if len(numbers) == 2:
        found = jnp.take(found, np.abs(numbers[0]).ravel(), axis=-2)
    return found if axis is None else found * np.sign(numbers[axis])


Problem = SteadyProblem | CycleProblem


class Posed(NamedTuple):
    """A problem with its load.

    **Fields:**

    - `problem`, `load`: what is solved.
    - `reached`: whether the kernel is good; True if a bad one raises.
    """

    problem: Problem
    load: Prescribed
    reached: Array | bool = True
