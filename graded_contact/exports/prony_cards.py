"""A Prony series as text for other programs, and for a scene of this package.

Scenes, JSON and CSV hold all digits of a double. The cards of Abaqus and Ansys hold ratios to the
instantaneous modulus E_inf = E_eq + Σ E_k, which they take as the elastic constant:
E(t) = E_inf (1 - Σ g_k (1 - exp(-t/τ_k))), g_k = E_k/E_inf. Poisson's ratio is constant, so the
bulk modulus relaxes as the shear modulus does: k_k = g_k. Items of cards have at most 20
characters, see `in_card`: the remainder E_eq = E_inf (1 - Σ g_k) keeps a relative error of about
1e-13 E_inf/E_eq. A liquid, of which nothing remains, is refused.

Sources: Abaqus Keywords Reference Guide, *VISCOELASTIC and *TRS; Mechanical APDL Material
Reference, TB,PRONY and TB,SHIFT.
"""

import dataclasses
import json
import re
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from ..core.checks import short
from ..core.escaping import in_comment
from ..materials.coverage import MeasuredRange
from ..materials.material import AbstractMaterial, Prony
from ..materials.shift import WLF, AbstractShift

ANSYS_TERMS = 100  # the most that TB,PRONY takes
LEAST_REMAINDER = 1e-7  # of E_eq in E_inf, to keep it to about 1e-6


def entry_text(value: Any) -> str:
    """Returns the text of a number, list or inline table in TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {entry_text(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(entry_text, value)) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value).lower()


def export_prony(material: AbstractMaterial, format: str, *, name: str = "material") -> str:
    """Returns the text of a Prony material in one of `PRONY_CARDS`, SI units.

    - "toml": a table [materials.NAME] to paste into a scene;
    - "json": the same entries;
    - "csv": a line for each branch, relaxation time [s] and modulus [Pa], the equilibrium modulus
      first, with an infinite time;
    - "abaqus": *MATERIAL with *ELASTIC, MODULI=INSTANTANEOUS and *VISCOELASTIC, TIME=PRONY;
    - "ansys": MP,EX and MP,PRXY, TB,PRONY for shear and bulk.

    A WLF law is written too (*TRS, TB,SHIFT), with temperatures in kelvin; the cards mention an
    Arrhenius law and a table of shifts in comments only. Raises `ValueError` for what a format
    cannot hold.

    **Arguments:**

    - `material`: to be written.
    - `format`: one of `PRONY_CARDS`.
    - `name`: of the material in the other program.

    **Returns:** the text of the file.
    """
    if not isinstance(material, Prony):
        kind = type(material).__name__
        raise ValueError(f"`material` is of type {kind}; only a `Prony` series is exported.")
    check_card(format, PRONY_CARDS, name)
    return PRONY_CARDS[format](material, name)


def check_card(format: Any, formats: Collection[str], name: Any) -> None:
    """Raises `ValueError` for a format that does not exist, or a name that programs refuse."""
    if format not in formats:
        raise ValueError(f"`format={format!r}` is refused: use one of {tuple(formats)}.")
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name):
        allowed = "a letter, then letters, digits, `_` and `-` are allowed"
        raise ValueError(f"`name={short(name)}` is refused: {allowed}.")


def in_card(value: float) -> str:
    """Returns a number for a card of another program, in at most 20 characters."""
    return f"{value:.13g}"


def _fields(material: Prony) -> dict[str, Any]:
    """The entries of a scene's table, as Python numbers."""
    fields: dict[str, Any] = {
        "kind": "prony",
        "equilibrium": float(material.equilibrium),
        "strengths": np.asarray(material.strengths, float).tolist(),
        "times": np.asarray(material.times, float).tolist(),
        "poisson": float(material.poisson),
    }
    if material.shift is not None:
        kind = type(material.shift).__name__.lower().removesuffix("shift")
        fields["shift"] = {"kind": kind, **_constants(material.shift)}
    if material.measured is not None:
        fields["measured"] = _constants(material.measured)
    return fields


def _toml(material: Prony, name: str) -> str:
    lines = [f"{key} = {entry_text(entry)}" for key, entry in _fields(material).items()]
    return "\n".join([f"[materials.{name}]", *lines, ""])


def _json(material: Prony, name: str) -> str:
    units = {"equilibrium": "Pa", "strengths": "Pa", "times": "s", "poisson": "1"}
    return json.dumps({"name": name, **_fields(material), "units": units}, indent=2) + "\n"


def _csv(material: Prony, name: str) -> str:
    fields = _fields(material)
    branches = zip(fields["times"], fields["strengths"], strict=True)
    lines = [
        f"# {name}: Young's relaxation modulus, the sum of modulus * exp(-t/time) over lines",
        f"# Poisson's ratio {fields['poisson']!r}",
        *(in_comment(line, "#") for line in (*_law(material.shift), *_measured(material))),
        "relaxation time [s],modulus [Pa]",
        *(f"{t},{e!r}" for t, e in [("inf", fields["equilibrium"]), *branches]),
    ]
    return "\n".join([*lines, ""])


