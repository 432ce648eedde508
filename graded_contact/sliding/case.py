"""A case: everything that decides the numbers of one contact under sliding, and nothing else.

Facts of a case decide which numbers of its contact are printed and stored, `Numerics` how large
their errors are.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import Stack, check_at_rest
from ..contacts.law import AbstractLaw, HardWall
from ..contacts.solve import default_rtol
from ..contacts.solver.abstract_solver import AbstractContactSolver
from ..contacts.solver.nested_solve import DouglasRachford
from ..core.checks import (
    Numbers,
    as_float,
    check_ascending,
    check_positive,
    check_type,
    check_values,
    is_concrete,
    numbers,
    optional,
    positive,
    short,
    within,
)
from ..core.display import shown
from ..fields.frequency import as_velocity
from ..fields.grid import Grid
from ..kernels.creep import LONGEST
from ..kernels.window import has_ground
from ..surfaces.surface import Surface, check_periodic
from .motion.motion import check_closed, check_path, check_resolved
from .shear import ShearLaw, is_coupled

PERIODIC, WINDOW = "periodic", "window"  # whether the surface repeats
GROUND = "ground"  # the block of a window does not move far away
LOAD_FOLLOWS = "load follows"  # from a mean gap or an approach
GIVEN_LOAD = "given load"  # or a mean gap: the approach follows
SHEARED = "sheared"  # there is shear stress in the contact
COUPLED = "coupled"  # the shear stress moves the surface of the block
HEATED = "heated"
COUNTERFACE = "counterface"  # the body that carries the surface deforms
# Asked for by [observe] of a scene, whose keys these are. All contacts can compute them.
STIFFNESS, CONDUCTANCE, FLOW = "stiffness", "conductance", "flow"

OfParts = Float[Array, ""] | Float[Array, " parts"]


@shown(units=False)
class Heating(eqx.Module):
    """How heat flows in the block and in the body that carries the surface.

    **Fields:**

    - `conductivity`: κ of the block [W/(m K)]: one number, or one for each layer, surface first,
      and one for the half space below (also below a rigid base).
    - `diffusivity`: D of the block [m²/s]: one number, or as many as layers plus one.
    - `counterface_conductivity`: κ of the body that carries the surface [W/(m K)]: one number, 0 if
      no heat flows into it, or one for each layer of a `counterface`, surface first, and one below.
    """

    conductivity: OfParts = eqx.field(converter=positive("conductivity", "[W/(m K)]", as_float))
    diffusivity: OfParts = eqx.field(converter=positive("diffusivity", "[m²/s]", as_float))
    counterface_conductivity: OfParts = eqx.field(
        converter=numbers("counterface_conductivity"), default=0.0
    )

    def __check_init__(self):
        if self.counterface_conductivity.ndim:
            check_positive("counterface_conductivity", self.counterface_conductivity, "[W/(m K)]")
        allowed = "a conductivity [W/(m K)] is zero or positive"
        check_values("counterface_conductivity", self.counterface_conductivity, allowed, at_least=0)


@shown()
class HeatedContact(eqx.Module):
    """The temperatures of a heated contact.

    **Fields:**

    - `surface_rise`: temperature of the surface above the bulk [K], mean over the contact.
    - `rises`: the same of each cell of the depth [K], shape `(cells,)`.
    - `edges`: depths between which the cells lie [m], from 0, shape `(cells + 1,)`.
    - `error`: change of the temperatures in the last step over the largest rise [1].
    - `friction_error`, `area_error`: estimated errors of friction and contact area [1], by `error`
      and by the finite number of cells.
    """

    surface_rise: Float[Array, ""]
    rises: Float[Array, " cells"]
    edges: Float[Array, " edges"]
    error: Float[Array, ""]
    friction_error: Float[Array, ""]
    area_error: Float[Array, ""]


@shown(units=False)
class Case(eqx.Module):
    """A block, a rough surface, a load and a motion; see `slide` and `slide_cycle`.

    `dataclasses.replace(case, pressure=2e5)` is a case with another load.

    **Fields:**

    - `stack`, `surface`: the block, and the rough surface on it.
    - `velocity`: of the surface over the block [m/s]; or
    - `displacement`: s(t) [m], with the `period` [s] of a cycle, or the `times` [s] of a motion
      that is transient.
    - `pressure` [Pa], `mean_gap` [m] or `approach` [m]: what is prescribed.
    - `law`: of contact.
    - `shear`: law of the shear stress in the contact, or None.
    - `temperature`: of the contact [K], with `heating` of the bulk; or None.
    - `heating`: how the heat of friction flows, or None; of a cycle it is the mean heat.
    - `strain_per_slope`: strain amplitude of each wave over the rms slope [1], or None.
    - `counterface`: the body that carries the surface and moves with it, or None if it is rigid.
    - `block_surface`: heights of the block itself, which rest on it; with a displacement, or None.
    """

    stack: Stack
    surface: Surface
    velocity: Any = eqx.field(converter=optional(numbers("velocity")), default=None)
    displacement: Any = eqx.field(converter=optional(numbers("displacement")), default=None)
    period: Any = eqx.field(converter=optional(positive("period", "[s]")), default=None)
    times: Any = eqx.field(converter=optional(numbers("times")), default=None)
    pressure: Numbers | None = None
    mean_gap: Numbers | None = None
    approach: Numbers | None = None
    law: AbstractLaw = HardWall()
    shear: ShearLaw | None = None
    temperature: Any = None
    heating: Heating | None = None
    strain_per_slope: Any = None
    counterface: Stack | None = None
    block_surface: Surface | None = None

    def __check_init__(self):
        check_type("stack", self.stack, Stack)
        check_type("surface", self.surface, Surface)
        check_type("law", self.law, AbstractLaw)
        check_type("heating", self.heating, Heating, type(None))
        check_type("counterface", self.counterface, Stack, type(None))
        check_type("block_surface", self.block_surface, Surface, type(None))
        if self.counterface is not None and self.times is None:
            with within("`counterface`:"):
                check_at_rest(self.counterface)  # its waves rest under the surface, forever
        if (self.velocity is None) == (self.displacement is None):
            raise ValueError(
                "`velocity`, or `displacement` with `period` or `times`, is needed, not both."
            )
        grid = self.surface.grid
        if self.velocity is not None:
            as_velocity(self.velocity, grid)
            if self.block_surface is not None:
                raise ValueError(
                    "`block_surface` is refused with a `velocity`: two rough surfaces have no "
                    "steady state. Use `slide_cycle` or `slide_transient`; if the sliding "
                    "surface is smooth, exchange the bodies: the block is the `counterface` of "
                    "its surface, which moves backwards."
                )
            return
        if self.strain_per_slope is not None:
            raise ValueError(
                "`strain_per_slope` is refused with a `displacement`: give a velocity."
            )
        check_values("displacement", self.displacement, "a displacement [m] must be finite")
        if self.times is None:
            self._check_period(grid)
        else:
            self._check_times(grid)
        if self.block_surface is not None:
            self._check_block_surface(self.block_surface)

    def _check_period(self, grid: Grid) -> None:
        if self.period is None:
            raise ValueError("`displacement` needs the `period` [s] of the motion, or `times` [s].")
        # Four times are the fewest with a frequency between 0 and the highest one.
        count = max((4, *self.displacement.shape[:1]))
        check_path(self.displacement, count, grid.ndim)
        check_resolved(f"`displacement` at {count} times", self.displacement, grid)
        check_closed(self.displacement, grid)

    def _check_block_surface(self, own: Surface) -> None:
        if self.heating is not None:
            raise ValueError(
                "`heating` is refused with a `block_surface`: the heat of a cycle is found in "
                "steady sliding, which two rough surfaces do not have."
            )
        for surface in (own, self.surface):
            with within("`block_surface`:"):
                check_periodic(surface)
        grid, other = self.surface.grid, own.grid
        known = is_concrete(grid.size) and is_concrete(other.size)
        same = not known or np.allclose(np.asarray(grid.size), np.asarray(other.size), rtol=1e-6)
        if other.shape != grid.shape or not same:
            raise ValueError(
                f"`block_surface` is on {short(other.shape)} points over {short(other.size)} m; "
                f"the grid of `surface`, {short(grid.shape)} over {short(grid.size)} m, is needed."
            )

    @property
    def bodies(self) -> tuple[Stack, ...]:
        """The bodies that deform: the block, and the counterface if there is one."""
        return (self.stack,) if self.counterface is None else (self.stack, self.counterface)

    def _check_times(self, grid: Grid) -> None:
        for name, refused in (("period", self.period), ("heating", self.heating)):
            if refused is not None:
                raise ValueError(f"`{name}` is not supported with `times`.")
        times = self.times
        check_ascending(1, times=times)
        check_path(self.displacement, len(times), grid.ndim)
        check_positive("times", times, "[s]")
        if is_concrete(self.displacement):
            known = np.asarray(self.displacement)  # inside of a program, too
            whole = np.concatenate([np.zeros_like(known[:1]), known])  # it begins at 0
            check_resolved(f"`displacement` in {len(known)} steps", whole, grid)
        if is_concrete(times):
            known = np.asarray(times)
            steps: Any = np.diff(known, prepend=0)
            last, least = float(known[-1]), float(np.min(steps))
            if last > LONGEST * least:
                raise ValueError(
                    f"`times` up to {last:.3g} s with a step of {least:.3g} s are refused: the "
                    f"last time is at most {LONGEST:.0e} times the shortest step."
                )

    @property
    def prescribed(self) -> str:
        """The name of the load: "pressure", "mean_gap" or "approach"."""
        return next((name for name, value in self.load.items() if value is not None), "pressure")

    @property
    def load(self) -> dict[str, Any]:
        """Pressure [Pa], mean gap and approach [m], of which one is not None."""
        return {"pressure": self.pressure, "mean_gap": self.mean_gap, "approach": self.approach}


class Numerics(eqx.Module):
    """How a contact is computed; it decides the errors of the numbers, nothing else.

    **Fields:**

    - `rtol`: requested relative error of the pressure [1]; None means 5e-5, or 5e-4 in float32.
      Static.
    - `solver`: of the contact, see `DouglasRachford`, or `AbstractContactSolver` to write one.
    - `derivative_rtol`: relative error of a derivative of the pressure [1]; None means twenty times
      `rtol`, at most 1e-3. Static.
    - `throw`: whether to raise if a solve or a kernel fails; with False see `.result`. Static.
    """

    rtol: Any = eqx.field(default=None, static=True)  # a number once `of` is called
    solver: AbstractContactSolver = DouglasRachford()
    derivative_rtol: float | None = eqx.field(default=None, static=True)
    throw: bool = eqx.field(default=True, static=True)

    def __check_init__(self):
        check_type("solver", self.solver, AbstractContactSolver)
        check_type("throw", self.throw, bool)

    def of(self, *given: Any) -> "Numerics":
        """Returns a copy whose `rtol=None` is replaced by the default for the dtype of `given`."""
        if self.rtol is not None:
            return self
        # The most precise of their numbers decides in which precision a contact is computed.
        leaves = jax.tree.leaves(eqx.filter(given, eqx.is_inexact_array))
        return dataclasses.replace(self, rtol=default_rtol(jnp.result_type(*leaves)))


def facts_of(case: Case) -> frozenset[str]:
    """Returns the facts of a case."""
    window = not case.surface.periodic
    known = {
        PERIODIC: not window,
        WINDOW: window,
        GROUND: window and all(has_ground(body, case.surface.grid) for body in case.bodies),
        LOAD_FOLLOWS: case.prescribed != "pressure",
        GIVEN_LOAD: case.prescribed != "approach",
        SHEARED: case.shear is not None,
        COUPLED: is_coupled(case.shear),
        HEATED: case.heating is not None,
        COUNTERFACE: case.counterface is not None,
    }
    return frozenset(fact for fact, holds in known.items() if holds)
