"""Ways to measure a modulus, and which one a table shows."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from .decisions import Options
from .tables import DataColumn, DataTable
from .units import DIMENSIONS


class Way(NamedTuple):
    """A way to measure: its kind, quantities beside the abscissa, and the value at each point.

    `value` takes the numbers of the quantities in SI units, and behind them the constant load.
    """

    kind: str
    quantities: str
    value: Callable[..., Any]

    @property
    def names(self) -> list[str]:
        """The abscissa and the other quantities."""
        abscissa = "time" if self.kind in ("relaxation", "creep") else self.kind
        return [abscissa, *self.quantities.split()]


# The most direct ones first; in the order of the first of a kind the columns of a file without
# names are read.
ALL_WAYS = (
    Way("frequency", "storage loss", lambda storage, loss: storage + 1j * loss),
    Way("frequency", "storage tan_delta", lambda storage, tan: storage * (1 + 1j * tan)),
    Way("frequency", "storage phase", lambda storage, phase: storage * (1 + 1j * np.tan(phase))),
    Way("frequency", "magnitude tan_delta", lambda size, tan: size * np.exp(1j * np.arctan(tan))),
    Way("frequency", "magnitude phase", lambda size, phase: size * np.exp(1j * phase)),
    Way("frequency", "loss tan_delta", lambda loss, tan: loss * (1 / tan + 1j)),
    Way("frequency", "loss phase", lambda loss, phase: loss * (1 / np.tan(phase) + 1j)),
    *(
        Way("frequency", quantities, value)  # E* = 1/D*, with D* = D' - iD''
        for quantities, value in {
            "storage_compliance loss_compliance": lambda real, loss: 1 / (real - 1j * loss),
            "storage_compliance tan_delta": lambda real, tan: 1 / (real * (1 - 1j * tan)),
            "storage_compliance phase": lambda real, delta: 1 / (real * (1 - 1j * np.tan(delta))),
            "compliance_magnitude tan_delta": lambda size, tan: np.exp(1j * np.arctan(tan)) / size,
            "compliance_magnitude phase": lambda size, delta: np.exp(1j * delta) / size,
            "loss_compliance tan_delta": lambda loss, tan: 1 / (loss * (1 / tan - 1j)),
            "loss_compliance phase": lambda loss, delta: 1 / (loss * (1 / np.tan(delta) - 1j)),
        }.items()
    ),
    Way("relaxation", "modulus", lambda modulus: modulus),
    Way("creep", "compliance", lambda compliance: compliance),
    Way("relaxation", "stress strain", lambda stress, strain: stress / strain),
    Way("creep", "strain stress", lambda strain, stress: strain / stress),
    Way("relaxation", "stress", lambda stress, strain: stress / strain),
    Way("creep", "strain", lambda strain, stress: strain / stress),
)  # fmt: skip
AT_LOAD = ALL_WAYS[-2:]  # if the constant load is known
SWEEPS = tuple(way._replace(kind="strain") for way in ALL_WAYS if way.kind == "frequency")
# What a modulus or a compliance beside a loss tangent may be.
_EITHER = {
    "modulus": "'storage' or 'magnitude'",
    "compliance": "'storage_compliance' or 'compliance_magnitude'",
}
CONSTANT = 0.05  # what a test holds constant varies by less
_SIGN_CHANGES = 3  # changes of sign that make a signal of a column; noise about 0 of both is none


def ways_of_kind(kind: str | None) -> list[Way]:
    return [
        way
        for way in (*ALL_WAYS, *SWEEPS)
        if way.kind == kind or (kind is None and way in ALL_WAYS)
    ]


def way_of(table: DataTable, places: dict, loaded: bool, options: Options) -> Way:
    """The kind of measurement and the quantities to take it from."""
    ways = ways_of_kind(options.kind)
    possible = [way for way in ways if loaded or way not in AT_LOAD]
    possible = [way for way in possible if set(way.names) <= set(places)]
    sized = any(DIMENSIONS[name] in ("modulus", "compliance") for name in places)
    tangent = {"tan_delta", "phase"} & set(places)
    if tangent and not sized:
        remedy = "export E' or |E*| (G' or a compliance) with it, or name its column by `columns`"
        raise ValueError(f"{table.place}: the loss tangent alone has no modulus: {remedy}")
    for name, roles in _EITHER.items():
        if tangent and not possible and name in places:
            which = f"{table.place}: {table.label(places[name][0])} may be the storage part or the"
            raise ValueError(f"{which} size of the {name}: name it by `columns`, {roles}")
    if not possible:
        shortest = {way.kind: ", ".join(way.names) for way in reversed(ways)}
        known = f" (understood: {', '.join(sorted(places))})" if places else ""
        order = "" if places or options.kind else ", or pass `kind` if they are in this order"
        there = f"{table.place}: there are" if any(table.names) else "it has"
        raise ValueError(
            f"{there} {table.listed()}{known}. Name them with `columns`: "
            f"{'; or '.join(reversed(shortest.values()))}{order}"
        )
    if possible[0].kind != "frequency" and {"stress", "strain"} <= set(places):
        _check_signal(table, places)
    if [way.kind for way in possible[:2]] != ["relaxation", "creep"]:
        return possible[0]
    if possible[0].quantities == "modulus":
        if possible[1].quantities == "compliance":
            raise ValueError(f"{table.place}: it has a modulus and a compliance; pass `kind`")
        return possible[0]
    # Creep is at constant stress, relaxation at constant strain.
    constant = []
    for way, quantity in zip(possible, ("strain", "stress"), strict=False):
        values = _values_of(table, quantity, places)
        values = values[values > 0.5 * np.nanmax(values, initial=0)]
        if len(values) and np.mean(np.abs(values / np.median(values) - 1) < CONSTANT) > 0.9:
            constant.append(way)
    if len(constant) != 1:
        which = "both of stress and strain are" if constant else "neither of stress and strain is"
        raise ValueError(f"{table.place}: {which} constant; pass `kind`, 'relaxation' or 'creep'")
    return constant[0]


def _values_of(table: DataTable, quantity: str, places: dict) -> np.ndarray:
    """The numbers of a quantity, in any unit."""
    place = places[quantity][0]
    return DataColumn(quantity, place, base=table.headings[place].base).numbers(table.rows)


def _check_signal(table: DataTable, places: dict) -> None:
    """Refuses stress and strain that oscillate in time: the signal of a dynamic test."""
    signs = [np.sign(_values_of(table, quantity, places)) for quantity in ("stress", "strain")]
    signs = [each[np.abs(each) == 1] for each in signs]
    if all(np.sum(np.diff(each) != 0) >= _SIGN_CHANGES for each in signs):
        what = "stress and strain change their signs again and again: it is the signal of a dynamic"
        raise ValueError(f"{table.place}: {what} test; export its moduli E' and E'' or G' and G''")
