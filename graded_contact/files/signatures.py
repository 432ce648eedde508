"""Objects built from sections of a TOML text: keys, types and defaults are those of signatures.

A parameter is read by its annotation: a number, a list of numbers, a whole number, a text, a path,
one of the choices of a `Literal`. One of an abstract class takes a table with a `kind`, or the kind
alone where it needs nothing more.
"""

import dataclasses
import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from jaxtyping import AbstractArray

from .paths import full_path
from .toml import Section, within

Kinds = Mapping[str, Callable]


def keys_of(make: Callable) -> tuple[str, ...]:
    """Returns the names of the parameters of a function or constructor."""
    return tuple(inspect.signature(make).parameters)


class Builder:
    """Calls constructors and functions with the entries of sections.

    **Fields:**

    - `kinds`: for an abstract class the constructors that a `kind` chooses from.
    - `readers`: for a class what reads it in another way, called with a section and a key.
    - `folder`: what paths are relative to.
    - `paths`: those that were read.
    """

    def __init__(
        self,
        kinds: Mapping[type, Kinds],
        readers: Mapping[type, Callable[[Section, str], Any]],
        folder: Path,
    ):
        self.kinds, self.folder = kinds, folder
        self.paths: list[Path] = []
        self.readers = {os.PathLike: self.path, **readers}

    def arguments(self, section: Section, make: Callable, given: Sequence[str] = ()) -> dict:
        """Returns what the section holds of the arguments of `make`, but for those `given`."""
        types = getattr(make, "__annotations__", {})
        found = {}
        for key, parameter in inspect.signature(make).parameters.items():
            required = parameter.default is parameter.empty
            if key not in given and (required or key in section.content):
                # The signature of a module with converters says `Any`, its fields what they hold.
                kind = parameter.annotation
                found[key] = self._entry(section, key, types.get(key) if kind is Any else kind)
        return found

    def build(self, section: Section, make: Callable, **given: Any) -> Any:
        """Returns what `make` gives of the entries of a section, and of what is `given`."""
        with within(section.place):
            return make(**given, **self.arguments(section, make, tuple(given)))

    def build_kind(self, place: str, content: Any, kinds: Kinds) -> Any:
        """Returns what the kind makes that a table names."""
        keys = {kind: keys_of(make) for kind, make in kinds.items()}
        section, kind = Section.of_kind(place, content, keys)
        return self.build(section, kinds[kind])

    def _entry(self, section: Section, key: str, annotation: Any) -> Any:
        kinds, value = _flat(annotation), section.get(key)
        choices = tuple(kind for kind in kinds if isinstance(kind, str))
        arrays = [kind for kind in kinds if _is(kind, AbstractArray)]
        if type(None) in kinds and value == "none":  # TOML has no None
            return None
        for kind in kinds:
            if kind in self.readers:
                return self.readers[kind](section, key)
            if kind in self.kinds:
                return self._of_kind(section, key, self.kinds[kind])
            if get_origin(kind) is Annotated:
                return section.inner(key, kind.__metadata__).content
            if isinstance(kind, type) and dataclasses.is_dataclass(kind):
                return self.build(section.inner(key, keys_of(kind)), kind)
        if choices:
            return section.choice(key, choices)
        if any(kind.dims for kind in arrays):
            return section.numbers(key)
        if Sequence in kinds and not isinstance(value, list):
            return section.number(key)
        if Sequence in kinds:
            return section.numbers(key)
        if tuple in kinds:
            return section.wholes(key)
        if float in kinds or arrays:
            return section.number(key)
        if int in kinds and not (str in kinds and isinstance(value, str)):
            return section.whole(key)
        return section.truth(key) if bool in kinds else section.text(key)

    def _of_kind(self, section: Section, key: str, kinds: Kinds) -> Any:
        if not isinstance(section.content[key], str):
            return self.build_kind(section.place_of(key), section.content[key], kinds)
        make = kinds[section.choice(key, tuple(kinds))]
        return self.build(Section(section.place_of(key), {}, ()), make)

    def path(self, section: Section, key: str) -> Path:
        """Returns the path under a key, relative to `folder`, and adds it to `paths`."""
        with within(section.place):
            self.paths.append(full_path(section.text(key), self.folder))
        return self.paths[-1]


def _is(kind: Any, base: type) -> bool:
    return isinstance(kind, type) and issubclass(kind, base)


def _flat(annotation: Any) -> list[Any]:
    """The classes and choices of an annotation, those of a union one by one."""
    origin = get_origin(annotation)
    if origin in (Union, UnionType):
        return [kind for part in get_args(annotation) for kind in _flat(part)]
    if origin is Literal:
        return list(get_args(annotation))
    return [annotation if origin in (None, Annotated) else origin]
