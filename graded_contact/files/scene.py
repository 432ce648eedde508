"""Scenes: a block, a surface, loads and velocities, as a TOML file describes them.

The keys of a scene are the names of arguments of this package, in SI units, angles in radians; a
`kind` names what takes them, see `MATERIALS`, `BASES` and `KINDS`. Paths are relative to the scene
file, or begin with `~`.

    [surface]             kind = "self_affine": the fields of `SelfAffine` (`q_low` is 2π over the
                          longest edge unless given), `roll_off`, `seed`, `amplitudes`, and a
                          table [grid] with `shape` and `size`; or kind = "file": the arguments of
                          `read_surface`, and `rms_height` or `rms_slope` to rescale to
    [materials.NAME]      kind = "elastic", "prony", "prony_creep", "tabulated", "tyre_tread" or
                          "bulk_shear", whose two parts are NAMEs of materials above it; the two
                          series may have `measured` = {omega = [lowest, highest], temperature =
                          [lowest, highest]}, where they follow data
    [[layers]]            `material` = a NAME, `thickness`; from the loaded surface downwards. A
                          graded one has, instead of `material`, the NAMEs `bottom` and `top`, and
                          may have `shape` ("linear", {kind = "exponential", rate = 2.0}, ...) and
                          `mixing` as in `Blend`
    [base]                kind = "half_space" with a `material`, "rigid" or "free"
    [load]                `pressure` and `velocity`: a number, a list, or {from, to, points},
                          equally spaced in the logarithm; `direction` of the velocity from the
                          x axis; `temperature` [K]; `extrapolate` = true to allow friction from
                          frequencies at which a material was not measured
    [solver]              `rtol` and the numbers of `DouglasRachford`; `graded` = "layering" or
                          "riccati", or a table with that `kind` and its `rtol`, for graded layers
    [output]              `name`, `directory`, and which `fields` to keep: "last", "every" or "none"
    [design]              what the command `design` is to do, see `files/design_scene.py`
"""

import dataclasses
import os
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float, ScalarLike

from .._checks import as_float, check_positive, check_tolerance, check_values
from .._memory import check_points
from ..contact.douglas_rachford import DouglasRachford
from ..response.grading import AbstractGradedSolver
from ..response.layering import Layering
from ..response.profile import Blend
from ..response.riccati import Riccati
from ..response.shape import AbstractShape, ErrorFunction, Exponential, Linear, PowerLaw, Sinusoidal
from ..response.stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack
from ..rheology.library import tyre_tread
from ..rheology.material import AbstractMaterial, BulkShear, Elastic, Prony
from ..rheology.shift import WLF, AbstractShift, Arrhenius
from ..rheology.tabulated import Tabulated
from ..rheology.tabulated_shift import TabulatedShift
from .moduli.quantities import DIMENSIONS, UNITS
from .moduli.reading import read_moduli
from .output import check_name, full_path
from .signatures import Builder, keys_of
from .surfaces import RandomSurface, SurfaceFile, parse_surface
from .toml import Section, nearest, parse_toml, short, within

KEYS = (
    "title", "surface", "grid", "materials", "layers", "base", "load", "solver", "output", "design",
)  # fmt: skip
SOLVER_KEYS = tuple(
    field.name for field in dataclasses.fields(DouglasRachford) if field.metadata.get("static")
)
LOAD_KEYS = ("pressure", "velocity", "direction", "temperature", "extrapolate")
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


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """What to compute, as a scene file says.

    **Fields:**

    - `text`: the TOML text.
    - `title`: one line for people.
    - `stack`: the block, at the temperature of the scene.
    - `surface`: where the surface comes from; `build_surface` makes it.
    - `pressure`, `velocity`: mean pressures [Pa] and velocities [m/s], one axis each.
    - `direction`: of the velocity from the x axis [rad].
    - `extrapolate`: whether friction may come from where a material was not measured.
    - `solver`, `rtol`: algorithm of the contact and wanted relative error.
    - `graded`: the solver of graded layers.
    - `name`, `directory`: of the output; None leaves them to the caller.
    - `keep`: which fields the results hold: "last", "every" or "none".
    - `inputs`: the files that the scene names.
    - `notes`: what was understood of its tables of moduli, one sentence each.
    """

    text: str
    title: str
    stack: Stack
    surface: RandomSurface | SurfaceFile
    pressure: Float[np.ndarray, " pressures"]
    velocity: Float[np.ndarray, " velocities"]
    direction: float
    extrapolate: bool
    solver: DouglasRachford
    rtol: float
    graded: AbstractGradedSolver
    name: str | None
    directory: Path | None
    keep: str
    inputs: tuple[Path, ...]
    notes: tuple[str, ...] = ()


