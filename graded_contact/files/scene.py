"""Scenes: a block, a surface, loads and velocities, as a TOML file describes them.

The keys of a scene are the names of arguments of this package, in SI units, angles in radians; a
`kind` names what takes them. The site lists all of them. Paths are relative to the scene file, or
begin with `~`.
"""

import dataclasses
import itertools
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import jax
import numpy as np
from jaxtyping import ArrayLike, Float, PRNGKeyArray, ScalarLike

from ..contact.nested_solve import DouglasRachford
from ..contact.problem import RTOL
from ..core.checks import as_float, check_positive, check_tolerance, check_values, check_whole
from ..core.display import shown
from ..core.memory import check_points
from ..core.parameters import paths, with_values
from ..core.warnings import unusual
from ..fields.grid import Grid
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
from ..roughness.spectrum import SelfAffine
from ..roughness.surface import Surface, random_surface, rescale
from .moduli.reading import read_moduli
from .parameter_covariance import Errors, check_errors, read_errors
from .paths import check_name, existing_file
from .schema import (
    LARGEST,
    LINEAR,
    LOGARITHMIC,
    ROOT,
    Key,
    Reader,
    check_keys,
    keys_of,
    kind_of,
    nearest,
    parse_toml,
    within,
)
from .topography.reading import read_surface
from .units import DIMENSIONS, UNITS

# What a `kind` makes; its keys are the parameters. Tables of moduli are made by `Block`.
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
ERRORS = Key("errors", os.PathLike, None)  # of every material

Values = Annotated[Float[np.ndarray, " _"], LOGARITHMIC]


@shown()
class RandomSurface(NamedTuple):
    """A surface to be drawn: arguments of `random_surface`, with the seed of its key.

    **Fields:**

    - `spectrum`, `grid`: of the surface.
    - `seed`: of the random surface, or of the first.
    - `amplitudes`: as in `random_surface`.
    - `seeds`: number of surfaces, drawn from `seed`, `seed` + 1, ...; one axis of the results.
    """

    spectrum: SelfAffine
    grid: Grid
    seed: int = 0
    amplitudes: Literal["exact", "gaussian"] = "exact"
    seeds: int | None = None

    def build(self) -> Surface:
        """Returns the (first) surface, drawn anew; the same one each time."""
        with within("[surface]"):
            return self.drawn(self.seed)

    def drawn(self, seed: ArrayLike) -> Surface:
        """Returns the surface of another seed, which JAX may trace."""
        return self.of_key(jax.random.key(seed))

    def of_key(self, key: PRNGKeyArray) -> Surface:
        """Returns the surface of a random key."""
        return random_surface(self.spectrum, self.grid, key, amplitudes=self.amplitudes)


@shown()
class SurfaceFile(NamedTuple):
    """A surface to be read: arguments of `read_surface` and of `rescale`."""

    arguments: dict[str, Any]
    target: dict[str, float]

    def build(self) -> Surface:
        """Returns the surface, read and rescaled."""
        with within("[surface]"):
            surface = read_surface(**self.arguments)
            return rescale(surface, **self.target) if self.target else surface


SURFACES: dict[str, Mapping[Callable, tuple[Key, ...]]] = {
    "self_affine": {
        SelfAffine: tuple(
            key._replace(default=None) if key.name == "q_low" else key
            for key in keys_of(SelfAffine)
        ),
        RandomSurface: keys_of(RandomSurface, "spectrum", "grid"),
    },
    "file": {read_surface: keys_of(read_surface), rescale: keys_of(rescale, "surface")},
}


@dataclasses.dataclass(frozen=True)
class Tables:
    """The tables of a scene; those that need others are converted after them.

    **Fields:**

    - `surface`: of the rough counter-body, with a `kind`.
    - `materials`: tables [materials.NAME], each with a `kind`; one may use those above it.
    - `base`: below the layers, with a `kind`.
    - `load`: pressures, velocities, temperatures.
    - `title`: one line for the reader.
    - `grid`: of a random surface.
    - `layers`: tables [[layers]], from the loaded surface downwards. A graded one has, instead of
      `material`, the NAMEs `bottom` and `top`.
    - `sweep`: other values for numbers of the block, by paths as in `with_values`:
      "layers[0].thickness" = [1e-5, 1e-4]. A temperature acts on the block with these values.
    - `solver`: tolerance and algorithm.
    - `output`: names and fields of the results.
    - `design`: what the command `design` does.
    """

    surface: dict[str, object]
    materials: dict[str, object]
    base: dict[str, object]
    load: dict[str, object]
    title: str = ""
    grid: Grid | None = None
    layers: list[dict] = dataclasses.field(default_factory=list)
    sweep: dict[str, Values] = dataclasses.field(default_factory=dict)
    solver: dict[str, object] = dataclasses.field(default_factory=dict)
    output: dict[str, object] = dataclasses.field(default_factory=dict)
    design: dict[str, object] | None = None


