"""Prony series from tables of relaxation times and moduli or ratios."""

import os
from collections.abc import Mapping

import numpy as np

from ..core.checks import Numbers, as_poisson, as_scalar, check_positive
from ..materials.material import Prony
from .columns import Heading, understood
from .source import Layout, source_of
from .tables import DataTable, read_table

_SERIES = {
    "time": Heading("time", r"(tau|τ)[ijk]?|t[ijk]|(relaxation|rel)times?"),
    "modulus": Heading("modulus", r"[EG][ijk]?|modulus|(mode|branch)modulus|strengths?"),
    "ratio": Heading("ratio", r"[ge][ijk]|ratio|weights?|(rel|relative)mod(ulus)?", "1"),
}
_WAYS = [("time", "modulus"), ("time", "ratio")]
_ROUNDED = 1e-3  # how far rounded ratios may add up to more than 1


def read_prony(
    path: str | os.PathLike,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    glassy: Numbers | None = None,
    equilibrium: Numbers | None = None,
    deformation: str | None = None,
    poisson: Numbers = 0.5,
    layout: Layout | None = None,
) -> Prony:
    """Returns the material of a Prony series in a table.

    A plain table begins with "tau [s], E_i [MPa]", or with "tau [s], g_i" for ratios of the
    instantaneous modulus. A line with the time "inf" has the equilibrium.

    **Arguments:**

    - `path`: the file, text or Excel.
    - `columns`: which column, by name or number from 1, is the "time", "modulus" or "ratio".
    - `units`: of "time" and "modulus", where the file states none.
    - `glassy` or `equilibrium`: the instantaneous modulus E_0 or the long-time modulus E_eq [Pa]
      (0 for a liquid), in tension or shear as the moduli of the table; not for a table with a line
      of the equilibrium.
    - `deformation`: "tension" (E) or "shear" (G), where the names do not say it. Ratios need none.
    - `poisson`: Poisson's ratio ν; moduli in shear become E = 2(1 + ν)G.
    - `layout`: of a table that is not plain, as in `read_moduli`.

    **Returns:** the material.

    **Raises:** `FileNotFoundError`; `ValueError` for a table that needs options.
    """
    poisson = as_poisson(poisson)
    table = read_table(source_of(path, "read_prony", columns=columns, units=units, layout=layout))
    found = understood(table, _SERIES, _WAYS, deformation=deformation)
    times, parts = found.numbers["time"], found.numbers[found.way[1]]
    if np.any(~(times > 0)) or np.any(~(parts >= 0)):
        raise table.not_plain(["times must be positive, and moduli or ratios not negative"])
    last = np.isinf(times)
    ends = {"glassy": glassy, "equilibrium": equilibrium}
    known = {name: float(as_scalar(each, name)) for name, each in ends.items() if each is not None}
    if found.way[1] == "ratio":
        rest, parts = _of_ratios(table, parts[~last], known)
    else:
        stated = {"inf": float(np.sum(parts[last]))} if np.any(last) else {}
        rest, parts = _of_moduli(table, parts[~last], known | stated)
    factor = 2 * (1 + float(poisson)) if found.deformation == "shear" else 1.0
    used = parts > 0
    return Prony(factor * rest, factor * parts[used], times[~last][used], poisson)


def _of_ratios(
    table: DataTable, ratios: np.ndarray, known: Mapping[str, float]
) -> tuple[float, np.ndarray]:
    """The long-time modulus, and the moduli of ratios of the instantaneous one."""
    total = float(np.sum(ratios))
    if len(known) != 1:
        reason = "its ratios need `glassy`, the instantaneous modulus, or `equilibrium`"
        raise table.not_plain([reason], **({} if known else {"glassy": "..."}))
    if total > 1 + _ROUNDED or ("equilibrium" in known and total >= 1):
        raise table.not_plain([f"its ratios add up to {total:.6g}"])
    whole = known["glassy"] if "glassy" in known else known["equilibrium"] / (1 - total)
    check_positive("glassy", whole, "[Pa]")
    return whole * max(0.0, 1 - total), whole * ratios


def _of_moduli(
    table: DataTable, moduli: np.ndarray, known: Mapping[str, float]
) -> tuple[float, np.ndarray]:
    """The long-time modulus, and the moduli of the branches."""
    if len(known) != 1:
        reason = "one is needed of `equilibrium`, `glassy` and a line with the time inf"
        raise table.not_plain([reason], **({} if known else {"equilibrium": "..."}))
    total = float(np.sum(moduli))
    ((name, value),) = known.items()
    if name == "glassy" and value < total:
        raise ValueError(f"`glassy` must be at least {total:.6g} Pa, the sum of the moduli.")
    return value - total if name == "glassy" else value, moduli
