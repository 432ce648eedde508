"""Ways to measure a modulus: the quantities of each, and the value that they give."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np


class Way(NamedTuple):
    """A way to measure: its kind, quantities beside the abscissa, and the value at each point.

    `value` takes the numbers of the quantities in SI units, and behind them the constant load.
    """

    kind: str
    quantities: str
    value: Callable[..., Any]

    @property
    def names(self) -> list[str]:
        """The abscissa and the other quantities."""
        abscissa = "time" if self.kind in ("relaxation", "creep") else self.kind
        return [abscissa, *self.quantities.split()]


# The most direct ones first; in the order of the first of a kind the columns of a file without
# names are read.
ALL_WAYS = (
    Way("frequency", "storage loss", lambda storage, loss: storage + 1j * loss),
    Way("frequency", "storage tan_delta", lambda storage, tan: storage * (1 + 1j * tan)),
    Way("frequency", "storage phase", lambda storage, phase: storage * (1 + 1j * np.tan(phase))),
    Way("frequency", "magnitude tan_delta", lambda size, tan: size * np.exp(1j * np.arctan(tan))),
    Way("frequency", "magnitude phase", lambda size, phase: size * np.exp(1j * phase)),
    Way("frequency", "loss tan_delta", lambda loss, tan: loss * (1 / tan + 1j)),
    Way("frequency", "loss phase", lambda loss, phase: loss * (1 / np.tan(phase) + 1j)),
    *(
        Way("frequency", quantities, value)  # E* = 1/D*, with D* = D' - iD''
        for quantities, value in {
            "storage_compliance loss_compliance": lambda real, loss: 1 / (real - 1j * loss),
            "storage_compliance tan_delta": lambda real, tan: 1 / (real * (1 - 1j * tan)),
            "storage_compliance phase": lambda real, delta: 1 / (real * (1 - 1j * np.tan(delta))),
            "compliance_magnitude tan_delta": lambda size, tan: np.exp(1j * np.arctan(tan)) / size,
            "compliance_magnitude phase": lambda size, delta: np.exp(1j * delta) / size,
            "loss_compliance tan_delta": lambda loss, tan: 1 / (loss * (1 / tan - 1j)),
            "loss_compliance phase": lambda loss, delta: 1 / (loss * (1 / np.tan(delta) - 1j)),
        }.items()
    ),
    Way("relaxation", "modulus", lambda modulus: modulus),
    Way("creep", "compliance", lambda compliance: compliance),
    Way("relaxation", "stress strain", lambda stress, strain: stress / strain),
    Way("creep", "strain stress", lambda strain, stress: strain / stress),
    Way("relaxation", "stress", lambda stress, strain: stress / strain),
    Way("creep", "strain", lambda strain, stress: strain / stress),
)  # fmt: skip
AT_LOAD = ALL_WAYS[-2:]  # if the constant load is known
SWEEPS = tuple(way._replace(kind="strain") for way in ALL_WAYS if way.kind == "frequency")