@shown("title", "stack", "surface", "sweep", "temperature", "pressure", "velocity")
@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """What to compute: block, surface and loads of a scene file.

    Its fields are keys of the tables [load], [solver] and [output], see `KEYS`.

    **Fields:**

    - `text`: the TOML text.
    - `title`: one line for the reader.
    - `stack`: the block of the file; `block` returns that of a point.
    - `surface`: where the surface comes from; `build_surface` makes it.
    - `sweep`: other values for numbers of the stack, by their paths.
    - `pressure`: mean pressures [Pa], an axis.
    - `velocity`: sliding velocities [m/s], an axis.
    - `temperature`: of the block [K], one or an axis; None leaves the materials unchanged.
    - `direction`: of the velocity from the x axis [rad]. (In Python two numbers are one velocity,
      (vx, vy).)
    - `extrapolate`: true allows friction from frequencies at which a material was not measured.
    - `solver`: algorithm of the contact.
    - `tolerance`: `friction_rtol` or `rtol` of `slide`, by its name.
    - `graded_solver`: the solver of graded layers.
    - `name`: begins the names of the files of results.
    - `directory`: folder of the results, relative to the scene.
    - `fields`: solves whose fields over the surface are stored.
    - `errors`: of materials: name, material of the stack, and errors of its numbers.
    - `inputs`: the files that the scene names.
    - `notes`: what was understood of its tables of moduli, one sentence each.
    """

    text: str
    title: str
    stack: Stack
    surface: RandomSurface | SurfaceFile
    sweep: dict[str, Values]
    pressure: Values
    velocity: Values
    temperature: Annotated[Float[np.ndarray, "*temperatures"], LINEAR] | None = None
    direction: float = 0.0
    extrapolate: bool = False
    solver: DouglasRachford
    tolerance: Mapping[str, Any]
    graded_solver: AbstractGradedSolver = Layering()  # noqa: RUF009 (immutable)
    name: str | None = None
    directory: Path | None = None
    fields: Literal["last", "every", "none"] = "last"
    errors: tuple[tuple[str, AbstractMaterial, Errors], ...]
    inputs: tuple[Path, ...]
    notes: tuple[str, ...] = ()

    @property
    def axes(self) -> dict[str, np.ndarray]:
        """What is varied, by name, in the order of the results' axes."""
        found = dict(self.sweep)
        if self.temperature is not None and self.temperature.ndim:
            found["temperature"] = self.temperature
        if isinstance(self.surface, RandomSurface) and self.surface.seeds is not None:
            found["seed"] = self.surface.seed + np.arange(self.surface.seeds)
        return {**found, "pressure": self.pressure, "velocity": self.velocity}

    @property
    def num_solves(self) -> int:
        """How many combinations there are of what is varied."""
        return math.prod(len(values) for values in self.axes.values())

    def block(self, point: Mapping[str, Any]) -> Stack:
        """Returns the stack at a point, given by its numbers on the axes; JAX may trace them."""
        values = {path: point[path] for path in self.sweep}
        stack = with_values(self.stack, values) if values else self.stack
        temperature = point.get("temperature", self.temperature)
        return stack if temperature is None else stack.at(temperature)

    def blocks(self) -> Iterator[tuple[dict[str, float], Stack]]:
        """Yields the stacks that differ, each with its numbers of [sweep] and its temperature."""
        axes = {name: at for name, at in self.axes.items() if name in (*self.sweep, "temperature")}
        for numbers in itertools.product(*axes.values()):
            point = dict(zip(axes, numbers, strict=True))
            yield point, self.block(point)


def read_scene(path: str | os.PathLike) -> Scene:
    """Returns the scene that a TOML file describes; the site lists its keys.

    A missing file raises `FileNotFoundError`. An error in the file raises `ValueError` with the
    table and the key.

    **Arguments:**

    - `path`: of the TOML file.

    **Returns:** the scene.
    """
    path = existing_file(path, at_most=LARGEST)
    with within(f"{path}:"):
        return parse_scene(path.read_text(encoding="utf-8"), path.parent)


