"""The result of a periodic motion."""

from operator import attrgetter
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...blocks.stack import Stack
from ...contacts.solution import ContactSolution
from ...core.display import shown
from ...core.quantities import CYCLE
from ..case import HeatedContact
from ..errors import neighbours
from ..number import AbstractSliding
from ..numbers import area, cycle, warnings
from ..numbers import friction as of_friction
from ..problem import CycleProblem


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
    contact_area, contact_area_error = area.contact_area, area.area_error_of_cycle
    contact_area_pixels, mean_gap = area.contact_area_pixels, area.mean_gap
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
