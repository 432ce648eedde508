"""Caveats: warnings about numbers of solves that succeeded, in sentences.

A caveat is computed from the numbers of a `Sliding` or of a result file; it is not stored.
`Sliding.caveats` and `warnings_of(results)` give the sentences. The table, the file, the figure and
the command's summary print those of the results. The limit and the sentence stand beside the
number, as `warns=Above(...)` of its observable.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool

from .display import shown
from .quantities import OBSERVABLES, TRANSIENT, NumberOf

DOUBTFUL = 0.1  # the part of a result above which there is a caveat


@shown("sentence")
class Caveat(NamedTuple):
    """One warning, and the solves that it concerns, in the shape of their numbers."""

    sentence: str
    where: Bool[np.ndarray, "*solves"]


class _Ends(NamedTuple):
    """The smallest and the largest of some numbers; printed as one if they look alike."""

    low: float
    high: float

    def __format__(self, form: str) -> str:
        return " to ".join(dict.fromkeys(format(float(end), form) for end in self))


def caveats_of(number: NumberOf, kind: str) -> tuple[Caveat, ...]:
    """Returns the caveats of a result, in the order of the observables.

    **Arguments:**

    - `number`: returns a number of the result by its name, or 0 if the result has none, as a
      periodic contact has no rim.
    - `kind`: of the contacts, one of `KINDS`.
    """
    caveats, what = [], "times" if kind == TRANSIENT else "solves"
    for name, entry in OBSERVABLES.items():
        rule = entry.warns
        if rule is None or kind not in entry.kinds or kind not in rule.kinds:
            continue
        values = np.asarray(number(name) if rule.of is None else rule.of(number))
        where = values > rule.limit
        if np.any(where):
            text = rule.sentence.format(value=_Ends(np.min(values[where]), np.max(values[where])))
            if not np.all(where):
                text += f" ({np.sum(where)} of {values.size} {what}.)"
            caveats.append(Caveat(text, where))
    return tuple(caveats)
