"""Warnings about numbers of solves that succeeded, in sentences.

A warning follows from the numbers of a result, or of a file of results. The limit and the sentence
stand beside the number, as `warns=Above(...)`.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool

from .display import shown

WARN_ABOVE = 0.1  # the part of a number above which an error of it is warned of

# Returns a number of a result by its name. It has any shape, and is NaN where a solve has none.
NumberOf = Callable[[str], Any]


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


@shown("sentence")
class ResultWarning(NamedTuple):
    """One warning, and the solves that it concerns, in the shape of their numbers."""

    sentence: str
    where: Bool[np.ndarray, "*solves"]


class _Ends(NamedTuple):
    """The smallest and the largest of some numbers; printed as one if they look alike."""

    low: float
    high: float

    def __format__(self, form: str) -> str:
        return " to ".join(dict.fromkeys(format(float(end), form) for end in self))


def warnings_by(
    rules: Mapping[str, Above], number: NumberOf, what: str = "solves"
) -> tuple[ResultWarning, ...]:
    """Returns the warnings of a result, in the order of the rules.

    **Arguments:**

    - `rules`: limits by the names of numbers.
    - `number`: returns a number of the result by its name, or 0 if the result has none.
    - `what`: the numbers are one for each of these.
    """
    found = []
    for name, rule in rules.items():
        values = np.asarray(number(name) if rule.of is None else rule.of(number))
        where = values > rule.limit
        if np.any(where):
            text = rule.sentence.format(value=_Ends(np.min(values[where]), np.max(values[where])))
            if not np.all(where):
                text += f" ({np.sum(where)} of {values.size} {what}.)"
            found.append(ResultWarning(text, where))
    return tuple(found)
