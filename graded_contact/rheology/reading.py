"""Measured moduli and compliances from files of rheometers, DMAs and spreadsheets.

Whatever a file says about its columns, units and temperatures is used; what it leaves open is
asked for. Only a frequency without a unit goes by its name (f is in Hz, omega in rad/s), and a
modulus that is not called one of shear is Young's. What was understood is recorded, in sentences,
in `Measured.history`.
"""

import contextlib
import dataclasses
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from .._checks import Numbers, check_poisson
from .files.cells import Sheet, read_sheets
from .files.layout import KINDS, Layout, Told, understand
from .files.points import measured_points
from .files.quantities import DIMENSIONS, UNITS

DEFORMATIONS = ("tension", "shear")

# RepTate's master curves have no names of columns; its manual fixes their order and units.
_TTS_COLUMNS = {"frequency": 1, "storage": 2, "loss": 3}
_TTS_UNITS = {"frequency": "rad/s", "modulus": "Pa"}


@dataclasses.dataclass(frozen=True, eq=False)
class Measured:
    """Measured moduli or compliances, sorted by isotherm, then by frequency or time.

    **Fields:**

    - `kind`: "frequency" (complex modulus), "relaxation" (modulus) or "creep" (compliance).
    - `deformation`: "tension" (Young's modulus E, compliance D) or "shear" (G, J).
    - `abscissa`: angular frequencies [rad/s] or times [s], shape `(points,)`.
    - `values`: E' + iE'' [Pa], E(t) [Pa] or D(t) [1/Pa]; in shear G or J; shape `(points,)`.
    - `temperature`: [K], shape `(points,)`; None if it is not known.
    - `isotherm`: number of the isotherm from 0, in order of temperature, shape `(points,)`.
    - `lines`: where each point stands in the file, shape `(points,)`.
    - `path`: the file.
    - `history`: what was understood and done, one sentence each.
    """

    kind: str
    deformation: str
    abscissa: Float[np.ndarray, " points"]
    values: Complex[np.ndarray, " points"] | Float[np.ndarray, " points"]
    temperature: Float[np.ndarray, " points"] | None
    isotherm: Int[np.ndarray, " points"]
    lines: Int[np.ndarray, " points"]
    path: Path
    history: tuple[str, ...]

    def isotherms(self) -> tuple["Measured", ...]:
        """Returns the isotherms, from the coldest to the hottest."""
        return tuple(self._part(self.isotherm == i) for i in range(np.max(self.isotherm) + 1))

    def table(self) -> tuple[Float[np.ndarray, " points"], Complex[np.ndarray, " points"]]:
        """Returns `(omega, modulus)` [rad/s], [Pa] as `Tabulated` takes them.

        Raises `ValueError` unless these are Young's moduli at one temperature, each frequency
        once.
        """
        count = np.max(self.isotherm) + 1
        if self.kind != "frequency" or self.deformation != "tension" or count > 1:
            raise ValueError(
                f"`path={self.path}` holds {count} isotherm(s) of kind {self.kind!r} in "
                f"{self.deformation}; a table needs one, of kind 'frequency' in tension (shear is "
                "converted with `poisson`)."
            )
        twice = np.flatnonzero(np.diff(self.abscissa) == 0)
        if len(twice):
            first, second = self.lines[twice[0] : twice[0] + 2]
            raise ValueError(
                f"`path={self.path}`, lines {first} and {second}: the same frequency "
                f"{self.abscissa[twice[0]]:g} rad/s stands in both. Keep one of them."
            )
        return self.abscissa, self.values

    def _part(self, chosen: Bool[np.ndarray, " points"]) -> "Measured":
        return dataclasses.replace(
            self,
            abscissa=self.abscissa[chosen],
            values=self.values[chosen],
            temperature=None if self.temperature is None else self.temperature[chosen],
            isotherm=np.zeros(np.sum(chosen), int),
            lines=self.lines[chosen],
        )


