"""What a page shows: a scene built, its knobs, and the compiled functions of their values.

Values of knobs are traced: turning one compiles nothing. Another scene of the same structure
(number of layers, kinds of materials, grid) takes the compiled functions of the first.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..contact.solver import AbstractContactSolver
from ..fields.grid import direction_and_speed
from ..files.surfaces import RandomSurface
from ..friction.sliding import Sliding, slide
from ..persson.mean_field import mean_field_friction
from ..response.compliance import effective_modulus
from ..response.grading import AbstractGradedSolver
from ..response.stack import Stack
from ..roughness.surface import Surface, radial_spectrum, statistics
from ..studies.extrapolation import velocity_vector
from ..studies.run import build_surface
from .document import Document
from .knobs import STEPS, Turn, knobs_of, turned, written

RTOL = 1e-4  # of pressures: what is drawn and printed needs no more
NUM_SPEEDS, NUM_WAVES = 25, 80
PER_CENT = 0.01


class Bench(eqx.Module):
    """What the compiled functions take besides the values of knobs."""

    stack: Stack
    surface: Surface
    spectrum: tuple[Array, Array] | None
    rms_height: Float[Array, ""]
    drawn: RandomSurface | None
    turns: tuple[Turn, ...] = eqx.field(static=True)
    direction: float = eqx.field(static=True)
    solver: AbstractContactSolver
    graded_solver: AbstractGradedSolver


class Curves(NamedTuple):
    """Response and mean field: against `q` [rad/m] at the velocity, and against `speed` [m/s]."""

    q: np.ndarray
    modulus: np.ndarray
    loss_tangent: np.ndarray
    speed: np.ndarray
    friction: np.ndarray
    contact_area: np.ndarray


class Contact(NamedTuple):
    """The contact at the chosen point, and the heights [m] that make it."""

    sliding: Sliding
    heights: np.ndarray
    velocity: float


class Derivatives(NamedTuple):
    """Changes [%] of friction and contact area per step of each knob (`Knob.step`)."""

    friction: np.ndarray
    contact_area: np.ndarray


class Model:
    """A scene that can be turned.

    **Fields:**

    - `document`, `scene`, `surface`: as opened.
    - `knobs`: what can be turned.
    - `highest`: wavenumber [rad/m] of the roughness.
    """

    def __init__(self, document: Document):
        self.document, self.scene = document, document.scene()
        self.surface = surface = build_surface(self.scene)
        self.knobs = knobs_of(document, self.scene, surface)
        drawn = self.scene.surface if isinstance(self.scene.surface, RandomSurface) else None
        spectrum = None
        if drawn is None and surface.grid.ndim == 2:
            q, density = map(np.asarray, radial_spectrum(surface))
            spectrum = (jnp.asarray(q[density > 0]), jnp.asarray(density[density > 0]))
        self.bench = Bench(
            stack=self.scene.stack,
            surface=surface,
            spectrum=spectrum,
            rms_height=statistics(surface).rms_height,
            drawn=drawn,
            turns=tuple(knob.turn for knob in self.knobs),
            direction=self.scene.direction,
            solver=self.scene.solver,
            graded_solver=self.scene.graded_solver,
        )
        low, high = document.speeds
        self._speeds = jnp.geomspace(low, high, NUM_SPEEDS)
        grid = surface.grid
        highest = float(np.pi / np.max(grid.spacing)) if drawn is None else drawn.spectrum.q_high
        self.highest = float(highest)
        self._waves = jnp.geomspace(2 * np.pi / float(np.max(grid.size)), highest, NUM_WAVES)
        self._start = jnp.zeros_like(surface.heights) + self.values[0]
        self._last: Any = ((), None)

    @property
    def values(self) -> tuple[float, ...]:
        """Where the knobs stood when the scene was opened [SI]."""
        return tuple(knob.value for knob in self.knobs)

    def curves(self, values: Sequence[float]) -> Curves:
        """Returns response and mean field with the knobs at `values` [SI]."""
        found, friction, area = _curves(self.bench, jnp.array(values), self._waves, self._speeds)
        modulus: Any = np.asarray(found)
        return Curves(
            q=np.asarray(self._waves),
            modulus=np.abs(modulus),
            loss_tangent=modulus.imag / modulus.real,
            speed=np.asarray(self._speeds),
            friction=np.asarray(friction),
            contact_area=np.asarray(area),
        )

    def contact(self, values: Sequence[float]) -> Contact:
        """Returns the contact at `values` [SI], found from the last one."""
        sliding, heights = _contact(self.bench, jnp.array(values), self._start)
        if np.all(np.isfinite(np.asarray(sliding.pressure))):
            self._start = sliding.pressure
        self._last = (tuple(values), Contact(sliding, np.asarray(heights), values[1]))
        return self._last[1]

    def derivatives(self, values: Sequence[float]) -> Derivatives:
        """Returns what a step of each knob changes, at `values` [SI]."""
        last, contact = self._last
        if last != tuple(values):
            contact = self.contact(values)
        known = contact.sliding.contact
        found, slopes = map(np.asarray, _derivatives(self.bench, jnp.array(values), known))
        steps = [
            PER_CENT * value if knob.logarithmic else STEPS[knob.quantity]
            for knob, value in zip(self.knobs, values, strict=True)
        ]
        with np.errstate(invalid="ignore", divide="ignore"):
            return Derivatives(*(slopes * steps / found[:, None] / PER_CENT))

    def turned(self, values: Sequence[float]) -> Document:
        """Returns the scene with the knobs at `values` [SI], to be saved or changed."""
        return written(self.document, self.scene.stack, self.knobs, values)


def _at(bench: Bench, numbers: Array) -> tuple[Stack, Surface, Any, Array, Any]:
    """Block, surface, its spectrum, pressure and velocity with knobs at `numbers`."""
    by_kind = dict(zip((turn.kind for turn in bench.turns), numbers, strict=True))
    surface, spectrum = bench.surface, bench.spectrum
    if bench.drawn is not None:
        spectrum = eqx.tree_at(
            lambda s: (s.amplitude, s.hurst),
            bench.drawn.spectrum,
            (by_kind["amplitude"], by_kind["hurst"]),
        )
        drawn = bench.drawn._replace(spectrum=spectrum)
        surface = drawn.drawn(drawn.seed)
    else:
        factor = by_kind["height"] / bench.rms_height
        surface = eqx.tree_at(lambda s: s.heights, surface, surface.heights * factor)
        if spectrum is not None:
            spectrum = (spectrum[0], spectrum[1] * factor**2)
    velocity = velocity_vector(by_kind["velocity"], bench.direction)
    stack = turned(bench.stack, bench.turns, numbers)
    # A profile's spectrum is not that of a surface: its modes are summed as they are.
    rough = surface if surface.grid.ndim == 1 else spectrum
    return stack, surface, rough, by_kind["pressure"], velocity


@eqx.filter_jit
def _curves(bench, numbers, waves, speeds):
    stack, _, rough, pressure, velocity = _at(bench, numbers)
    speed = direction_and_speed(velocity)[1]
    modulus = effective_modulus(stack, waves, waves * speed, graded_solver=bench.graded_solver)

    def at(speed):
        field = mean_field_friction(
            stack,
            rough,
            pressure=pressure,
            velocity=speed,
            graded_solver=bench.graded_solver,
            throw=False,
        )
        return field.friction, field.contact_area

    along = speeds if bench.direction == 0 else speeds[:, None] * velocity / speed
    return modulus.astype(complex), *jax.lax.map(at, along)


def _slide(bench, numbers, start, solution=None):
    stack, surface, _, pressure, velocity = _at(bench, numbers)
    return slide(
        stack, surface, pressure=pressure, velocity=velocity, solver=bench.solver,
        graded_solver=bench.graded_solver, rtol=RTOL, start=start, solution=solution, throw=False,
    ), surface.heights  # fmt: skip


@eqx.filter_jit
def _contact(bench, numbers, start):
    return _slide(bench, numbers, start)


@eqx.filter_jit
def _derivatives(bench, numbers, contact):
    def observed(numbers):
        sliding, _ = _slide(bench, numbers, None, solution=contact)
        return jnp.stack([sliding.friction, sliding.contact_area_smooth])

    found, pull = jax.vjp(observed, numbers)
    # One after the other: together they would run until the slower has converged.
    return found, jax.lax.map(lambda row: pull(row)[0], jnp.eye(2, dtype=numbers.dtype))
