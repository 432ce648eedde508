"""Limits of numbers, above which a result warns."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

WARN_ABOVE = 0.1  # the part of a number above which an error of it is warned of

# Returns a number of a result by its name. It has any shape, and is NaN where a solve has none.
NumberOf = Callable[[str], Any]


class _Ends(NamedTuple):
    """The smallest and the largest of some numbers; printed as one if they look alike."""

    low: float
    high: float

    def __format__(self, form: str) -> str:
        return " to ".join(dict.fromkeys(format(float(end), form) for end in self))


class Above(NamedTuple):
    """The limit of a number above which there is a warning.

    **Fields:**

    - `limit`: the largest number without a warning.
    - `sentence`: the warning; `{value}` is the number; of several solves, the ends of their range.
    - `of`: what is compared instead of the number itself.
    """

    limit: float
    sentence: str
    of: Callable[[NumberOf], Any] | None = None

    def warning(self, name: str, number: NumberOf, solves: str) -> str | None:
        """Returns the warning about a number of this name, if any; `solves` is what it counts."""
        values = np.asarray(number(name) if self.of is None else self.of(number))
        where = values > self.limit
        if not np.any(where):
            return None
        text = self.sentence.format(value=_Ends(np.min(values[where]), np.max(values[where])))
        return text if np.all(where) else f"{text} ({np.sum(where)} of {values.size} {solves}.)"
