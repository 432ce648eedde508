"""Saving the scene of a page: other numbers in the text of the scene, whose comments stay."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from ..scenes.scene import Scene, parse_scene
from .numbers import varied_numbers


def save(scene: Scene, values: Mapping[str, float], path: Path) -> None:
    """Writes a scene with other values of its numbers to a new file.

    **Raises:** `FileExistsError`, and `ValueError` as `with_numbers`.
    """
    text = with_numbers(scene, values, path.parent)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("x", encoding="utf-8") as file:
        file.write(text)


def with_numbers(scene: Scene, values: Mapping[str, float], folder: Path) -> str:
    """Returns the text of a scene with other values of its numbers.

    A number that did not change stays as it is written, such as a list of velocities.

    **Raises:** `ValueError` if the scene file has no key for a number that changed, and if its
    paths do not lead to its files from `folder`.
    """
    document: Any = tomlkit.parse(scene.text)
    changed = {name: n for name, n in varied_numbers(scene).items() if values[name] != n.value}
    for name, number in changed.items():
        *way, last = number.place
        table = document
        for key in way:
            table = table[key] if isinstance(key, int) or key in table else {}
        if not isinstance(last, int) or last < len(table):
            table[last] = values[name]
    text = tomlkit.dumps(document)
    again = {name: n.value for name, n in varied_numbers(parse_scene(text, folder)).items()}
    # A number that is 0 has no slider.
    kept = {name: np.isclose(again.get(name, 0.0), values[name]) for name in changed}
    lost = [number.label for name, number in changed.items() if not kept[name]]
    if lost:
        raise ValueError(f"the scene file has no key for {', '.join(lost)}.")
    return text