def read_moduli(
    path: str | os.PathLike,
    *,
    kind: str | None = None,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    deformation: str | None = None,
    poisson: Numbers | None = None,
    temperature: Numbers | None = None,
    sheet: str | None = None,
) -> Measured:
    """Returns the moduli or compliances that a file holds.

    Understood are text with commas, semicolons, tabs or spaces, with decimal points or commas, and
    Excel workbooks (the extra `io`); a line of names, such as "f, E', tan delta", "Storage modulus
    [MPa]" or "G_loss_pa", and one of units below it; several isotherms below one another, told
    apart by a column of temperature (steps above 1 K), or side by side; rows in any order; missing
    values; RepTate's `.tts`. Every argument but the first overrides what the file says.

    **Arguments:**

    - `path`: the file.
    - `kind`: "frequency", "relaxation" or "creep"; of a file without telling names it also sets
      their order: frequency, storage, loss; time, modulus; time, compliance.
    - `columns`: which column, by name or by number from 1, is the "frequency", "time",
      "temperature", "storage", "loss", "magnitude", "tan_delta", "phase", "modulus" (relaxation)
      or "compliance".
    - `units`: of "frequency", "time", "modulus", "compliance", "temperature", "angle", "ratio":
      one of `rheology.files.quantities.UNITS`.
    - `deformation`: "tension" (E) or "shear" (G).
    - `poisson`: Poisson's ratio ν, to turn shear into tension by E = 2(1 + ν)G.
    - `temperature`: [K], of the whole file or of each of the curves side by side.
    - `sheet`: of a workbook.

    A missing file raises `FileNotFoundError`; what cannot be understood `ValueError`, naming the
    file, the line and the argument that would settle it.
    """
    path = Path(path)
    told = _told(kind, columns or {}, units or {}, deformation, temperature is not None)
    if poisson is not None:
        check_poisson("poisson", np.asarray(poisson))
    sheets = read_sheets(path)
    with _naming(path):
        if path.suffix.lower() == ".tts":
            told, temperature = _as_tts(told, temperature, sheets[0])
        chosen, layout = _choose(sheets, told, sheet)
        notes = [f"Read {len(layout.data)} rows of {path.name}, {chosen.layout}."]
        if len(sheets) > 1:
            others = ", ".join(repr(other.name) for other in sheets if other is not chosen)
            notes.append(f"Left out the sheets {others}.")
        points = measured_points(layout, poisson, temperature, notes)
        if layout.unused:
            notes.append(f"Not used: {', '.join(map(repr, layout.unused))}.")
    return Measured(kind=layout.kind, path=path, history=tuple(notes), **points._asdict())


def _told(
    kind: str | None,
    columns: Mapping[str, str | int],
    units: Mapping[str, str],
    deformation: str | None,
    temperature: bool,
) -> Told:
    choices = {"kind": (kind, KINDS), "deformation": (deformation, DEFORMATIONS)}
    for name, (value, allowed) in choices.items():
        if value is not None and value not in allowed:
            raise ValueError(f"`{name}={value!r}` is refused: use one of {allowed}.")
    for quantity in columns:
        if quantity not in DIMENSIONS:
            raise ValueError(
                f"`columns` has the key {quantity!r}; the quantities are {tuple(DIMENSIONS)}."
            )
    for dimension, unit in units.items():
        if dimension not in UNITS:
            raise ValueError(f"`units` has the key {dimension!r}; use one of {tuple(UNITS)}.")
        if unit not in UNITS[dimension]:
            raise ValueError(
                f"`units={{{dimension!r}: {unit!r}}}` is refused: use one of "
                f"{tuple(UNITS[dimension])}."
            )
    return Told(kind, columns, units, deformation, temperature)


@contextlib.contextmanager
def _naming(path: Path) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise ValueError(f"`path={path}`: {str(error).rstrip('.')}.") from None


def _as_tts(told: Told, temperature: Numbers | None, sheet: Sheet) -> tuple[Told, Numbers | None]:
    """What RepTate's format fixes, and the temperature [°C] of its first line, such as "T=-35;"."""
    first = " ".join(sheet.rows[0].cells) if sheet.rows else ""
    found = re.search(r"(?:^|;)\s*T=([-+.\deE]+)\s*;", first)
    if temperature is None and found:
        temperature = float(found[1]) + 273.15
    told = dataclasses.replace(
        told,
        columns={**_TTS_COLUMNS, **told.columns},
        units={**_TTS_UNITS, **told.units},
        deformation=told.deformation or "shear",
        temperature=temperature is not None,
        source="as told" if told.units else "as in all of RepTate's",
    )
    return told, temperature


def _choose(sheets: list[Sheet], told: Told, name: str | None) -> tuple[Sheet, Layout]:
    """The sheet asked for, or the longest one that is understood."""
    if name is not None:
        names = [sheet.name for sheet in sheets]
        if name not in names:
            raise ValueError(f"there is no `sheet={name!r}`, only {names}")
        sheets = [sheets[names.index(name)]]
    refusals = []
    for sheet in sorted(sheets, key=lambda sheet: len(sheet.rows), reverse=True):
        try:
            return sheet, understand(sheet, told)
        except ValueError as error:
            refusals.append(f"sheet {sheet.name!r}: {error}" if sheet.name else str(error))
    raise ValueError("; ".join(refusals))
