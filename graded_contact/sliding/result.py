"""The results of sliding: a contact and its problem, from which numbers are computed."""

from operator import attrgetter
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import Stack
from ..contacts.solution import ContactSolution
from ..core.display import shown
from ..core.quantities import CYCLE, STEADY, TRANSIENT
from ..fields.frequency import direction_and_speed
from .case import HeatedContact
from .errors.neighbours import neighbours_of
from .number import AbstractSliding
from .numbers import contact as of_contact
from .numbers import cycle, gap_flow, stiffness, warnings
from .numbers import friction as of_friction
from .problem import CycleProblem, Problem, SteadyProblem
from .transient import numbers as of_steps
from .transient_problem import TransientProblem


@shown("contact", "warnings")
class Sliding(AbstractSliding):
    """Friction, contact area and fields of a sliding contact.

    The contact is solved. Every other number is computed when it is read. A batch, from
    `jax.lax.map`, `jax.vmap` or a stack of leaves, has arrays of numbers. Errors and
    `energy_imbalance` have no derivative.

    On a window (`Surface(..., periodic=False)`) the errors of friction and area include the error
    of the kernel; at a given approach they also include the error of the load.

    **Fields:**

    - `contact`: pressure, gap and convergence, see `ContactSolution`; also reached directly as
      `.pressure`, `.gap`, `.displacement` [Pa, m, m] and `.result`.
    - `problem`: what was solved, see `SteadyProblem`; its `operator`, `heights`, `grid`, `law`,
      `velocity`, `shear`, `coupling` and others are also reached directly. `.kernel` is the M of
      the block [m/Pa], see `stack_kernel` and `window_kernel`.
    - `heated`: temperatures of the contact, see `HeatedContact`, or None.
    - `bodies`: the block, and the counterface if it deforms; with heating in thin layers, each at
      its temperature.
    """

    contact: ContactSolution
    problem: SteadyProblem
    heated: HeatedContact | None = None
    bodies: tuple[Stack, ...] = ()
    kind: ClassVar[str] = STEADY

    mean_pressure, mean_pressure_error = of_contact.mean_pressure, of_contact.mean_pressure_error
    approach, approach_error = of_contact.approach, of_contact.approach_error
    friction, friction_error = of_friction.friction, of_friction.friction_error
    pressure_friction = of_friction.pressure_friction
    shear_friction = of_friction.shear_friction
    block_friction = of_friction.block_friction
    interface_friction = of_friction.interface_friction
    surface_rise = of_friction.surface_rise
    contact_area, contact_area_error = of_contact.contact_area, of_contact.contact_area_error
    contact_area_pixels = of_contact.contact_area_pixels
    mean_gap, mean_gap_error = of_contact.mean_gap, of_contact.mean_gap_error
    flow_along_x, flow_along_y = gap_flow.flow_along_x, gap_flow.flow_along_y
    flow_along_x_error = flow_along_x.error(gap_flow.flow_errors(0, "solver", "grid"))
    flow_along_y_error = flow_along_y.error(gap_flow.flow_errors(1, "solver", "grid"))
    contact_stiffness = stiffness.contact_stiffness
    contact_stiffness_error = stiffness.contact_stiffness_error
    specific_conductance = stiffness.specific_conductance
    specific_conductance_error = stiffness.specific_conductance_error
    energy_imbalance = warnings.energy_imbalance
    slope_in_contact = warnings.slope_in_contact
    unmeasured_friction = warnings.unmeasured_friction
    shortest_wave, last_octave_friction = warnings.shortest_wave, warnings.last_octave_friction
    extrapolated_friction = warnings.extrapolated_friction
    rim_load = warnings.rim_load
    error, num_fft_pairs = warnings.error, warnings.num_fft_pairs

    velocity = property(attrgetter("problem.velocity"))
    kernel = property(attrgetter("operator.kernel"))
    displacement = property(attrgetter("contact.displacement"))

    neighbours = neighbours_of

    @property
    def directions(self) -> list[float]:
        """The unit vector of the traction, by its components: one, along the velocity."""
        return [1.0]

    @property
    def speed(self) -> Float[Array, ""]:
        """|v| [m/s]."""
        return direction_and_speed(self.velocity)[1]