def parse_scene(text: str, folder: str | os.PathLike = ".") -> Scene:
    """Returns the scene that a TOML text describes; its paths are relative to `folder`."""
    block = Block(Path(folder))
    reader = block.reader
    tables: Tables = reader.build(ROOT, parse_toml(text), Tables)
    (load,) = reader.arguments("[load]", tables.load, KEYS["[load]"])
    solver, tolerance, accuracy = reader.arguments(
        "[solver]", tables.solver, keys_of(DouglasRachford), keys_of(_tolerance), KEYS["[solver]"]
    )
    block.read_materials(tables.materials, load.get("temperature"))
    if any(
        isinstance(m, Tabulated) and m.extrapolate == "plateau" for m in block.materials.values()
    ):
        load["extrapolate"] = True
    with within("[load]"):
        check_positive("pressure", load["pressure"], "[Pa]")
        check_values("velocity", load["velocity"], "a velocity [m/s] must be finite")
        full, reason = 2 * np.pi, "an angle [rad] lies between -2π and 2π"
        check_values("direction", load.get("direction", 0.0), reason, at_least=-full, at_most=full)
    with within("[solver]"):
        algorithm = {"solver": DouglasRachford(**solver), "tolerance": _tolerance(**tolerance)}
        for name, rtol in algorithm["tolerance"].items():
            check_tolerance(name, rtol, as_float(load["pressure"]))
    surface, stack, inputs = _surface(tables, reader), block.stack(tables), tuple(reader.paths)
    (output,) = reader.arguments("[output]", tables.output, KEYS["[output]"])
    with within("[output]"):
        if "name" in output:
            check_name(output["name"])
    found = Scene(
        text=text,
        title=tables.title,
        surface=surface,
        stack=stack,
        sweep=tables.sweep,
        errors=tuple(
            (name, block.materials[name], errors) for name, errors in block.errors.items()
        ),
        inputs=inputs,
        notes=tuple(block.notes),
        **algorithm,
        **load,
        **accuracy,
        **output,
    )
    _check_sweep(found)
    check_points("` x `".join(found.axes), found.num_solves)
    return found


def _tolerance(rtol: float | None = None, friction_rtol: float | None = None) -> dict[str, float]:
    """The tolerance of `slide`, by its name.

    **Arguments:**

    - `rtol`: relative error of the contact pressure [1]; 5e-5 if neither tolerance is given, which
      gives friction to 1e-4.
    - `friction_rtol`: relative error of friction and contact area [1].
    """
    if friction_rtol is None:
        return {"rtol": RTOL if rtol is None else rtol}
    if rtol is not None:
        raise ValueError("Give `rtol` or `friction_rtol`, not both.")
    return {"friction_rtol": friction_rtol}


def _surface(tables: Tables, reader: Reader) -> RandomSurface | SurfaceFile:
    """Where the surface of a scene comes from."""
    place, keys = "[surface]", {kind: [*takers.values()] for kind, takers in SURFACES.items()}
    kind, entries = kind_of(place, tables.surface, {name: sum(keys[name], ()) for name in keys})
    if kind == "file":
        if tables.grid is not None:
            raise ValueError(
                '[grid] belongs to a surface of kind "self_affine"; the points of a file are '
                "resampled by `shape` in [surface]."
            )
        if all(key.name in entries for key in keys[kind][1]):
            raise ValueError(f"{place} takes `rms_height` or `rms_slope` to rescale to, not both.")
        return SurfaceFile(*reader.arguments(place, entries, *keys[kind]))
    if tables.grid is None:
        raise ValueError(f"{ROOT} lacks the key `grid`.")
    spectrum, drawn = reader.arguments(place, entries, *keys[kind])
    # Unless given, the longest wave is as long as the longest edge.
    spectrum.setdefault("q_low", 2 * np.pi / float(np.max(tables.grid.size)))
    with within(place):
        found = RandomSurface(SelfAffine(**spectrum), tables.grid, **drawn)
        if found.seeds is not None:
            check_whole("seeds", found.seeds, 1)
            check_points("seeds", found.seeds)
    return found


def _extremes(temperature: np.ndarray | None) -> list[float]:
    """The lowest and the highest temperature: laws hold in between."""
    return [] if temperature is None else [float(np.min(temperature)), float(np.max(temperature))]


def _check_sweep(scene: Scene) -> None:
    """Raises `ValueError` unless every value makes a block, at each temperature."""
    with within("[sweep]"):
        check_paths(scene.sweep, scene.stack)
        for path, values in scene.sweep.items():
            for value in (np.min(values), np.max(values)):  # what is allowed has no gaps
                changed = with_values(scene.stack, {path: value})
                for at in _extremes(scene.temperature):
                    changed.at(at)


def check_paths(given: Iterable[str], stack: Stack) -> None:
    """Raises `ValueError` unless all name numbers of the block."""
    known = paths(stack)
    whole = [path for path in known if not path.endswith("]")]  # entries of arrays are many
    for path in given:
        if path not in known:
            raise ValueError(f"`{path}` is no number of the block; {nearest(path, whole)}")


