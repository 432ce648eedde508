"""Scenes: a block, a surface, loads and velocities, read from a TOML file and run.

The keys of a scene are the names of fields and arguments of this package, in SI units, angles in
radians; `KEYS` lists them. Paths are relative to the scene file.

    [surface]             kind = "self_affine": the fields of `SelfAffine` (`q_low` is 2π over the
                          longest edge unless given), `roll_off`, `seed`, `amplitudes`, and a
                          table [grid] with `shape` and `size`; or kind = "file": the arguments of
                          `read_surface`, and `rms_height` or `rms_slope` to rescale to
    [materials.NAME]      kind = "elastic", "prony", "prony_creep", "tabulated" or "tyre_tread"; the
                          two series may have `measured` = {omega = [lowest, highest], temperature =
                          [lowest, highest]}, where they follow data
    [[layers]]            `material` = a NAME, `thickness`; from the loaded surface downwards. A
                          graded one has, instead of `material`, the NAMEs `bottom` and `top`, and
                          may have `shape` ("linear", "sinusoidal") and `mixing` as in `Blend`
    [base]                kind = "half_space" with a `material`, "rigid" or "free"
    [load]                `pressure` and `velocity`: a number, a list, or {from, to, points},
                          equally spaced in the logarithm; `direction` of the velocity from the
                          x axis; `temperature` [K]; `extrapolate` = true to allow friction from
                          frequencies at which a material was not measured
    [solver]              `rtol` and the fields of `DouglasRachford`
    [output]              `name`, `directory`, and which `fields` to keep: "last", "every" or "none"
    [design]              what the command `design` is to do, see `studies/design_scene.py`
"""

import dataclasses
import hashlib
import math
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from .._checks import as_float, check_positive, check_tolerance, check_values
from .._memory import check_memory, check_points, num_numbers, sliding_memory
from ..caveats import EXTRAPOLATED
from ..contact.douglas_rachford import DouglasRachford
from ..contact.observables import wave_frequencies
from ..contact.problem import RESULTS
from ..files.moduli.quantities import DIMENSIONS, UNITS
from ..files.moduli.reading import read_moduli
from ..files.output import check_name, folder_path
from ..files.results import (
    FAILED,
    FIELDS,
    NOT_STARTED,
    OBSERVABLES,
    Fields,
    Results,
    package_versions,
)
from ..files.toml import Table, nearest, parse_toml, short, within
from ..files.topography.reading import read_surface
from ..grid import Grid
from ..persson.mean_field import mean_field_friction
from ..response.profile import Blend
from ..response.shape import Linear, Sinusoidal
from ..response.stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack
from ..rheology.library import tyre_tread
from ..rheology.material import AbstractMaterial, Elastic, Prony
from ..rheology.measured import MeasuredRange, check_frequencies, coverage, is_unknown
from ..rheology.shift import WLF, AbstractShift, Arrhenius
from ..rheology.tabulated import Tabulated
from ..rheology.tabulated_shift import TabulatedShift
from ..sliding import slide
from ..spectrum import SelfAffine
from ..surface import Surface, random_surface, rescale
from .store import Point, Store, fingerprint

READ_ARGUMENTS = ("periodic", "shape", "size", "unit", "region", "fill", "rim", "channel")
SPECTRUM_FIELDS = ("rms_height", "rms_slope", "hurst", "q_low", "q_roll", "q_high")
TABLE_ARGUMENTS = ("columns", "units", "deformation", "sheet")
SHAPES = {"linear": Linear, "sinusoidal": Sinusoidal}
SOLVER_FIELDS = tuple(field.name for field in dataclasses.fields(DouglasRachford))

# The keys of every table; those that have a `kind` list them by kind.
KEYS: dict[str, Any] = {
    "scene": (
        "title", "surface", "grid", "materials", "layers", "base", "load", "solver", "output",
        "design",
    ),
    "surface": {
        "self_affine": (*SPECTRUM_FIELDS, "roll_off", "seed", "amplitudes"),
        "file": ("path", *READ_ARGUMENTS, "rms_height", "rms_slope"),
    },
    "grid": ("shape", "size"),
    "material": {
        "elastic": ("modulus", "poisson"),
        "prony": ("equilibrium", "strengths", "times", "poisson", "shift", "measured"),
        "prony_creep": ("glassy", "compliances", "times", "poisson", "shift", "measured"),
        "tabulated": ("path", *TABLE_ARGUMENTS, "poisson", "extrapolate", "shift"),
        "tyre_tread": ("poisson",),
    },
    "shift": {
        "wlf": ("c1", "c2", "reference"),
        "arrhenius": ("activation_energy", "reference"),
        "tabulated": ("temperatures", "log10_factors", "reference", "vertical_factors"),
    },
    "layers": ("material", "bottom", "top", "shape", "mixing", "thickness"),
    "base": {"half_space": ("material",), "rigid": (), "free": ()},
    "measured": ("omega", "temperature"),
    "load": ("pressure", "velocity", "direction", "temperature", "extrapolate"),
    "solver": ("rtol", *SOLVER_FIELDS),
    "output": ("name", "directory", "fields"),
}  # fmt: skip


