"""The scene that a page shows, as the tables of its file: what is added, replaced and saved.

Every change makes other tables, which the reader of scenes then takes or refuses: what it says is
what the page shows. A page shows one point: axes of the scene (lists of pressures, [sweep], seeds)
give their middle, and are not saved.
"""

import copy
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..files.given import existing_file
from ..files.output import full_path
from ..files.scene import Scene, parse_scene
from ..files.schema import LARGEST, parse_toml, toml_text, within
from ..files.topography.reading import read_surface

POINTS = 256  # along the longer edge of a topography that is dropped in
THICKNESS = 1e-4  # m, of a first layer


class Document(NamedTuple):
    """A scene of one point, as tables.

    **Fields:**

    - `content`: as `tomllib` gives it; never changed in place.
    - `folder`: what its paths are relative to.
    - `speeds`: lowest and highest velocity [m/s] that the page offers.
    """

    content: dict[str, Any]
    folder: Path
    speeds: tuple[float, float]

    def scene(self) -> Scene:
        """Returns what the tables describe, or raises what `read_scene` does."""
        return parse_scene(toml_text(self.content), self.folder)


def open_document(path: Path | None) -> Document:
    """Returns the scene of a file, or the embedded one, at one point.

    **Raises:** `FileNotFoundError`; `ValueError` for what is no scene, or has no motion.
    """
    if path is None:
        file: Any = resources.files("graded_contact.studies").joinpath("demo.toml")
    else:
        file = existing_file(path, at_most=LARGEST)
    folder = Path.cwd() if path is None else Path(path).absolute().parent
    text = file.read_text("utf-8")
    with within(f"{file.name}:"):
        scene = parse_scene(text, folder)
        return _at_one_point(parse_toml(text), scene, folder)


def _at_one_point(content: dict[str, Any], scene: Scene, folder: Path) -> Document:
    moving = np.sort(np.abs(scene.velocity[scene.velocity != 0]))
    if not moving.size:
        raise ValueError("[load] `velocity` is 0: the page shows sliding, at a velocity above 0.")
    speeds = (float(moving[0]), float(moving[-1]))
    if speeds[1] < 100 * speeds[0]:
        speeds = (speeds[0] / 1e3, speeds[1] * 1e3)
    load = {"pressure": _middle(scene.pressure), "velocity": _middle(moving)}
    if scene.direction:
        load["direction"] = scene.direction
    if scene.temperature is not None:
        load["temperature"] = _middle(np.sort(scene.temperature, axis=None))
    kept = {k: copy.deepcopy(v) for k, v in content.items() if k not in ("sweep", "design")}
    kept["load"] = load
    kept["surface"].pop("seeds", None)
    for table in (kept["surface"], *kept["materials"].values()):
        if "path" in table:
            table["path"] = str(full_path(table["path"], folder))
        if table.get("kind") == "tabulated":
            # A knob soon leaves a table; what its friction then rests on is told.
            table["extrapolate"] = "plateau"
    return Document(kept, folder, speeds)


def _middle(values: np.ndarray) -> float:
    return float(values[len(values) // 2])


def with_layer(document: Document, material: str | None) -> Document:
    """Returns the scene with one more layer on top, as thick as the one below it.

    **Arguments:**

    - `document`: the scene.
    - `material`: a name of [materials]; None for a new elastic one.
    """
    content = copy.deepcopy(document.content)
    if material is None:
        material = free_name("coat", content["materials"])
        content["materials"][material] = {"kind": "elastic", "modulus": 1e7, "poisson": 0.49}
    below = content.get("layers", [])
    thickness = below[0]["thickness"] if below else THICKNESS
    content["layers"] = [{"material": material, "thickness": thickness}, *below]
    return document._replace(content=content)


def without_layer(document: Document, index: int) -> Document:
    """Returns the scene without one of its layers, counted from the surface; its material stays."""
    content = copy.deepcopy(document.content)
    del content["layers"][index]
    return document._replace(content=content)


def with_moduli(document: Document, name: str, path: Path) -> Document:
    """Returns the scene with the table of moduli in a file for the material `name`."""
    content = copy.deepcopy(document.content)
    old = content["materials"][name]
    table: dict[str, Any] = {"kind": "tabulated", "path": str(path), "extrapolate": "plateau"}
    if "poisson" in old:
        table["poisson"] = old["poisson"]
    if old.get("kind") == "tabulated" and "shift" in old:
        table["shift"] = old["shift"]
    content["materials"][name] = table
    return document._replace(content=content)


def with_topography(document: Document, path: Path, told: dict[str, str]) -> Document:
    """Returns the scene with the surface in a file, resampled to some `POINTS` along its edge.

    **Arguments:**

    - `document`: the scene.
    - `path`: of the topography.
    - `told`: texts of `periodic`, and of `unit` and `size` [m] for a file that does not tell.

    **Raises:** what `read_surface` does.
    """
    content = copy.deepcopy(document.content)
    with within(f"{path.name}:"):
        arguments: dict[str, Any] = dict(told)
        if "size" in told:
            arguments["size"] = _number("size", told["size"])
        none = {"periodic": None} if told.get("periodic") == "none" else {}
        found = read_surface(path, **{**arguments, **none}).grid.shape
    content["surface"] = {"kind": "file", "path": str(path), **arguments}
    if max(found) > POINTS:
        content["surface"]["shape"] = [max(2 * (POINTS * n // max(found) // 2), 16) for n in found]
    content.pop("grid", None)
    return document._replace(content=content)


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"`{name}={text}` is refused: a number is needed.") from None


def free_name(stem: str, taken: Any) -> str:
    """Returns the first of STEM, STEM2, STEM3, ... that is not taken."""
    names = (stem, *(f"{stem}{i}" for i in range(2, len(taken) + 3)))
    return next(name for name in names if name not in taken)
