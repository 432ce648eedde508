"""The result of a periodic motion."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...blocks.heated_stack import HeatedContact
from ...contacts.solution import ContactSolution
from ...core.display import shown
from ...core.quantities import CYCLE
from .. import case as facts
from ..errors import neighbours, parts
from ..number import AbstractSliding, error_of, number
from ..numbers import area, checks, cycle
from ..numbers import friction as of_friction
from ..numbers import traction as tractions
from ..problem import CycleProblem
from .steady import Sliding


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
    """

    contact: ContactSolution
    problem: CycleProblem
    heated: HeatedContact | None = None
    kind: ClassVar[str] = CYCLE

    friction = number(of_friction.friction, "friction coefficient", r"\mu", over_time=True)
    mean_friction = number(cycle.mean_friction, "work of friction over load and path", r"\bar\mu")
    mean_friction_error = error_of(mean_friction, cycle.MEAN_ERRORS, over=parts.over_friction)
    peak_friction = number(
        cycle.peak_friction, "largest friction coefficient of a cycle", r"\mu_\mathrm{max}"
    )
    peak_friction_error = error_of(peak_friction, cycle.PEAK_ERRORS)
    mean_shear_friction = number(
        cycle.mean_shear_friction,
        "part of the mean friction from shear in the contact",
        r"\bar\mu_\mathrm{shear}",
        needs=[facts.SHEARED],
    )
    traction = number(
        of_friction.traction, "shear stress that opposes the motion", r"\tau", "Pa", over_time=True
    )
    load = number(
        of_friction.load,
        "mean pressure at each time",
        r"\sigma_0",
        "Pa",
        over_time=True,
        warns=checks.NEVER_LOADED,
    )
    work = number(cycle.work, "work of friction in a cycle", "W", "J/m²")
    work_error = error_of(work, cycle.WORK_ERRORS)
    load_work = number(cycle.load_work, "work of the load in a cycle", r"W_\sigma", "J/m²")
    load_work_error = error_of(load_work, cycle.LOAD_WORK_ERRORS)
    dissipated_power = number(
        cycle.dissipated_power, "mean power that the block dissipates", "P", "W/m²"
    )
    dissipated_power_error = error_of(dissipated_power, cycle.POWER_ERRORS)
    counterface_power = number(
        cycle.counterface_power,
        "mean power that the counterface dissipates",
        r"P_\mathrm{c}",
        "W/m²",
        needs=[facts.COUNTERFACE],
    )
    interface_power = number(
        tractions.interface_power,
        "mean power that heats the interface",
        r"P_\mathrm{int}",
        "W/m²",
        needs=[facts.COUPLED],
    )
    phase = number(
        cycle.phase, "phase of the traction before the displacement, in radians", r"\delta"
    )
    surface_rise = number(
        of_friction.surface_rise,
        "temperature of the contact above the bulk",
        r"\Delta T",
        "K",
        needs=[facts.HEATED],
        warns=checks.WARMS,
    )
    contact_area = number(area.contact_area, "contact area fraction", "A/A_0", over_time=True)
    contact_area_pixels = number(
        area.contact_area_pixels, "share of points in contact", "A/A_0", over_time=True
    )
    mean_gap = number(area.mean_gap, "mean gap", r"\bar u", "m", over_time=True)
    energy_imbalance = Sliding.energy_imbalance
    slope_in_contact = Sliding.slope_in_contact
    extrapolated_friction = Sliding.extrapolated_friction
    largest_step = number(
        checks.largest_step,
        "largest step from one time to the next, in spacings of the grid",
        warns=checks.TOO_FAST,
    )
    stroke_over_cell = number(
        checks.stroke_over_cell,
        "extent of the motion that comes back, over the cell",
        warns=checks.TOO_FAR,
    )
    error, num_fft_pairs = Sliding.error, Sliding.num_fft_pairs

    def neighbours(self) -> neighbours.Neighbours:
        return neighbours.neighbours_of(self)

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

    @property
    def displacement(self) -> Float[Array, "nt ..."]:
        """s(t) of the surface [m]."""
        return self.problem.displacement

    @property
    def period(self) -> Float[Array, ""]:
        """T [s]."""
        return self.problem.period

    @property
    def times(self) -> Float[Array, " nt"]:
        """The times of all arrays over time [s]."""
        return self.problem.times

    @property
    def moved(self) -> Float[Array, "nt components"]:
        """The displacement, its components on the second axis [m]."""
        return self.problem.moved

    @property
    def motion_of_surface(self) -> tuple[Float[Array, "nt axes"], Float[Array, "nt axes"]]:
        """ds/dt [m/s], and the part of s [m] that comes back after each period."""
        return self.problem.motion_of_surface

    @property
    def velocity(self) -> Float[Array, "nt ..."]:
        """ds/dt of the surface [m/s]."""
        return self.motion_of_surface[0].reshape(self.displacement.shape)
