"""The problem of a contact under sliding on one grid: both bodies as an operator, surface, law.

A `SteadyProblem` is solved once, a `CycleProblem` at all times of a period together, the problem in
`transient_problem.py` step by step. The first two give the contact at a load, by `contact`; on
another grid of the cell, by `on`, they have the waves of block and traction that both resolve.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..contacts.inputs import as_start, loading_of
from ..contacts.law import AbstractLaw
from ..contacts.operators.operator import AbstractOperator, Field
from ..contacts.operators.space_time import SpaceTime, at_rest, in_motion
from ..contacts.operators.window import operator_of
from ..contacts.solution import ContactSolution
from ..contacts.solve import contact_of, solve_contact
from ..contacts.solver.abstract_solver import Inputs
from ..fields.grid import Grid, resample_spectrum, resampled
from .bodies import Counterface, Coupling, coupling_on, of_block
from .case import Numerics
from .motion.motion import components, rate_of
from .shear import ShearStress

Range = tuple[Float[Array, "..."], Float[Array, "..."]]
Prescribed = Mapping[str, Any]  # "pressure" [Pa], "mean_gap" or "approach" [m]; the others are None


class AbstractProblem(eqx.Module):
    """The fields of all problems.

    **Fields:**

    - `heights`: h of the surface [m].
    - `grid`, `law`: of the surface and of the contact.
    - `shear`: shear stress [Pa] as a function of the pressure, or None; in a motion each
      time has its speed.
    - `block_heights`: of the block's own surface [m], out of the block, or None.
    - `coupling`: how the traction moves the surface of the block.
    - `counterface`: how the counterface deforms, or None if it is rigid.
    - `measured_ranges`: for each body the lowest and the highest ω at which all materials were
      measured [rad/s], or None.
    - `prescribed`: what is given: "pressure", "mean_gap" or "approach". Static.
    - `facts`: of the contact, see `facts_of`. Static.
    """

    operator: eqx.AbstractVar[AbstractOperator]
    heights: Field
    grid: Grid
    law: AbstractLaw
    shear: ShearStress | None = eqx.field(default=None, kw_only=True)
    block_heights: Field | None = eqx.field(default=None, kw_only=True)
    coupling: Coupling = eqx.field(default=Coupling(), kw_only=True)
    counterface: Counterface | None = eqx.field(default=None, kw_only=True)
    measured_ranges: tuple[Range | None, ...] = eqx.field(default=(), kw_only=True)
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
    - `kernel_error`: two estimated errors of the kernel of a window [m/Pa]; None if periodic.
    """

    operator: AbstractOperator
    velocity: Float[Array, "..."]
    measured: Float[Array, "..."] | None = None
    kernel_error: Inexact[Array, "..."] | None = None

    @property
    def between(self) -> Field:
        """The heights of both bodies together [m]."""
        return self.heights

    def contact(
        self, load: Prescribed, how: Numerics, shift=None, start=None, solution=None
    ) -> ContactSolution:
        """Returns the contact of the heights less a shift [m], from a start or of a solution."""
        heights = self.heights if shift is None else self.heights - shift
        given = dict(load) | dict(law=self.law, start=start, solution=solution)
        return solve_contact(self.operator.kernel, heights, **given, **vars(how))

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
    """

    operator: SpaceTime
    displacement: Float[Array, "nt ..."]
    period: Float[Array, ""]

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
        self, load: Prescribed, how: Numerics, shift=None, start=None, solution=None
    ) -> ContactSolution:
        """Returns the contact at all times, as of a `SteadyProblem`."""
        heights = jnp.broadcast_to(self.between, self.shape)
        start = as_start(start, heights, self.law)
        loading = loading_of(self.law, heights, self.shape[0], **load)
        heights = heights if shift is None else heights - shift
        inputs = Inputs(self.operator, heights, self.law, loading)
        rtol = how.rtol, how.derivative_rtol
        return contact_of(inputs, how.solver, *rtol, start, solution, how.throw)

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


Problem = SteadyProblem | CycleProblem
