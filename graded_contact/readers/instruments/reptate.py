"""Moduli in the files of RepTate: `.tts`, `.osc`, `.gt` and `.creep`.

RepTate's manual fixes the order and units of the columns by the ending of the file, and which
parameter of its first line is the constant load; without a strain, "stress" is a modulus.
"""

from ...core.files import Refusal
from ..cells import Sheet, holds_number, sheets_of
from ..decisions import Options
from ..registry import File, reader
from ..tables import settings_in
from ..units import DIMENSIONS, OFFSETS, UNITS, parse_unit

_SWEEP = {"frequency": "rad/s", "storage": "Pa", "loss": "Pa"}
_FORMS = {
    ".tts": ("frequency", _SWEEP, "", None),
    ".osc": ("frequency", _SWEEP, "", None),
    ".gt": ("relaxation", {"time": "s", "stress": "Pa"}, "gamma", 1.0),
    ".creep": ("creep", {"time": "s", "strain": "1"}, "stress", None),
}


@reader("reptate", "moduli", knows=lambda file: file.name.suffix.lower() in _FORMS)
def read_reptate(file: File) -> list[Sheet]:
    """Returns the table; temperature [°C] and load are in the first line."""
    kind, columns, load, usual = _FORMS[file.name.suffix.lower()]
    sheet = sheets_of(file)[0]
    given = settings_in(sheet.rows[0]) if sheet.rows else {}
    known = {name: float(given[name]) for name in ("T", load) if holds_number(given.get(name, ""))}
    below = [[parse_unit(cell) for cell in row.cells[: len(columns)]] for row in sheet.rows[1:4]]
    own = next((units for units in below if len(units) == len(columns) and all(units)), None)
    pairs = zip(columns, own or columns.values(), strict=True)
    units = {DIMENSIONS[name]: str(unit) for name, unit in pairs}
    if any(unit not in UNITS[dimension] for dimension, unit in units.items()):
        raise Refusal(f"its columns must be {', '.join(columns)}, in this order; pass `columns`")
    fixed = Options(
        kind=kind,
        columns={name: i + 1 for i, name in enumerate(columns)},
        units=units,
        deformation="shear",
        temperature=known["T"] + OFFSETS["C"] if "T" in known else None,
        load=known.get(load, usual),
        source="as in the file" if own else "as in all of RepTate's",
    )
    return [sheet._replace(fixed=fixed)]
