"""Measured moduli or compliances, and how those of several files or sheets are joined."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from ...core.display import shown
from .isotherms import grouped


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
                "converted with `poisson`). Fit all others with `master_curve`, `fit_relaxation` "
                "or `fit_creep`; the command `graded-contact fit FILE` does so, and writes the "
                "material as a table for a scene."
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


def apart(parts: Sequence[Measured]) -> bool:
    """Whether no two parts hold isotherms of one temperature."""
    if any(part.temperature is None for part in parts):
        return False
    _, group, owner = _groups(parts)
    return all(len(set(owner[group == i])) == 1 for i in range(np.max(group) + 1))


def _groups(parts: Sequence[Measured]) -> tuple[list[Measured], np.ndarray, np.ndarray]:
    """The isotherms of all parts, the group of temperature of each, and the part it is from."""
    curves = [curve for part in parts for curve in part.isotherms()]
    owner = np.repeat(np.arange(len(parts)), [len(part.isotherms()) for part in parts])
    return curves, grouped(np.array([np.mean(_known(curve)) for curve in curves])), owner


def _known(part: Measured) -> Float[np.ndarray, " points"]:
    if part.temperature is None:
        raise ValueError(f"`path={part.path}` does not say its temperature; pass `temperature`.")
    return part.temperature


def joined(parts: Sequence[Measured]) -> Measured:
    """The isotherms of several files or sheets; those of one temperature become one."""
    for field in ("kind", "deformation"):
        found = {str(part.path.name): getattr(part, field) for part in parts}
        if len(set(found.values())) > 1:
            raise ValueError(f"`path` names files of different {field}: {found}.")
    lacking = [str(part.path) for part in parts if part.temperature is None]
    if lacking:
        raise ValueError(
            f"`path` names several files, of which {lacking} do not say their temperature; pass "
            "`temperature` [K], one for each file."
        )
    curves, group, _ = _groups(parts)
    isotherm = np.repeat(group, [len(curve.abscissa) for curve in curves])
    abscissa = np.concatenate([curve.abscissa for curve in curves])
    order = np.lexsort((abscissa, isotherm))
    count, kelvin = np.max(group) + 1, np.concatenate([_known(curve) for curve in curves])
    told = (
        f"Together {count} isotherm(s), {np.min(kelvin):.2f} to {np.max(kelvin):.2f} K, of "
        f"{len(order)} points."
    )
    return dataclasses.replace(
        parts[0],
        abscissa=abscissa[order],
        values=np.concatenate([curve.values for curve in curves])[order],
        temperature=kelvin[order],
        isotherm=isotherm[order],
        lines=np.concatenate([curve.lines for curve in curves])[order],
        history=(*(sentence for part in parts for sentence in part.history), told),
    )
