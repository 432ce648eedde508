"""What a reading decides, and who decides it: one rule for heights, moduli and motions.

1. What the file states counts: the quantity of a column, the unit of a number, a size, a scale.
2. An option of the user fills what the file leaves open. It may correct a unit that the file states
   by another unit of one kind (MPa by Pa), never by one of another kind (1/MPa by MPa).
3. What neither states is asked for: a `Refusal` names the option. If nearly all files mean one
   thing, the thing is assumed, and a sentence says so beside each number that rests on it.

Each decision is a sentence. What is assumed and changes a number is a warning of the result:
`Surface.assumed` and `Measured.assumed` bring it there; all other sentences are history.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

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

    def begin(self, sentence: str) -> None:
        """Puts what is read before all that was decided of it."""
        self.history.insert(0, sentence)

    def note(self, *sentences: str) -> None:
        """Adds what the file states, the user gave, or the reading did."""
        self.history.extend(sentences)

    def assume(self, *sentences: str) -> None:
        """Adds what is assumed and changes a number; each sentence ends with the remedy."""
        self.history.extend(sentences)
        self.assumed.extend(sentences)


@dataclasses.dataclass(frozen=True)
class Options:
    """What the user says of moduli, or what a format fixes; empty where the file decides.

    - `kind`: "frequency", "relaxation", "creep" or "strain".
    - `columns`: name, or number counted from 1, of the column of a quantity.
    - `units`: unit of a dimension.
    - `deformation`: "tension" or "shear".
    - `poisson`: Poisson's ratio.
    - `temperature`: [K], so that a column of it is not needed.
    - `sheet`: of a workbook; the material of a deck or of a scene.
    - `step`: numbers, or parts of titles, of the steps to read.
    - `load`: the constant stress of a creep test [Pa], the strain of a relaxation test [1].
    - `glassy`, `equilibrium`: instantaneous and long-time modulus of a Prony series [Pa].
    - `source`: where the units come from, in words.
    """

    kind: str | None = None
    columns: Mapping[str, str | int] = dataclasses.field(default_factory=dict)
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    deformation: str | None = None
    poisson: float | None = None
    temperature: Any = None
    sheet: str | None = None
    step: tuple[str | int, ...] = ()
    load: float | None = None
    glassy: float | None = None
    equilibrium: float | None = None
    source: str = ""

    def completed(self, fixed: "Options") -> "Options":
        """Returns these options, and where they are silent those that the format fixes."""
        own = {name: value for name, value in vars(self).items() if value is not None}
        own["columns"] = self.columns or fixed.columns
        own["units"] = {**fixed.units, **self.units}
        own["source"] = self.source or fixed.source
        return dataclasses.replace(fixed, **own)


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