def _abaqus(material: Prony, name: str) -> str:
    glassy, ratios, times = _normalised(material, "Abaqus")
    lines = [
        "** Units: Pa, s, K. Ratios to the instantaneous moduli; Poisson's ratio is constant.",
        "** Poisson's ratios near 1/2 need hybrid elements.",
        *(in_comment(sentence, "**") for sentence in _measured(material)),
        f"*MATERIAL, NAME={name}",
        "*ELASTIC, MODULI=INSTANTANEOUS",
        f"{in_card(glassy)}, {in_card(float(material.poisson))}",
        "*VISCOELASTIC, TIME=PRONY",
        *(f"{ratio}, {ratio}, {time}" for ratio, time in zip(ratios, times, strict=True)),
    ]
    card = "*TRS, DEFINITION=WLF\n{}, {}, {}"
    return "\n".join([*lines, *_shift_lines(material.shift, card, "**"), ""])


def _ansys(material: Prony, name: str) -> str:
    glassy, ratios, times = _normalised(material, "Ansys")
    poisson = float(material.poisson)
    if poisson == 0.5:
        remedy = "give the material 0.4999 (`--poisson 0.4999`) and use mixed u-P elements"
        raise ValueError(f"`poisson=0.5` is refused: Ansys needs less, {remedy}.")
    if len(times) > ANSYS_TERMS:
        raise ValueError(
            f"`times` has {len(times)} entries: Ansys takes at most {ANSYS_TERMS} terms."
        )
    lines = [
        f"! {name}. Units: Pa, s, K. Ratios to the instantaneous moduli; constant Poisson's ratio.",
        *(in_comment(sentence, "!") for sentence in _measured(material)),
        "MATID=1",
        f"MP,EX,MATID,{in_card(glassy)}",
        f"MP,PRXY,MATID,{in_card(poisson)}",
    ]
    # TBDATA takes constants by their position: the ratio and the time of each term alternate.
    for part in ("SHEAR", "BULK"):
        lines.append(f"TB,PRONY,MATID,1,{len(times)},{part}")
        for i, (ratio, time) in enumerate(zip(ratios, times, strict=True)):
            lines.append(f"TBDATA,{2 * i + 1},{ratio},{time}")
    card = "TB,SHIFT,MATID,1,3,WLF\nTBDATA,1,{},{},{}"
    return "\n".join([*lines, *_shift_lines(material.shift, card, "!"), ""])


def _normalised(material: Prony, program: str) -> tuple[float, list[str], list[str]]:
    """Instantaneous modulus [Pa]; ratios g_k [1] and times [s] as items of cards."""
    strengths, equilibrium = np.asarray(material.strengths, float), float(material.equilibrium)
    # The card holds the equilibrium modulus as 1 - Σ g_k, whose rounding must not swallow it.
    glassy = equilibrium + float(np.sum(strengths))
    if equilibrium < LEAST_REMAINDER * glassy:
        least = f"at least {LEAST_REMAINDER:g} of the instantaneous modulus, {glassy:.4g} Pa"
        raise ValueError(f"`equilibrium={equilibrium:g}` Pa is refused: {program} needs {least}.")
    ratios, times = strengths / glassy, np.asarray(material.times, float)
    return glassy, [*map(in_card, ratios.tolist())], [*map(in_card, times.tolist())]


def _constants(fields: AbstractShift | MeasuredRange) -> dict[str, Any]:
    """The fields of a law, table or range, as Python numbers."""
    given = {field.name: getattr(fields, field.name) for field in dataclasses.fields(fields)}
    return {k: np.asarray(v, float).tolist() for k, v in given.items() if v is not None}


def _measured(material: Prony) -> list[str]:
    """The range that was measured, in at most one sentence."""
    if material.measured is None:
        return []
    # Programs use a series outside of its data without a warning: the card says where these end.
    units = {"omega": "rad/s", "temperature": "K"}
    ends = _constants(material.measured).items()
    ranges = " and ".join(f"{low:.4g} to {high:.4g} {units[name]}" for name, (low, high) in ends)
    return [f"Measured from {ranges}; an extrapolation outside"]


def _shift_lines(shift: AbstractShift | None, card: str, comment: str) -> list[str]:
    """A WLF law in the words of `card`, another law in comments."""
    if shift is None:
        return []
    if isinstance(shift, WLF):
        return [card.format(*(in_card(float(n)) for n in (shift.reference, shift.c1, shift.c2)))]
    return [in_comment(line, comment) for line in ("Not part of this card:", *_law(shift))]


def _law(shift: AbstractShift | None) -> list[str]:
    """A law on one line; a table with a line for each temperature."""
    if shift is None:
        return []
    constants = _constants(shift)
    columns = {key: value for key, value in constants.items() if isinstance(value, list)}
    single = ", ".join(f"{key}={constants[key]!r}" for key in constants if key not in columns)
    lines = [f"time-temperature shift {type(shift).__name__}({single})"]
    if columns:
        lines.append(", ".join(columns))
        lines += [", ".join(map(repr, row)) for row in zip(*columns.values(), strict=True)]
    return lines


PRONY_CARDS: dict[str, Callable[[Prony, str], str]] = {
    "toml": _toml, "json": _json, "csv": _csv, "abaqus": _abaqus, "ansys": _ansys,
}  # fmt: skip
