"""Objects from TOML tables: keys, types and defaults are those of the constructors.

A table holds the arguments of a dataclass or a function. Its signature is the schema: from it come
the conversion, the keys that errors name, and the table of keys on the site. What an annotation
takes in a scene:

    a number, a list of numbers, a whole number, a text, true or false, a choice (`Literal`)
    a dataclass            a table with its fields
    an abstract class      a table with a `kind`, or the kind alone if it needs nothing more
    `dict[str, X]`         a table with any keys; `dict[Literal["a", "b"], X]` with these
    `Annotated[X, Spacing]` a number, a list, or {from, to, points}
    None                   the text "none", since TOML has no None

A parameter of any other type is no key.
"""

import dataclasses
import difflib
import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

import numpy as np
from jaxtyping import AbstractArray, Float

from ..core.checks import check_positive, check_type, check_values, nearest, short, within
from ..core.files import full_path
from ..core.memory import check_points

ROOT = "the scene"
REQUIRED = inspect.Parameter.empty

# The classes of plain values, and of the entries of lists, by the types of annotations.
CLASSES: dict[Any, type] = {
    float: float, list[float]: float, Sequence[Any]: float, int: int, tuple[int, ...]: int,
    bool: bool, str: str, os.PathLike: str, Path: str, list[dict]: dict, list[str]: str,
}  # fmt: skip

Kinds = Mapping[str, Callable]


class Key(NamedTuple):
    """A key of a table.

    **Fields:**

    - `name`: of the parameter.
    - `annotation`: its type.
    - `default`: if the key is missing; `REQUIRED` if it must be there.
    """

    name: str
    annotation: Any
    default: Any = REQUIRED


class Spacing(NamedTuple):
    """How the values of a range {from, to, points} are spaced; dimensions of a single number."""

    words: str
    values: Callable[[float, float, int], np.ndarray]
    ndim: int


LOGARITHMIC = Spacing("equally spaced in the logarithm", np.geomspace, 1)
LINEAR = Spacing("equally spaced", np.linspace, 0)
RANGE = (Key("from", float), Key("to", float), Key("points", int))


def keys_of(make: Callable, *without: str) -> tuple[Key, ...]:
    """Returns the keys that a table has for a function or class, without some parameters."""
    types = getattr(make, "__annotations__", {})
    found = []
    for name, parameter in inspect.signature(make).parameters.items():
        # The signature of a module with converters says `Any`, its fields say what they contain.
        annotation = parameter.annotation
        annotation = types.get(name) if annotation is Any else annotation
        parts = parts_of(annotation)
        if name not in without and (classes_of(parts) or any(map(_is_table, parts))):
            found.append(Key(name, annotation, parameter.default))
    return tuple(found)


