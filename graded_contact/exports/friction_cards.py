"""A table of friction as text for other programs, SI units; in CSV all digits of a double.

Source: Abaqus Keywords Reference Guide, *FRICTION: a data line holds the friction coefficient, slip
rate, contact pressure and average temperature of the two surfaces. The first of these varies
fastest, each in increasing order, and outside of its range the coefficient is that at the end.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..core.checks import check_values, short
from ..core.escaping import in_comment, in_csv
from .prony_cards import check_card, in_card

if TYPE_CHECKING:
    from xarray import Dataset

TABLE_AXES = ("temperature", "pressure", "velocity")  # from slow to fast


def export_friction(table: "Dataset", format: str, *, name: str = "friction") -> str:
    """Returns the text of a table of friction in one of `FRICTION_CARDS`.

    - "abaqus": *SURFACE INTERACTION with *FRICTION, which depends on slip rate, contact pressure
      and, if it is an axis, temperature [K];
    - "csv": a line for each point with velocity, pressure, temperature (if it is an axis), friction
      and contact area with their errors, as brush models of tyres and models of ABS interpolate it.

    Comments (`**` or `#`) have the method, the errors and the conditions.

    **Arguments:**

    - `table`: of `friction_table`, or of `Plan.run` without further axes.
    - `format`: one of `FRICTION_CARDS`.
    - `name`: of the surface interaction.

    **Returns:** the text of the file.

    **Raises:** `ValueError` for a table with other axes, points without a friction, a negative
    velocity or friction, or a format that does not exist.
    """
    check_card(format, FRICTION_CARDS, name)
    return FRICTION_CARDS[format](_checked(table), name)


NUMBERS = (
    "friction", "friction_error", "friction_standard_error", "contact_area", "contact_area_error",
)  # fmt: skip
METHODS = {
    "contact": "contact of the surface on a grid; errors are those of solver and grid together",
    "mean_field": (
        "mean field (Persson's theory); its errors are those of the quadrature alone, and contact "
        "may differ by a factor of 2"
    ),
}
ERRORS_IN_WORDS = {
    "friction_error": "Relative error of friction",
    "friction_standard_error": "Relative standard error of friction by the errors of the materials",
}


def _checked(table: "Dataset") -> "Dataset":
    """The table with its axes in order, each increasing."""
    axes = [axis for axis in TABLE_AXES if axis in getattr(table, "dims", ())]
    variables = [getattr(table, "data_vars", {}).get(n) for n in ("friction", "friction_error")]
    if any(v is None or {*v.dims} != {*axes} for v in variables) or axes[-2:] != [*TABLE_AXES[1:]]:
        axes = "velocity, pressure and perhaps temperature, and nothing else"
        needed = f"it needs `friction` and `friction_error` over {axes}"
        raise ValueError(f"`table={short(table)}` is refused: {needed}.")
    # The last axis varies fastest in the lines, and *FRICTION wants increasing values.
    table = table.transpose(*axes, ...).sortby(axes)
    messages = np.ravel(table.get("message", np.array("")))
    if failed := [message for message in messages if message != ""]:
        share = f"{len(failed)} of {len(messages)} points that failed or did not converge"
        raise ValueError(f"`table` has {share}, see `message`. The first: {failed[0]}")
    words = "it must be a finite number, not negative"
    for part in ("friction", "friction_error", "velocity"):
        check_values(f"table.{part}", table[part].values, words, at_least=0)
    return table


def _lines(
    table: "Dataset", columns: list[str], separator: str, spell: Callable[[float], str]
) -> list[str]:
    """A line of numbers for each point, the velocity varying fastest."""
    names = [name for name in NUMBERS if name in table]
    points = table[names].to_dataframe([*table["friction"].dims])
    rows = points.reset_index()[columns].astype(float).to_numpy().tolist()
    return [separator.join(map(spell, row)) for row in rows]


def _remarks(table: "Dataset") -> list[str]:
    """Method, errors and conditions, in lines."""
    lines = [f"Method: {METHODS[table.attrs.get('method', 'contact')]}"]
    if title := table.attrs.get("title"):
        lines.insert(0, f"Friction of: {title}")
    friction = np.where(table["friction"] > 0, table["friction"], np.inf)
    for name, words in ERRORS_IN_WORDS.items():
        if name in table:
            share = table[name].values / friction
            lines.append(f"{words}: {100 * np.min(share):.2g} % to {100 * np.max(share):.2g} %")
    told = "\n".join(table.attrs.get(name, "") for name in ("conditions", "warnings"))
    return [*lines, *filter(None, told.split("\n"))]


def _abaqus(table: "Dataset", name: str) -> str:
    columns = ["friction", "velocity", "pressure", *table["friction"].dims[:-2]]
    least = float(table["velocity"].min())
    lines = [
        "** Units: m/s, Pa, K. Friction coefficient, slip rate, contact pressure, temperature.",
        f"** Below {least:.4g} m/s Abaqus keeps the friction of this rate. At rest friction by",
        "** hysteresis is 0: adhesion or shear hold a surface at rest, if the scene has them.",
        *(in_comment(line, "**") for line in _remarks(table)),
        f"*SURFACE INTERACTION, NAME={name}",
        "*FRICTION",
    ]
    return "\n".join([*lines, *_lines(table, columns, ", ", in_card), ""])


def _csv(table: "Dataset", name: str) -> str:
    units = {"velocity": " [m/s]", "pressure": " [Pa]", "temperature": " [K]"}
    units = {axis: unit for axis, unit in units.items() if axis in table["friction"].dims}
    units |= {name: "" for name in NUMBERS if name in table}
    heads = ",".join(f"{column}{unit}" for column, unit in units.items())
    remarks = [in_csv(line, "#") for line in _remarks(table)]
    return "\n".join([*remarks, heads, *_lines(table, [*units], ",", repr), ""])


FRICTION_CARDS: dict[str, Callable[["Dataset", str], str]] = {"abaqus": _abaqus, "csv": _csv}
