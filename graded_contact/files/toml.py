"""Tables of a TOML text: entries by type, with errors that name the table and the key."""

import contextlib
import difflib
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator
from reprlib import repr as short
from typing import Any

import numpy as np
from jaxtyping import Float

from ..core.checks import check_positive, check_values
from ..core.memory import check_points

LARGEST = 1_000_000  # bytes of a text; building 20,000 layers takes a minute
RANGE_KEYS = ("from", "to", "points")
_REQUIRED = object()


class Section:
    """One table of a scene; its entries are asked for by type.

    **Arguments:**

    - `place`: how errors call it.
    - `content`: as `tomllib` gives it.
    - `keys`: those allowed; any other is refused, with the nearest one of them.
    """

    def __init__(self, place: str, content: Any, keys: Iterable[str]):
        if not isinstance(content, dict):
            raise ValueError(f"{place} must be a table, got {short(content)}.")
        for key in content:
            if key not in keys:
                raise ValueError(f"{place} has no key `{key}`; {nearest(key, keys)}")
        self.place, self.content = place, content

    @classmethod
    def of_kind(
        cls, place: str, content: Any, kinds: dict[str, tuple[str, ...]]
    ) -> tuple["Section", str]:
        """Returns the table and its kind, which decides its keys."""
        if not isinstance(content, dict):
            raise ValueError(f"{place} must be a table, got {short(content)}.")
        if "kind" not in content:
            all_keys = ["kind", *(key for keys in kinds.values() for key in keys)]
            cls(place, content, all_keys)
            raise ValueError(f"{place} lacks the key `kind`, one of {list(kinds)}.")
        kind = content["kind"]
        if not isinstance(kind, str) or kind not in kinds:
            raise ValueError(f"{place} `kind` = {short(kind)} is not known; {nearest(kind, kinds)}")
        return cls(place, content, ("kind", *kinds[kind])), kind

    def get(self, key: str, default: Any = _REQUIRED) -> Any:
        if key in self.content:
            return self.content[key]
        if default is _REQUIRED:
            raise ValueError(f"{self.place} lacks the key `{key}`.")
        return default

    def place_of(self, key: str) -> str:
        """How errors call the table under a key."""
        return f"{self.place[:-1]}.{key}]"

    def inner(self, key: str, keys: Iterable[str]) -> "Section":
        """Returns the table under a key."""
        return Section(self.place_of(key), self.get(key), keys)

    def number(self, key: str, default: Any = _REQUIRED) -> float:
        return self._typed(key, default, _is_number, "a number (without quotes)", float)

    def whole(self, key: str, default: Any = _REQUIRED) -> int:
        return self._typed(key, default, _is_whole, "a whole number of at most 18 digits", int)

    def truth(self, key: str, default: Any = _REQUIRED) -> bool:
        return self._typed(key, default, lambda v: isinstance(v, bool), "true or false", bool)

    def text(self, key: str, default: Any = _REQUIRED) -> Any:
        return self._typed(key, default, lambda v: isinstance(v, str), "a text in quotes", str)

    def texts(self, key: str, default: Any = _REQUIRED) -> Any:
        return self._typed(
            key, default, lambda v: _all_of(v, lambda entry: isinstance(entry, str)),
            "a list of texts", list,
        )  # fmt: skip

    def numbers(self, key: str, default: Any = _REQUIRED) -> Any:
        """One number, or a list of them, as a list."""
        value = self.get(key, default)
        if _is_number(value):
            return [float(value)]
        wanted = "a number or a list of numbers"
        return self._typed(
            key, default, lambda v: _all_of(v, _is_number), wanted, lambda v: list(map(float, v))
        )

    def wholes(self, key: str) -> tuple[int, ...]:
        value = self.get(key)
        if _is_whole(value):
            return (value,)
        wanted = "a whole number, or a list of them, of at most 18 digits"
        return self._typed(key, _REQUIRED, lambda v: _all_of(v, _is_whole), wanted, tuple)

    def choice(self, key: str, choices: tuple[str, ...], default: Any = _REQUIRED) -> Any:
        value = self.text(key, default)
        if value not in choices:
            raise ValueError(
                f"{self.place} `{key}` = {value!r} is not known; {nearest(value, choices)}"
            )
        return value

    def values(self, key: str, *, linear: bool = False) -> Float[np.ndarray, " values"]:
        """A number, a list, or {from, to, points}, as an array.

        A range is equally spaced in the logarithm, or itself if `linear`.
        """
        value = self.get(key)
        if not isinstance(value, dict):
            return np.array(self.numbers(key))
        span = Section(f"{self.place} `{key}`", value, RANGE_KEYS)
        first, last, points = span.number("from"), span.number("to"), span.whole("points")
        with within(span.place):
            for name, end in (("from", first), ("to", last)):
                if linear:
                    check_values(name, end, "it must be finite")
                else:
                    check_positive(name, end, "(the spacing is logarithmic)")
            check_values("points", points, "at least 2 points are needed", at_least=2)
            check_points("points", points)
        return (np.linspace if linear else np.geomspace)(first, last, points)

    def axis(self, key: str, *, linear: bool = False) -> Float[np.ndarray, " values"]:
        """As `values`, no value twice."""
        values = self.values(key, linear=linear)
        ordered, counts = np.unique(values, return_counts=True)
        if len(ordered) < len(values):
            raise ValueError(
                f"{self.place} `{key}` has {ordered[np.argmax(counts)]:g} more than once: an axis "
                "has a point for each value."
            )
        return values

    def _typed(
        self, key: str, default: Any, right: Callable, wanted: str, convert: Callable
    ) -> Any:
        value = self.get(key, default)
        if key not in self.content:
            return value
        if not right(value):
            raise ValueError(f"{self.place} `{key}` = {short(value)} must be {wanted}.")
        return convert(value)


def _is_number(value: Any) -> bool:
    """Whether it is a number that a float can hold: TOML's whole numbers have no end."""
    if isinstance(value, bool):
        return False
    return isinstance(value, float) or (isinstance(value, int) and abs(value) <= sys.float_info.max)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 10**18


def _all_of(value: Any, right: Callable) -> bool:
    return isinstance(value, list) and len(value) > 0 and all(map(right, value))


def parse_toml(text: str) -> dict[str, Any]:
    """Returns the tables of a TOML text, or raises `ValueError` saying where it is none."""
    if len(text) > LARGEST:
        raise ValueError(
            f"The text has {len(text) / 1e6:.3g} MB; at most {LARGEST / 1e6:g} MB are read."
        )
    with within("Not valid TOML:"):
        try:
            return tomllib.loads(text)
        except RecursionError as error:
            raise ValueError("its lists or tables are nested too deeply.") from error


def nearest(word: Any, choices: Iterable[str]) -> str:
    """Returns advice on a word that is none of `choices`."""
    choices = list(choices)
    close = difflib.get_close_matches(str(word), choices, n=1)
    if close:
        return f"did you mean `{close[0]}`?"
    return f"it takes {', '.join(f'`{choice}`' for choice in choices) or 'nothing'}."


@contextlib.contextmanager
def within(place: str) -> Iterator[None]:
    """Puts the place in the scene before the message of an error that arises there."""
    try:
        yield
    except FileNotFoundError as error:
        raise FileNotFoundError(f"{place} {error}") from error
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(place) else f"{place} {text}") from error
