"""How objects show themselves: numbers with units, arrays by their shape, how a solve ended.

Units and meanings are those that the docstring of a class gives under **Fields:**, and that of a
property in its own. Text for the terminal, a table for notebooks; under `jit` the shapes alone.
"""

import dataclasses
import functools
import html
import re
from collections.abc import Callable, Iterator, Mapping
from types import EllipsisType
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import numpy as np

from .checks import is_concrete, short

T = TypeVar("T", bound=type)
M = TypeVar("M", bound=eqx.Module)
FEW = 8  # numbers of an array that are shown one by one, and entries of a list
ENTRY = re.compile(r"^ *- ((?:`\w+`(?:, )?)+): (.*?)(?=^ *- `|^ *$|\Z)", re.MULTILINE | re.DOTALL)
PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
UNIT = re.compile(r"\[((?:1|(?:(?:1|Pa|rad|m|s|K|J|bytes)[²³⁴]?[/ ]?)+))\]")


class _Row(NamedTuple):
    """A line: how far it is indented, its name with the unit, its text, and what it means."""

    depth: int
    name: str
    text: str
    meaning: str


def shown(*names: str | EllipsisType, argument: bool = False) -> Callable[[T], T]:
    """Lets a class show its fields, or what it has under these names; `...` stands for the fields.

    It is a module, dataclass or named tuple. Methods among them are called. A derivative by an
    `argument` has the same class, but other units. Arguments therefore show units only if their
    constructor built them: JAX builds derivatives without it.
    """

    def decorate(kind: T) -> T:
        new = kind.__new__

        def build(kind: type, *given: Any, **named: Any) -> Any:
            return with_units(new(kind, *given, **named))

        if argument:
            setattr(kind, "_has_units", False)  # noqa: B010 (pyright)
            setattr(kind, "__new__", build)  # noqa: B010
        setattr(kind, "_shown_names", names or (...,))  # noqa: B010
        setattr(kind, "__repr__", _as_text)  # noqa: B010
        setattr(kind, "_repr_html_", _as_html)  # noqa: B010
        return kind

    return decorate


def with_units(built: M) -> M:
    """Returns a module, which shows units from now on."""
    object.__setattr__(built, "_has_units", True)
    return built


def _as_text(self) -> str:
    if not _is_known(self):
        return eqx.tree_pformat(self)
    first, *rows = _rows(self, 0, "")
    width = max((2 * row.depth + len(row.name) for row in rows), default=0)
    lines = [f"{'  ' * row.depth + row.name:{width}s}  {row.text}".rstrip() for row in rows]
    return "\n".join([first.text, *lines])


def _as_html(self) -> str:
    if not _is_known(self):
        return f"<pre>{html.escape(eqx.tree_pformat(self))}</pre>"
    first, *rows = (_Row(row.depth, *map(html.escape, row[1:])) for row in _rows(self, 0, ""))
    cell = '<td style="text-align: left'
    lines = [
        f'<tr title="{row.meaning}">{cell}; padding-left: {2 * row.depth - 1}em">{row.name}</td>'
        f'{cell}">{row.text.replace(chr(10), "<br>")}</td></tr>'
        for row in rows
    ]
    return f"<table><caption><b>{first.text}</b></caption>{''.join(lines)}</table>"


def _is_known(shown: Any) -> bool:
    return all(map(is_concrete, jax.tree.leaves(shown)))


def _rows(
    value: Any, depth: int, name: str, meaning: str = "", units: bool | None = None
) -> Iterator[_Row]:
    """A line for a value, and one for each of its parts; the outermost decides about `units`."""
    if units is None:
        units = bool(getattr(value, "_has_units", True))
    if hasattr(value, "_shown_names"):
        yield _Row(depth, name.partition(" [")[0], type(value).__name__, meaning)
        yield from _parts(value, depth + 1, units)
        return
    entries: list[tuple[str, Any]] = []
    if isinstance(value, Mapping):
        entries = [(str(key), entry) for key, entry in value.items()]
    elif isinstance(value, list | tuple) and not all(map(_is_number, value)):
        entries = [(f"[{i}]", entry) for i, entry in enumerate(value)]
    if not entries:
        yield _Row(depth, name, _text(value), meaning)
        return
    yield _Row(depth, name, "", meaning)
    for key, entry in entries[:FEW]:
        yield from _rows(entry, depth + 1, key, units=units)
    if len(entries) > FEW:
        yield _Row(depth + 1, "...", f"{len(entries) - FEW} more", "")