class Block:
    """The materials of a scene, and the stack that is made of them.

    **Fields:**

    - `materials`: by name.
    - `errors`: of the numbers of some of them, by name.
    - `notes`: what was understood of tables of moduli.
    - `reader`: converts the tables.
    """

    def __init__(self, folder: Path):
        self.materials: dict[str, AbstractMaterial] = {}
        self.errors: dict[str, Errors] = {}
        self.notes: list[str] = []
        self.reader = Reader(folder, KINDS, {AbstractMaterial: self._named})

    def read_materials(self, tables: Mapping[str, Any], temperature: np.ndarray | None) -> None:
        """Makes the materials of [materials], each of which may use those above it."""
        kinds = {**MATERIALS, "tabulated": self.tabulated}
        keys = {kind: (*keys_of(make), ERRORS) for kind, make in kinds.items()}
        for name, table in tables.items():
            understood, place = len(self.notes), f"[materials.{name}]"
            kind, entries = kind_of(place, table, keys)
            found, beside = self.reader.arguments(place, entries, keys[kind][:-1], (ERRORS,))
            with within(place):
                self.materials[name] = kinds[kind](**found)
            if beside:
                with within(f"{place} `errors`:"):
                    self.errors[name] = read_errors(beside["errors"])
                    with within(f"`path={beside['errors']}`:"):
                        check_errors(self.errors[name], self.materials[name])
            self.notes[understood:] = [f"{name}: {note}" for note in self.notes[understood:]]
        for name, material in self.materials.items():
            for at in _extremes(temperature):
                with within(f"[load] `temperature`, of [materials.{name}]:"):
                    material.at(at)

    def stack(self, tables: Tables) -> Stack:
        """Returns the stack of the layers and the base."""
        layers = [self._layer(f"[layers[{i}]]", table) for i, table in enumerate(tables.layers)]
        for i, layer in enumerate(layers):
            if sentence := unusual("thickness", float(layer.thickness)):
                self.notes.append(f"layers[{i}]: {sentence}")
        base = self.reader.build_kind("[base]", tables.base, BASES)
        with within("[base]"):
            return Stack(layers=layers, base=base)

    def _layer(self, place: str, table: dict[str, Any]) -> Layer | GradedLayer:
        check_keys(place, table, [key.name for key in (*keys_of(Layer), *keys_of(Blend))])
        if "bottom" not in table and "top" not in table:
            return self.reader.build(place, table, Layer)
        if "material" in table:
            raise ValueError(f"{place} has `material` besides `bottom` or `top`: give one.")
        thickness, profile = self.reader.arguments(
            place, table, keys_of(GradedLayer), keys_of(Blend)
        )
        with within(place):
            return GradedLayer(profile=Blend(**profile), **thickness)

    def _named(self, place: str, key: str, value: Any) -> AbstractMaterial:
        name = self.reader.value(place, Key(key, str), value)
        if name not in self.materials:
            raise ValueError(
                f"{place} `{key}` = {name!r} is not in [materials]; {nearest(name, self.materials)}"
            )
        return self.materials[name]

    def tabulated(
        self,
        path: os.PathLike,
        columns: dict[Literal[tuple(DIMENSIONS)], object] | None = None,
        units: dict[Literal[tuple(UNITS)], object] | None = None,
        deformation: str | None = None,
        sheet: str | None = None,
        step: str | None = None,
        poisson: ScalarLike = 0.5,
        extrapolate: Literal["refuse", "plateau"] = "refuse",
        shift: AbstractShift | None = None,
    ) -> Tabulated:
        """Returns the material of a table of moduli; its history goes to the notes.

        **Arguments:**

        - `path`: of the table, text or Excel.
        - `columns`: names of quantities and their columns, by name or by number from 1.
        - `units`: of the columns, if the table does not state them.
        - `deformation`: "tension" or "shear"; moduli in shear become Young's moduli.
        - `sheet`: of a workbook.
        - `step`: of a test with several steps.
        - `poisson`: Poisson's ratio [1].
        - `extrapolate`: "plateau" continues the moduli outside the table, "refuse" does not.
        - `shift`: time-temperature shift.
        """
        options = {"columns": columns, "units": units, "deformation": deformation}
        try:
            found = read_moduli(
                path, kind="frequency", sheet=sheet, step=step, poisson=poisson, **options
            )
        except ValueError as error:
            advice = "`graded-contact fit FILE` reads more, and writes a material for a scene."
            raise ValueError(f"{error} {advice}") from error
        self.notes += found.history
        return Tabulated(*found.table(), poisson, shift=shift, extrapolate=extrapolate)


# The keys of tables that are fields of a scene.
KEYS = {
    place: tuple(key for key in keys_of(Scene) if key.name in names)
    for place, names in {
        "[load]": ("pressure", "velocity", "temperature", "direction", "extrapolate"),
        "[solver]": ("graded_solver",),
        "[output]": ("name", "directory", "fields"),
    }.items()
}
