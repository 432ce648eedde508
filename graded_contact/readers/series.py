"""A Prony series as a file has it, and the material that it becomes.

The units, the modulus that ratios are of, tension or shear are stated by the file, given by the
user, or asked for. Of decks, which state no units, the usual ones are assumed if they are credible.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from ..materials.coverage import MeasuredRange
from ..materials.material import Prony
from ..materials.shift import AbstractShift
from .decisions import Log, Options, settled
from .deformation import deformation_in
from .stated_moduli import differ
from .units import UNITS

# Instantaneous moduli of solids lie between 10 kPa and 1 TPa: numbers of a deck without units.
_SOFTEST, _HARDEST = 1e4, 1e12  # Pa
_FOREVER = 1e30  # s
_NEGLIGIBLE_ERROR = 1e-3  # of a modulus
_ROUNDED = 1e-3  # of the instantaneous modulus: how far rounded ratios may add up to more than 1


# What a table is that may be a Prony series or a relaxation modulus.
Doubt = Literal["refused", "series", "moduli"]
SERIES = (
    "it holds a Prony series (relaxation times with moduli or ratios), no measured moduli: "
    "`readers.read_prony` reads it, and `graded-contact fit` converts it"
)


class Modes(NamedTuple):
    """A Prony series as a file has it; None where the file is silent.

    **Fields:**

    - `layout`: what the file is, in words.
    - `log`: of the reading.
    - `strengths`: moduli of the branches, or shares of the instantaneous modulus.
    - `times`: relaxation times; infinite for the equilibrium.
    - `ratios`: whether `strengths` are shares.
    - `bulk`: shares of the bulk modulus, if these differ from those of the shear modulus.
    - `equilibrium`, `glassy`: long-time and instantaneous modulus.
    - `bare`: words that state one of both without a unit, though other moduli have one.
    - `letters`: "tension" or "shear" of `equilibrium` and `glassy`, if the file states it.
    - `units`: those that the file states, of "modulus" and "time".
    - `deck`: whether it is a deck, which states no units as a rule.
    - `deformation`: "tension" or "shear", of the moduli.
    - `poisson`: ν [1].
    - `shift`, `measured`: as in `Prony`.
    - `lines`: those of the file without numbers of the series.
    """

    layout: str
    log: Log
    strengths: Sequence[float]
    times: Sequence[float]
    ratios: bool = False
    bulk: Sequence[float] | None = None
    equilibrium: float | None = None
    glassy: float | None = None
    bare: str | None = None
    letters: Mapping[str, str] = {}
    units: Mapping[str, str] = {}
    deck: bool = False
    deformation: str | None = None
    poisson: float | None = None
    shift: AbstractShift | None = None
    measured: MeasuredRange | None = None
    lines: Sequence[str] = ()


def material_of_series(series: Modes, options: Options) -> Prony:
    """Returns the material of a series, with the options of the user."""
    log, glassy, equilibrium = series.log, options.glassy, options.equilibrium
    modulus, second = _si_factors(series, options)
    times = second * np.asarray(series.times, float)
    last, shares = times >= _FOREVER, np.asarray(series.strengths, float)
    if np.any(last & np.isfinite(times)):
        log.note(f"Times from {_FOREVER:g} s on are taken as infinite, as that of the equilibrium.")
    stated = {
        "glassy": None if series.glassy is None else modulus * series.glassy,
        "equilibrium": None if series.equilibrium is None else modulus * series.equilibrium,
    }
    for name, value in (("glassy", glassy), ("equilibrium", equilibrium)):
        if value is not None and stated[name] is not None:
            raise ValueError(f"the file states {name} = {stated[name]:g} Pa: leave out `{name}`")
    if series.ratios and all(x is None for x in (*stated.values(), glassy, equilibrium)):
        raise ValueError(
            "its ratios need a modulus: pass the instantaneous one as `glassy` [Pa], or the "
            "long-time one as `equilibrium` [Pa]"
        )
    whose = _deformation(series, options)
    poisson = series.poisson if options.poisson is None else options.poisson
    if poisson is None and (mixed := set(series.letters.values()) - {whose}):
        raise ValueError(
            f"it states moduli in {whose} and in {mixed.pop()}: pass `poisson`, which converts"
        )
    if poisson is None:
        poisson = 0.5
        log.note("Poisson's ratio is 0.5, unless `poisson` is given.")
    # The user gives Young's moduli.
    factors = {"shear": 2 * (1 + poisson), "tension": 1.0}
    factor = factors[whose]
    if factor != 1:
        log.note(f"Converted from shear to tension by Poisson's ratio: E = {factor:.6g} G.")
    first, rest = (
        given if (own := stated[name]) is None else factors[series.letters.get(name, whose)] * own
        for name, given in (("glassy", glassy), ("equilibrium", equilibrium))
    )
    if np.any(times <= 0) or np.any(shares < 0) or not np.all(np.isfinite(shares)):
        raise ValueError("relaxation times must be positive, and moduli or ratios not negative")
    if series.ratios:
        strengths, rest = _of_ratios(shares, last, first, rest)
    else:
        strengths = factor * modulus * shares
        if np.any(last) and equilibrium is not None:
            raise ValueError("it has a row of the equilibrium: leave out `equilibrium`")
        rest = _rest(strengths, last, first, rest, log)
    if series.bulk is not None:
        _note_bulk(series, poisson)
    used = ~last & (strengths > 0)
    if np.any(~last & ~used):
        log.note(f"Left out {np.sum(~last & ~used)} branches without a modulus.")
    log.note(f"E_eq = {rest:.6g} Pa, and {np.sum(used)} branches.")
    return Prony(rest, strengths[used], times[used], poisson, series.shift, series.measured)


def _si_factors(series: Modes, options: Options) -> tuple[float, float]:
    """Pascals per unit of the moduli, and seconds per unit of the times."""
    log, units, found = series.log, options.units, {}
    if series.bare and "modulus" not in units:
        raise ValueError(
            f"{series.bare!r} has no unit: write it behind the number, or pass the unit of all "
            "moduli of the file, for instance `units={'modulus': 'MPa'}`"
        )
    absolute = not series.ratios or series.glassy is not None or series.equilibrium is not None
    for name, needed in (("modulus", absolute), ("time", True)):
        given = units.get(name)
        unit = settled(
            f"the {name}", series.units.get(name), given, option=f"`units={ {name: given} }`",
            alike=lambda stated, unit, name=name: {stated, unit} <= set(UNITS[name]),
        )  # fmt: skip
        if given is not None and given not in UNITS[name]:
            allowed = list(UNITS[name])
            raise ValueError(f"`units={ {name: given} }` is refused: use one of {allowed}")
        if unit is None and needed and series.deck:
            unit = "s" if name == "time" else _credible_unit(series)
            if unit is not None:
                other = "ms" if name == "time" else {"Pa": "MPa", "MPa": "Pa"}[unit]
                log.assume(
                    f"The {name} is assumed to be in {unit}, as the deck states no unit; otherwise "
                    f"pass it, for instance `units={ {name: other} }`."
                )
        if unit is None and needed:
            usual = {"modulus": "MPa", "time": "s"}[name]
            raise ValueError(f"the {name} has no unit: pass for instance `units={ {name: usual} }`")
        if unit is not None and needed:
            log.note(f"The {name} is in {unit}.")
        found[name] = UNITS[name][unit] if unit else 1.0
    return found["modulus"], found["time"]


def _credible_unit(series: Modes) -> str | None:
    """Pa or MPa, the usual units of decks, if only one of them makes a modulus of a solid."""
    value = series.glassy if series.glassy is not None else series.equilibrium or 0.0
    fits = [
        unit for unit in ("Pa", "MPa") if _SOFTEST <= UNITS["modulus"][unit] * value <= _HARDEST
    ]
    return fits[0] if len(fits) == 1 else None


def _deformation(series: Modes, options: Options) -> str:
    """Tension or shear, of the moduli in the file."""
    given = options.deformation
    found = settled(
        "the modulus", series.deformation, given, option=f"`deformation={given!r}`",
        alike=lambda stated, given: stated == given,
    )  # fmt: skip
    if found is None and series.ratios and (options.glassy, options.equilibrium) != (None, None):
        return "tension"  # as the modulus of the user
    if found is None:
        found, reason = deformation_in([], series.lines)
        if found is None:
            raise ValueError(f"{reason}: pass `deformation='tension'` or `deformation='shear'`")
        series.log.note(f"The moduli are of {found}, because of {reason}.")
    return found


def _of_ratios(
    shares: np.ndarray, last: np.ndarray, glassy: float | None, rest: float | None
) -> tuple[np.ndarray, float]:
    """The moduli of branches [Pa] and the equilibrium modulus [Pa] of shares."""
    total = math.fsum(shares)
    if total > 1 + _ROUNDED:
        raise ValueError(
            f"the ratios add up to {total:.6g}, which is more than 1; perhaps they are moduli"
        )
    remainder = max(0.0, math.fsum([1.0, *-shares[~last]]))
    if np.any(last) and abs(total - 1) > _ROUNDED:
        raise ValueError(f"the ratios with that of the equilibrium add up to {total:.6g}, not to 1")
    if glassy is None:
        if not remainder or rest is None:
            raise ValueError(
                "the ratios add up to 1, so nothing is left at equilibrium: pass `glassy`"
            )
        glassy = rest / remainder
    elif rest is not None:
        _check_sum(glassy, rest, math.fsum(glassy * shares[~last]))
    return glassy * shares, remainder * glassy if rest is None else rest


def _rest(
    strengths: np.ndarray, last: np.ndarray, glassy: float | None, rest: float | None, log: Log
) -> float:
    """The equilibrium modulus [Pa] of a table of moduli."""
    total = math.fsum(strengths[~last])
    if np.any(last):
        row = math.fsum(strengths[last])
        if rest is not None and differ(rest, row):
            raise ValueError(
                f"its row of the equilibrium has {row:.6g} Pa, but it states {rest:.6g} Pa too"
            )
        rest = row
    if glassy is not None:
        rest = glassy - total if rest is None else rest
        if rest < -_ROUNDED * glassy:
            raise ValueError(
                f"the moduli add up to {total:.6g} Pa, more than the glassy {glassy:.6g}"
            )
        rest = max(0.0, rest)
        _check_sum(glassy, rest, total)
    if rest is not None:
        return rest
    log.assume(
        "It is assumed to be of a liquid, with the equilibrium modulus 0, because the file names "
        "none; otherwise pass `equilibrium`."
    )
    return 0.0


def _check_sum(glassy: float, rest: float, total: float) -> None:
    """Refuses moduli [Pa] that contradict each other: E_0 = E_eq + the sum of the branches."""
    if differ(glassy, rest + total):
        raise ValueError(
            f"the instantaneous modulus {glassy:.6g} Pa is not the sum of the long-time modulus "
            f"{rest:.6g} Pa and of its branches, {total:.6g} Pa: a branch lacks, or one is wrong"
        )


def _note_bulk(series: Modes, poisson: float) -> None:
    """Says how far Young's modulus is off if the bulk modulus relaxes in another way."""
    shear, bulk = math.fsum(series.strengths), math.fsum(series.bulk or ())
    # The ratio of G to K at the end, over that at the start.
    ratio = 3 * (1 - 2 * poisson) / (2 * (1 + poisson)) * (1 - shear) / max(1 - bulk, 1e-9)
    final = (3 - 2 * ratio) / (2 * (3 + ratio))
    error = abs((1 + final) / (1 + poisson) - 1)
    if error > _NEGLIGIBLE_ERROR:
        series.log.assume(
            "The bulk modulus relaxes otherwise than the shear modulus. Poisson's ratio is taken "
            f"as constant, {poisson:g}, so that E is up to {error:.1%} off; "
            "`materials.BulkShear` has both moduli."
        )
