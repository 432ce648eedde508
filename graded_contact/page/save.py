"""Saving the scene of a page: other numbers in the text of the scene, whose comments stay."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from ..scenes.scene import Scene, parse_scene
from .numbers import Number, numbers_of


def save(
    scene: Scene,
    numbers: Mapping[str, Number],
    values: Mapping[str, float],
    folder: Path,
    name: str,
) -> Path:
    """Writes a scene with other values of its numbers, and returns the path of the new file.

    **Raises:** `ValueError` for the name of a file that exists or lies elsewhere, and as
    `with_numbers`.
    """
    path = folder / f"{name.strip().removesuffix('.toml')}.toml"
    if path.parent != folder or path.name == ".toml":
        raise ValueError(f"{name!r} is not the name of a file.")
    if path.exists():
        raise ValueError(f"{path} exists: choose another name.")
    text = with_numbers(scene, numbers, values, folder)
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(text, "utf-8")
    return path


def with_numbers(
    scene: Scene, numbers: Mapping[str, Number], values: Mapping[str, float], folder: Path
) -> str:
    """Returns the text of a scene with other values of its numbers.

    A number that did not change stays as it is written, such as a list of velocities.

    **Raises:** `ValueError` if the scene file has no key for a number that changed, and if its
    paths do not lead to its files from `folder`.
    """
    document: Any = tomlkit.parse(scene.text)
    changed = {name: n for name, n in numbers.items() if values[name] != n.value}
    for name, number in changed.items():
        *way, last = number.place
        table = document
        for key in way:
            table = table[key] if isinstance(key, int) or key in table else {}
        if not isinstance(last, int) or last < len(table):
            table[last] = values[name]
    text = tomlkit.dumps(document)
    labels = ", ".join(number.label for number in changed.values())
    try:
        again = numbers_of(parse_scene(text, folder))
    except (ValueError, OSError) as error:
        raise ValueError(f"the scene with another {labels} is refused: {error}") from error
    kept = {name: np.isclose(again[name].value, values[name]) for name in changed}
    lost = [number.label for name, number in changed.items() if not kept[name]]
    if lost:
        raise ValueError(f"the scene file has no key for {', '.join(lost)}.")
    return text
