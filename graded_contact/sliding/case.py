"""A case: everything that decides the numbers of one contact under sliding, and nothing else."""

from collections.abc import Callable
from typing import Any

import equinox as eqx

from ..blocks.stack import Stack
from ..contacts.law import AbstractLaw, HardWall
from ..contacts.solution import ContactSolution
from ..core.checks import Numbers, as_float, as_scalar, check_positive, check_type, check_values
from ..core.display import shown
from ..fields.frequency import as_velocity
from ..surfaces.spectrum import SelfAffine
from ..surfaces.surface import Surface
from .cycle import solve_cycle
from .heating import Heating, solve_heated
from .motion import check_resolved
from .numerics import Numerics
from .result import CyclicSliding, Sliding
from .shear import ShearLaw
from .steady import solve_steady


def _if_given(convert: Callable[[Any, str], Any], name: str) -> Callable[[Any], Any]:
    return lambda value: None if value is None else convert(value, name)


@shown(units=False)
class Case(eqx.Module):
    """A block, a rough surface, a load and a motion; see `slide` and `slide_cycle`.

    `dataclasses.replace(case, pressure=2e5)` is a case with another load.

    **Fields:**

    - `stack`, `surface`: the block, and the rough surface on it. A case of the mean field alone may
      have a spectrum in its place, see `mean_field_friction`.
    - `velocity`: of the surface over the block [m/s]; or
    - `displacement`, `period`: s(t) [m] over a period [s].
    - `pressure` [Pa], `mean_gap` [m] or `approach` [m]: what is prescribed.
    - `law`: of contact.
    - `shear`: law of the shear stress in the contact, or None.
    - `temperature`: of the contact [K], with `heating` that of the bulk; or None.
    - `heating`: how the heat of friction flows, or None; of a cycle it is the mean heat.
    - `strain_per_slope`: strain amplitude of each wave over the rms slope [1], or None.
    """

    stack: Stack
    surface: Surface | SelfAffine | tuple[Any, Any]
    velocity: Any = eqx.field(converter=_if_given(as_float, "velocity"), default=None)
    displacement: Any = eqx.field(converter=_if_given(as_float, "displacement"), default=None)
    period: Any = eqx.field(converter=_if_given(as_scalar, "period"), default=None)
    pressure: Numbers | None = None
    mean_gap: Numbers | None = None
    approach: Numbers | None = None
    law: AbstractLaw = HardWall()
    shear: ShearLaw | None = None
    temperature: Numbers | None = None
    heating: Heating | None = None
    strain_per_slope: Numbers | None = None

    def __check_init__(self):
        check_type("stack", self.stack, Stack)
        check_type("surface", self.surface, Surface, SelfAffine, tuple)
        check_type("law", self.law, AbstractLaw)
        check_type("heating", self.heating, Heating, type(None))
        if (self.velocity is None) == (self.displacement is None):
            raise ValueError("`velocity` or `displacement` with `period` is needed, not both.")
        grid: Any = getattr(self.surface, "grid", None)  # a spectrum has none
        if self.velocity is not None:
            as_velocity(self.velocity, grid)
            return
        check_type("surface", self.surface, Surface)
        if self.strain_per_slope is not None:
            raise ValueError(
                "`strain_per_slope` is refused with a `displacement`: give a velocity."
            )
        if self.period is None:
            raise ValueError("`displacement` needs the `period` [s] of the motion.")
        shape = self.displacement.shape
        allowed = ((), (2,)) if grid.ndim == 2 else ((),)
        # Four times are the fewest with a frequency between 0 and the highest one.
        if not shape or shape[0] < 4 or shape[1:] not in allowed:
            raise ValueError(
                f"`displacement` has shape {shape}; `(nt,)` or, on a grid in two dimensions, "
                "`(nt, 2)` is needed, with nt of at least 4 times."
            )
        check_values("displacement", self.displacement, "a displacement [m] must be finite")
        check_resolved(f"`displacement` at {shape[0]} times", self.displacement, grid)
        check_positive("period", self.period, "[s]")

    @property
    def prescribed(self) -> str:
        """What is given: "pressure", "mean_gap" or "approach"."""
        given = [n for n in ("mean_gap", "approach") if getattr(self, n) is not None]
        return given[0] if given else "pressure"

    def solve(
        self,
        numerics: Numerics = Numerics(),  # noqa: B008 (immutable)
        *,
        start: Numbers | None = None,
        solution: ContactSolution | None = None,
    ) -> Sliding | CyclicSliding:
        """Returns the contact: a `Sliding`, or with a displacement over time a `CyclicSliding`.

        **Arguments:**

        - `numerics`: tolerance and solvers.
        - `start`: a pressure field [Pa] to start from, see `solve_contact`.
        - `solution`: `.contact` of an earlier solve of this case. Nothing is solved then: the same
          numbers are returned, with derivatives.

        **Raises:** `ValueError` for a refused number; `RuntimeError` if kernel or solve fail.
        """
        check_type("surface", self.surface, Surface)
        numerics = numerics.of(self.stack, self.surface)
        # With heat several contacts are solved, and a motion has one at each time.
        if solution is not None and (self.heating is not None or self.velocity is None):
            raise ValueError(
                "`solution` is refused with `heating` or a motion: it holds steady contacts alone."
            )
        if self.heating is not None:
            return solve_heated(self, numerics, start)
        if self.velocity is None:
            return solve_cycle(self, numerics, start)
        return solve_steady(self, numerics, start, solution)
