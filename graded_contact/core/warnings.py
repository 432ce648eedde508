"""Caveats: warnings about numbers of solves that succeeded, in sentences.

A caveat is computed from the numbers of a `Sliding`, a `Surface` or a result file; it is not
stored. `Sliding.caveats`, `Surface.caveats` and `warnings_of(results)` give the sentences. The
table, the file, the figure and the command's summary print those of the results. A new rule is
one more `Rule` in `RULES`. Its quantity is a number of `Sliding` (and thus a variable of the file),
of any shape, and NaN where a solve has none.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Bool

from .display import shown, with_unit

EXTRAPOLATED = 0.01  # of the friction, from frequencies at which a material was not measured
MOST = 10.0  # share of an error above which a number means nothing
LIMIT = 0.1  # the part of a result above which there is a warning
# Small strains neglect slope²/2, the excess of an arc over its chord. Above STEEP it is > LIMIT.
STEEP = (2 * LIMIT) ** 0.5
SQUEEZED = 0.2 - 1e-3  # of the layers; from 20 % on, whatever the error of the solve
RIM = 1e-3  # of the load, on the outermost points of a window
WHOLE = 1e-3  # of the cell: a stroke as long as the cell may be rounded
RIPPLE = 0.01  # of the peak of the friction; 0.3 % or less of smooth starts
WARM = 1.0  # K above the bulk; less changes the moduli of a rubber by a few per cent
ROUNDING = 1e-12  # of the slope: friction below it is none
IDLE = 1e-3  # friction over slope below which a contact counts as without friction
# What to do where a step of reading changed the slope.
REMEDIES = {
    "resampled": "Leave out `shape`, or take more points.",
    "equally spaced": "Dense parts lost their short waves, or sparse parts have none.",
    "filled": "Crop to a `region` without holes, or discard the spikes around them with `rim`.",
    "joined": 'Its edges differ much: take `periodic = "mirror"`, which keeps every height.',
    "tapered": 'Leave out `periodic`, or take "mirror", which keeps every height.',
}
PREPARING = ("read", "equally spaced", "cropped", "lines levelled", "tilt removed", "filled")
# Measured surfaces from a scan of atoms to a road; a wrong unit is wrong by 1000 mostly.
USUAL = {
    "size": (1e-8, 1e3),  # [m]
    "rms height": (1e-11, 1.0),  # [m]
    "rms slope": (5e-4, 3.0),
    "thickness": (1e-9, 1.0),  # [m], of a layer
}
SPIKE = 10  # distance from the mean over the rms height; 1e-22 of Gaussian heights are beyond


class Rule(NamedTuple):
    """A warning where `quantity` exceeds `limit`.

    **Fields:**

    - `quantity`: the name of a number of a `Sliding` or of `Results`, or a function of these.
    - `limit`: above it there is a warning.
    - `sentence`: the warning; `{value}` is the number; of several solves, the ends of their range.
    """

    quantity: str | Callable[[Any], ArrayLike]
    limit: float
    sentence: str


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


def _number(found: Any, name: str) -> np.ndarray:
    """A number of a result, or 0 if it has none, as a periodic contact has no rim."""
    known = name in getattr(found, "numbers", (name,))  # or a `Sliding` would compute it
    return np.asarray(getattr(found, name, 0.0) if known else 0.0)


def _of_friction(error: str) -> Callable[[Any], ArrayLike]:
    """Returns the function of an error over the friction [1]; 0 where nothing is dissipated."""
    name = "mean_friction" if error.startswith("mean") else "friction"

    def share(found):
        names = (name, error, "slope_in_contact")
        friction, wrong, slope = (_number(found, name) for name in names)
        scale = np.maximum(np.abs(friction), IDLE * slope)
        idle = np.abs(friction) <= ROUNDING * slope
        return np.where(idle, 0.0, np.minimum(wrong / np.where(scale == 0, 1, scale), MOST))

    return share


def _of_area(found: Any) -> ArrayLike:
    """The error of the contact area by the grid over the area [1]; 0 without contact."""
    area, wrong = (_number(found, name) for name in ("contact_area", "contact_area_grid_error"))
    return np.where(area > 0, np.minimum(wrong / np.where(area > 0, area, 1), MOST), 0.0)


def _unmeasured(what: str) -> str:
    return (
        f"{{value:.0%}} of the {what} on points that were filled or tapered, not measured. "
        "Crop to a `region` without them, or read with `periodic='mirror'`."
    )


# Of every contact under sliding, steady or not.
SLIDING_RULES = (
    Rule("slope_in_contact", STEEP,
         "The block's rms slope where it carries the load is {value:.2g}. The model assumes small "
         f"strains: above an rms slope of {STEEP:.2g} the neglected terms exceed {LIMIT:.0%}."),
    Rule("extrapolated_friction", EXTRAPOLATED,
         "{value:.0%} of the friction comes from frequencies or a temperature at which a material "
         "was not measured: its modulus there is an extrapolation."),
)  # fmt: skip
RULES = (
    Rule(_of_friction("friction_grid_error"), LIMIT,
         "The grid does not resolve the contact: the friction has an error of about {value:.0%}. "
         "Take more points, or a smoother surface."),
    Rule(_of_area, LIMIT,
         "The grid does not resolve the contact: the contact area has an error of about "
         "{value:.0%}. Take more points, or a smoother surface."),
    *SLIDING_RULES,
    Rule(lambda found: np.isnan(found.friction) & (_number(found, "slope_in_contact") == 0), 0,
         "The surfaces do not touch: there is no load, so friction is not defined."),
    Rule(lambda found: np.isnan(_number(found, "shear_friction"))
         & (_number(found, "slope_in_contact") > 0), 0,
         "The friction of shear is not a number: `shear` returned NaN under a pressure of this "
         "contact."),
    Rule("compression", SQUEEZED,
         "The body moved into the layers by {value:.0%} of their thickness above the rigid base. "
         f"The model assumes small strains: above 20% the neglected terms exceed {LIMIT:.0%}."),
    Rule("unmeasured_friction", LIMIT, _unmeasured("friction arises")),
    Rule("unmeasured_area", LIMIT, _unmeasured("contact area lies")),
    Rule("rim_load", RIM,
         "{value:.2g} of the load acts on the rim of the window. Take a larger window, unless the "
         "body ends there."),
)  # fmt: skip
CYCLE_RULES = (
    *SLIDING_RULES,
    Rule(_of_friction("mean_friction_grid_error"), LIMIT,
         "The grid does not resolve the contact: the mean friction has an error of about "
         "{value:.0%}. Take more points, or a smoother surface."),
    Rule(_of_friction("mean_friction_time_error"), LIMIT,
         "The times do not resolve the motion: the mean friction has an error of about "
         "{value:.0%}. Take more times."),
    Rule("largest_step", 1.0 + LIMIT,
         "The surface moves by up to {value:.2g} spacings of the grid from one time to the next: "
         "the times do not resolve how the shortest waves move. Take more times."),
    Rule("load_mismatch", LIMIT,
         "The work of the load has an error of about {value:.0%} of the dissipated energy: the "
         "load or the gap changes too fast for the number of times. Take more times, or let a "
         "jump last several of them."),
    Rule(lambda found: np.all(np.asarray(found.load) == 0, axis=-1), 0,
         "The surfaces never touch: without a load there is no friction."),
    Rule("unresolved_motion", LIMIT,
         "{value:.0%} of the velocity is at the upper half of the frequencies that the times "
         "resolve: the motion has kinks or jumps. Take more times, or a smoother motion."),
    Rule("surface_rise", WARM,
         "The contact is {value:.2g} K above the bulk in the mean over the cycle. Within the cycle "
         "it is warmer at the highest speed and colder at a turn; this, and heat that is left when "
         "the next pass comes, are neglected."),
    Rule("stroke_over_cell", 1 + WHOLE,
         "The stroke is {value:.3g} times as long as the cell: the surface is periodic, so that "
         "the next copy of each asperity follows in its track before it turns. Take a larger cell "
         "or a shorter stroke."),
    Rule("ripple_at_rest", RIPPLE,
         "At rest, before it starts, the friction ripples by {value:.1%} of its peak. This ripple "
         "is numerical: the motion starts too suddenly for the times. Take more times, or a "
         "smoother start."),
)  # fmt: skip


def caveats_of(found: Any, rules: Sequence[Rule] = RULES) -> tuple[Caveat, ...]:
    """Returns the caveats of a `Sliding` or of the results of a scene."""
    caveats = []
    for quantity, limit, sentence in rules:
        values = np.asarray(quantity(found) if callable(quantity) else _number(found, quantity))
        where = values > limit
        if np.any(where):
            text = sentence.format(value=_Ends(np.min(values[where]), np.max(values[where])))
            if not np.all(where):
                text += f" ({np.sum(where)} of {values.size} solves.)"
            caveats.append(Caveat(text, where))
    return tuple(caveats)


def unusual(name: str, value: float) -> str:
    """Returns a warning if a number is outside of its range in `USUAL`, or nothing.

    Lengths are in m.
    """
    low, high = USUAL[name]
    if low <= value <= high:
        return ""
    plain = name == "rms slope"
    here, first, last = (f"{n:.2g}" if plain else with_unit(n, "m") for n in (value, low, high))
    return f"The {name} of {here} is unusual (usual are {first} to {last}): check units."


def caveats_of_steps(steps: Sequence[Any], size: Sequence[float] = ()) -> tuple[str, ...]:
    """Returns the warnings about a measured surface.

    **Arguments:**

    - `steps`: its roughness after each step of reading, see `Step`.
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
        if after.name == "filled" and before.missing > LIMIT:
            sentences.append(
                f"{before.missing:.0%} of the points were not measured and were filled. The "
                "history gives the largest `region` without such points."
            )
        if after.name not in REMEDIES or before.rms_slope == 0:
            continue
        change = after.rms_slope / before.rms_slope - 1
        # A finer grid sees steeper slopes between its points, and is no worse for it; spikes that
        # `rim` discards took their slopes with them.
        rose = change > LIMIT and after.name in ("filled", "tapered")
        if rose or (change < -LIMIT and after.name != "filled"):
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
