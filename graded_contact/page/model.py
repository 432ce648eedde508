"""The numbers of a page: a scene with its knobs, and compiled functions of their values.

Values of knobs are traced: changing one compiles nothing. Another scene of the same structure
(number of layers, kinds of materials, grid) uses the compiled functions of the first, and one of
another structure those that only see the grid: the contact, and its derivatives by the kernel.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float

from ..blocks.compliance import effective_modulus
from ..blocks.stack import Stack
from ..contacts.law import AbstractLaw
from ..core.compilation import jit
from ..core.derivative import derivative_apart
from ..fields.frequency import direction_and_speed, velocity_along
from ..mean_field.mean_field import mean_field_friction
from ..scenes.plan import build_surface
from ..scenes.scene_checks import refuse_liquids
from ..scenes.surface_source import RandomSurface
from ..sliding.case import Case, Heating
from ..sliding.numerics import Numerics
from ..sliding.result import Sliding
from ..sliding.shear import AbstractShear
from ..sliding.slide import solve
from ..surfaces.statistics import radial_spectrum, statistics
from ..surfaces.surface import Surface
from .document import Document, described
from .knobs import PARTS, Target, changed_document, changed_part, changed_stack, knobs_of

PAGE_RTOL = 1e-4  # of pressures: enough for figures and the printed digits
NUM_SPEEDS, NUM_WAVES = 25, 80


class Scenery(eqx.Module):
    """Arguments of the compiled functions other than the values of knobs."""

    stack: Stack
    surface: Surface
    spectrum: tuple[Array, Array] | None
    rms_height: Float[Array, ""]
    random: RandomSurface | None
    shear: AbstractShear | None
    heating: Heating | None
    temperature: Float[Array, ""] | None
    targets: tuple[Target, ...] = eqx.field(static=True)
    direction: float = eqx.field(static=True)
    law: AbstractLaw
    numerics: Numerics


class Contact(NamedTuple):
    """The contact at the chosen velocity [m/s], and the heights [m] of its surface."""

    sliding: Sliding
    heights: np.ndarray
    velocity: float


class Derivatives(NamedTuple):
    """Changes [%] of friction and contact area by a step of each knob (`Knob.step`)."""

    friction: np.ndarray
    contact_area: np.ndarray


class Model:
    """A scene whose knobs can be changed.

    **Fields:**

    - `document`, `scene`, `surface`: as opened.
    - `knobs`: see `knobs_of`.
    - `waves`: lowest and highest wavenumber of the roughness [rad/m].
    """

    def __init__(self, document: Document):
        self.document, self.scene = document, document.scene()
        self.surface = surface = build_surface(self.scene)
        self.knobs = knobs_of(document, self.scene, surface)
        random = self.scene.surface if isinstance(self.scene.surface, RandomSurface) else None
        spectrum = None
        if random is None and surface.grid.ndim == 2:
            q, density = map(np.asarray, radial_spectrum(surface))
            spectrum = (jnp.asarray(q[density > 0]), jnp.asarray(density[density > 0]))
        self._scenery = Scenery(
            stack=self.scene.stack, surface=surface, spectrum=spectrum, random=random,
            rms_height=statistics(surface).rms_height, direction=float(self.scene.direction),
            targets=tuple(knob.target for knob in self.knobs), law=self.scene.contact_law,
            shear=self.scene.shear, heating=self.scene.heating,
            temperature=None if (at := self.scene.temperature) is None else jnp.asarray(at),
            numerics=dataclasses.replace(self.scene.numerics, rtol=PAGE_RTOL),
        )  # fmt: skip
        self._speeds = jnp.geomspace(*document.speeds, NUM_SPEEDS)
        grid = surface.grid
        highest = np.pi / np.max(grid.spacing) if random is None else random.spectrum.q_high
        self.waves = float(2 * np.pi / np.max(grid.size)), float(highest)
        self._waves = jnp.geomspace(*self.waves, NUM_WAVES)
        self._start = jnp.zeros_like(surface.heights) + self.values[0]
        self._last: Any = ((), None)

    @property
    def values(self) -> tuple[float, ...]:
        """The values of the knobs in the scene as opened [SI]."""
        return tuple(knob.value for knob in self.knobs)

    @property
    def size(self) -> np.ndarray:
        """Edge lengths of the cell [m]."""
        return np.asarray(self.surface.grid.size)

    def curves(self, values: Sequence[float]) -> xr.Dataset:
        """Returns response and mean field with the knobs at `values` [SI].

        The response is over `q` [rad/m] at the chosen velocity, the mean field over `speed` [m/s].
        """
        found = _curves(self._scenery, jnp.array(values), self._waves, self._speeds)
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
        return xr.Dataset({
            name: (along, np.asarray(numbers), {"units": unit, "long_name": words})
            for name, (along, numbers, unit, words) in curves.items()
        })  # fmt: skip

    def contact(self, values: Sequence[float]) -> Contact:
        """Returns the contact at `values` [SI], solved from the last one.

        Raises `ValueError` for a liquid, which has curves but, in two dimensions, no contact.
        """
        if self.surface.grid.ndim == 2:
            refuse_liquids(self.scene)
        sliding, heights = _slide(self._scenery, jnp.array(values), self._start)
        sliding.compute(*sliding.numbers)  # here in the thread, not when the page reads them
        # A failed solve is no start for the next one.
        if np.all(np.isfinite(np.asarray(sliding.pressure))):
            self._start = sliding.pressure
        self._last = (tuple(values), Contact(sliding, np.asarray(heights), values[1]))
        return self._last[1]

    def derivatives(self, values: Sequence[float]) -> Derivatives:
        """Returns the change by a step of each knob, at `values` [SI].

        NaN with the heat of friction, where they would take minutes.
        """
        if self.scene.heating is not None:
            unknown = np.full(len(values), np.nan)
            return Derivatives(unknown, unknown)
        last, contact = self._last
        if last != tuple(values):
            contact = self.contact(values)

        def observed(numbers):
            sliding, _ = _slide(self._scenery, numbers, None, solution=contact.sliding.contact)
            return jnp.stack(sliding.compute("friction", "contact_area"))

        # Two outputs and some ten knobs: backwards is cheaper than forwards.
        found, pull = jax.vjp(observed, jnp.array(values))
        slopes = jnp.stack([pull(row)[0] for row in jnp.eye(2, dtype=found.dtype)])
        steps = [k.step_size(value) for k, value in zip(self.knobs, values, strict=True)]
        with np.errstate(invalid="ignore", divide="ignore"):
            return Derivatives(*(100 * np.asarray(slopes) * steps / np.asarray(found)[:, None]))

    def stepped(self, values: Sequence[float]) -> list[str]:
        """Returns the label of each knob with its step, at `values` [SI]."""
        return [knob.stepped(value) for knob, value in zip(self.knobs, values, strict=True)]

    def thickness(self, values: Sequence[float]) -> list[float]:
        """Returns the thicknesses of the layers [m], with the knobs at `values` [SI]."""
        settings = zip(self.knobs, values, strict=True)
        return [value for knob, value in settings if knob.quantity == "thickness"]

    def title(self, values: Sequence[float]) -> str:
        """Returns the title of the scene, or its layers with the knobs at `values` [SI]."""
        content = self.document.content
        title = content.get("title") if tuple(values) == self.values else ""
        return title or described(content, self.thickness(values))

    def changed(self, values: Sequence[float]) -> Document:
        """Returns the scene with the knobs at `values` [SI]."""
        document = changed_document(self.document, self.scene.stack, self.knobs, values)
        document.content["title"] = self.title(values)
        return document


@derivative_apart
@jit
def _at(scenery: Scenery, numbers: Array) -> tuple[Stack, Surface, Any, Array, Any, dict]:
    """Block, surface, its spectrum, pressure, velocity, and other fields of the case, with knobs
    at `numbers`."""
    kinds = (target.kind for target in scenery.targets)
    by_kind = dict(zip(kinds, numbers, strict=True))
    surface, spectrum = scenery.surface, scenery.spectrum
    if scenery.random is not None:
        amplitude_and_hurst = (by_kind["amplitude"], by_kind["hurst"])
        spectrum = eqx.tree_at(
            lambda s: (s.amplitude, s.hurst), scenery.random.spectrum, amplitude_and_hurst
        )
        random = scenery.random._replace(spectrum=spectrum)
        surface = random.drawn(random.seed)
    else:
        factor = by_kind["height"] / scenery.rms_height
        surface = eqx.tree_at(lambda s: s.heights, surface, surface.heights * factor)
        if spectrum is not None:
            spectrum = (spectrum[0], spectrum[1] * factor**2)
    velocity = velocity_along(by_kind["velocity"], scenery.direction)
    stack = changed_stack(scenery.stack, scenery.targets, numbers)
    # The spectrum of a profile is not that of a surface: the mean field sums its modes.
    rough = surface if surface.grid.ndim == 1 else spectrum
    others = {"temperature": by_kind.get("temperature", scenery.temperature)}
    for kind in PARTS:
        others[kind] = changed_part(getattr(scenery, kind), kind, scenery.targets, numbers)
    return stack, surface, rough, by_kind["pressure"], velocity, others


@eqx.filter_jit
def _curves(scenery, numbers, waves, speeds):
    stack, _, rough, pressure, velocity, others = _at(scenery, numbers)
    others: dict[str, Any] = others | {"heating": None}  # it takes many mean fields for each
    speed = direction_and_speed(velocity)[1]
    modulus = effective_modulus(stack, waves, waves * speed)

    def at(speed):
        field = mean_field_friction(
            stack, rough, pressure=pressure, velocity=speed, throw=False, **others
        )
        return field.friction, field.contact_area

    along = speeds if scenery.direction == 0 else speeds[:, None] * velocity / speed
    return modulus.astype(complex), *jax.lax.map(at, along)


# Not in one `jit`: what does not depend on the block is compiled once for all blocks.
def _slide(scenery, numbers, start, solution=None):
    stack, surface, _, pressure, velocity, others = _at(scenery, numbers)
    load = {"pressure": pressure, "velocity": velocity, "law": scenery.law}
    case = Case(stack=stack, surface=surface, **load, **others)
    found = solve(case, scenery.numerics, start=start, solution=solution)
    return cast(Sliding, found), surface.heights
