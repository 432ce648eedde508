"""The numbers of a page: a scene with its knobs, and compiled functions of their values.

Values of knobs are traced: changing one compiles nothing. Another scene of the same structure
(number of layers, kinds of materials, grid) uses the compiled functions of the first, and one of
another structure those that only see the grid: the contact, and its derivatives by the kernel.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np

from ..core.compilation import compiled
from ..core.derivative import derivative_apart
from ..fields.frequency import direction_and_speed
from ..mean_field.mean_field import RTOL, mean_field_friction
from ..mean_field.refinement import Nodes, misses, solve_refined
from ..response.compliance import effective_modulus
from ..scenes.plan import build_surface
from ..scenes.scene_checks import refuse_liquids
from ..scenes.surface_source import RandomSurface
from ..sliding.case import Case
from ..sliding.result import Sliding
from ..sliding.slide import slide_case
from ..surfaces.surface import Surface
from .document import Document
from .knobs import knobs_of, turned
from .scenery import Scenery, scenery_of, with_numbers

PAGE_RTOL = 1e-4  # of pressures: enough for figures and the printed digits
AT_THE_TOP = ("friction", "contact_area", "mean_gap", "surface_rise")  # of the page, if known
NUM_SPEEDS, NUM_WAVES = 25, 80


class Curve(NamedTuple):
    """Numbers of a curve over another one, or of an abscissa: a variable as xarray takes it."""

    along: str
    numbers: np.ndarray
    attributes: dict[str, str]


class Derivatives(NamedTuple):
    """Changes [%] of friction and contact area by a step of each knob (`Knob.step`)."""

    friction: np.ndarray
    contact_area: np.ndarray


class Model:
    """A scene whose knobs can be changed.

    **Fields:**

    - `document`, `surface`: as opened.
    - `knobs`: see `knobs_of`.
    - `waves`: lowest and highest wavenumber of the roughness [rad/m].
    """

    def __init__(self, document: Document):
        self.document, scene = document, document.scene
        self.surface = surface = build_surface(scene)
        self._scenery = scenery_of(scene, surface)
        self.knobs = knobs_of(self._scenery, scene.materials, document.speeds)
        self._numerics = dataclasses.replace(scene.numerics, rtol=PAGE_RTOL)
        self._speeds = jnp.asarray(np.geomspace(*document.speeds, NUM_SPEEDS))
        highest = getattr(scene.surface, "spectrum", None)
        grid = surface.grid
        highest = np.pi / np.max(grid.spacing) if highest is None else highest.q_high
        self.waves = float(2 * np.pi / np.max(grid.size)), float(highest)
        self._waves = jnp.asarray(np.geomspace(*self.waves, NUM_WAVES))
        self._start = jnp.asarray(np.full(grid.shape, scene.pressure[0]))
        self._last: Any = ((), None)

    @property
    def values(self) -> tuple[float, ...]:
        """The values of the knobs in the scene as opened [SI]."""
        return tuple(knob.value for knob in self.knobs)

    def _at(self, values: Any) -> Scenery:
        return turned(self._scenery, self.knobs, values)

    def curves(self, values: Sequence[float]) -> dict[str, Curve]:
        """Returns response and mean field with the knobs at `values` [SI].

        The response is over `q` [rad/m] at the chosen velocity, the mean field over `speed` [m/s].
        """

        def solve(nodes: Nodes) -> Any:
            found = _response_and_theory(self._at(values), self._waves, self._speeds, nodes)
            return found[:-1], found[-1]

        found, _ = solve_refined(solve)
        modulus, friction, area = (np.asarray(numbers) for numbers in found)
        tangent = np.imag(modulus) / np.real(modulus)
        meaning = "composite modulus |2/(q M_zz)|"
        curves = {
            "q": ("q", self._waves, "rad/m", "wavenumber"),
            "modulus": ("q", np.abs(modulus), "Pa", f"{meaning} at the chosen velocity"),
            "loss_tangent": ("q", tangent, "1", "composite loss tangent at the chosen velocity"),
            "speed": ("speed", self._speeds, "m/s", "velocity"),
            "friction": ("speed", friction, "1", "friction by mean field"),
            "contact_area": ("speed", area, "1", "contact area fraction by mean field"),
        }
        return {
            name: Curve(along, np.asarray(numbers), {"units": unit, "long_name": words})
            for name, (along, numbers, unit, words) in curves.items()
        }

    def contact(self, values: Sequence[float]) -> Sliding:
        """Returns the contact at `values` [SI], solved from the last one, without its errors.

        Raises `ValueError` for a liquid, which has curves but, in two dimensions, no contact.
        """
        if self.surface.grid.ndim == 2:
            refuse_liquids(self.document.scene)
        found = self._slide(values, self._start)
        # Here in the thread, not when the page reads them.
        found.compute(*(name for name in AT_THE_TOP if name in found.numbers))
        # A failed solve is no start for the next one.
        if np.all(np.isfinite(np.asarray(found.pressure))):
            self._start = found.pressure
        self._last = (tuple(values), found)
        return found

    def _slide(self, values: Any, start: Any, solution: Any = None) -> Sliding:
        # Not in one `jit`: what does not depend on the block is compiled once for all blocks.
        case = _case(self._at(values))
        return cast(Sliding, slide_case(case, self._numerics, start=start, solution=solution))

    def errors(self, values: Sequence[float]) -> tuple[str, ...]:
        """Returns the warnings about the contact at `values` [SI], which then has its errors."""
        return self._found(values).warnings

    def _found(self, values: Sequence[float]) -> Sliding:
        last, contact = self._last
        return contact if last == tuple(values) else self.contact(values)

    def derivatives(self, values: Sequence[float]) -> Derivatives:
        """Returns the change by a step of each knob, at `values` [SI].

        NaN with the heat of friction, where they would take minutes.
        """
        if self.document.scene.heating is not None:
            unknown = np.full(len(values), np.nan)
            return Derivatives(unknown, unknown)
        contact = self._found(values)

        def observed(numbers):
            found = self._slide(numbers, None, contact.contact)
            return jnp.stack(found.compute("friction", "contact_area"))

        # Two outputs and some ten knobs: backwards is cheaper than forwards.
        found, pull = jax.vjp(observed, jnp.array(values))
        slopes = jnp.stack([pull(row)[0] for row in jnp.eye(2, dtype=found.dtype)])
        steps = [k.step_size(value) for k, value in zip(self.knobs, values, strict=True)]
        with np.errstate(invalid="ignore", divide="ignore"):
            return Derivatives(*(100 * np.asarray(slopes) * steps / np.asarray(found)[:, None]))

    def stepped(self, values: Sequence[float]) -> list[str]:
        """Returns the label of each knob with its step, at `values` [SI]."""
        return [knob.stepped(value) for knob, value in zip(self.knobs, values, strict=True)]

    def changed(self, values: Sequence[float]) -> Document:
        """Returns the scene with the knobs at `values` [SI], and its title."""
        if tuple(values) == self.values:
            return self.document.titled()
        return with_numbers(self.document, self._scenery, self._at(values)).titled()


@derivative_apart
def _case(scenery: Scenery) -> Case:
    # The program that draws a surface is compiled already, see `build_surface`.
    drawn = scenery.surface.build() if isinstance(scenery.surface, RandomSurface) else None
    return _case_on(scenery, drawn)


@compiled
def _case_on(scenery: Scenery, surface: Surface | None) -> Case:
    return scenery.case(surface)


@compiled
def _response_and_theory(scenery, waves, speeds, nodes):
    case = scenery.case(scenery.roughness())
    speed = direction_and_speed(case.velocity)[1]
    modulus = effective_modulus(case.stack, waves, waves * speed)

    def at(speed):
        # Without heat, which takes many mean fields for each.
        field = mean_field_friction(
            case.stack, case.surface, pressure=case.pressure, velocity=speed,
            shear=case.shear, temperature=case.temperature,
            strain_per_slope=case.strain_per_slope, throw=False, **nodes._asdict(),
        )  # fmt: skip
        return field.friction, field.contact_area, misses(field.error, RTOL)

    along = speeds if scenery.direction == 0 else speeds[:, None] * case.velocity / speed
    return modulus.astype(complex), *jax.lax.map(at, along)
