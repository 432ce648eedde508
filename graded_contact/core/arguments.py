"""The arguments that a message names, in the words of whoever shows it."""

import ast
import contextlib
import re
from collections.abc import Callable
from typing import Any

_NAMED = re.compile(r"`(\w+)(?:=([^`]*))?`")


def with_words(message: str, words: Callable[[str, Any], str | None]) -> str:
    """Returns a message with other words in place of the arguments that it names.

    **Arguments:**

    - `message`: names arguments as `name` or `name=value`.
    - `words`: of a name and its value, which is None if the message gives none and a text if it was
      cut; returns None for an argument that keeps its name.
    """

    def spelt(found: re.Match) -> str:
        name, value = found.groups()
        with contextlib.suppress(SyntaxError, ValueError, TypeError):
            value = ast.literal_eval(value)
        return words(name, value) or found[0]

    return _NAMED.sub(spelt, message)
