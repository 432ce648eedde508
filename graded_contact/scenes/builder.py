"""Objects from TOML tables: a table has the arguments of a constructor, `kind` names which one.

    [materials.tread]            ->  materials["tread"] = Prony(equilibrium=..., ...)
    kind = "prony"
    equilibrium = 5e6

Constructors check their own values. This module checks the names of keys, and puts the name of the
table before the message of an error.
"""

import contextlib
import inspect
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from ..core.checks import nearest, short, within
from ..materials import AbstractMaterial

F = TypeVar("F", bound=Callable)
Kinds = Mapping[str, Callable]
MATERIAL_KEYS = ("material", "bottom", "top", "bulk", "shear")


class Builder:
    """Makes objects from tables.

    **Arguments:**

    - `folder`: paths are relative to it.
    - `nested`: kinds of the tables that may stand under a key, such as "shift".

    **Fields:**

    - `materials`: by the names under which other tables refer to them.
    """

    def __init__(self, folder: Path, nested: Mapping[str, Kinds]):
        self.folder, self.nested = folder, nested
        self.materials: dict[str, AbstractMaterial] = {}

    def build(self, place: str, table: Any, make: Callable, **given: Any) -> Any:
        """Returns `make` called with the entries of a table and with `given`."""
        parameters = inspect.signature(make).parameters
        check_table(place, table, parameters.keys() - given.keys())
        for name, each in parameters.items():
            if each.default is each.empty and name not in {**table, **given}:
                raise ValueError(f"[{place}] lacks the key `{name}`.")
        entries = {key: self.entry(f"{place}.{key}", key, value) for key, value in table.items()}
        with in_table(place):
            return make(**entries, **given)

    def build_kind(self, place: str, table: Any, kinds: Kinds, **given: Any) -> Any:
        """Returns the object whose constructor a table names by its `kind`."""
        kind, rest = kind_of(place, table, kinds)
        make = kinds[kind]
        known = inspect.signature(make).parameters
        return self.build(place, rest, make, **{n: v for n, v in given.items() if n in known})

    def entry(self, place: str, key: str, value: Any) -> Any:
        """Returns the value under a key: an object for a name or a table, a path, or unchanged."""
        if key in self.nested and isinstance(value, dict | str):
            return self.build_kind(place, value, self.nested[key])
        if isinstance(value, str) and key in MATERIAL_KEYS:
            if value not in self.materials:
                hint = nearest(value, self.materials)
                raise ValueError(f"[{place}] {value!r} is not a material above; {hint}")
            return self.materials[value]
        if isinstance(value, str) and (key == "path" or key.endswith("_path")):
            return self.folder / Path(value).expanduser()
        if isinstance(value, list):
            return tuple(value)
        return None if value == "none" else value


def with_keys_of(other: Callable) -> Callable[[F], F]:
    """Returns a decorator: the keywords `**` of a function are the parameters of another one."""

    def decorate(make: F) -> F:
        own = inspect.signature(make).parameters
        named = [each for each in own.values() if each.kind is not each.VAR_KEYWORD]
        more = [
            each for name, each in inspect.signature(other).parameters.items() if name not in own
        ]
        named += [each.replace(kind=each.KEYWORD_ONLY) for each in more]
        setattr(make, "__signature__", inspect.Signature(named))  # noqa: B010 (pyright)
        return make

    return decorate


def kind_of(place: str, table: Any, kinds: Collection[str]) -> tuple[str, dict[str, Any]]:
    """Returns the `kind` of a table, one of `kinds`, and its other entries."""
    table = {"kind": table} if isinstance(table, str) else table
    check_table(place, table, table)
    kind = table.get("kind")
    if kind not in kinds:
        raise ValueError(f"[{place}] `kind={kind!r}` is not known; {nearest(kind, kinds)}")
    return kind, {key: value for key, value in table.items() if key != "kind"}


def check_table(place: str, table: Any, allowed: Collection[str]) -> None:
    """Raises `ValueError` unless it is a table whose keys are all `allowed`."""
    if not isinstance(table, Mapping):
        raise ValueError(f"[{place}] must be a table, not {short(table)}.")
    for key in table:
        if key not in allowed:
            raise ValueError(f"[{place}] has no key `{key}`; {nearest(key, sorted(allowed))}")


def tables_of(place: str, value: Any) -> dict[str, Any]:
    """Returns the tables of a list [[...]] by their places."""
    if not (isinstance(value, list) and all(isinstance(table, dict) for table in value)):
        raise ValueError(f"[{place}] must be a list of tables: write [[{place}]] above each.")
    return {f"{place}[{i}]": table for i, table in enumerate(value)}


@contextlib.contextmanager
def in_table(place: str) -> Iterator[None]:
    """Puts the name of a table before errors; wrong types are refused as wrong values are."""
    with within(f"[{place}]"):
        try:
            yield
        except TypeError as error:
            raise ValueError(str(error)) from error
