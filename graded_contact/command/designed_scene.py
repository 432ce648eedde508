"""The scene of a designed block: that of the design, with the designed numbers in its tables."""

import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..blocks.stack import Stack
from ..core.parameters import arrays, paths, with_values
from ..designs.results import DesignResults
from ..page.document import Document, free_name
from ..page.scenery import layer_of, part_at, with_numbers
from ..scenes.scene_file import parse_scene
from ..scenes.toml import parse_toml, toml_text


class _Block(NamedTuple):
    stack: Stack


def designed_scene(results: DesignResults, scene_file: Path, folder: Path) -> str:
    """Returns the text of the scene with the designed block, for a file in another folder.

    A material that several parts of the block share, but the design changed in some, gets a table
    of its own there. Without [design], and [output] names no file.

    **Raises:** `ValueError` for a block that the tables of a scene do not give.
    """
    content, study = parse_toml(results.study.scene.text), results.study
    scene = parse_scene(study.scene.text, scene_file.parent)
    before, designed = scene.stack, paths(results.candidates["designed"].stack)
    # At the scene's temperature numbers are scaled: times, for example, by a_T.
    known, own = paths(before), study.start
    changed = {path: designed[path] * (known[path] / own[path]) for path in own}
    after = with_values(before, changed)
    del content["design"]
    for key in ("name", "directory"):  # those of the results before
        content.get("output", {}).pop(key, None)
    for (place, key), path in scene.inputs.items():
        _table_at(content, place)[key] = Path(os.path.relpath(path.absolute(), folder)).as_posix()
    for path, name in scene.materials.items():
        shared = (at for at, other in scene.materials.items() if other == name)
        # The paths are those of the block alone: the counterface may have the material, too.
        alone = "counterface" not in content
        if alone and all(_same(part_at(after, path), part_at(after, at)) for at in shared):
            continue
        if not _same(part_at(before, path), part_at(after, path)):
            new = free_name(f"{name}-designed", content["materials"])
            content["materials"][new] = dict(content["materials"][name])
            _owner_of(content, path)[path.rpartition(".")[2]] = new
    document = Document(content, folder, (0.0, 0.0))
    tables = with_numbers(document, _Block(before), _Block(after)).content
    text = toml_text(tables | {"title": scene.title})
    written = parse_scene(text, folder)
    if not (_same(written.stack, after) and _same(written.counterface, scene.counterface)):
        raise ValueError("no tables of a scene give this block.")
    return text


def _table_at(content: dict[str, Any], place: str) -> dict[str, Any]:
    """The table at a place, such as "[surface]" or "[materials.coat]"."""
    head, _, name = place[1:-1].partition(".")
    return content[head][name] if name else content[head]


def _owner_of(content: dict[str, Any], path: str) -> dict[str, Any]:
    """The table that names the material at a path of the block."""
    head, *inner, _ = path.split(".")
    table = content["base"] if head == "base" else content["layers"][layer_of(path)]
    if inner not in ([], ["profile"]):
        raise ValueError(f"{path} is part of a material that several parts of the block share.")
    return table


def _same(one: Any, other: Any) -> bool:
    """Whether two parts of a block have the same numbers, but for rounding."""
    numbers, others = arrays(one), arrays(other)
    return numbers.keys() == others.keys() and all(
        np.shape(n) == np.shape(others[at]) and np.allclose(n, others[at], rtol=1e-9, atol=0)
        for at, n in numbers.items()
    )
