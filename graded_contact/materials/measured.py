"""Measured moduli or compliances, of one file or of several together."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from ..core.display import shown

ISOTHERM_GAP = 1.0  # K from one isotherm to the next; instruments vary by a few tenths


@shown("kind", "deformation", "abscissa", "values", "temperature", "history")
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
    - `lines`: the line of each point in the file, shape `(points,)`.
    - `path`: the file.
    - `history`: how the file was read, one sentence for each step.
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
        return tuple(self.part(self.isotherm == i) for i in range(np.max(self.isotherm) + 1))

    def table(self) -> tuple[Float[np.ndarray, " points"], Complex[np.ndarray, " points"]]:
        """Returns `(omega, modulus)` [rad/s], [Pa], the arguments of `Tabulated`.

        Raises `ValueError` unless these are Young's moduli at one temperature.
        """
        count = np.max(self.isotherm) + 1
        if self.kind != "frequency" or self.deformation != "tension" or count > 1:
            raise ValueError(
                f"`path={self.path}` holds {count} isotherm(s) of kind {self.kind!r} in "
                f"{self.deformation}; a table needs one, of kind 'frequency' in tension (shear is "
                "converted with `poisson`). Fit others: `graded-contact fit FILE`."
            )
        return self.abscissa, self.values

    def part(self, chosen: Bool[np.ndarray, " points"] | Int[np.ndarray, " chosen"]) -> "Measured":
        """Returns some of the points; isotherms without a point are not counted."""
        return dataclasses.replace(
            self,
            abscissa=self.abscissa[chosen],
            values=self.values[chosen],
            temperature=None if self.temperature is None else self.temperature[chosen],
            isotherm=np.unique(self.isotherm[chosen], return_inverse=True)[1],
            lines=self.lines[chosen],
        )


def grouped(kelvin: np.ndarray) -> Int[np.ndarray, " points"]:
    """Numbers of groups of temperatures, from 0, the coldest first."""
    # A step from one sorted temperature to the next starts a group: drift does not.
    order = np.argsort(kelvin, kind="stable")
    group = np.empty(len(kelvin), int)
    group[order] = np.cumsum(np.diff(kelvin[order], prepend=kelvin[order[0]]) > ISOTHERM_GAP)
    return group


def joined(parts: Sequence[Measured]) -> Measured:
    """The isotherms of several files or sheets; isotherms of one temperature become one."""
    for field in ("kind", "deformation"):
        found = {str(part.path.name): getattr(part, field) for part in parts}
        if len(set(found.values())) > 1:
            raise ValueError(f"`path` names files of different {field}: {found}.")
    lacking = [str(part.path) for part in parts if part.temperature is None]
    if lacking:
        raise ValueError(f"`path` lacks the temperature of {lacking}: pass `temperature` [K].")
    curves = [curve for part in parts for curve in part.isotherms()]
    group = grouped(np.array([np.mean(np.asarray(curve.temperature)) for curve in curves]))
    isotherm = np.repeat(group, [len(curve.abscissa) for curve in curves])

    def all_of(field: str) -> np.ndarray:
        return np.concatenate([getattr(curve, field) for curve in curves])

    order = np.lexsort((all_of("abscissa"), isotherm))
    kelvin = all_of("temperature")
    note = (
        f"Together {np.max(group) + 1} isotherm(s), {np.min(kelvin):.2f} to {np.max(kelvin):.2f} "
        f"K, of {len(order)} points."
    )
    return dataclasses.replace(
        parts[0],
        **{name: all_of(name)[order] for name in ("abscissa", "values", "temperature", "lines")},
        isotherm=isotherm[order],
        history=(*(sentence for part in parts for sentence in part.history), note),
    )
