"""Evaluations of a design's objective, kept in a file: what was computed once is not again.

A search repeats itself exactly from what is kept, up to where it was cut off, and goes on from
there. The file has one line of JSON for its parameters' names and one for each evaluation, after a
digest of itself, written at once; of a killed program at most the last line is half and is dropped.
"""

import hashlib
import json
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

FORMAT = "graded_contact evaluations 2"
# How far values may differ that the same problem has on another day or machine, relative to what
# is usual, and how far constraints may besides, which are held by such a margin.
SAME, MARGIN = 1e-6, 1e-8
REMEDY = "Delete it or give another name."


class Evaluation(NamedTuple):
    """Objective and constraints at some parameters, with their derivatives by them."""

    value: float
    limits: Float[np.ndarray, " constraints"]
    slope: Float[np.ndarray, " parameters"]
    slopes: Float[np.ndarray, "constraints parameters"]


class Evaluations:
    """Evaluations by their flat parameters, in memory and, if it has a path, in a file.

    **Arguments:**

    - `path`: of the file; None keeps nothing.
    - `names`: of the parameters.

    **Raises:** `ValueError` if the folder does not exist, if the file is not one of these, or if
    its parameters have other names.
    """

    def __init__(self, path: str | Path | None, names: list[str]):
        self.path, self.names = None if path is None else Path(path), names
        self.kept: dict[tuple[float, ...], Evaluation] = {}
        self.unproven: set[tuple[float, ...]] = set()
        if self.path is None:
            return
        if not self.path.parent.is_dir():
            raise ValueError(f"`store={str(path)!r}`: its folder does not exist.")
        if self.path.exists():
            self._read(self.path)
            self.unproven = set(self.kept)
        else:
            self.path.write_text(self._head() + "\n", encoding="utf-8")

    @property
    def first(self) -> Float[np.ndarray, " parameters"] | None:
        """The parameters evaluated first, or None."""
        return np.array(next(iter(self.kept))) if self.kept else None

    def get(self, x: Float[np.ndarray, " parameters"], proven: bool) -> Evaluation | None:
        """Returns what is kept of the parameters `x`, or None; `proven`, if computed here."""
        at = tuple(x.tolist())
        return None if proven and at in self.unproven else self.kept.get(at)

    def add(self, x: Float[np.ndarray, " parameters"], found: Evaluation) -> None:
        """Keeps what was computed at the parameters `x`; what a file holds of them must agree."""
        at = tuple(x.tolist())
        if at in self.unproven:
            self._check(at, found)
            self.unproven.remove(at)
            return
        self.kept[at] = found
        if self.path is not None:
            numbers = {name: np.asarray(part).tolist() for name, part in found._asdict().items()}
            with self.path.open("a", encoding="utf-8") as file:
                file.write(_sealed(json.dumps({"parameters": at, **numbers})) + "\n")

    def _check(self, at, found):
        kept = self.kept[at]
        eps = max(SAME, 100 * float(np.finfo(found.slope.dtype).eps))
        size = np.median([abs(one.value) for one in self.kept.values()])
        # Compared so that what is not a number is refused.
        if not abs(found.value - kept.value) <= eps * max(abs(kept.value), size):
            self._refuse("objective", at, kept.value, found.value)
        if found.limits.shape != kept.limits.shape:
            self._refuse("constraints", at, kept.limits, found.limits)
        size = np.median([np.abs(one.limits) for one in self.kept.values()], axis=0)
        room = MARGIN + eps * np.maximum(np.abs(kept.limits), size)
        if not np.all(np.abs(found.limits - kept.limits) <= room):
            self._refuse("constraints", at, kept.limits, found.limits)

    def _refuse(self, name, at, kept, found):
        where = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.names, at, strict=True))
        raise ValueError(
            f"`store={str(self.path)!r}` belongs to another `{name}`: at {where} it holds {kept}, "
            f"and `{name}` is {found}. {REMEDY}"
        )

    def _read(self, path):
        content = path.read_bytes()
        whole, newline, half = content.rpartition(b"\n")
        if not newline and self._head().encode().startswith(half):  # killed while it was made
            path.write_text(self._head() + "\n", encoding="utf-8")
            return
        try:
            first, *lines = whole.decode("utf-8").split("\n")
            for number, line in enumerate(lines, start=2):
                if line != _sealed(line.partition(" ")[2]):
                    raise ValueError(f"line {number} was changed after it was written")
            head, *entries = map(json.loads, [first, *(s.partition(" ")[2] for s in lines)])
            if head["format"] != FORMAT:
                raise ValueError(f"it does not say that it holds {FORMAT!r}")
            names = [str(name) for name in head["parameters"]]
            for entry in entries:
                x = tuple(map(float, entry["parameters"]))
                value, limits, slope, slopes = (entry[name] for name in Evaluation._fields)
                slopes = np.reshape(np.array(slopes, float), (len(limits), len(slope)))
                arrays = np.array(limits, float), np.array(slope, float), slopes
                self.kept[x] = Evaluation(float(value), *arrays)
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise ValueError(
                f"`store={str(path)!r}` cannot be read as evaluations of a design: {error}. "
                f"{REMEDY}"
            ) from error
        if names != self.names:
            raise ValueError(
                f"`store={str(path)!r}` belongs to a design of {', '.join(names)}, not of "
                f"{', '.join(self.names)}. {REMEDY}"
            )
        if half:
            os.truncate(path, len(whole) + 1)

    def _head(self):
        return json.dumps({"format": FORMAT, "parameters": self.names})


def _sealed(line: str) -> str:
    """A line after a digest of it."""
    return f"{hashlib.sha256(line.encode('utf-8', 'surrogatepass')).hexdigest()[:16]} {line}"
