"""The scene that a page shows, as the tables of its file: opened, changed and saved.

Every change makes new tables. The reader of scenes checks them, and the page shows its errors. A
page shows one point: of lists of pressures, [sweep] and seeds it takes the middle, and it does not
save them.
"""

import copy
import dataclasses
import os
from collections.abc import Callable
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from ..core.checks import within
from ..core.files import check_name, read_file
from ..core.quantities import AXES, TRANSIENT
from ..exports.prony_cards import export_prony
from ..fitting.master import master_curve
from ..materials.material import AbstractMaterial
from ..readers.moduli import read_moduli
from ..readers.topography import read_surface
from ..scenes.described import described
from ..scenes.scene import Scene
from ..scenes.scene_checks import refuse_tables
from ..scenes.scene_file import parse_scene
from ..scenes.toml import parse_toml, text_of_scene, toml_text
from ..studies.dataset import write_whole
from .wording import worded

FINEST_DROP = 256  # along the longer edge of a topography that the user drops
FIRST_THICKNESS = 1e-4  # m, of a layer on a bare base
NEW_NAME = "coat"  # of a new material


@dataclasses.dataclass(frozen=True, eq=False)
class Document:
    """A scene of one point, as tables.

    **Fields:**

    - `content`: as `tomllib` gives it; never changed in place.
    - `folder`: its paths are relative to this folder.
    - `speeds`: lowest and highest velocity [m/s] of the page.
    """

    content: dict[str, Any]
    folder: Path
    speeds: tuple[float, float]

    @property
    def text(self) -> str:
        """The tables as TOML."""
        return toml_text(self.content)

    @cached_property
    def scene(self) -> Scene:
        """The scene of the tables; raises the errors of `read_scene`."""
        return parse_scene(self.text, self.folder)

    def copied(self) -> "Document":
        """Returns a copy, whose tables may be changed, without the title."""
        return dataclasses.replace(self, content=copy.deepcopy(self.content) | {"title": ""})

    def titled(self) -> "Document":
        """Returns the scene with its title, or if it has none, with what it is made of."""
        title = self.content.get("title") or described(self.content)
        return dataclasses.replace(self, content=self.content | {"title": title})