class TableReader:
    """Makes objects of tables.

    **Arguments:**

    - `folder`: what paths are relative to.
    - `kinds`: for an abstract class, the constructors by the `kind` of a table.
    - `readers`: for a class, the function of a place, a key and a value that makes it.

    **Fields:**

    - `paths`: those that were read, by place and key. Every text of a scene that names a file is
      here.
    """

    def __init__(
        self,
        folder: Path,
        kinds: Mapping[type, Kinds] = {},
        readers: Mapping[type, Callable[[str, str, Any], Any]] = {},
    ):
        self.folder, self.kinds = folder, kinds
        self.readers = {os.PathLike: self.path, Path: self.path, **readers}
        self.paths: dict[tuple[str, str], Path] = {}

    def build(self, place: str, table: Any, make: Callable, **given: Any) -> Any:
        """Returns `make` called with the entries of a table and with `given`."""
        (entries,) = self.arguments(place, table, keys_of(make, *given))
        with within(place):
            return make(**given, **entries)

    def build_kind(self, place: str, table: Any, kinds: Kinds, **given: Any) -> Any:
        """Returns the object of the constructor that a table names by its `kind`."""
        kind, rest = kind_of(place, table, kinds)
        return self.build(place, rest, kinds[kind], **given)

    def arguments(self, place: str, table: Any, *keys: Sequence[Key]) -> list[dict[str, Any]]:
        """Returns the entries of one table, converted, in as many parts as there are `keys`."""
        # Misspelt keys first: a missing key may be one of them.
        known = [key for part in keys for key in part]
        check_keys(place, table, [key.name for key in known])
        for key in known:
            if key.default is REQUIRED and key.name not in table:
                raise ValueError(f"{place} lacks the key `{key.name}`.")
        return [
            {key.name: self.value(place, key, table[key.name]) for key in part if key.name in table}
            for part in keys
        ]

    def value(self, place: str, key: Key, value: Any) -> Any:
        """Returns the value under a key, converted to the type of the key."""
        parts = parts_of(key.annotation)
        # A sheet may be called "none"; that there is no sheet is the default.
        is_text = key.default is None and str in classes_of(parts)
        if type(None) in parts and value == "none" and not is_text:
            return None
        inner = f"[{key.name}]" if place == ROOT else f"{place[:-1]}.{key.name}]"
        for part in parts:
            if part in self.readers:
                return self.readers[part](place, key.name, value)
            if part in self.kinds:
                table = {"kind": value} if isinstance(value, str) else value
                return self.build_kind(inner, table, self.kinds[part])
            if get_origin(part) is dict:
                names, entry = get_args(part)
                table: Any = value
                check_keys(inner, value, value if names is str else parts_of(names))
                if entry is object:
                    return value
                return {k: self.value(inner, Key(k, entry), v) for k, v in table.items()}
            if isinstance(part, Spacing):
                return self._axis(place, key.name, value, part)
            # After the kinds: a dataclass of a kind is made by its constructor.
            if isinstance(part, type) and dataclasses.is_dataclass(part):
                return self.build(inner, value, part)
        if list[dict] in parts:
            if not isinstance(value, list):
                raise ValueError(
                    f"{place} `{key.name}={short(value)}` must be a list of tables: write "
                    f"`[{inner}]` above each."
                )
            return value
        if choices := [part for part in parts if isinstance(part, str)]:
            return _choice(place, key.name, value, choices)
        with within(place):
            return _plain(key.name, value, parts)

    def path(self, place: str, name: str, value: Any) -> Path:
        """Returns the path under a key, relative to `folder`, and adds it to `paths`."""
        with within(place):
            found = full_path(self.value(place, Key(name, str), value), self.folder)
        self.paths[place, name] = found  # the results store a checksum of each file
        return found

    def _axis(
        self, place: str, key: str, value: Any, spacing: Spacing
    ) -> Float[np.ndarray, "*values"]:
        """The array of a number, a list of different numbers, or {from, to, points}."""
        if not isinstance(value, dict):
            values = np.array(self.value(place, Key(key, Sequence[Any]), value), ndmin=spacing.ndim)
        else:
            place = f"{place} `{key}`"
            (ends,) = self.arguments(place, value, RANGE)
            with within(place):
                for name in ("from", "to"):
                    if spacing is LINEAR:
                        check_values(name, ends[name], "it must be finite")
                    else:
                        check_positive(name, ends[name], "(the spacing is logarithmic)")
                check_values("points", ends["points"], "at least 2 points are needed", at_least=2)
                check_points("points", ends["points"])
            values = spacing.values(*ends.values())
        # Equal values would be one solve under two indices.
        ordered, counts = np.unique(values, return_counts=True)
        if len(ordered) < values.size:
            raise ValueError(
                f"{place} `{key}` has {ordered[np.argmax(counts)]:g} more than once: give each "
                "value once."
            )
        return values


