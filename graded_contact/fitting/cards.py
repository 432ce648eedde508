"""A Prony series as text: a table of a scene, and a card for Abaqus.

The card holds ratios to the instantaneous modulus E_inf = E_eq + Σ E_k, which is its elastic
constant: E(t) = E_inf (1 - Σ g_k (1 - exp(-t/τ_k))), g_k = E_k/E_inf. Poisson's ratio is constant,
so the bulk modulus relaxes as the shear modulus does: k_k = g_k. Numbers of a card have at most 20
characters, so that E_eq keeps a relative error of about 1e-13 E_inf/E_eq.

Source: Abaqus Keywords Reference Guide, `*VISCOELASTIC` and `*TRS`.
"""

import dataclasses
import json
from typing import Any

import numpy as np

from ..materials.material import Prony
from ..materials.shift import WLF

LEAST_REMAINDER = 1e-7  # of E_eq in E_inf, to keep it to about 1e-6


def toml_table(material: Prony, name: str) -> str:
    """Returns a series as the table [materials.NAME] of a scene, with all digits.

    **Arguments:**

    - `material`: the series, with its shift and the range that was measured.
    - `name`: of the material in the scene.

    **Returns:** the text, in TOML.
    """
    names = ("equilibrium", "strengths", "times", "poisson")
    entries = {"kind": "prony", **{key: _plain(getattr(material, key)) for key in names}}
    if material.shift is not None:
        kind = type(material.shift).__name__.lower().removesuffix("shift")
        entries["shift"] = {"kind": kind, **_given_fields(material.shift)}
    if material.measured is not None:
        entries["measured"] = {"kind": "range", **_given_fields(material.measured)}
    lines = [f"{key} = {_in_toml(entry)}" for key, entry in entries.items()]
    bare = name.isascii() and name.replace("-", "_").isidentifier()
    return "\n".join([f"[materials.{name if bare else json.dumps(name)}]", *lines, ""])


def abaqus_card(material: Prony, name: str) -> str:
    """Returns a series as `*MATERIAL` with `*ELASTIC` and `*VISCOELASTIC`, in SI units.

    A WLF law is `*TRS`, with temperatures in kelvin; another law is left out.

    **Arguments:**

    - `material`: the series.
    - `name`: of the material in Abaqus.

    **Returns:** the text of the card.

    **Raises:** `ValueError` for a liquid: the card holds E_eq as what is left of E_inf.
    """
    strengths, times = np.asarray(material.strengths), np.asarray(material.times)
    glassy = float(material.equilibrium + np.sum(strengths))
    if material.equilibrium < LEAST_REMAINDER * glassy:
        raise ValueError(f"`equilibrium` must be at least {LEAST_REMAINDER:g} of {glassy:g} Pa.")
    lines = [
        "** Units: Pa, s, K. Poisson's ratios near 1/2 need hybrid elements.",
        f"*MATERIAL, NAME={name}",
        "*ELASTIC, MODULI=INSTANTANEOUS",
        _row(glassy, material.poisson),
        "*VISCOELASTIC, TIME=PRONY",
        *(_row(e / glassy, e / glassy, t) for e, t in zip(strengths, times, strict=True)),
    ]
    law = material.shift
    if isinstance(law, WLF):
        lines += ["*TRS, DEFINITION=WLF", _row(law.reference, law.c1, law.c2)]
    if material.measured is not None:
        low, high = material.measured.omega
        lines.insert(1, f"** Measured from {low:.4g} to {high:.4g} rad/s.")
    return "\n".join([*lines, ""])


def _row(*numbers: Any) -> str:
    return ", ".join(f"{float(number):.13g}" for number in numbers)


def _plain(values: Any) -> Any:
    return np.asarray(values, float).tolist()


def _given_fields(part: Any) -> dict[str, Any]:
    """The fields of a law or a range that are set."""
    fields = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
    return {name: _plain(value) for name, value in fields.items() if value is not None}


def _in_toml(entry: Any) -> str:
    if isinstance(entry, dict):
        return "{" + ", ".join(f"{key} = {_in_toml(value)}" for key, value in entry.items()) + "}"
    return json.dumps(entry)
