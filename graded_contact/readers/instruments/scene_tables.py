"""Prony series in the tables of a scene and in JSON, as `export_prony` writes them."""

import json
import re
import tomllib
from typing import Any

from ...core.files import Refusal
from ...materials.coverage import MeasuredRange
from ...materials.shift import LAWS
from ..decisions import Log
from ..registry import File, reader
from ..series import Modes

_KIND = re.compile(r"""kind["']?\s*[=:]\s*["']prony["']""")


@reader("scene", "prony", knows=lambda file: _KIND.search(file.text or "") is not None)
def read_scene_tables(file: File) -> dict[str, Modes]:
    """Returns the materials of kind "prony", by their names; raises `Refusal` for other text."""
    text = file.text or ""
    try:
        if text.lstrip().startswith("{"):
            table = json.loads(text)
            tables = {str(table.get("name", "")): table}
        else:
            tables = tomllib.loads(text)["materials"]
        return {
            name: _series_of_material(name, table)
            for name, table in tables.items() if table.get("kind") == "prony"
        }  # fmt: skip
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise Refusal(f"its material of kind 'prony' is not complete ({error})") from None


def _series_of_material(name: str, table: dict[str, Any]) -> Modes:
    shift, measured = dict(table.get("shift") or {}), table.get("measured")
    log = Log()
    log.assume(*table.get("assumed", ()))
    return Modes(
        f"the material {name!r} of a scene, in SI units", log,
        table["strengths"], table["times"], equilibrium=table["equilibrium"],
        units={"modulus": "Pa", "time": "s"}, deformation="tension",
        poisson=table.get("poisson", 0.5),
        shift=LAWS[shift.pop("kind")](**shift) if shift else None,
        measured=MeasuredRange(**measured) if measured else None,
    )  # fmt: skip
