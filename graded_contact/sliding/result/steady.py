"""The result of steady sliding."""

from typing import ClassVar

from jaxtyping import Array, Float, Inexact

from ...blocks.heated_stack import HeatedContact
from ...contacts.solution import ContactSolution
from ...core.display import shown
from ...core.quantities import STEADY
from ...fields.frequency import direction_and_speed
from .. import case as facts
from ..errors import neighbours, parts
from ..number import AbstractSliding, error_of, number
from ..numbers import area, checks, gap_flow, load, stiffness
from ..numbers import friction as of_friction
from ..numbers import traction as tractions
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
    """

    contact: ContactSolution
    problem: SteadyProblem
    heated: HeatedContact | None = None
    kind: ClassVar[str] = STEADY

    mean_pressure = number(
        load.mean_pressure, "mean contact pressure", r"\bar\sigma", "Pa", needs=[facts.LOAD_FOLLOWS]
    )
    mean_pressure_error = error_of(mean_pressure, load.PRESSURE_ERRORS)
    approach = number(load.approach, "approach", r"\delta", "m", needs=[facts.GROUND])
    approach_error = error_of(approach, load.APPROACH_ERRORS, needs=[facts.GIVEN_LOAD])
    moment = number(
        load.moment,
        "moment of the pressure about the middle of the window",
        "M",
        "N m",
        stored=False,
    )
    friction = number(of_friction.friction, "friction coefficient", r"\mu", warns=checks.APART)
    friction_error = error_of(friction, of_friction.FRICTION_ERRORS, over=parts.over_friction)
    hysteresis_friction = number(
        of_friction.hysteresis_friction,
        "friction from the slopes, without coupling the hysteresis",
        r"\mu_\mathrm{hys}",
    )
    shear_friction = number(
        of_friction.shear_friction,
        "friction coefficient of shear in the contact",
        r"\mu_\mathrm{shear}",
        warns=checks.NO_SHEAR,
    )
    block_friction = number(
        tractions.block_friction,
        "friction lost in the block",
        r"\mu_\mathrm{block}",
        needs=[facts.COUPLED],
    )
    interface_friction = number(
        tractions.interface_friction,
        "friction that heats the interface",
        r"\mu_\mathrm{int}",
        needs=[facts.COUPLED],
    )
    geometric_friction = number(
        of_friction.geometric_friction,
        "friction coefficient from the surface slope",
        r"\mu_\mathrm{geo}",
        stored=False,
    )
    surface_rise = number(
        of_friction.surface_rise,
        "temperature of the contact above the bulk",
        r"\Delta T",
        "K",
        needs=[facts.HEATED],
    )
    contact_area = number(area.contact_area, "contact area fraction", "A/A_0")
    contact_area_error = error_of(contact_area, area.AREA_ERRORS, over=parts.over_number)
    contact_area_pixels = number(area.contact_area_pixels, "share of points in contact", "A/A_0")
    mean_gap = number(area.mean_gap, "mean gap", r"\bar u", "m")
    mean_gap_error = error_of(mean_gap, area.GAP_ERRORS)
    flow_along_x = number(
        gap_flow.flow_along_x,
        "conductance of the gap for a fluid along x",
        "K_x",
        "m³",
        needs=[facts.FLOW],
    )
    flow_along_x_error = error_of(flow_along_x, gap_flow.flow_errors(0, "solver", "grid"))
    flow_along_y = number(
        gap_flow.flow_along_y,
        "conductance of the gap for a fluid along y",
        "K_y",
        "m³",
        needs=[facts.FLOW],
    )
    flow_along_y_error = error_of(flow_along_y, gap_flow.flow_errors(1, "solver", "grid"))
    contact_stiffness = number(
        stiffness.contact_stiffness, "contact stiffness", "k", "Pa/m", needs=[facts.STIFFNESS]
    )
    contact_stiffness_error = error_of(
        contact_stiffness, {"grid": stiffness.contact_stiffness_error}
    )
    specific_conductance = number(
        stiffness.specific_conductance,
        "contact conductance times the sum of both resistivities",
        r"G\varrho",
        "1/m",
        needs=[facts.CONDUCTANCE],
    )
    specific_conductance_error = error_of(
        specific_conductance, {"grid": stiffness.specific_conductance_error}
    )
    energy_imbalance = number(
        checks.energy_imbalance, "relative difference of friction work and dissipation"
    )
    slope_in_contact = number(
        checks.slope_in_contact,
        "rms slope of the bodies, weighted by the pressure",
        warns=checks.TOO_STEEP,
    )
    unmeasured_friction = number(
        checks.unmeasured_friction,
        "share of the hysteresis on filled or tapered points",
        warns=checks.NOT_MEASURED,
    )
    extrapolated_friction = number(
        checks.extrapolated_friction,
        "share of the friction where no modulus was measured",
        warns=checks.BEYOND_FREQUENCIES,
    )
    compression = number(
        checks.compression,
        "approach over the thickness of layers on a rigid base",
        needs=[facts.WINDOW],
        warns=checks.COMPRESSED,
    )
    rim_load = number(
        checks.rim_load,
        "share of the load on the rim of the window",
        needs=[facts.WINDOW],
        warns=checks.ON_THE_RIM,
    )
    error = number(checks.error, "estimated relative error of the contact pressure")
    num_fft_pairs = number(checks.num_fft_pairs, "FFT pairs of the solve")

    def neighbours(self) -> neighbours.Neighbours:
        return neighbours.neighbours_of(self)

    @property
    def directions(self) -> list[float]:
        """The unit vector of the traction, by its components: one, along the velocity."""
        return [1.0]

    @property
    def at_approach(self) -> bool:
        """Whether the approach was given, not the load."""
        return self.problem.prescribed == "approach"

    @property
    def velocity(self) -> Float[Array, "..."]:
        return self.problem.velocity

    @property
    def kernel(self) -> Inexact[Array, "..."]:
        return self.operator.kernel

    @property
    def displacement(self) -> Float[Array, "*shape"]:
        return self.contact.displacement

    @property
    def speed(self) -> Float[Array, ""]:
        """|v| [m/s]."""
        return direction_and_speed(self.velocity)[1]
