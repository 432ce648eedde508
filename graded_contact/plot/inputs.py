"""What a figure is drawn of; other inputs are refused, with the function that draws them."""

from collections.abc import Mapping
from typing import Any, TypeVar

from ..core.checks import check_type
from ..core.quantities import CYCLE, KINDS, STEADY, TRANSIENT
from ..scenes.results import kind_of_results

T = TypeVar("T")
FIELDS_OF_ONE, FILM = "fields", "film"
DATASETS = {kind: f"results {kind}" for kind in KINDS}  # of `Plan.run` and, if steady, of `sweep`
# What each kind of input is in words, and what draws it. Others are solutions.
_DRAWN = {
    STEADY: ("a contact in steady sliding", "plot_sliding"),
    CYCLE: ("a contact in a motion that repeats", "plot_cycle"),
    TRANSIENT: ("a contact in what happens once", "plot_transient"),
    DATASETS[STEADY]: ("results of steady sliding", "plot_sweep"),
    DATASETS[CYCLE]: ("results of a motion that repeats", "plot_cycle"),
    DATASETS[TRANSIENT]: ("results of what happens once", "plot_transient"),
    FIELDS_OF_ONE: ("the fields of `kept_contact(results, index)`", "plot_sliding"),
    FILM: ("the fields of `kept_contact(results, index)` over time", "plot_film"),
}


def check_drawn(argument: str, found: Any, *kinds: str) -> None:
    """Raises `ValueError` unless an argument is of one of some kinds, keys of the table above."""
    kind = _kind_of(found)
    if kind in kinds:
        return
    lacks = " without `friction` and `contact_area`" if hasattr(found, "data_vars") else ""
    given, by = _DRAWN.get(kind, (f"a `{type(found).__name__}`{lacks}", ""))
    needed = " or ".join(_DRAWN[one][0] for one in kinds)
    hint = f", which `{by}` draws" if by else ""
    raise ValueError(f"`{argument}` must be {needed}; it is {given}{hint}.")


def labelled(argument: str, found: Any, kind: type[T]) -> Mapping[str, T]:
    """Returns several curves by their labels; one has an empty label, which no legend shows."""
    by_label = found if isinstance(found, Mapping) else {"": found}
    for label, curve in by_label.items():
        check_type(f"{argument}[{label!r}]" if label else argument, curve, kind)
    return by_label


def _kind_of(found: Any) -> str:
    if not hasattr(found, "data_vars"):
        kind = getattr(found, "kind", "")
        whole = hasattr(found, "pressure") and hasattr(found, "gap")
        return kind if kind in KINDS else FIELDS_OF_ONE if whole else ""
    if {"message", "friction", "contact_area"} <= {*found.data_vars}:
        return DATASETS[kind_of_results(found)]
    if not {"pressure", "gap"} <= {*found.data_vars}:
        return ""
    return FILM if {"time", "field_time"} & {*found.dims} else FIELDS_OF_ONE
