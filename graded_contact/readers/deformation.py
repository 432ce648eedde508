"""Tension or shear: what a file says of its moduli. Young's modulus E is about three times G.

The names of the columns count first (E', G'), then a column that only a test in shear has, then
what the lines of the file say: their geometry, the way of loading, the kind of instrument. If none
of them says it, tension is assumed, and a warning says so.
"""

import re
from collections.abc import Iterable, Sequence

from .columns import MeasuredTable

# Words of columns that only a test in shear has.
_OF_SHEAR = re.compile(
    r"(?i)shear|schub|scher|cisaill|torque|drehmoment|\bmoment\b|\bcouple\b|rotation|vis[ck]osit"
)
_TENSION = r"tension|tensile|compression|bending|cantilever|3[- ]?point|three[- ]point"
_SHEAR = r"\bshear|parallel|plates?\b|\bcones?\b|couette|concentric|torsion|\b[PC]P[- ]?\d"
_PLACE = r"(?i)(?:geometr|clamp|fixture|holder|halter|probe|system|prüfart|belastung|\bmode).*"
# Pairs for tension and shear; the first pair of which one is in a line of the file decides.
_SIGNS = (
    (rf"{_PLACE}(?:{_TENSION}|zug|biege|druck|traction|flexion)",
     rf"{_PLACE}(?:{_SHEAR}|scher|schub|platte|kegel|cisaill|c[oô]ne)"),
    (rf"(?i){_TENSION}|young",
     r"(?i)\bshear|(?:parallel|plate|cone)[- ](?:and[- ])?plate|couette|torque|drehmoment|torsion"
     r"|\bgap\b"),
    (r"(?i)\bDMT?A|eplexor|metravib|\bQ800|\bRSA\b",
     r"(?i)rh[eé]omet|rhéom|anton paar|\bphysica|\bMCR[- ]?\d|\bARES|\bAR[- ]?(?:G2|\d{3})"
     r"|discovery hr|\bD?HR[- ]?\d|kinexus|haake|\bbohlin|rheo(?:compass|plus|win)|\bDSR\b|\bRPA\b"
     r"|\brSpace"),
)  # fmt: skip


def deformation_in(columns: Iterable[str], lines: Iterable[str]) -> tuple[str | None, str]:
    """Returns "tension", "shear" or None, and what says so, or why nothing does.

    **Arguments:**

    - `columns`: names of columns that are no moduli.
    - `lines`: those of the file that hold no numbers of a table.
    """
    lines = list(lines)
    column = next(filter(_OF_SHEAR.search, columns), None)
    tension, shear = (next(filter(re.compile(sign).search, lines), None) for sign in _SIGNS[0])
    if column and tension and not shear:
        raise ValueError(
            f"the line {_clipped(tension)} names tension, compression or bending, but only a test "
            f"in shear has a column {column!r}: pass `deformation`"
        )
    if column:
        return "shear", f"the column {column!r}"
    for signs in _SIGNS:
        tension, shear = (next(filter(re.compile(sign).search, lines), None) for sign in signs)
        if tension and shear:
            return None, f"the lines {_clipped(tension)} and {_clipped(shear)} say both"
        if tension or shear:
            return (
                "tension" if tension else "shear"
            ), f"the line {_clipped(tension or shear or '')}"
    return None, "no column and no line of the file says tension or shear"


def _clipped(line: str) -> str:
    return repr(line if len(line) <= 60 else line[:57] + "...")


def as_young(measured: MeasuredTable, lines: Sequence[str]) -> tuple[str, float]:
    """Returns tension or shear, and the factor that converts the moduli of a table to it.

    **Arguments:**

    - `measured`: the table; without a Poisson's ratio in its options shear remains shear.
    - `lines`: as of `deformation_in`.
    """
    log, poisson = measured.log, measured.options.poisson
    if measured.kind == "strain":
        return "shear", 1.0  # only ratios of the moduli count
    named = {column.deformation for column in measured.columns.values()} - {None}
    if len(named) > 1:
        labels = ", ".join(column.label for column in measured.columns.values())
        raise ValueError(f"{labels} mix tension and shear; choose matching ones by `columns`")
    if not named:
        found, reason = deformation_in(measured.unused, lines)
        named = {found}
        if found is None:
            log.assume(
                f"The moduli are assumed to be Young's (tension), because {reason}. If they are of "
                "shear, E is about three times as large: read the file with "
                "`deformation='shear'`, or with `deformation='tension'` if this is right."
            )
        else:
            other = "tension" if found == "shear" else "shear"
            log.note(f"Read as {found}, because of {reason}; else pass `deformation={other!r}`.")
    if named != {"shear"}:
        return "tension", 1.0
    if poisson is None:
        log.note("These are shear moduli (G); `poisson` converts them to Young's moduli (E).")
        return "shear", 1.0
    factor = 2 * (1 + poisson)
    log.note(f"Converted from shear to tension by `poisson`: E = {factor:.6g} G.")
    return "tension", factor
