"""What decides a contact under sliding on one grid: the block as an operator, the surface, the law.

A `SteadyProblem` is solved once, a `CycleProblem` at all times of a period together. Each gives the
contact at a load, by `contact`; on another grid of the cell, by `on`, it has the waves of block and
traction that both grids resolve.
"""

import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..contacts.abstract_solver import Inputs
from ..contacts.inputs import as_start, loading_of
from ..contacts.law import AbstractLaw
from ..contacts.operator import AbstractOperator, Field
from ..contacts.solution import ContactSolution
from ..contacts.solve import contact_of, solve_contact
from ..contacts.space_time import SpaceTime, in_motion
from ..contacts.window import operator_of
from ..core.checks import Numbers
from ..fields.grid import Grid, Waves, resample_spectrum
from .half_grid import resampled
from .motion import components, rate_of
from .numerics import Numerics
from .shear import ShearStress

Range = tuple[Float[Array, "..."], Float[Array, "..."]]
Prescribed = Mapping[str, Any]  # "pressure" [Pa], "mean_gap" or "approach" [m]; the others are None


class Coupling(eqx.Module):
    """How traction moves the surface of the block.

    **Fields:**

    - `lift`: M_zi [m/Pa] of the traction along each component i.
    - `along`: M_ij [m/Pa].
    - `in_kernel`: whether the kernel of the contact contains the traction. Static.
    """

    lift: tuple[Waves, ...]
    along: tuple[tuple[Waves, ...], ...]
    in_kernel: bool = eqx.field(default=False, static=True)

    def lifted(self, operator: AbstractOperator, tractions: Sequence[Field]) -> Field:
        """Returns the displacement along z under tractions [m]."""
        waves = self._lifted([operator.to_waves(traction) for traction in tractions])
        return operator.to_field(waves, tractions[0].shape)

    def waves(
        self, operator: AbstractOperator, pressure: Field, tractions: Sequence[Field]
    ) -> tuple[list[Waves], list[Waves]]:
        """Returns the waves of pressure and tractions [Pa], and of the displacements [m].

        The displacements are those along z and along each component of the traction.
        """
        pressed, *sheared = (operator.to_waves(f) / pressure.size for f in (pressure, *tractions))
        down = operator.compliance * pressed
        if not self.in_kernel:
            down = down + self._lifted(sheared)
        moved = [
            functools.reduce(jnp.add, map(jnp.multiply, row, sheared), -lift * pressed)
            for lift, row in zip(self.lift, self.along, strict=True)
        ]
        return [pressed, *sheared], [down, *moved]

    def _lifted(self, sheared: Sequence[Waves]) -> Waves:
        return functools.reduce(jnp.add, map(jnp.multiply, self.lift, sheared))


def lags(coupling: Coupling | None) -> TypeGuard[Coupling]:
    """Returns whether a traction that is no part of the kernel moves the surface."""
    return coupling is not None and not coupling.in_kernel


def _coupling_on(coupling: Coupling | None, shape: tuple[int, ...], new: tuple[int, ...]):
    return jax.tree.map(lambda waves: resample_spectrum(waves, shape, new), coupling)


