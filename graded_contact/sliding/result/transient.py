"""The result of a transient motion."""

from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from ...blocks.heated_stack import HeatedContact
from ...contacts.solution import ContactSolution
from ...core.display import shown
from ...core.quantities import TRANSIENT
from .. import case as facts
from ..errors import neighbours, parts
from ..number import AbstractSliding, error_of, number
from ..numbers import checks, gap_flow
from ..numbers import friction as of_friction
from ..problem import TransientProblem
from ..transient import errors as of_steps
from ..transient import numbers as transient
from .cycle import CyclicSliding
from .steady import Sliding


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
    """

    contact: ContactSolution
    problem: TransientProblem
    recorded: dict[str, Array]
    failed: Array
    kept_steps: tuple[int, ...] = eqx.field(static=True)
    heated: HeatedContact | None = None
    kind: ClassVar[str] = TRANSIENT

    friction = CyclicSliding.friction
    friction_error = error_of(friction, of_steps.FRICTION_ERRORS)
    shear_friction = number(
        of_friction.shear_friction,
        "friction coefficient of shear in the contact",
        r"\mu_\mathrm{shear}",
        over_time=True,
        warns=checks.NO_SHEAR,
    )
    mean_friction = CyclicSliding.mean_friction
    mean_shear_friction = CyclicSliding.mean_shear_friction
    mean_friction_error = error_of(mean_friction, of_steps.MEAN_ERRORS)
    peak_friction = CyclicSliding.peak_friction
    peak_friction_error = error_of(peak_friction, of_steps.PEAK_ERRORS)
    time_to_peak = number(
        transient.time_to_peak,
        "time from the last start or stop to the largest friction",
        r"t_\mathrm{max}",
        "s",
    )
    time_since_change = number(
        transient.time_since_change,
        "time since the last start or stop",
        r"t - t_0",
        "s",
        over_time=True,
    )
    traction, load = CyclicSliding.traction, CyclicSliding.load
    load_error = error_of(load, of_steps.LOAD_ERRORS, needs=[facts.LOAD_FOLLOWS])
    work_done = number(transient.work_done, "work of friction so far", "W", "J/m²", over_time=True)
    work_done_error = error_of(work_done, of_steps.WORK_ERRORS)
    load_work_done = number(
        transient.load_work_done, "work of the load so far", r"W_\sigma", "J/m²", over_time=True
    )
    load_work_done_error = error_of(load_work_done, of_steps.LOAD_WORK_ERRORS)
    shear_work_done = number(
        transient.shear_work_done,
        "work of shear in the contact so far",
        r"W_\mathrm{shear}",
        "J/m²",
        over_time=True,
        needs=[facts.SHEARED],
    )
    contact_area = CyclicSliding.contact_area
    contact_area_error = error_of(contact_area, of_steps.AREA_ERRORS, over=parts.over_number)
    contact_area_pixels = CyclicSliding.contact_area_pixels
    mean_gap = CyclicSliding.mean_gap
    mean_gap_error = error_of(mean_gap, of_steps.GAP_ERRORS)
    flow_along_x, flow_along_y = Sliding.flow_along_x, Sliding.flow_along_y
    flow_along_x_error = error_of(
        flow_along_x, gap_flow.flow_errors(0, "solver", "grid", "time", "memory")
    )
    flow_along_y_error = error_of(
        flow_along_y, gap_flow.flow_errors(1, "solver", "grid", "time", "memory")
    )
    slope_in_contact = Sliding.slope_in_contact
    extrapolated_times = number(
        checks.extrapolated_times,
        "share of the times, by their logarithm, at which no modulus was measured",
        warns=checks.BEYOND_TIMES,
    )
    largest_step = CyclicSliding.largest_step
    path_after_rest = number(
        checks.path_after_rest, "path after a rest, over the cell", warns=checks.PASSES_ITS_REST
    )
    error, num_fft_pairs = Sliding.error, Sliding.num_fft_pairs

    def neighbours(self) -> neighbours.Neighbours:
        return of_steps.neighbours_of(self)

    @property
    def times(self) -> Float[Array, " nt"]:
        """Ends of the steps [s]."""
        return self.problem.times

    @property
    def displacement(self) -> Float[Array, "*kept"]:
        """Displacement of the block at the kept times [m]."""
        return self.contact.displacement

    @property
    def moved(self) -> Float[Array, "nt components"]:
        """The displacement s of the surface, its components on the second axis [m]."""
        return self.problem.moved

    @property
    def field_times(self) -> Float[Array, " kept"]:
        """Times of the kept fields [s]."""
        return self.times[np.array(self.kept_steps)]
