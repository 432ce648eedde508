"""How objects print: numbers with units, arrays by their shape, how a solve ended.

Units come from the table of quantities, by the names of fields; under `jit` objects print their
shapes alone. A derivative by a stack is a stack whose numbers have other units: classes that one
differentiates by, such as stacks, print no units of their own. In a result, such as a fit with its
material, they do.
"""

import dataclasses
import os
import reprlib
from collections.abc import Iterator, Mapping
from types import EllipsisType
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer

from .quantities import in_brackets, quantity_of

K = TypeVar("K", bound=type)
FEW = 8  # numbers of an array that are printed one by one, and entries of a list
DIGITS = 8  # of a number with an error at most: a smaller error is one of rounding
UNKNOWN = "—"  # in place of NaN: a solve failed, or the quantity is not defined there
_LONG_TIMES = {"years": 365.25 * 86400, "days": 86400.0, "h": 3600.0}  # [s]
PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


class _Shown(NamedTuple):
    """How a class prints: names of fields and others, with or without units and unset ones."""

    names: tuple[str | EllipsisType, ...]
    units: bool
    unset: bool


def short(value: Any) -> str:
    """Returns a value in a few words, on one line."""
    if hasattr(type(value), "_shown"):  # it prints as a table
        return f"{type(value).__name__}(...)"
    return " ".join(reprlib.repr(value).split())


def shown(*names: str | EllipsisType, units: bool = True, unset: bool = True):
    """Makes a module, dataclass or named tuple print its fields.

    Or the fields, properties and methods of these `names`; `...` means all fields. `units` is
    False for what one differentiates by, `unset` to leave out what is None or empty.
    """

    def decorate(kind: K) -> K:
        setattr(kind, "_shown", _Shown(names or (...,), units, unset))  # noqa: B010 (pyright)
        setattr(kind, "__repr__", _as_text)  # noqa: B010
        return kind

    return decorate


def _as_text(self) -> str:
    # Traced numbers have no values: the tree shows their shapes.
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(self)):
        return eqx.tree_pformat(self)
    (_, first), *rows = _rows(self, "", self._shown.units)
    width = max((len(name) for name, _ in rows), default=0)
    return "\n".join([first, *(f"{name:{width}s}  {text}".rstrip() for name, text in rows)])


def _rows(value: Any, name: str, units: bool, depth: int = 0) -> Iterator[tuple[str, str]]:
    """A line for a value, and one for each of its parts: its name, indented, and its text."""
    entries, most, text = [], FEW, ""
    if hasattr(value, "_shown"):
        entries, text = list(_entries(value, units)), type(value).__name__
        most, state = len(entries), getattr(value, "state", "")
        text += f" ({state})" if state else ""
    elif isinstance(value, Mapping):
        entries = [(str(key), entry) for key, entry in value.items()]
    elif isinstance(value, list | tuple) and not all(map(_is_number, value)):
        entries = [(f"[{i}]", entry) for i, entry in enumerate(value)]
    yield "  " * depth + name, text or ("" if entries else _in_words(value))
    for title, entry in entries[:most]:
        yield from _rows(entry, title, units, depth + 1)
    if len(entries) > most:
        yield "  " * (depth + 1) + "...", f"{len(entries) - most} more"


def _entries(value: Any, units: bool) -> Iterator[tuple[str, Any]]:
    """Titles and values that an object prints; a number and its error share a line."""
    first = value.before_display() if hasattr(value, "before_display") else ()
    named = getattr(value, "_fields", None)  # of a named tuple
    declared = {} if named else {field.name: field for field in dataclasses.fields(value)}
    fields = named or declared
    chosen = (fields if name is ... else [name] for name in value._shown.names)
    names = [*first, *(name for group in chosen for name in group)]
    parts: dict[str, Any] = {name: getattr(value, name) for name in names}
    causes_of = getattr(value, "error_parts", lambda name: {})
    noise: Mapping[str, float] = getattr(value, "noise", {})
    beside = {f"{name}_error" for name in parts}
    for name, part in parts.items():
        no_rows = isinstance(part, np.ndarray) and not part.size
        empty = part is None or no_rows or (isinstance(part, str | Mapping) and not part)
        if empty and not value._shown.unset:
            continue
        error: Any = parts.get(f"{name}_error")
        if name in beside and _is_number(part):
            continue
        if name not in fields and callable(part):
            part = part()
        array: Any = part
        words = declared[name].metadata.get("entries", ()) if name in declared else ()
        if words and np.shape(array) == (len(words),):
            part = ", ".join(f"{_in_words(n)} {of}" for n, of in zip(array, words, strict=True))
        owner = type(value).__name__
        quantity = quantity_of(name, owner)
        least = noise.get(quantity.unit, 0.0) if noise and quantity else 0.0
        known: Any = part
        if _is_number(part) and _is_number(error):
            part = with_error(float(known), float(error), noise=least)
            shares = [f"{cause} {float(e):.1e}" for cause, e in causes_of(name).items()]
            part += f" ({', '.join(shares)})" if shares and part != UNKNOWN else ""
        elif least and _is_number(part) and np.abs(known) <= least:
            part = 0
        elif isinstance(part, Mapping) and quantity is None and units:
            part = {_title(str(key)): entry for key, entry in part.items()}
        yield _title(name, owner) if units else name, part


