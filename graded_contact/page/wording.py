"""Errors of readers, in the words of the page."""

import contextlib
import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

from ..core.arguments import with_words

# The fields of the page, by the arguments for which messages ask.
FIELD_WORDS = {
    "unit": "unit of its heights", "size": "edge length", "periodic": "its edges", "name": "name",
    "units": "its units", "columns": "its columns", "deformation": "measured in",
}  # fmt: skip


@contextlib.contextmanager
def worded(function: Callable[..., Any]) -> Iterator[None]:
    """Errors of a function name the fields of the page in place of its arguments."""
    try:
        yield
    except ValueError as error:
        raise ValueError(for_page(str(error), function)) from error


def for_page(text: str, function: Callable[..., Any]) -> str:
    """Returns the text of an error of a function, for a user who sees the page only.

    A sentence is added about arguments for which the page has no field.
    """
    arguments, lacking = inspect.signature(function).parameters, []

    def in_words(name: str, value: Any) -> str | None:
        if name in FIELD_WORDS:
            if isinstance(value, dict):
                value = ", ".join(f"{key}={each}" for key, each in value.items())
            elif isinstance(value, str):
                value = repr(value)
            return f"“{FIELD_WORDS[name]}”" + ("" if value is None else f" {value}")
        if name in arguments and name not in (*lacking, "path"):
            lacking.append(name)
        return None

    text = text.replace("; `directory` sets the folder", "")
    text = re.sub(r"`path=[^`]*`( is refused)?: ", "", text)  # its name stands before
    text = re.sub(r"\bpass ((for instance )?“)", r"fill in \1", with_words(text, in_words))
    if lacking:
        names = ", ".join(f"`{name}`" for name in lacking)
        text = f"{text.rstrip('.')}. The page has no field for {names}: `{function.__name__}` in "
        text += "Python takes it."
    return text
