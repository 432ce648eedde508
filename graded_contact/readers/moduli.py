"""Measured moduli and compliances from tables.

a file ──> DataTable (names, units, cells) ──> the column of each quantity ──> Measured
"""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from ..core.checks import Numbers, as_poisson, check_positive
from ..materials.measured import Measured, grouped, joined
from .columns import Heading, Understood, understood
from .source import Layout, source_of
from .tables import DataTable, read_table

HUGE = 1e30  # in SI units; instruments write 9.9e37 where they measured nothing
_REPEATED = 0.1  # part of the lines that may repeat a frequency without being an isotherm
_RISE = 1.1  # of a relaxation modulus over time, by noise
_OF_E = r"(shear|tensile|young's)?"
QUANTITIES = {
    "frequency": Heading("frequency", r"f|w|ω|omega|freq(uency)?|ang(ular)?freq(uency)?"),
    "time": Heading("time", r"t|time"),
    "temperature": Heading("temperature", r"T|temp(erature)?"),
    "storage": Heading("modulus", rf"[EG]('|stor(age)?)|{_OF_E}storage(modulus)?"),
    "loss": Heading("modulus", rf"[EG](''|loss)|{_OF_E}loss(modulus)?"),
    "magnitude": Heading("modulus", rf"\|?[EG]\*\|?|{_OF_E}complexmodulus"),
    "tan_delta": Heading("ratio", r"tan\(?(delta|δ|d)\)?|lossfactor", "1"),
    "phase": Heading("angle", r"phase(angle)?|delta|δ"),
    "modulus": Heading("modulus", rf"[EG](\(t\)|relax(ation)?)?|{_OF_E}(relax(ation)?)?modulus"),
    "storage_compliance": Heading("compliance", r"[DJ]'|storagecompliance"),
    "loss_compliance": Heading("compliance", r"[DJ]''|losscompliance"),
    "compliance": Heading("compliance", r"[DJ](\(t\))?|(creep)?compliance"),
    "strain": Heading("ratio", r"strain|strainamplitude|strain(dyn)?|γ|ε|oscillationstrain"),
}
# The complex modulus by the quantities that are measured, the most direct first.
_COMPLEX: dict[tuple[str, ...], Callable[..., Any]] = {
    ("storage", "loss"): lambda storage, loss: storage + 1j * loss,
    ("storage", "tan_delta"): lambda storage, tangent: storage * (1 + 1j * tangent),
    ("magnitude", "tan_delta"): lambda size, tangent: size * np.exp(1j * np.arctan(tangent)),
    ("magnitude", "phase"): lambda size, phase: size * np.exp(1j * phase),
    ("storage_compliance", "loss_compliance"): lambda real, loss: 1 / (real - 1j * loss),
}
# By the quantities of a table, the kind of measurement and the values.
_WAYS: dict[tuple[str, ...], tuple[str, Callable[..., Any]]] = {
    **{("frequency", *names): ("frequency", value) for names, value in _COMPLEX.items()},
    ("time", "modulus"): ("relaxation", lambda modulus: modulus),
    ("time", "compliance"): ("creep", lambda compliance: compliance),
}
_SWEEPS = {("strain", *names): ("strain", value) for names, value in _COMPLEX.items()}


def read_moduli(
    path: str | os.PathLike | Sequence[str | os.PathLike],
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    deformation: str | None = None,
    poisson: Numbers | None = None,
    temperature: Numbers | None = None,
    layout: Layout | None = None,
) -> Measured:
    """Returns the moduli or compliances in a table, or in several tables of one material.

    A plain table needs no options: its first line has names and units, such as
    "f [Hz], E' [MPa], E'' [MPa], T [°C]", or the units stand in the line below. Rows with an empty
    cell, or a number that is not positive, are left out, and the history lists them. Isotherms are
    in one table with a column of temperature (steps above 1 K), or one in each of several files or
    sections. Where something is missing, the error shows the first lines and the call to complete.

    **Arguments:**

    - `path`: the file, text or Excel, or a list of files.
    - `columns`: which column, by name or number from 1, is the "frequency", "time", "temperature",
      "storage", "loss", "magnitude", "tan_delta", "phase", "modulus" (relaxation), "compliance"
      (creep), "storage_compliance" or "loss_compliance".
    - `units`: of "frequency", "time", "temperature", "modulus", "compliance", "ratio" or "angle",
      where the file states none, such as {"modulus": "MPa"}.
    - `deformation`: "tension" (E, D) or "shear" (G, J), where the names do not say it.
    - `poisson`: Poisson's ratio ν, to convert shear to tension by E = 2(1 + ν)G.
    - `temperature`: [K] of all tables, or of each, if they have no column of it.
    - `layout`: of a table that is not plain: {"header": 9} for the number of the line of names,
      "end" for the last line, "separator", "decimal" (","), "sheet" of a workbook, and
      "section" of a rheometer's text, one name or a list.

    **Returns:** isotherms, with a history of the reading, see `Measured`.

    **Raises:** `FileNotFoundError`; `ValueError` for a table that needs options.
    """
    paths = [path] if isinstance(path, str | os.PathLike) else list(path)
    ratio = None if poisson is None else float(as_poisson(poisson))
    layouts = _layouts(layout)
    tables = [
        read_table(source_of(each, "read_moduli", columns=columns, units=units, layout=one))
        for each in paths
        for one in layouts
    ]
    how: Any = {"also": ["temperature"], "deformation": deformation}
    found = [understood(table, QUANTITIES, list(_WAYS), **how) for table in tables]
    kelvins = _kelvins(temperature, len(tables))
    parts = [_measured(one, ratio, kelvin) for one, kelvin in zip(found, kelvins, strict=True)]
    return parts[0] if len(parts) == 1 else joined(parts)


