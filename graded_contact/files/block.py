"""The block of a scene: its materials, and the stack that is made of them."""

import os
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import ScalarLike

from ..core.warnings import unusual
from ..response.grading import AbstractGradedSolver
from ..response.layering import Layering
from ..response.profile import Blend
from ..response.riccati import Riccati
from ..response.shape import AbstractShape, ErrorFunction, Exponential, Linear, PowerLaw, Sinusoidal
from ..response.stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack
from ..rheology.library import tyre_tread
from ..rheology.material import AbstractMaterial, BulkShear, Elastic, Prony
from ..rheology.shift import WLF, AbstractShift, Arrhenius, TabulatedShift
from ..rheology.tabulated import Tabulated
from .errors import Errors, check_errors, read_errors
from .moduli.quantities import DIMENSIONS, UNITS
from .moduli.reading import read_moduli
from .signatures import Builder, keys_of
from .toml import Section, nearest, short, within

# What a `kind` makes; its keys are the parameters.
MATERIALS = {
    "elastic": Elastic,
    "prony": Prony,
    "prony_creep": Prony.from_creep,
    "tyre_tread": tyre_tread,
    "bulk_shear": BulkShear,
}
BASES = {"half_space": HalfSpace, "rigid": Rigid, "free": Free}
KINDS = {
    AbstractShift: {"wlf": WLF, "arrhenius": Arrhenius, "tabulated": TabulatedShift},
    AbstractShape: {
        "linear": Linear,
        "sinusoidal": Sinusoidal,
        "exponential": Exponential,
        "power_law": PowerLaw,
        "error_function": ErrorFunction,
    },
    AbstractGradedSolver: {"layering": Layering, "riccati": Riccati},
}


def extremes(temperature: np.ndarray | None) -> list[float]:
    """Returns the lowest and the highest temperature: laws hold in between."""
    return [] if temperature is None else [float(np.min(temperature)), float(np.max(temperature))]


class Block:
    """The materials of a scene, and the stack that is made of them.

    **Fields:**

    - `materials`: by name.
    - `errors`: what is known of the numbers of some of them, by name.
    - `notes`: what was understood of tables of moduli.
    - `builder`: what makes them of tables.
    """

    def __init__(self, folder: Path):
        self.materials: dict[str, AbstractMaterial] = {}
        self.errors: dict[str, Errors] = {}
        self.notes: list[str] = []
        self.builder = Builder(KINDS, {AbstractMaterial: self._named}, folder)

    def read_materials(self, scene: Section, temperature: np.ndarray | None) -> None:
        content = scene.get("materials")
        if not isinstance(content, dict):
            raise ValueError(
                f"[materials] must hold tables [materials.NAME], got {short(content)}."
            )
        kinds = {**MATERIALS, "tabulated": self._tabulated}
        for name, entry in content.items():
            understood, place, path = len(self.notes), f"[materials.{name}]", None
            if isinstance(entry, dict) and "errors" in entry:
                path = self.builder.path(Section(place, entry, entry), "errors")
                entry = {key: value for key, value in entry.items() if key != "errors"}
            self.materials[name] = self.builder.build_kind(place, entry, kinds)
            if path is not None:
                with within(f"{place} `errors`:"):
                    self.errors[name] = read_errors(path)
                    with within(f"`path={path}`:"):
                        check_errors(self.errors[name], self.materials[name])
            self.notes[understood:] = [f"{name}: {note}" for note in self.notes[understood:]]
        for name, material in self.materials.items():
            for at in extremes(temperature):
                with within(f"[load] `temperature`, of [materials.{name}]:"):
                    material.at(at)

    def stack(self, scene: Section) -> Stack:
        entries = scene.get("layers", [])
        if not isinstance(entries, list):
            raise ValueError(f"`layers` must be a list of tables [[layers]], got {short(entries)}.")
        layers = [self._layer(f"[layers[{i}]]", entry) for i, entry in enumerate(entries)]
        for i, layer in enumerate(layers):
            if sentence := unusual("thickness", float(layer.thickness)):
                self.notes.append(f"layers[{i}]: {sentence}")
        base = self.builder.build_kind("[base]", scene.get("base"), BASES)
        with within("[base]"):
            return Stack(layers=layers, base=base)

    def _layer(self, place: str, entry: Any) -> Layer | GradedLayer:
        keys = (*keys_of(Layer), *keys_of(Blend))
        section = Section(place, entry, keys)
        if "bottom" not in section.content and "top" not in section.content:
            return self.builder.build(section, Layer)
        if "material" in section.content:
            raise ValueError(f"{place} has `material` besides `bottom` or `top`: give one.")
        profile = self.builder.build(section, Blend)
        return self.builder.build(section, GradedLayer, profile=profile)

    def _named(self, section: Section, key: str) -> AbstractMaterial:
        name = section.text(key)
        if name not in self.materials:
            raise ValueError(
                f"{section.place} `{key}` = {name!r} is not in [materials]; "
                f"{nearest(name, self.materials)}"
            )
        return self.materials[name]

    def _tabulated(
        self,
        path: os.PathLike,
        columns: Annotated[dict, *DIMENSIONS] | None = None,
        units: Annotated[dict, *UNITS] | None = None,
        deformation: str | None = None,
        sheet: str | None = None,
        step: str | None = None,
        poisson: ScalarLike = 0.5,
        extrapolate: Literal["refuse", "plateau"] = "refuse",
        shift: AbstractShift | None = None,
    ) -> Tabulated:
        """The material of a table of moduli; what was understood of it goes to the notes."""
        try:
            found = read_moduli(
                path,
                kind="frequency",
                columns=columns,
                units=units,
                deformation=deformation,
                sheet=sheet,
                step=step,
                poisson=poisson,
            )
        except ValueError as error:
            advice = "`graded-contact fit FILE` reads more, and writes a material for a scene."
            raise ValueError(f"{error} {advice}") from error
        self.notes += found.history
        return Tabulated(*found.table(), poisson, shift=shift, extrapolate=extrapolate)
