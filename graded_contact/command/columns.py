"""Columns of the tables of results: heads, units, and cells with no digits beyond the error."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core.display import number, unit_of
from ..core.quantities import STEADY, quantity_of
from ..scenes.results import (
    DEPTH,
    FLOWS,
    LEAKAGE,
    SEED_ERROR,
    has_numbers,
    kind_of_results,
    without_friction,
)
from ..sliding.interior.stress import STRESSES
from ..sliding.number import FOUR, TOTAL, numbers_in
from ..sliding.result import RESULTS

if TYPE_CHECKING:
    from xarray import Dataset

OF_STRESS = tuple(name + end for name in STRESSES for end in ("", DEPTH))
# What a table has without `--full`, with the errors.
MAIN = (
    "mean_friction", "friction", "peak_friction", "contact_area", "mean_pressure", "approach",
    "contact_stiffness", "specific_conductance", *FLOWS, *LEAKAGE, *OF_STRESS,
)  # fmt: skip
OVER_TIME = ("friction", "load", "contact_area", "mean_gap", "work_done", *FLOWS, *LEAKAGE)
OF_FRICTION = ("friction", "work", "power")  # in names of what is rounding at rest
# Errors that are no part of the total: ends of names, and heads.
APART = {"_standard_error": "± by\nmaterials", SEED_ERROR: "± over\nsurfaces"}


_ENTRIES = {name: entry for kind in RESULTS.values() for name, entry in numbers_in(kind).items()}


class TableCells(NamedTuple):
    """A column of numbers: its head, their format, the factor to their unit, and their results."""

    head: str
    form: str
    factor: float
    results: Any

    def cell(self, name: str, index: tuple[int, ...]) -> str:
        """A number in words; one below its error as its bound, without the error beside it."""
        value, error = (self._at(one, index) for one in (name, f"{name}_error"))
        of = name.removesuffix("_error")
        if of != name and of in self.results and abs(self._at(of, index)) < value < np.inf:
            return ""
        of_friction = name in {f"friction{end}" for end in ("", *APART)}
        steady = of_friction and kind_of_results(self.results) == STEADY
        if steady and np.isfinite(value) and bool(without_friction(self.results)[index]):
            return "0"  # what stands there is rounding
        spread = 0.0 if of != name else self._at(f"{name}{SEED_ERROR}", index)
        return number(value, self.form, float(np.fmax(error, spread)))

    def _at(self, name: str, index: tuple[int, ...]) -> float:
        known = name in self.results
        return self.factor * float(self.results[name].values[index]) if known else 0.0


def names_in_table(results: "Dataset", full: bool) -> list[str]:
    """The names of the numbers in the table of solves; at rest it has the gap."""
    if full:
        every = [*(n for n, entry in _ENTRIES.items() if entry.column), *LEAKAGE, *OF_STRESS]
    else:
        every = [*MAIN, *(["mean_gap"] if rounding_in(results) else [])]
    axes = results["message"].dims
    return [
        n for n in every if not n.endswith("_error") and n in results and results[n].dims == axes
    ]


def columns_in_table(results: "Dataset", names: Iterable[str], full: bool) -> dict[str, TableCells]:
    """The columns of numbers and of their errors, which stand beside them."""
    known = {name: entry.column for name, entry in _ENTRIES.items() if entry.column}
    known |= {name: (f"leakage\nalong {name[-1]}\n[m³/s]", ".3e") for name in LEAKAGE}
    known |= {f"{name}_error": TOTAL for name in LEAKAGE}
    known |= {name + end: (head, ".1e") for name in MAIN for end, head in APART.items()}
    hidden = {"unmeasured_friction"} if "measured" not in results else set()
    # Without shear in the contact, all friction is hysteresis. With coupling, shear and slopes
    # exchange power: only what the block loses and what heats the interface are parts of it.
    without = "shear_friction" in results and not np.any(results["shear_friction"])
    if without or "block_friction" in results:
        hidden |= {"hysteresis_friction", "shear_friction"}
    if not full:
        hidden |= {*rounding_in(results)} | ({*FLOWS} if LEAKAGE[0] in results else set())
    found = {}
    for name in names:
        if name in hidden or name not in results:
            continue
        quantity, factor = quantity_of(name), 1.0
        unit = "" if quantity is None else quantity.unit
        head, form = known.get(name, (name.replace("_", " ") + f"\n[{unit}]", FOUR))
        if unit in ("m", "Pa"):
            shown, factor = unit_of(unit, float(abs(results[name]).max()))
            head = head.replace(f"[{unit}]", f"[{shown}]")
        found[name] = TableCells(head, form, factor, results)
        for error in (name + end for end in ("_error", *APART)):
            if error in known and error in results:
                found[error] = TableCells(*known[error], factor, results)
    return found


def rounding_in(results: "Dataset") -> list[str]:
    """The names of what friction does, where it is 0 within rounding or errors; at rest it is."""
    known = has_numbers(results)
    if not np.any(known):
        return []
    numbers = results.where(known)
    names = [n for n in _ENTRIES if n in results and any(part in n for part in OF_FRICTION)]
    names = [n for n in names if not n.endswith("_error")]
    if kind_of_results(results) == STEADY:
        return names if np.all(without_friction(results).values[known.values]) else []
    if np.any(results["surface_displacement"]):
        return []
    return [n for n in names if not np.any(abs(numbers[n]) > numbers.get(f"{n}_error", 0.0))]