def read_strain_sweep(
    path: str | os.PathLike,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    layout: Layout | None = None,
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Returns strain amplitudes ε [1] and the factors f of E' and g of E'' [1] in a strain sweep.

    They are what `materials.StrainSoftening` takes: `StrainSoftening(rubber, *read_strain_sweep(
    "sweep.csv"))`. The factors are relative to the smallest strain. Strains are read as they stand:
    halve a peak-to-peak amplitude.

    **Arguments:** as in `read_moduli`; columns of strain (% or 1), moduli in tension or shear.

    **Returns:** ε, f and g, in order of ε.
    """
    options = {"columns": columns, "units": units, "layout": layout}
    table = read_table(source_of(path, "read_strain_sweep", **options))
    found = understood(table, QUANTITIES, list(_SWEEPS), deformed=False)
    sweep = _measured(found, None, None)
    if np.any(np.diff(np.sign(np.diff(sweep.abscissa[np.argsort(sweep.lines)])))):
        raise table.not_plain(["its strains go up and down: it is not one sweep"])
    parts = np.real(sweep.values), np.imag(sweep.values)
    return sweep.abscissa, *(part / part[0] for part in parts)


def _layouts(layout: Layout | None) -> list[Layout | None]:
    """The layout of each table of a file: a list of sections has several."""
    sections = (layout or {}).get("section")
    if not isinstance(sections, list | tuple):
        return [layout]
    return [{**(layout or {}), "section": section} for section in sections]


def _kelvins(temperature: Numbers | None, count: int) -> list[float | None]:
    """The temperature of each table [K]."""
    if temperature is None:
        return [None] * count
    kelvins = np.asarray(temperature, float)
    check_positive("temperature", kelvins, "[K]")
    if kelvins.shape not in ((), (count,)):
        raise ValueError(f"`temperature` must have one number, or {count}, one for each table.")
    return np.broadcast_to(kelvins, count).tolist()


def _measured(found: Understood, poisson: float | None, kelvin: float | None) -> Measured:
    """The moduli of a table; lines without positive numbers are left out."""
    table, way = found.table, found.way
    good = np.all([(each > 0) & (each < HUGE) for each in found.numbers.values()], axis=0)
    if np.sum(good) < 2:
        raise table.not_plain([f"no lines have positive numbers of {', '.join(way)}"])
    history = [found.told]
    if not np.all(good):
        lines = ", ".join(map(str, table.lines[~good]))
        history.append(f"Left out lines without positive numbers: {lines}.")
    numbers = {name: each[good] for name, each in found.numbers.items()}
    kind, value = {**_WAYS, **_SWEEPS}[way]
    abscissa, values = numbers[way[0]], value(*(numbers[name] for name in way[1:]))
    deformation = found.deformation or "tension"
    if deformation == "shear" and poisson is not None:
        factor = 2 * (1 + poisson)
        values = values / factor if kind == "creep" else factor * values
        history.append(f"Converted from shear to tension by `poisson`: E = {factor:.6g} G.")
        deformation = "tension"
    temperature = numbers.get("temperature")
    if kelvin is not None:
        if temperature is not None:
            raise table.not_plain(["it has a column of temperature: leave out `temperature`"])
        temperature = np.full(len(values), kelvin)
    isotherm = np.zeros(len(values), int) if temperature is None else grouped(temperature)
    order = np.lexsort((abscissa, isotherm))
    measured = Measured(
        kind=kind,
        deformation=deformation,
        abscissa=abscissa[order],
        values=values[order],
        temperature=None if temperature is None else temperature[order],
        isotherm=isotherm[order],
        lines=table.lines[good][order],
        path=table.source.path,
        history=tuple(history),
    )
    _check_sweep(table, way[0], measured)
    return measured


def _check_sweep(table: DataTable, name: str, measured: Measured) -> None:
    """Refuses numbers at one frequency, isotherms without temperatures, and E(t) that rises."""
    first = measured.isotherms()[0]
    ends = np.abs(first.values[[0, -1] if first.kind == "relaxation" else [-1, 0]])
    if first.kind in ("relaxation", "creep") and ends[1] > _RISE * ends[0]:
        wrong = "rise" if first.kind == "relaxation" else "fall"
        raise table.not_plain([f"its values {wrong} over time: they are no {first.kind}"])
    if np.ptp(measured.abscissa) == 0:
        hint = " (`read_strain_sweep` reads a sweep of strain)" * (name == "frequency")
        raise table.not_plain([f"the {name} is the same in every line: it is no sweep{hint}"])
    repeated = (np.diff(measured.abscissa) == 0) & (np.diff(measured.isotherm) == 0)
    if measured.temperature is None and np.sum(repeated) > _REPEATED * len(measured.abscissa):
        reason = f"{np.sum(repeated)} lines repeat the {name} of others, as isotherms do"
        raise table.not_plain([reason], columns={"temperature": "..."})
