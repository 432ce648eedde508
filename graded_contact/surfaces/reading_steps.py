"""The steps of reading a measured surface: its roughness after each, and what makes it doubtful."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..core.checks import Numbers
from ..core.display import shown, with_unit
from ..core.warnings import WARN_ABOVE

# What to do where a step of reading changed the slope.
REMEDIES = {
    "resampled": "Take the points of the file (without a `shape`), or more.",
    "equally spaced": "Dense parts lost their short waves, or sparse parts have none.",
    "filled": "Crop to a `region` without holes, or discard the spikes around them with `rim`.",
    "joined": 'Its edges differ much: take `periodic = "mirror"`, which keeps every height.',
    "tapered": 'Leave out `periodic`, or take "mirror", which keeps every height.',
}
PREPARING = ("read", "equally spaced", "cropped", "lines levelled", "tilt removed", "filled")
# Measured surfaces from a scan of atoms to a road; a wrong unit is wrong by 1000 mostly.
USUAL = {
    "size": (1e-8, 1e3, "m"),
    "rms height": (1e-11, 1.0, "m"),
    "rms slope": (5e-4, 3.0, ""),
    "thickness": (1e-9, 1.0, "m"),  # of a layer
    "gap": (1e-11, 1.0, "m"),
    "pressure": (1e-6, 1e12, "Pa"),
    "stress": (1e-6, 1e12, "Pa"),
}
SPIKE = 10  # distance from the mean over the rms height; 1e-22 of Gaussian heights are beyond


@shown()
class ReadingStep(NamedTuple):
    """The roughness after one step of reading a measured surface, see `step`.

    **Fields:**

    - `name`: of the step.
    - `rms_height`: about the mean [m].
    - `rms_slope`: between neighbouring measured points [1].
    - `peak`: the largest distance from the mean over the rms height [1].
    - `missing`: the share of points without a height [1].
    """

    name: str
    rms_height: float
    rms_slope: float
    peak: float
    missing: float


def step(name: str, heights: Numbers, spacing: Numbers) -> ReadingStep:
    """Returns the roughness of heights [m], NaN where missing, at distances `spacing` [m]."""
    values = np.asarray(heights, float)
    deviation = values - np.nanmean(values)
    rms = float(np.sqrt(np.nanmean(deviation**2)))
    slopes = (np.diff(values, axis=axis) / apart for axis, apart in enumerate(np.asarray(spacing)))
    squares = [np.mean(slope[np.isfinite(slope)] ** 2) for slope in slopes]
    peak = float(np.nanmax(np.abs(deviation)) / rms) if rms > 0 else 0.0
    missing = float(np.mean(np.isnan(values)))
    return ReadingStep(name, rms, float(np.sqrt(np.sum(squares))), peak, missing)


def unusual(name: str, value: float, at_least: float = 0.0, at_most: float = math.inf) -> str:
    """Returns a warning if a number [SI] is outside of its range in `USUAL`, or nothing.

    The range is narrower if `at_least` and `at_most` say so.
    """
    low, high, unit = USUAL[name]
    low, high = max(low, at_least), min(high, at_most)
    if low <= value <= high:
        return ""
    here, first, last = (with_unit(n, unit) if unit else f"{n:.2g}" for n in (value, low, high))
    return f"The {name} of {here} is unusual (usual are {first} to {last}): check units."


def warnings_of_steps(steps: Sequence[ReadingStep], size: Sequence[float] = ()) -> tuple[str, ...]:
    """Returns the warnings about a measured surface.

    **Arguments:**

    - `steps`: its roughness after each step of reading, see `ReadingStep`.
    - `size`: its edge lengths [m].
    """
    if not steps:
        return ()
    last, sentences = steps[-1], []
    if last.rms_slope > 0:
        numbers = [("size", edge) for edge in {min(size), max(size)}] if len(size) else []
        numbers += [("rms height", last.rms_height), ("rms slope", last.rms_slope)]
        sentences += [sentence for pair in numbers if (sentence := unusual(*pair))]
    for before, after in pairwise(steps):
        if after.name == "filled" and before.missing > WARN_ABOVE:
            sentences.append(
                f"{before.missing:.0%} of the points were not measured and were filled. The "
                "history gives the largest `region` without such points."
            )
        if after.name not in REMEDIES or before.rms_slope == 0:
            continue
        change = after.rms_slope / before.rms_slope - 1
        # A finer grid sees steeper slopes between its points, and is no worse for it; spikes that
        # `rim` discards took their slopes with them.
        rose = change > WARN_ABOVE and after.name in ("filled", "tapered")
        if rose or (change < -WARN_ABOVE and after.name != "filled"):
            sentences.append(
                f"The rms slope {'fell' if change < 0 else 'rose'} from {before.rms_slope:.3g} to "
                f"{after.rms_slope:.3g} when {after.name}: friction and contact area follow the "
                f"slope. {REMEDIES[after.name]}"
            )
    prepared = [i for i, row in enumerate(steps) if row.name in PREPARING]
    # Resampling only blurs a spike: what the last step of preparation left counts.
    peak = max(row.peak for row in steps[max(prepared, default=0) :])
    if peak > SPIKE:
        sentences.append(
            f"The highest point is {peak:.3g} rms heights from the mean: probably a spike of the "
            "instrument or dust. Discard it with `rim`, or crop by `region`."
        )
    return tuple(sentences)
