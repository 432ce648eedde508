"""Tables that hold no moduli: what the names of their columns say they are, and what would do."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from .tables import DataTable

_TIME = r"^\W*(?:t|time|zeit|temps)\b"
_FORCE = r"^\W*(?:force|load|kraft|last|F|normal force|axial force)\b"
_WAY = r"displacement|position|\bweg\b|d[eé]placement|extension|elongation|deflection|\bstroke\b"
_TORQUE = r"torque|drehmoment|\bmoment\b|\bcouple\b"
_ANGLE = r"angle|winkel|twist|rotation|deflection|auslenkung|displacement"
_FREQUENCY = r"freq|\bf\b|omega|ω|\bw\b"


class Other(NamedTuple):
    """A table of other quantities.

    **Fields:**

    - `columns`: patterns of names, each of another column.
    - `what`: the table is.
    - `remedy`: what to do instead.
    """

    columns: tuple[str, ...]
    what: str
    remedy: str


OTHER_TABLES = (
    Other((r"temp|^\W*T\b",
           r"(?:\b|_|log ?)[ab]_?T\b|shift.?fa[ck]t|^log\W*aT|verschiebungsfaktor"),
          "a table of shift factors a_T over temperature",
          "read the isotherms themselves; a scene takes shift factors as the law "
          "`shift` of kind 'tabulated', Python as `materials.TabulatedShift`"),
    Other((r"^\W*(?:q|k|wave.?(?:number|vector)|wellenzahl|spatial freq\w*)(?![\w'*])",
           r"^\W*(?:C|PSD|C_?iso|C_?[12]D|psd_?[12]d|power.?spectr\w*|spectral.?dens\w*|spectrum)"
           r"(?![\w'*])"),
          "a spectrum of heights, C(q)",
          "a surface is read from its heights by `read_surface`, or given by the numbers of "
          "`surfaces.SelfAffine`"),
    Other((r"tau|τ|lambda|λ|relaxation.?time|relaxationszeit",
           r"^\W*[HhL](?:\s*\(|\b(?!_))|spectrum|spektrum|spectre"),
          "a continuous relaxation spectrum H(τ)",
          "export moduli over frequency or time, or discrete modes (τ_i, E_i), which "
          "`readers.read_prony` reads"),
    Other((r"retardation|retardationszeit", r"^\W*[JD]|compliance"),
          "a series of retardation times and compliances",
          "give it to `Prony.from_creep`, or as a material of kind 'prony_creep' to a scene"),
    Other((_TORQUE, _ANGLE),
          "torque and angle",
          "moduli need the factors of the geometry: export G' and G'', or shear stress and strain"),
    Other((_TIME, _FORCE, _WAY),
          "a raw signal, force and displacement over time",
          "moduli need the dimensions of the sample: export E' and E'', or stress and strain at a "
          "constant load"),
    Other((_FREQUENCY, r"stiffness|steifigkeit|rigidit|^\W*[kK](?:'|''|\*)(?!\w)"),
          "a dynamic stiffness (force over displacement)",
          "moduli need the dimensions of the sample: export E' and E''"),
    Other((_FREQUENCY, r"^\W*(?:η|eta)|vis[ck]osit"),
          "a complex viscosity over frequency",
          "export G' and G'' with it"),
    Other((r"shear.?rate|schergeschw|scherrate|vitesse de cisaillement",
           r"vis[ck]osit|η|eta|stress"),
          "a flow curve, viscosity over shear rate",
          "export an oscillation test, G' and G''"),
)  # fmt: skip


def check_others(table: DataTable, chosen: Iterable[str | int]) -> None:
    """Raises `ValueError` for a table that holds other quantities, by its name with a remedy.

    **Arguments:**

    - `table`: none of whose names are those of moduli.
    - `chosen`: columns that the user names; if one is no sign of the other quantities, it may hold
      moduli.
    """
    wanted = {i for i, name in enumerate(table.names) if {name, i + 1} & set(chosen)}
    for columns, what, remedy in OTHER_TABLES:
        places = _matched(table.names, columns)
        if places and wanted <= places:
            raise ValueError(f"{table.place}: with {table.listed()} it is {what}: {remedy}")


def _matched(names: list[str], columns: tuple[str, ...]) -> set[int]:
    """The places of columns that match the patterns, one each; empty if one has none."""
    places: set[int] = set()
    for pattern in columns:
        found = (i for i, name in enumerate(names) if re.search(f"(?i){pattern}", name))
        place = next((i for i in found if i not in places), None)
        if place is None:
            return set()
        places.add(place)
    return places