def open_document(path: Path | None) -> Document:
    """Returns the scene of a file, or that of the demo, at one point.

    **Raises:** `FileNotFoundError`; `ValueError` for a file without a scene, at rest, or with a
    table that the page does not take.
    """
    if path is None:
        name, folder = "demo.toml", Path.cwd()
        text = resources.files("graded_contact.scenes").joinpath(name).read_text("utf-8")
    else:
        name, folder, text = path.name, path.absolute().parent, text_of_scene(path)
    with within(f"{name}:"):
        scene = parse_scene(text, folder)
        if scene.kind == TRANSIENT:
            raise ValueError(
                "[motion] `once = true`: the page shows the results of what happens once. Run the "
                "scene by `graded-contact run`, and open the file NAME.h5 that it writes."
            )
        refuse_tables(scene, "The page", "motion", "counterface")
        if not np.any(scene.velocity):
            raise ValueError("[load] `velocity` is 0. The page needs a velocity above 0.")
    moving = np.sort(np.abs(scene.velocity[scene.velocity != 0]))
    # A scene of one speed, or of a narrow range, still has a slider and curves over decades.
    speeds, usual = (float(moving[0]), float(moving[-1])), AXES["velocity"].usual
    if speeds[1] < 100 * speeds[0] and usual:
        speeds = (usual.ends(speeds[0])[0], usual.ends(speeds[1])[1])
    middle = lambda values: float(values[len(values) // 2])  # noqa: E731
    load: dict[str, Any] = {"pressure": middle(scene.pressure), "velocity": middle(moving)}
    if scene.strain_per_slope is not None:
        load["strain_per_slope"] = scene.strain_per_slope
    if direction := middle(np.ravel(scene.direction)):
        load["direction"] = direction
    if scene.temperature is not None:
        load["temperature"] = middle(np.sort(scene.temperature, axis=None))
    content = parse_toml(text)
    content = {k: v for k, v in content.items() if k not in ("sweep", "design")} | {"load": load}
    content["surface"].pop("seeds", None)
    content.get("output", {}).pop("name", None)  # saved scenes are called as their files
    tables = {"[surface]": content["surface"]}
    for i, scan in enumerate(content["surface"].get("scans", ())):
        tables[f"[surface.scans[{i}]]"] = scan
    for name, table in content["materials"].items():
        tables[f"[materials.{name}]"] = table
    for (place, key), path in scene.inputs.items():  # the scene is saved in another folder
        tables[place][key] = str(path)
    return Document(content, folder, speeds)


def with_layer(document: Document, material: str | None, name: str = "") -> Document:
    """Returns the scene with one more layer on top, as thick as the layer below it.

    **Arguments:**

    - `document`: the scene.
    - `material`: a name of [materials]; None for a new elastic material.
    - `name`: of a new material, with a number behind it if another material has the name.
    """
    document = document.copied()
    content = document.content
    if material is None:
        material = free_name(name.strip() or NEW_NAME, content["materials"])
        content["materials"][material] = {"kind": "elastic", "modulus": 1e7, "poisson": 0.49}
    below = content.get("layers", [])
    thickness = below[0]["thickness"] if below else FIRST_THICKNESS
    content["layers"] = [{"material": material, "thickness": thickness}, *below]
    return document


def without_layer(document: Document, index: int) -> Document:
    """Returns the scene without one layer, counted from the surface; its material stays."""
    document = document.copied()
    layers = document.content["layers"]
    if index >= len(layers):  # a second click, before the page had changed
        raise ValueError(f"Layer {index + 1} is removed already.")
    del layers[index]
    return document


def with_moduli(document: Document, path: Path, options: dict[str, Any], name: str) -> Document:
    """Returns the scene with the moduli in a file for the material `name`.

    Isotherms at several temperatures are shifted into a master curve and fitted by a Prony series.
    `options` are `units`, `columns` and `deformation`, if the file does not give them, as the
    tables of a scene have them.
    """
    document = document.copied()
    old = document.content["materials"][name]
    poisson = old.get("poisson", 0.5)
    table = dict(kind="tabulated", path=str(path), poisson=poisson)
    table |= options
    if old["kind"] == "tabulated" and "shift" in old:
        table["shift"] = old["shift"]
    with within(f"{path.name}:"), worded(read_moduli):
        isotherms = read_moduli(path, poisson=poisson, **options).isotherms()
        if len(isotherms) > 1:
            table = material_table(master_curve(isotherms, poisson=poisson).exported())
    document.content["materials"][name] = table
    return document


def material_table(material: AbstractMaterial) -> dict[str, Any]:
    """Returns the table of a scene for a series of Prony."""
    return parse_toml(export_prony(material, "toml"))["materials"]["material"]


def with_topography(document: Document, path: Path, options: dict[str, Any]) -> Document:
    """Returns the scene with the surface in a file, which is resampled to `FINEST_DROP` points.

    **Arguments:**

    - `document`: the scene.
    - `path`: of the topography.
    - `options`: `periodic`, and `unit` and `size` [m] if the file does not give them, as the
      tables of a scene have them.

    **Raises:** the errors of `read_surface`.
    """
    document = document.copied()
    content = document.content
    with within(f"{path.name}:"), worded(read_surface):
        periodic = {"periodic": None} if options.get("periodic") == "none" else {}
        shape = read_surface(path, **{**options, **periodic}).grid.shape
    content["surface"] = {"kind": "file", "path": str(path), **options}
    if (most := max(shape)) > FINEST_DROP:
        content["surface"]["shape"] = [max(2 * (FINEST_DROP * n // most // 2), 16) for n in shape]
    content.pop("grid", None)
    return document


def with_file(
    document: Document, folder: Path, name: str, data: bytes,
    change: Callable[[Document, Path], Document],
) -> Document:  # fmt: skip
    """Returns the scene with a file of the user, which is stored in a folder.

    **Arguments:**

    - `document`: the scene.
    - `folder`: keeps the file if its scene is valid, under a new name if another file has its own.
    - `name`, `data`: of the file, as a browser sends them.
    - `change`: makes the scene with a file at a path.

    **Raises:** the errors of the scene with the file; the folder then stays unchanged.
    """
    name = Path(name.replace("\\", "/")).name
    with worded(check_name):
        check_name(name)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    # A link may lead out of the folder.
    stored = path.is_file() and not path.is_symlink() and read_file(path) == data
    if not stored:
        taken = {path.stem for path in folder.iterdir()}
        path = folder / f"{free_name(path.stem, taken)}{path.suffix}"
        write_whole(path, data)
    try:  # the readers take paths, so the file is stored first and removed if they refuse it
        changed = change(document, path)
        _ = changed.scene
    except BaseException as error:
        if not stored:
            path.unlink()
        if isinstance(error, ValueError):
            text = str(error).replace(f"{folder}{os.sep}", "")
            raise ValueError(text.replace(path.name, name)) from error
        raise
    return changed


def save_document(document: Document, folder: Path, name: str, replace: bool) -> Path:
    """Writes the scene as NAME.toml into a folder, and returns its path.

    **Raises:** `ValueError` for a bad name, or for an existing file unless `replace`; `OSError`.
    """
    with worded(check_name):
        check_name(name)
    path = folder / f"{name}.toml"
    if path.exists() and not replace:
        raise ValueError(f"{path} exists: choose another name.")
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(path, document.text)
    return path


def free_name(stem: str, taken: Any) -> str:
    """Returns the first of STEM, STEM2, STEM3, ... that is not taken."""
    names = (stem, *(f"{stem}{i}" for i in range(2, len(taken) + 3)))
    return next(name for name in names if name not in taken)
