"""What figures share: their colours, and units that suit the size of numbers."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # it takes a third of a second to import
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DOTS_PER_INCH = 160
_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


def new_figure(width: float, height: float) -> "Figure":
    """An empty figure [inches] with a constrained layout, and its own font sizes and spines."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=DOTS_PER_INCH, layout="constrained")


def unit_of(base: str, largest: float) -> tuple[str, float]:
    """The unit in which `largest` [base] is between 1 and 1000, and its reciprocal in `base`."""
    exponent = 3 * int(np.floor(np.log10(largest) / 3 + 1e-9)) if largest > 0 else 0
    exponent = min(max(exponent, min(_PREFIXES)), max(_PREFIXES))
    return f"{_PREFIXES[exponent]}{base}", 10.0**-exponent