@shown("contact", "warnings")
class CyclicSliding(AbstractSliding):
    """Friction, contact area and fields over a cycle.

    Numbers are computed when they are read. Arrays over time have the shape `(nt,)`; those along
    the motion, friction and traction, `(nt, 2)` if the displacement has two components. Errors and
    `energy_imbalance` have no derivative.

    **Fields:**

    - `contact`: pressure, gap and convergence, see `ContactSolution`; the fields have the shape
      `(nt, *grid.shape)`. Also reached directly as `.pressure`, `.gap` [Pa, m] and `.result`.
    - `problem`: what was solved, see `CycleProblem`; its `operator`, `heights`, `grid`, `law`,
      `displacement`, `period`, `shear`, `coupling` and others are also reached directly.
    - `heated`: temperatures of the contact, see `HeatedContact`, or None.
    - `bodies`: the block, and the counterface if it deforms; with heating in thin layers, each at
      its temperature.
    """

    contact: ContactSolution
    problem: CycleProblem
    heated: HeatedContact | None = None
    bodies: tuple[Stack, ...] = ()
    kind: ClassVar[str] = CYCLE

    friction = of_friction.friction
    mean_friction, mean_friction_error = cycle.mean_friction, cycle.mean_friction_error
    peak_friction, peak_friction_error = cycle.peak_friction, cycle.peak_friction_error
    mean_shear_friction = cycle.mean_shear_friction
    traction, load = of_friction.traction, of_friction.load
    work, work_error = cycle.work, cycle.work_error
    load_work, load_work_error = cycle.load_work, cycle.load_work_error
    dissipated_power, dissipated_power_error = cycle.dissipated_power, cycle.dissipated_power_error
    counterface_power, interface_power = cycle.counterface_power, of_friction.interface_power
    surface_rise = of_friction.surface_rise
    contact_area, contact_area_error = of_contact.contact_area, of_contact.area_error_of_cycle
    contact_area_pixels, mean_gap = of_contact.contact_area_pixels, of_contact.mean_gap
    energy_imbalance = warnings.energy_imbalance
    slope_in_contact = warnings.slope_in_contact
    shortest_wave, last_octave_friction = warnings.shortest_wave, warnings.last_octave_friction
    extrapolated_friction = warnings.extrapolated_friction
    largest_step = warnings.largest_step
    error, num_fft_pairs = warnings.error, warnings.num_fft_pairs

    displacement = property(attrgetter("problem.displacement"))
    period = property(attrgetter("problem.period"))
    times = property(attrgetter("problem.times"))
    moved = property(attrgetter("problem.moved"))
    motion_of_surface = property(attrgetter("problem.motion_of_surface"))

    neighbours = neighbours_of

    @property
    def directions(self) -> list[Float[Array, "nt ..."]]:
        """The unit vector of the motion at each time, by its components; 0 at rest."""
        rate, back = self.motion_of_surface
        # From the time before to the time after: what the Fourier series of a rest adds is no
        # motion.
        step = jnp.mean(rate, axis=0) * (2 * self.period / len(back))
        step = step + jnp.roll(back, -1, axis=0) - jnp.roll(back, 1, axis=0)
        squared = jnp.sum(step**2, axis=1)
        moves = squared > 1e-12 * jnp.max(squared)
        length = jnp.sqrt(jnp.where(moves, squared, 1))
        unit = jnp.where(moves[:, None], step / length[:, None], 0)
        return [part.reshape(-1, *[1] * self.grid.ndim) for part in unit.T]


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
    contact_area, contact_area_error = of_contact.contact_area, of_steps.contact_area_error
    contact_area_pixels = of_contact.contact_area_pixels
    mean_gap, mean_gap_error = of_contact.mean_gap, of_steps.mean_gap_error
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

    neighbours = of_steps.neighbours_in_time

    @property
    def field_times(self) -> Float[Array, " kept"]:
        """Times of the kept fields [s]."""
        return self.times[np.array(self.kept_steps)]


def result_of(problem: Problem, contact: ContactSolution) -> Sliding | CyclicSliding:
    """Returns the result of a contact."""
    if isinstance(problem, CycleProblem):
        return CyclicSliding(contact, problem)
    return Sliding(contact, problem)


KINDS = {kind.kind: kind for kind in (Sliding, CyclicSliding, TransientSliding)}
