"""Computations of a page: curves of the mean field, the contact, and derivatives of friction.

The numbers of the sliders are traced by JAX: each function compiles once, moving a slider compiles
nothing.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..contacts import HardWall
from ..contacts.solution import RESULTS
from ..core.compilation import compiled
from ..mean_field.mean_field import mean_field_of
from ..scenes.scene import Scene
from ..sliding import Case, slide_case
from ..surfaces import isotropic_spectrum
from .numbers import middle_point, varied_numbers

PAGE_RTOL = 1e-4  # of pressures: enough for figures and the printed digits
SPEEDS, DECADES = 25, 3.0  # of a curve, to both sides of the velocity of the scene
# Numbers at the head of the page for each kind of contact; derivatives are of the first.
SHOWN = {
    "steady": ("friction", "contact_area", "mean_gap"),
    "cycle": ("mean_friction", "peak_friction"),
    "transient": ("friction", "contact_area", "mean_gap"),
}
Values = Mapping[str, Any]


class Curve(NamedTuple):
    """Friction and contact area [1] by mean field over the velocity [m/s]."""

    velocity: np.ndarray
    friction: np.ndarray
    contact_area: np.ndarray


class Curves:
    """The compiled functions of a scene; values are numbers [SI] by their names.

    **Fields:**

    - `scene`: as it was read.
    - `numbers`: that vary, see `varied_numbers`.
    - `surface`: of the contacts.
    - `kind`: of the contacts, one of `SHOWN`.
    - `has_curve`: whether there is a mean field: of steady sliding of one periodic surface with a
      hard wall. It is computed without the heat of friction.
    """

    def __init__(self, scene: Scene):
        self.scene, self.numbers = scene, varied_numbers(scene)
        first = scene.case(middle_point(scene))
        self.surface = first.surface
        self.kind = scene.kind
        self.has_curve = self.kind == "steady" and _has_mean_field(first)
        spectrum: Any = isotropic_spectrum(self.surface) if self.has_curve else None
        numerics = dataclasses.replace(scene.numerics, rtol=PAGE_RTOL)

        def contact(values):
            return slide_case(self.case(values), numerics)

        def curve(values):
            def at(speed):
                case = self.case({**values, "velocity": speed})
                found = mean_field_of(case, spectrum, heating=None, throw=False)
                return found.friction, found.contact_area

            return jax.lax.map(at, self._speeds())

        def decisive(values):
            return getattr(contact(values), SHOWN[self.kind][0])

        self._contact, self._curve = compiled(contact), compiled(curve)
        self._slopes = compiled(jax.value_and_grad(decisive))

    def case(self, values: Values) -> Case:
        """Returns the case of values, which JAX may trace, or raises `ValueError`."""
        point = {path: value for name, value in values.items() for path in self.numbers[name].paths}
        return self.scene.case(middle_point(self.scene) | point)

    def curve(self, values: Values) -> Curve | None:
        """Returns the curve of the mean field, if there is one."""
        if not self.has_curve:
            return None
        return Curve(*map(np.asarray, (self._speeds(), *self._curve(_traced(values)))))

    def _speeds(self) -> jax.Array:
        middle = np.log10(self.numbers["velocity"].value)
        return jnp.asarray(np.logspace(middle - DECADES, middle + DECADES, SPEEDS))

    def contact(self, values: Values) -> Any:
        """Returns the contact.

        **Raises:** `ValueError` if it is not solved.
        """
        found = self._contact(_traced(values))
        if found.result != RESULTS.successful:
            raise ValueError(RESULTS[found.result])
        return found

    def shown(self, found: Any, end: str = "") -> dict[str, float]:
        """Returns the numbers at the head of the page, or with "_error" their errors.

        Of a number over time it is the last.
        """
        names = SHOWN[self.kind]
        numbers = found.compute(*(name + end for name in names))
        return {n: float(np.ravel(at)[-1]) for n, at in zip(names, numbers, strict=True)}

    def what_matters(self, values: Values) -> dict[str, float]:
        """Returns the change of friction [%] by +1 % of each number, by labels; largest first."""
        value, slopes = self._slopes(_traced(values))
        change = {
            self.numbers[name].label: float(slope) * values[name] / float(value)
            for name, slope in slopes.items()
        }
        return dict(sorted(change.items(), key=lambda one: -abs(one[1])))


def _has_mean_field(case: Case) -> bool:
    hard = isinstance(case.law, HardWall) and case.law.hardness is None
    pressed = case.pressure is not None and bool(np.any(case.velocity))
    rough = case.surface.periodic and case.surface.grid.ndim == 2
    return hard and pressed and rough and case.block_surface is None


def _traced(values: Values) -> dict[str, jax.Array]:
    return {name: jnp.asarray(value) for name, value in values.items()}