class SteadyProblem(eqx.Module):
    """A surface that slides steadily on a block.

    **Fields:**

    - `operator`: the block; `.kernel` is its M [m/Pa].
    - `heights`: h of the surface [m].
    - `grid`, `law`: of the surface and of the contact.
    - `measured_range`: lowest and highest ω at which all materials were measured [rad/s], or None.
    - `prescribed`: what is given: "pressure", "mean_gap" or "approach". Static.
    - `velocity`: of the surface over the block [m/s].
    - `measured`: share of each height that was measured [1], or None, see `Surface`.
    - `kernel_error`: two estimated errors of the kernel of a window [m/Pa]; None if periodic.
    - `shear`: shear stress [Pa] as a function of the pressure, or None.
    - `coupling`: how its traction moves the surface of the block, or None.
    - `thickness`: of the layers between a window and a rigid base [m], else None.
    - `facts`: of the contact, see `facts_of`. Static.
    """

    operator: AbstractOperator
    heights: Float[Array, "..."]
    grid: Grid
    law: AbstractLaw
    measured_range: Range | None = eqx.field(default=None, kw_only=True)
    prescribed: str = eqx.field(default="pressure", static=True, kw_only=True)
    velocity: Float[Array, "..."]
    measured: Float[Array, "..."] | None = None
    kernel_error: Inexact[Array, "..."] | None = None
    shear: ShearStress | None = None
    coupling: Coupling | None = None
    thickness: Float[Array, "..."] | None = None
    facts: frozenset[str] = eqx.field(default=frozenset(), static=True)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the fields."""
        return self.heights.shape

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

    def on(
        self, shape: tuple[int, ...], heights: Field, num_times: int | None = None
    ) -> "SteadyProblem":
        """Returns the problem on another grid, with other heights; its errors are not known."""
        grid = Grid(shape, self.grid.size)
        old, new = self.operator.cell(self.grid).shape, self.operator.cell(grid).shape
        kernel = resample_spectrum(self.operator.kernel, old, new)
        return SteadyProblem(
            operator=operator_of(kernel, shape), heights=heights, grid=grid, law=self.law,
            measured_range=self.measured_range, prescribed=self.prescribed, velocity=self.velocity,
            measured=None, kernel_error=None, shear=self.shear,
            coupling=_coupling_on(self.coupling, old, new), thickness=self.thickness,
            facts=self.facts,
        )  # fmt: skip


class CycleProblem(eqx.Module):
    """A surface in periodic motion on a block.

    **Fields:**

    - `operator`: the block in space and time.
    - `heights`, `grid`, `law`, `measured_range`, `shear`, `coupling`: as in `SteadyProblem`; the
      speed of `shear` is that of each time.
    - `prescribed`: what is given: "pressure" or "mean_gap". Static.
    - `displacement`: s(t) of the surface [m], shape `(nt,)` or `(nt, 2)`.
    - `period`: T [s].
    - `facts`: as in `SteadyProblem`. Static.
    """

    operator: SpaceTime
    heights: Float[Array, "..."]
    grid: Grid
    law: AbstractLaw
    measured_range: Range | None = eqx.field(default=None, kw_only=True)
    prescribed: str = eqx.field(default="pressure", static=True, kw_only=True)
    displacement: Float[Array, "nt ..."]
    period: Float[Array, ""]
    shear: ShearStress | None = None
    coupling: Coupling | None = None
    facts: frozenset[str] = eqx.field(default=frozenset(), static=True)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the fields over time."""
        return (len(self.displacement), *self.grid.shape)

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
        heights = jnp.broadcast_to(self.heights, self.shape)
        start = as_start(start, heights, self.law)
        loading = loading_of(self.law, heights, self.shape[0], **load)
        heights = heights if shift is None else heights - shift
        inputs = Inputs(self.operator, heights, self.law, loading)
        return contact_of(inputs, how.solver, how.adjoint, how.rtol, start, solution, how.throw)

    def on(self, shape: tuple[int, ...], heights: Field, num_times: int) -> "CycleProblem":
        """Returns the problem on another grid, with other heights and other times."""
        old, new, grid = self.shape, (num_times, *shape), Grid(shape, self.grid.size)
        rate, back = self.motion_of_surface
        moved = resampled(back, (num_times, back.shape[1]))
        drift = jnp.mean(rate, axis=0) * self.period
        moved = moved + drift * (np.arange(num_times) / num_times)[:, None]
        kernel = resample_spectrum(self.operator.compliance, old, new)
        still = [(0, 0), (0, len(shape) - moved.shape[1])]
        return CycleProblem(
            operator=in_motion(kernel, jnp.pad(moved, still), grid), heights=heights, grid=grid,
            law=self.law, measured_range=self.measured_range, prescribed=self.prescribed,
            displacement=moved.reshape(num_times, *self.displacement.shape[1:]),
            period=self.period, shear=self.shear, coupling=_coupling_on(self.coupling, old, new),
            facts=self.facts,
        )  # fmt: skip


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
