"""What a reading decides, and who decides it: one rule for heights, moduli and motions.

1. What the file states counts: the quantity of a column, the unit of a number, a size, a scale.
2. An option of the user fills what the file leaves open. It may correct a unit that the file states
   by another unit of one kind (MPa by Pa), never by one of another kind (1/MPa by MPa).
3. What neither states is asked for: a `Refusal` names the option. If nearly all files mean one
   thing, the thing is assumed, and a sentence says so beside each number that rests on it.

Each decision is a sentence. What is assumed and changes a number is a caveat of the result:
`Surface.assumed` and `Measured.assumed` bring it there; all other sentences are history.
"""

import dataclasses

from ..core.files import Refusal


@dataclasses.dataclass
class Log:
    """The sentences of one reading, in the order of the decisions.

    **Fields:**

    - `history`: all of them.
    - `assumed`: those that neither the file nor the user states, and that change a number.
    """

    history: list[str] = dataclasses.field(default_factory=list)
    assumed: list[str] = dataclasses.field(default_factory=list)

    def note(self, *sentences: str) -> None:
        """Adds what the file states, the user gave, or the reading did."""
        self.history.extend(sentences)

    def assume(self, *sentences: str) -> None:
        """Adds what is assumed and changes a number; each sentence ends with the remedy."""
        self.history.extend(sentences)
        self.assumed.extend(sentences)


def settled(what: str, stated: str | None, given: str | None, *, option: str, alike) -> str | None:
    """Returns the unit or role that counts: the given one if it is of the stated kind.

    **Arguments:**

    - `what`: the number or column, in words.
    - `stated`: by the file; None if it is silent.
    - `given`: by the user; None without the option.
    - `option`: how the user gave it, for the message.
    - `alike`: whether two of them are of one kind, a function of both.

    **Returns:** one of them, None if both are silent: then ask, or assume.

    **Raises:** `Refusal` if the user's would override what the file states of another kind.
    """
    if stated is None or given is None:
        return stated if given is None else given
    if not alike(stated, given):
        raise Refusal(f"{what}: the file states {stated!r}; leave out {option}")
    return given