def _plain(name: str, value: Any, parts: Sequence[Any]) -> Any:
    """A number, text or truth, or a list of numbers, as the types take them."""
    classes, is_list = classes_of(parts), isinstance(value, list)
    rows = list[float] in parts or any(_is_array(part) and part.dims for part in parts)
    takes_list = rows or any(part in parts for part in (Sequence[Any], tuple[int, ...], list[str]))
    entries = value if is_list and takes_list else [value]
    if not entries:
        raise ValueError(f"`{name}` is an empty list; at least one number is needed.")
    for entry in entries:
        check_type(name, entry, *classes)
        # JAX keeps the last 64 bits of a whole number, and would take another seed.
        if classes != (float,) and isinstance(entry, int) and abs(entry) >= 10**18:
            raise ValueError(f"`{name}={short(entry)}` has more than 18 digits.")
    if classes == (float,):
        entries = [float(entry) for entry in entries]
    if tuple[int, ...] in parts:
        return tuple(entries)
    single = any(_is_array(part) and not part.dims for part in parts)
    whole = list[str] in parts or (rows and not single)
    return entries if is_list or whole else entries[0]


def classes_of(parts: Sequence[Any]) -> tuple[type, ...]:
    """Returns the classes of a plain value, or of the entries of a list; none for a table."""
    found = [float if _is_array(part) else CLASSES.get(part) for part in parts]
    found += [str for part in parts if isinstance(part, str)]  # choices
    # A whole number is given where a float is meant: that class alone is enough.
    return (float,) if float in found else tuple(dict.fromkeys(filter(None, found)))


def _is_array(part: Any) -> bool:
    return isinstance(part, type) and issubclass(part, AbstractArray)


def _is_table(part: Any) -> bool:
    return dataclasses.is_dataclass(part) or get_origin(part) is dict or isinstance(part, Spacing)


def parts_of(annotation: Any) -> list[Any]:
    """Returns the classes and choices of an annotation, those of a union one by one."""
    origin = get_origin(annotation)
    if origin in (Union, UnionType):
        return [part for member in get_args(annotation) for part in parts_of(member)]
    if origin is Annotated:
        return list(annotation.__metadata__)
    return list(get_args(annotation)) if origin is Literal else [annotation]


def kind_of(
    place: str, table: Any, kinds: Iterable[str], lacking: str = ""
) -> tuple[str, dict[str, Any]]:
    """Returns the `kind` of a table, one of `kinds`, and its other entries.

    An error about an unknown kind ends with the sentence `lacking`: what there is no kind for.
    """
    if isinstance(table, dict) and "kind" not in table:
        for key in difflib.get_close_matches("kind", table, n=1):
            check_keys(place, {key: table[key]}, ["kind"])
    if not isinstance(table, dict) or "kind" not in table:
        raise ValueError(f"{place} must be a table with the key `kind`, one of {list(kinds)}.")
    rest = {key: value for key, value in table.items() if key != "kind"}
    return _choice(place, "kind", table["kind"], kinds, lacking), rest


def check_keys(place: str, table: Any, allowed: Iterable[str]) -> None:
    """Raises `ValueError` unless it is a table whose keys are all `allowed`."""
    if not isinstance(table, dict):
        raise ValueError(f"{place} must be a table, got {short(table)}.")
    for key in table:
        if key not in allowed:
            raise ValueError(f"{place} has no key `{key}`; {nearest(key, allowed)}")


def _choice(
    place: str, key: str, value: Any, choices: Iterable[str], lacking: str = ""
) -> str:  # fmt: skip
    if not isinstance(value, str) or value not in choices:
        hint = nearest(value, choices)
        if lacking:
            # "poroelastic" is no misspelt "elastic": all kinds, then what none of them is.
            close = difflib.get_close_matches(str(value), choices, n=1, cutoff=0.8)
            meant = f"did you mean `{close[0]}`? The" if close else "the"
            hint = f"{meant} kinds are {', '.join(f'`{c}`' for c in choices)}. {lacking}"
        raise ValueError(f"{place} `{key}` = {short(value)} is not known; {hint}")
    return value