def _parts(value: Any, depth: int, units: bool) -> Iterator[_Row]:
    """The lines of what a value shows; a number and its error share one."""
    if hasattr(value, "before_display"):
        value.before_display()
    known = dataclasses.is_dataclass(value)  # a named tuple is none
    declared = {field.name: field for field in dataclasses.fields(value)} if known else {}
    fields = getattr(value, "_fields", declared)
    asked = value._shown_names
    names = [name for entry in asked for name in (fields if entry is ... else [entry])]
    about = {name: _about(type(value), name) for name in names}
    # Names are those of paths, see `parameters`.
    spelt = {name: field.metadata.get("argument", name) for name, field in declared.items()}
    for name in names:
        part, (unit, meaning) = getattr(value, name), about[name]
        if name.endswith("_error") and _shares(value, name.removesuffix("_error"), about):
            continue
        title = _title(spelt.get(name, name), unit if units else "")
        if _shares(value, name, about):
            text = f"{_text(part)} ± {float(getattr(value, f'{name}_error')):.1e}"
            yield _Row(depth, title, text, meaning)
            continue
        if isinstance(part, Mapping) and not unit and hasattr(value, "units"):
            part = {_title(key, value.units.get(key, "")): entry for key, entry in part.items()}
        yield from _rows(
            part() if callable(part) and name not in fields else part, depth, title, meaning, units
        )


def _title(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit not in ("", "1") else name


def _shares(value: Any, name: str, about: Mapping[str, tuple[str, str]]) -> bool:
    """Whether a number and its error, in the same unit, are both shown."""
    error = f"{name}_error"
    both = name in about and error in about and about[name][0] == about[error][0]
    return both and all(_is_number(getattr(value, entry)) for entry in (name, error))


@functools.cache
def _about(kind: type, name: str) -> tuple[str, str]:
    """The unit and the meaning of a field or property of a class, as its docstring has them."""
    for names, body in ENTRY.findall(kind.__doc__ or ""):
        listed = re.findall(r"\w+", names)
        if name in listed:
            return _unit(body, listed.index(name), len(listed)), " ".join(body.split())
    lines = (getattr(getattr(kind, name, None), "__doc__", None) or "").partition("\n\n")[0]
    return _unit(lines, 0, 1), " ".join(lines.split())


def _unit(text: str, place: int, count: int) -> str:
    """The unit in a text, or that of one of several fields; empty if it has more than one."""
    units = UNIT.findall(text)
    if count > 1 and len(units) >= count:
        return units[place]
    return units[0] if len(set(units)) == 1 else ""


def _is_number(value: Any) -> bool:
    return np.ndim(value) == 0 and isinstance(value, int | float | complex | np.number | jax.Array)


def _text(value: Any) -> str:
    if hasattr(value, "_enumeration"):  # of `equinox`; the first entry is success
        ends = np.asarray(jax.tree.leaves(value)[0])
        if ends.ndim == 0:
            return value._enumeration[value] or "successful"
        return f"{np.sum(ends == 0)} of {ends.size} successful"
    if isinstance(value, jax.Array | np.ndarray):
        return _array(value)
    if _is_number(value) and not isinstance(value, bool):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(_text, value)) or "none"
    if value is None:
        return "none"
    return str(value) if isinstance(value, bool | str) else short(value)


def _array(array: jax.Array | np.ndarray) -> str:
    """Its numbers if they are few, the ends of its range if it is a row; else its shape."""
    shape = f"{' × '.join(map(str, array.shape))} {array.dtype}"
    away = isinstance(array, jax.Array) and (array.is_deleted() or not array.is_fully_addressable)
    if away or not (array.ndim == 1 or array.size <= FEW):
        return shape
    entries = np.asarray(array)
    if entries.size <= FEW:
        numbers = entries.dtype.kind in "fciu"
        return ", ".join(f"{n:.6g}" if numbers else str(n) for n in entries.ravel()) or "none"
    if entries.dtype.kind not in "fiu" or np.all(np.isnan(entries)):
        return shape
    return f"{shape}, {np.nanmin(entries):.6g} to {np.nanmax(entries):.6g}"


def unit_of(base: str, largest: float) -> tuple[str, float]:
    """The unit in which `largest` [base] is between 1 and 1000, and its reciprocal in `base`."""
    exponent = 3 * int(np.floor(np.log10(largest) / 3 + 1e-9)) if largest > 0 else 0
    exponent = min(max(exponent, min(PREFIXES)), max(PREFIXES))
    return f"{PREFIXES[exponent]}{base}", 10.0**-exponent


def with_unit(value: float, base: str) -> str:
    """Returns a number in a common unit, such as "1.54 nm"."""
    unit, factor = unit_of(base, value)
    return f"{factor * value:.3g} {unit}"