def read_scene(path: str | os.PathLike) -> Scene:
    """Returns the scene that a TOML file describes; see the module's text for its keys.

    A missing file raises `FileNotFoundError`; whatever is wrong in it `ValueError`, naming the
    table and the key.

    **Arguments:**

    - `path`: of the TOML file.

    **Returns:** what it describes.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    with within(f"{path}:"):
        return parse_scene(path.read_text(encoding="utf-8"), path.parent)


def parse_scene(text: str, folder: str | os.PathLike = ".") -> Scene:
    """Returns the scene that a TOML text describes; its paths are relative to `folder`."""
    folder = Path(folder)
    scene = Section("the scene", parse_toml(text), KEYS)
    load = Section("[load]", scene.get("load"), LOAD_KEYS)
    solver = Section("[solver]", scene.get("solver", {}), ("rtol", "graded", *SOLVER_KEYS))
    output = Section("[output]", scene.get("output", {}), ("name", "directory", "fields"))
    block = _Block(folder)
    block.read_materials(scene, load)
    surface = parse_surface(scene, block.builder)
    pressure, velocity = load.values("pressure"), load.values("velocity")
    with within(load.place):
        check_points("pressure` x `velocity", pressure.size * velocity.size)
        check_positive("pressure", pressure, "[Pa]")
        check_values("velocity", velocity, "a velocity [m/s] must be finite")
        direction = load.number("direction", 0.0)
        full = 2 * np.pi
        reason = "an angle [rad] lies between -2π and 2π"
        check_values("direction", direction, reason, at_least=-full, at_most=full)
    rtol, graded = block.builder.build(solver, _accuracy)
    with within(solver.place):
        check_tolerance("rtol", rtol, as_float(pressure))
    name, directory = output.text("name", None), output.text("directory", None)
    with within(output.place):
        if name is not None:
            check_name(name)
        if directory is not None:
            directory = full_path(directory, folder)
    materials = block.materials.values()
    return Scene(
        text=text,
        title=scene.text("title", ""),
        stack=block.stack(scene),
        surface=surface,
        pressure=pressure,
        velocity=velocity,
        direction=direction,
        extrapolate=load.truth("extrapolate", False)
        or any(isinstance(m, Tabulated) and m.extrapolate == "plateau" for m in materials),
        solver=block.builder.build(solver, DouglasRachford),
        rtol=rtol,
        graded=graded,
        name=name,
        directory=directory,
        keep=output.choice("fields", ("last", "every", "none"), "last"),
        inputs=tuple(block.builder.paths),
        notes=tuple(block.notes),
    )


def _accuracy(
    rtol: ScalarLike = 1e-6,
    graded: AbstractGradedSolver = Layering(),  # noqa: B008 (immutable)
) -> tuple[ScalarLike, AbstractGradedSolver]:
    return rtol, graded


class _Block:
    """The materials of a scene, and the stack that is made of them."""

    def __init__(self, folder: Path):
        self.materials: dict[str, AbstractMaterial] = {}
        self.notes: list[str] = []
        self.builder = Builder(KINDS, {AbstractMaterial: self._named}, folder)

    def read_materials(self, scene: Section, load: Section) -> None:
        content = scene.get("materials")
        if not isinstance(content, dict):
            raise ValueError(
                f"[materials] must hold tables [materials.NAME], got {short(content)}."
            )
        kinds = {**MATERIALS, "tabulated": self._tabulated}
        for name, entry in content.items():
            understood = len(self.notes)
            self.materials[name] = self.builder.build_kind(f"[materials.{name}]", entry, kinds)
            self.notes[understood:] = [f"{name}: {note}" for note in self.notes[understood:]]
        if "temperature" in load.content:
            temperature = load.number("temperature")
            for name, material in self.materials.items():
                with within(f"[load] `temperature`, of [materials.{name}]:"):
                    self.materials[name] = material.at(temperature)

    def stack(self, scene: Section) -> Stack:
        entries = scene.get("layers", [])
        if not isinstance(entries, list):
            raise ValueError(f"`layers` must be a list of tables [[layers]], got {short(entries)}.")
        layers = [self._layer(f"[layers[{i}]]", entry) for i, entry in enumerate(entries)]
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
                poisson=poisson,
            )
        except ValueError as error:
            advice = "`graded-contact fit FILE` reads more, and writes a material for a scene."
            raise ValueError(f"{error} {advice}") from error
        self.notes += found.history
        return Tabulated(*found.table(), poisson, shift=shift, extrapolate=extrapolate)