class RandomSurface(NamedTuple):
    """A surface to be drawn: arguments of `random_surface`, with the seed of its key."""

    spectrum: SelfAffine
    grid: Grid
    seed: int
    amplitudes: Literal["exact", "gaussian"]


class SurfaceFile(NamedTuple):
    """A surface to be read: its path, arguments of `read_surface` and of `rescale`."""

    path: Path
    arguments: dict[str, Any]
    target: dict[str, float]


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
    - `solver`, `rtol`: algorithm and wanted relative error.
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
    name: str | None
    directory: Path | None
    keep: str
    inputs: tuple[Path, ...]
    notes: tuple[str, ...] = ()


def read_scene(path: str | os.PathLike) -> Scene:
    """Returns the scene that a TOML file describes; see the module's text for its keys.

    A missing file raises `FileNotFoundError`; whatever is wrong in it `ValueError`, naming the
    table and the key.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    with within(f"{path}:"):
        return parse_scene(path.read_text(encoding="utf-8"), path.parent)


def parse_scene(text: str, folder: str | os.PathLike = ".") -> Scene:
    """Returns the scene that a TOML text describes; its paths are relative to `folder`."""
    folder = Path(folder)
    scene = Table("the scene", parse_toml(text), KEYS["scene"])
    load = Table("[load]", scene.get("load"), KEYS["load"])
    solver = Table("[solver]", scene.get("solver", {}), KEYS["solver"])
    output = Table("[output]", scene.get("output", {}), KEYS["output"])
    materials, inputs, notes = _materials(scene, folder, load)
    surface = _surface(scene, folder)
    if isinstance(surface, SurfaceFile):
        inputs.append(surface.path)
    pressure, velocity = load.values("pressure"), load.values("velocity")
    with within(load.place):
        check_points("pressure` x `velocity", pressure.size * velocity.size)
        check_positive("pressure", pressure, "[Pa]")
        check_values("velocity", velocity, "a velocity [m/s] must be finite")
        direction = load.number("direction", 0.0)
        full = 2 * np.pi
        reason = "an angle [rad] lies between -2π and 2π"
        check_values("direction", direction, reason, at_least=-full, at_most=full)
    rtol = solver.number("rtol", 1e-6)
    with within(solver.place):
        check_tolerance("rtol", rtol, as_float(pressure))
        settings: dict[str, Any] = {
            key: solver.number(key) if key == "relaxation" else solver.whole(key)
            for key in SOLVER_FIELDS
            if key in solver.content
        }
        method = DouglasRachford(**settings)
    name, directory = output.text("name", None), output.text("directory", None)
    with within(output.place):
        if name is not None:
            check_name(name)
        if directory is not None:
            directory = folder_path(directory, folder)
    return Scene(
        text=text,
        title=scene.text("title", ""),
        stack=_stack(scene, materials),
        surface=surface,
        pressure=pressure,
        velocity=velocity,
        direction=direction,
        extrapolate=load.truth("extrapolate", False)
        or any(isinstance(m, Tabulated) and m.extrapolate == "plateau" for m in materials.values()),
        solver=method,
        rtol=rtol,
        name=name,
        directory=directory,
        keep=output.choice("fields", ("last", "every", "none"), "last"),
        inputs=tuple(inputs),
        notes=tuple(notes),
    )


def build_surface(scene: Scene) -> Surface:
    """Returns the surface of a scene, drawn or read from its file."""
    source = scene.surface
    check_scene(scene)
    with within("[surface]"):
        if isinstance(source, RandomSurface):
            key = jax.random.key(source.seed)
            return random_surface(source.spectrum, source.grid, key, amplitudes=source.amplitudes)
        surface = read_surface(source.path, **source.arguments)
        return rescale(surface, **source.target) if source.target else surface


def scene_memory(scene: Scene, shape: tuple[int, ...]) -> float:
    """Returns the bytes that a scene takes with a surface of this shape, in double precision."""
    kept = {"every": scene.pressure.size * scene.velocity.size, "last": 1, "none": 0}[scene.keep]
    numbers, askew = num_numbers(scene.stack), scene.direction != 0
    fields = (1 + len(FIELDS) * kept) * math.prod(shape) * 8  # the surface, and what is kept
    return fields + sliding_memory(shape, 8, numbers, askew, scene.solver.memory)


def check_scene(scene: Scene) -> None:
    """Raises `ValueError` if a scene with a random surface needs more memory than there is."""
    if isinstance(scene.surface, RandomSurface):
        with within("[grid]"):
            needed = partial(scene_memory, scene)
            check_memory("shape", scene.surface.grid.shape, needed, "this scene")


def run_scene(
    scene: Scene,
    *,
    surface: Surface | None = None,
    store: Store | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Results:
    """Returns friction, contact area and more of a scene at each of its pressures and velocities.

    A solve that does not converge is kept with its message, one that fails (a kernel that cannot
    be evaluated) with its reason, and the run goes on; a run that is interrupted (Ctrl-C) returns
    what it has, with NaN and "not started" for the rest. Every solve starts afresh: a start from
    the neighbouring velocity saves 2 to 12 % of the FFT pairs (measured with 13 and 41 velocities
    over four decades), costs a second compilation, and would make each result depend on the one
    before.

    **Arguments:**

    - `scene`: what to compute.
    - `surface`: the surface, if built before.
    - `store`: keeps each solve on disk as it ends; those that it has are not computed again.
    - `progress`: called after each solve with the number of finished solves and of all solves.

    **Raises:** `ValueError` for velocities that a table of moduli does not cover; `MemoryError`;
    `OSError` if the store cannot be written; `KeyboardInterrupt` if nothing had finished.
    """
    surface = build_surface(scene) if surface is None else surface
    check_frequencies_of(scene, surface)
    names = point_names(scene, surface)
    indices = list(np.ndindex(names.shape))
    with_fields = {"every": indices, "last": indices[-1:], "none": []}[scene.keep]
    points: dict[tuple[int, ...], Point] = {}
    for index in indices:
        point = None if store is None else store.read(str(names[index]))
        if point is not None and _is_whole(point, index in with_fields):
            points[index] = point
    if points and progress is not None:
        progress(len(points), len(indices))
    try:
        for index in [index for index in indices if index not in points]:
            point = _solve(scene, surface, index, index in with_fields)
            if store is not None:
                store.write(str(names[index]), point)
            points[index] = point
            if progress is not None:
                progress(len(points), len(indices))
    except KeyboardInterrupt:
        if not points:
            raise  # there is nothing to keep
    return _collect(scene, surface, names, points, with_fields)


def point_names(scene: Scene, surface: Surface) -> np.ndarray:
    """Returns a name for each solve of a scene by all that decides its numbers, for a store.

    Two scenes that have solves in common have names in common. The shape is that of the results.
    """
    versions = {key: package_versions()[key] for key in ("version_graded_contact", "version_jax")}
    common = fingerprint(
        versions, scene.stack, surface.heights, surface.measured, surface.grid, scene.solver,
        scene.rtol,
    )  # fmt: skip
    names = [
        [fingerprint(common, *_load(scene, i, j)) for j in range(len(scene.velocity))]
        for i in range(len(scene.pressure))
    ]
    return np.array(names)


def _load(scene: Scene, i: int, j: int) -> tuple[Array, Array]:
    """Pressure and velocity of one solve, as `slide` takes them."""
    velocity = velocity_vector(scene.velocity[j], scene.direction)
    return jnp.asarray(scene.pressure[i]), jnp.asarray(velocity)


def _solve(scene: Scene, surface: Surface, index: tuple[int, ...], with_fields: bool) -> Point:
    """One solve of a scene, or why there is none."""
    pressure, velocity = _load(scene, *index)
    inputs = {
        "pressure": np.asarray(pressure),
        "velocity": np.asarray(velocity),
        "scene": scene.text,
        **package_versions(),
    }
    try:
        sliding = slide(
            scene.stack,
            surface,
            pressure=pressure,
            velocity=velocity,
            solver=scene.solver,
            rtol=scene.rtol,
            throw=False,
        )
    except (ValueError, RuntimeError) as error:
        # Not the point's fault; compiled code tells it as an error of its own.
        if "RESOURCE_EXHAUSTED" in str(error):
            raise MemoryError(reason_of(error)) from error
        if "KeyboardInterrupt" in str(error):
            raise KeyboardInterrupt from error
        return Point(values={}, message=FAILED + reason_of(error), inputs=inputs)
    kept = (*OBSERVABLES, *FIELDS) if with_fields else OBSERVABLES
    values = {name: np.asarray(getattr(sliding, name)) for name in kept}
    return Point(values=values, message=str(RESULTS[sliding.result]), inputs=inputs)


def reason_of(error: Exception) -> str:
    """Returns what an error says, without the traceback that compiled code puts around it."""
    return str(error).rpartition("Error: ")[2].partition("\n\n")[0].strip()


def _is_whole(point: Point, with_fields: bool) -> bool:
    wanted = {*OBSERVABLES, *FIELDS} if with_fields else {*OBSERVABLES}
    return point.message.startswith(FAILED) or wanted <= point.values.keys()


def _collect(
    scene: Scene,
    surface: Surface,
    names: np.ndarray,
    points: dict[tuple[int, ...], Point],
    with_fields: list[tuple[int, ...]],
) -> Results:
    """The results of a scene from its solves, those that there are."""
    values = {name: np.full(names.shape, np.nan, surface.heights.dtype) for name in OBSERVABLES}
    message, fields = np.full(names.shape, NOT_STARTED, object), {}
    for index, point in points.items():
        message[index] = point.message
        if not point.values:
            continue
        for name in OBSERVABLES:
            values[name][index] = point.values[name]
        if index in with_fields:
            fields[index] = Fields(**{name: point.values[name] for name in FIELDS})
    return Results(
        pressure=scene.pressure,
        velocity=scene.velocity,
        **values,
        message=message.astype(str),
        point=names,
        surface=surface,
        fields=fields,
        attributes=_attributes(scene, surface, values["error"], message),
    )


def velocity_vector(speed: ArrayLike, direction: float) -> np.ndarray:
    """Returns the velocity as `slide` takes it: one number along x, otherwise two components."""
    if direction == 0:
        return np.asarray(speed)
    unit = np.array([np.cos(direction), np.sin(direction)])
    # Rounding of a right angle would excite frequencies near zero.
    return np.asarray(speed) * np.where(np.abs(unit) < 1e-12, 0, unit)


def _attributes(scene: Scene, surface: Surface, error: np.ndarray, message: np.ndarray) -> dict:
    digests = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path}" for path in scene.inputs]
    attributes = {
        "title": scene.title,
        "scene": scene.text,
        "inputs": "\n".join(digests),
        "moduli": "\n".join(scene.notes),
        "dtype": str(surface.heights.dtype),
        "direction": scene.direction,
        "rtol": scene.rtol,
        "largest_error": float(np.fmax.reduce(error, axis=None)),
        "num_solves": message.size,
        "num_converged": int(np.sum(message == "")),
        **package_versions(),
    }
    if isinstance(scene.surface, RandomSurface):
        attributes["seed"] = scene.surface.seed
    return attributes


def check_frequencies_of(scene: Scene, surface: Surface) -> None:
    """Refuses, before the first solve, friction of frequencies that no material was measured at.

    What a table of moduli does not hold is refused whatever its share. A series is refused if more
    than 1 % of the friction at some velocity comes from where it only extrapolates, by the mean
    field of the surface at the highest pressure, unless [load] has `extrapolate = true` or a table
    of moduli `extrapolate = "plateau"`.
    """
    with within("[load] `velocity` and the surface:"):
        check_frequencies(scene.stack, _excited(scene, surface.grid))

    def shares() -> np.ndarray:
        return np.array([
            mean_field_friction(
                scene.stack,
                surface,
                pressure=np.max(scene.pressure),
                velocity=velocity_vector(v, scene.direction),
                throw=False,
            ).extrapolated_friction
            for v in scene.velocity
        ])  # fmt: skip

    refuse_extrapolated(scene, surface.grid, shares)


def refuse_extrapolated(scene: Scene, grid: Grid, friction_shares: Callable[[], ArrayLike]) -> None:
    """Refuses friction that comes from where a material only extrapolates, unless that is allowed.

    **Arguments:**

    - `scene`: block and velocities.
    - `grid`: of its surface.
    - `friction_shares`: returns the share [1] at each velocity; called if any wave is outside.

    **Raises:** `ValueError` for a share of more than 1 %.
    """
    found, excited = coverage(scene.stack), _excited(scene, grid)
    if scene.extrapolate or found is None:
        return
    low, high = map(float, found)
    if not np.any(is_unknown(excited, (low, high))):
        return
    shares = np.asarray(friction_shares())
    refused = shares > EXTRAPOLATED
    if np.any(refused):
        where = (
            f"the materials of the block were measured from {low:.3g} to {high:.3g} rad/s"
            if low <= high
            else "there is no frequency at which all materials of the block were measured, at this "
            "temperature"
        )
        speeds = np.abs(scene.velocity[refused])
        raise ValueError(
            f"[load] `velocity` and the surface excite {np.min(excited[excited > 0]):.3g} to "
            f"{np.max(excited):.3g} rad/s, but {where}: up to {np.max(shares):.0%} of the friction "
            f"at {np.sum(refused)} of {len(shares)} velocities ({np.min(speeds):.3g} to "
            f"{np.max(speeds):.3g} m/s) would come from outside. Take other velocities or another "
            "temperature, or set `extrapolate = true` in [load]."
        )


def _excited(scene: Scene, grid: Grid) -> np.ndarray:
    """Frequencies [rad/s] of all waves at each velocity."""
    velocities = [velocity_vector(v, scene.direction) for v in scene.velocity]
    excited = np.abs([np.asarray(wave_frequencies(grid, v)) for v in velocities])
    # Rounding of q·v is no frequency.
    return np.where(excited > 1e-12 * np.max(excited), excited, 0)


def _materials(
    scene: Table, folder: Path, load: Table
) -> tuple[dict[str, AbstractMaterial], list[Path], list[str]]:
    content = scene.get("materials")
    if not isinstance(content, dict):
        raise ValueError(f"[materials] must hold tables [materials.NAME], got {short(content)}.")
    materials, inputs, notes = {}, [], []
    for name, entry in content.items():
        table, kind = Table.of_kind(f"[materials.{name}]", entry, KEYS["material"])
        if kind == "tabulated":
            inputs.append(folder / table.text("path"))
        with within(table.place):
            materials[name], said = _material(table, kind, folder)
        notes += [f"{name}: {sentence}" for sentence in said]
    if "temperature" in load.content:
        temperature = load.number("temperature")
        for name, material in materials.items():
            with within(f"[load] `temperature`, of [materials.{name}]:"):
                materials[name] = material.at(temperature)
    return materials, inputs, notes


def _material(table: Table, kind: str, folder: Path) -> tuple[AbstractMaterial, tuple[str, ...]]:
    """A material, and what was understood of its file."""
    poisson = table.number("poisson", 0.5)
    if kind == "elastic":
        return Elastic(modulus=table.number("modulus"), poisson=poisson), ()
    if kind == "tyre_tread":
        return tyre_tread(poisson), ()
    shift, measured = _shift(table), _measured(table)
    if kind == "prony":
        relaxing = Prony(
            equilibrium=table.number("equilibrium"),
            strengths=table.numbers("strengths"),
            times=table.numbers("times"),
            poisson=poisson,
            shift=shift,
            measured=measured,
        )
        return relaxing, ()
    if kind == "prony_creep":
        creeping = Prony.from_creep(
            glassy=table.number("glassy"),
            compliances=table.numbers("compliances"),
            times=table.numbers("times"),
            poisson=poisson,
            shift=shift,
            measured=measured,
        )
        return creeping, ()
    place = table.place[:-1]
    columns = Table(f"{place}.columns]", table.get("columns", {}), DIMENSIONS)
    units = Table(f"{place}.units]", table.get("units", {}), UNITS)
    try:
        found = read_moduli(
            folder / table.text("path"),
            kind="frequency",
            columns=columns.content,
            units=units.content,
            deformation=table.text("deformation", None),
            sheet=table.text("sheet", None),
            poisson=poisson,
        )
    except ValueError as error:
        advice = "`graded-contact fit FILE` reads more, and writes a material for a scene."
        raise ValueError(f"{error} {advice}") from error
    omega, modulus = found.table()
    extrapolate = table.choice("extrapolate", ("refuse", "plateau"), "refuse")
    material = Tabulated(omega, modulus, poisson, shift=shift, extrapolate=extrapolate)
    return material, found.history


def _measured(table: Table) -> MeasuredRange | None:
    if "measured" not in table.content:
        return None
    ends = Table(f"{table.place[:-1]}.measured]", table.get("measured"), KEYS["measured"])
    temperature = ends.numbers("temperature") if "temperature" in ends.content else None
    with within(ends.place):
        return MeasuredRange(ends.numbers("omega"), temperature)


def _shift(table: Table) -> AbstractShift | None:
    if "shift" not in table.content:
        return None
    place = f"{table.place[:-1]}.shift]"
    shift, kind = Table.of_kind(place, table.get("shift"), KEYS["shift"])
    if kind == "tabulated":
        return TabulatedShift(
            temperatures=shift.numbers("temperatures"),
            log10_factors=shift.numbers("log10_factors"),
            reference=shift.number("reference"),
            vertical_factors=shift.numbers("vertical_factors", None),
        )
    constants = {key: shift.number(key) for key in KEYS["shift"][kind]}
    return WLF(**constants) if kind == "wlf" else Arrhenius(**constants)


def _surface(scene: Table, folder: Path) -> RandomSurface | SurfaceFile:
    table, kind = Table.of_kind("[surface]", scene.get("surface"), KEYS["surface"])
    target = {key: table.number(key) for key in ("rms_height", "rms_slope") if key in table.content}
    if kind == "file":
        if "grid" in scene.content:
            raise ValueError(
                '[grid] belongs to a surface of kind "self_affine"; the points of a file are '
                "resampled by `shape` in [surface]."
            )
        if len(target) == 2:
            raise ValueError("[surface] takes `rms_height` or `rms_slope` to rescale to, not both.")
        arguments = {key: table.get(key) for key in READ_ARGUMENTS if key in table.content}
        for key in ("periodic", "fill"):
            if arguments.get(key) == "none":  # TOML has no None
                arguments[key] = None
        if "shape" in arguments:
            arguments["shape"] = table.wholes("shape")
        if "size" in arguments:
            sizes = table.numbers("size")
            arguments["size"] = sizes[0] if len(sizes) == 1 else sizes
        if "region" in arguments:
            arguments["region"] = table.numbers("region")
        return SurfaceFile(folder / table.text("path"), arguments, target)
    place = Table("[grid]", scene.get("grid"), KEYS["grid"])
    with within(place.place):
        sizes = place.numbers("size")
        grid = Grid(place.wholes("shape"), sizes[0] if len(sizes) == 1 else sizes)
    seed = table.whole("seed", 0)
    rest: dict[str, Any] = {key: table.number(key) for key in ("hurst", "q_roll", "q_high")}
    rest["q_low"] = table.number("q_low", 2 * np.pi / float(np.max(grid.size)))
    rest["roll_off"] = table.choice("roll_off", ("sharp", "smooth"), "sharp")
    with within(table.place):
        spectrum = SelfAffine(**target, **rest)
    amplitudes = table.choice("amplitudes", ("exact", "gaussian"), "exact")
    return RandomSurface(spectrum, grid, seed, amplitudes)


def _stack(scene: Table, materials: dict[str, AbstractMaterial]) -> Stack:
    entries = scene.get("layers", [])
    if not isinstance(entries, list):
        raise ValueError(f"`layers` must be a list of tables [[layers]], got {short(entries)}.")

    def named(table: Table, key: str = "material") -> AbstractMaterial:
        name = table.text(key)
        if name not in materials:
            raise ValueError(
                f"{table.place} `{key}` = {name!r} is not in [materials]; "
                f"{nearest(name, materials)}"
            )
        return materials[name]

    def layer(table: Table) -> Layer | GradedLayer:
        thickness = table.number("thickness")
        if "bottom" not in table.content and "top" not in table.content:
            return Layer(named(table), thickness)
        if "material" in table.content:
            raise ValueError(f"{table.place} has `material` besides `bottom` or `top`: give one.")
        shape = SHAPES[table.choice("shape", tuple(SHAPES), "linear")]
        mixing = table.choice("mixing", ("linear", "logarithmic"), "linear")
        profile = Blend(named(table, "bottom"), named(table, "top"), shape(), mixing)
        return GradedLayer(profile, thickness)

    layers = []
    for i, entry in enumerate(entries):
        table = Table(f"[layers[{i}]]", entry, KEYS["layers"])
        with within(table.place):
            layers.append(layer(table))
    table, kind = Table.of_kind("[base]", scene.get("base"), KEYS["base"])
    base = (
        HalfSpace(named(table)) if kind == "half_space" else {"rigid": Rigid, "free": Free}[kind]()
    )
    with within(table.place):
        return Stack(layers=layers, base=base)