def _digits(value: Any) -> str:
    return UNKNOWN if np.isnan(value) else f"{value:.6g}"


def _bound(value: float, error: float) -> float:
    """A number plus its error, to two digits, rounded up."""
    bound = abs(value) + error
    step = 10.0 ** (np.floor(np.log10(bound)) - 1)
    return float(np.ceil(bound / step - 1e-9) * step)


def with_error(value: float, error: float, unit: str = "", noise: float = 0.0) -> str:
    """Returns a number with its error, to two digits of that, such as "1.200 ± 0.041 µm".

    A number below its error is 0, and the bound of its size follows: "0 ± 480 pm". An error below
    the last of `DIGITS` digits is left out.

    **Arguments:**

    - `value`, `error`: in `unit`.
    - `unit`: a base unit, which gets a prefix; "" for none.
    - `noise`: a value of this size is one of rounding, and counts as 0.
    """
    if np.isnan(value):
        return UNKNOWN
    value, error = (0.0 if abs(one) <= noise else one for one in (value, error))
    if abs(value) < error < np.inf:
        value, error = 0.0, _bound(value, error)
    if unit:
        unit, factor = unit_of(unit, max(abs(value), error if np.isfinite(error) else 0.0))
        value, error, unit = factor * value, factor * error, f" {unit}"
    if not np.isfinite(error):
        return f"{value:#.4g} ± {UNKNOWN if np.isnan(error) else error:}{unit}"
    if value == 0:
        return f"0 ± {error:.3g}{unit}" if error else f"0{unit}"
    power = int(np.floor(np.log10(abs(value))))
    # The second digit of the error is the last digit of both numbers.
    last = max(int(np.floor(np.log10(error or abs(value)))) - 1, power - DIGITS + 1)
    if not round(error / 10.0**last):
        return f"{value:.{DIGITS}g}{unit}"
    if -3 <= power < 5:
        digits = max(0, -last)
        return f"{value:.{digits}f} ± {error:.{digits}f}{unit}"
    scale = 10.0**power
    digits = power - last
    return f"({value / scale:.{digits}f} ± {error / scale:.{digits}f})e{power:+03d}{unit}"


def _title(name: str, owner: str = "") -> str:
    known = quantity_of(name, owner)
    return name if known is None else name + in_brackets(known.unit)


def _is_number(value: Any) -> bool:
    numbers = int | float | complex | np.number | jax.Array
    return isinstance(value, numbers) and np.ndim(value) == 0


def _in_words(value: Any) -> str:
    if hasattr(value, "_enumeration"):  # of `equinox`; the first entry is success
        ends = np.asarray(jax.tree.leaves(value)[0])
        if ends.ndim == 0:
            return value._enumeration[value]
        return f"{np.sum(ends == 0)} of {ends.size} successful"
    if isinstance(value, jax.Array | np.ndarray):
        return _array(value)
    if _is_number(value) and not isinstance(value, bool):
        return _digits(value)
    if isinstance(value, list | tuple):
        return ", ".join(map(_in_words, value)) or "none"
    if value is None or (isinstance(value, Mapping) and not value):
        return "none"
    return str(value) if isinstance(value, bool | str | os.PathLike) else short(value)


def _array(array: jax.Array | np.ndarray) -> str:
    """Its numbers if they are few, the ends of its range if it is a row; else its shape."""
    shape = f"{' × '.join(map(str, array.shape))} {array.dtype}"
    # A donated array and one over several processes have no numbers here to print.
    away = isinstance(array, jax.Array) and (array.is_deleted() or not array.is_fully_addressable)
    if away or not (array.ndim == 1 or array.size <= FEW):
        return shape
    entries = np.asarray(array)
    if entries.size <= FEW:
        numbers = entries.dtype.kind in "fciu"
        return ", ".join(_digits(n) if numbers else str(n) for n in entries.ravel()) or "none"
    if entries.dtype.kind not in "fiu" or np.all(np.isnan(entries)):
        return shape
    kind = "numbers" if entries.dtype == float else entries.dtype
    return f"{entries.size} {kind}, {np.nanmin(entries):.6g} to {np.nanmax(entries):.6g}"


def unit_of(base: str, largest: float) -> tuple[str, float]:
    """The unit in which `largest` [base] is between 1 and 1000, and its reciprocal in `base`."""
    exponent = 3 * int(np.floor(np.log10(largest) / 3 + 1e-9)) if largest > 0 else 0
    exponent = min(max(exponent, min(PREFIXES)), max(PREFIXES))
    return f"{PREFIXES[exponent]}{base}", 10.0**-exponent


def time_unit(largest: float) -> tuple[str, float]:
    """The unit in which a time [s] is written, such as "h" or "years", and its reciprocal in s."""
    for unit, seconds in _LONG_TIMES.items():
        if largest >= seconds:
            return unit, 1 / seconds
    return unit_of("s", largest)


def with_time(value: float) -> str:
    """Returns a time in a common unit, such as "1.54 ms" or "10 years"."""
    unit, factor = time_unit(abs(value))
    return f"{factor * value:.3g} {unit}"


def with_unit(value: float, base: str) -> str:
    """Returns a number in a common unit, such as "1.54 nm"."""
    unit, factor = unit_of(base, abs(value))
    return f"{factor * value:.3g} {unit}"
