"""The result of steady sliding."""

from operator import attrgetter
from typing import ClassVar

from jaxtyping import Array, Float

from ...blocks.stack import Stack
from ...contacts.solution import ContactSolution
from ...core.display import shown
from ...core.quantities import STEADY
from ...fields.frequency import direction_and_speed
from ..case import HeatedContact
from ..errors import neighbours
from ..number import AbstractSliding
from ..numbers import area, gap_flow, load, stiffness, warnings
from ..numbers import friction as of_friction
from ..problem import SteadyProblem


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

    mean_pressure, mean_pressure_error = load.mean_pressure, load.mean_pressure_error
    approach, approach_error = load.approach, load.approach_error
    friction, friction_error = of_friction.friction, of_friction.friction_error
    pressure_friction = of_friction.pressure_friction
    shear_friction = of_friction.shear_friction
    block_friction = of_friction.block_friction
    interface_friction = of_friction.interface_friction
    surface_rise = of_friction.surface_rise
    contact_area, contact_area_error = area.contact_area, area.contact_area_error
    contact_area_pixels = area.contact_area_pixels
    mean_gap, mean_gap_error = area.mean_gap, area.mean_gap_error
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

    def neighbours(self) -> neighbours.Neighbours:
        return neighbours.neighbours_of(self)

    @property
    def directions(self) -> list[float]:
        """The unit vector of the traction, by its components: one, along the velocity."""
        return [1.0]

    @property
    def speed(self) -> Float[Array, ""]:
        """|v| [m/s]."""
        return direction_and_speed(self.velocity)[1]
