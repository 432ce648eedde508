"""The result of a transient motion."""

from operator import attrgetter
from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from ...blocks.stack import Stack
from ...contacts.solution import ContactSolution
from ...core.display import shown
from ...core.quantities import TRANSIENT
from ..errors import neighbours
from ..number import AbstractSliding
from ..numbers import area, cycle, gap_flow, warnings
from ..numbers import friction as of_friction
from ..transient import errors as of_steps
from ..transient_problem import TransientProblem


@shown("contact", "failed", "warnings")
class TransientSliding(AbstractSliding):
    """Friction, contact area and fields in a transient motion.

    Arrays over time have the shape `(nt,)`, one number for each of `.times`; those along the
    motion, friction and traction, `(nt, 2)` if the displacement has two components. Errors have no
    derivative. After a step that failed all numbers are NaN.

    **Fields:**

    - `contact`: the fields at the ends of some steps, of the shape `(kept, *grid.shape)`, see
      `ContactSolution`; its numbers are the largest errors and the sums of all steps. Also reached
      directly as `.pressure`, `.gap`, `.displacement` [Pa, m, m], at the `.field_times` [s].
    - `problem`: what was solved, see `TransientProblem`; its `times`, `displacement`, `heights`,
      `grid`, `law`, `shear` and others are also reached directly.
    - `recorded`: numbers of the steps by their names, each with the times on its first axis.
    - `failed`: number of the first step that did not succeed, or -1.
    - `kept_steps`: numbers of the steps whose fields are kept. Static.
    - `bodies`: the block, and the counterface if it deforms.
    """

    contact: ContactSolution
    problem: TransientProblem
    recorded: dict[str, Array]
    failed: Array
    kept_steps: tuple[int, ...] = eqx.field(static=True)
    bodies: tuple[Stack, ...] = ()
    kind: ClassVar[str] = TRANSIENT

    friction, friction_error = of_friction.friction, of_steps.friction_error
    shear_friction, mean_shear_friction = of_friction.shear_friction, cycle.mean_shear_friction
    mean_friction, mean_friction_error = cycle.mean_friction, of_steps.mean_friction_error
    peak_friction, peak_friction_error = cycle.peak_friction, of_steps.peak_friction_error
    time_to_peak, time_since_change = of_steps.time_to_peak, of_steps.time_since_change
    traction, load, load_error = of_friction.traction, of_friction.load, of_steps.load_error
    work_done, work_done_error = of_steps.work_done, of_steps.work_done_error
    load_work_done, load_work_done_error = of_steps.load_work_done, of_steps.load_work_done_error
    shear_work_done = of_steps.shear_work_done
    contact_area, contact_area_error = area.contact_area, of_steps.contact_area_error
    contact_area_pixels = area.contact_area_pixels
    mean_gap, mean_gap_error = area.mean_gap, of_steps.mean_gap_error
    flow_along_x, flow_along_y = gap_flow.flow_along_x, gap_flow.flow_along_y
    flow_along_x_error = flow_along_x.error(gap_flow.flow_errors(0, *of_steps.CAUSES))
    flow_along_y_error = flow_along_y.error(gap_flow.flow_errors(1, *of_steps.CAUSES))
    slope_in_contact = warnings.slope_in_contact
    extrapolated_times = warnings.extrapolated_times
    largest_step = warnings.largest_step
    error, num_fft_pairs = warnings.error, warnings.num_fft_pairs

    times = property(attrgetter("problem.times"))
    displacement = property(attrgetter("contact.displacement"))  # at the kept times
    moved = property(attrgetter("problem.moved"))

    def neighbours(self) -> neighbours.Neighbours:
        return of_steps.neighbours_in_time(self)

    @property
    def field_times(self) -> Float[Array, " kept"]:
        """Times of the kept fields [s]."""
        return self.times[np.array(self.kept_steps)]
