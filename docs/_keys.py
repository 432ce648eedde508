"""The page of all keys of a scene, made from the signatures and docstrings of what takes them."""

import inspect
import re
from collections.abc import Callable

from graded_contact.blocks import Layer
from graded_contact.blocks.profile import Blend
from graded_contact.contacts import DouglasRachford
from graded_contact.fields.grid import Grid
from graded_contact.scenes import kinds
from graded_contact.scenes.scene import Observe, Output
from graded_contact.sliding import Fluid, Heating
from graded_contact.sliding.shear import SHEARS

INTRODUCTION = """# Keys of a scene

A key is the name of an argument: the reference of that name has more. Units are SI, angles are in
radians. `[load]` has `pressure` or `approach`, `velocity`, `temperature`, `direction` and
`strain_per_slope`: a number, a list, or `{from = 1e-3, to = 1.0, points = 7}`. `[sweep]` has paths
of numbers, such as `"layers[0].thickness" = [1e-5, 5e-5]`.
"""
TABLES: dict[str, dict[str, Callable]] = {
    "[grid]": {"": Grid}, "[surface], [block_surface]": kinds.SURFACES,
    "[materials.NAME]": kinds.MATERIALS, "`shift` of a material": kinds.NESTED["shift"],
    "[[layers]]": {"": Layer}, "[[layers]], graded (with `thickness`)": {"": Blend},
    "`shape` of a graded layer": kinds.SHAPES, "[base]": kinds.BASES,
    "[motion]": kinds.CYCLES, "[[motion]]": kinds.TRANSIENTS, "[law]": kinds.CONTACT_LAWS,
    "[shear]": SHEARS, "[heating]": {"": Heating}, "[fluid]": {"": Fluid},
    "[observe]": {"": Observe}, "[solver]": {"": DouglasRachford}, "[output]": {"": Output},
}  # fmt: skip
MADE = ("grid", "profile", "file")  # arguments that other tables give


def keys_page() -> str:
    """Returns the page: a table for each kind."""
    parts = [INTRODUCTION]
    for table, made in TABLES.items():
        parts.append(f"## {table}\n")
        for kind, make in made.items():
            rows = list(rows_of(make))
            parts += [f'`kind = "{kind}"`', ""] if kind else []
            parts += ["| key | default | meaning |", "|---|---|---|", *rows, ""] if rows else []
    return "\n".join(parts)


def rows_of(make: Callable):
    """Yields a row for each argument of a constructor or function."""
    for name, parameter in inspect.signature(make).parameters.items():
        if name in MADE or parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        default = parameter.default
        shown = "" if default is parameter.empty or callable(default) else f"`{default}`"
        yield f"| `{name}` | {shown} | {meaning_of(make, name)} |"


def meaning_of(make: Callable, name: str) -> str:
    """Returns what the docstring of a constructor says of an argument."""
    found = re.search(
        rf"- [^:\n]*`{name}`[^:\n]*:(.*?)(?=\n\s*- `|\n\n|\Z)", make.__doc__ or "", re.S
    )
    return " ".join(found[1].split()).replace("|", "\\|") if found else ""
