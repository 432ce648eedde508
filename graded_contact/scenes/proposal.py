"""First loads for a measured material and surface."""

import itertools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..blocks.stack import HalfSpace, Stack
from ..materials.coverage import coverage
from ..materials.material import Prony
from ..mean_field.mean_field import mean_field_friction
from ..sliding.numbers.checks import EXTRAPOLATED
from ..surfaces.statistics import isotropic_spectrum, statistics
from ..surfaces.surface import Surface

CONTACT_SHARE = 0.1  # share of the nominal area; at small loads twice p/(E* h') in Persson's theory
_DECADES = 3  # largest number of decades of velocity
_USUAL = 1e-2  # m/s
_TEMPERATURES = 5  # at most


class ProposedLoad(NamedTuple):
    """A first load.

    **Fields:**

    - `pressure`: mean pressure [Pa] for contact on about a tenth of the area.
    - `velocity`: lowest and highest [m/s], powers of ten.
    - `temperature`: [K]; empty without a law of temperature.
    """

    pressure: float
    velocity: tuple[float, float]
    temperature: tuple[float, ...]


def proposed_load(
    material: Prony,
    surface: Surface,
    temperatures: Float[np.ndarray, " isotherms"],
    every: bool = False,
) -> ProposedLoad:
    """Returns a load at which friction comes from measured frequencies, if there is one.

    **Arguments:**

    - `material`: the material of the half-space.
    - `surface`: what slides on it.
    - `temperatures`: at which the material was measured [K], if known.
    - `every`: whether the load has all of them; by default few, whose velocities overlap.
    """
    stack, times = Stack(base=HalfSpace(material)), np.asarray(material.times)
    low, high = (float(end) for end in coverage(stack) or (0.0, np.inf))
    if not 0 < low < high < np.inf:  # a series that was not measured, but given
        low, high = 1 / np.max(times), 1 / np.min(times)
    # In the middle of the measured frequencies, on the logarithm.
    modulus = abs(material.modulus(np.sqrt(low * high))) / (1 - float(material.poisson) ** 2)
    pressure = float(CONTACT_SHARE / 2 * modulus * statistics(surface).rms_slope)
    size, spacing = np.asarray(surface.grid.size), np.asarray(surface.grid.spacing)
    # The shortest wave must excite the lowest measured frequency, the longest wave the highest.
    first = np.floor(np.log10(low * np.min(spacing) / np.pi))
    last = np.ceil(np.log10(high * np.max(size) / (2 * np.pi)))
    decades = np.arange(first, last + 1)
    spectrum = isotropic_spectrum(surface)
    fields = [
        mean_field_friction(stack, spectrum, pressure=pressure, velocity=10.0**k, throw=False)
        for k in decades
    ]
    shares = np.array([field.extrapolated_friction for field in fields])
    shares = np.where(np.isfinite(shares), shares, 1.0)  # no mean field: no reason to go there
    limit = max(EXTRAPOLATED, 1.5 * float(np.min(shares)))
    runs = itertools.groupby(range(len(decades)), key=lambda i: bool(shares[i] <= limit))
    longest = max((list(run) for measured, run in runs if measured), key=len)
    start, stop = longest[0], longest[-1]
    law, shifts = material.shift, np.zeros(1)
    if law is not None:
        shifts = np.array([law.log_factor(t) for t in temperatures]) / np.log(10)
    # Half of the measured decades: the other half leaves room for the shifts by temperature.
    length = min(_DECADES, max(1, (stop - start) // 2))
    bottoms = [decades[i] - np.round(a) for i in longest for a in shifts]

    def inside(bottom: float) -> np.ndarray:
        """Isotherms whose velocities, times a_T, are those of measured frequencies."""
        low_end, high_end = decades[start] - 0.5, decades[stop] + 0.5
        return (bottom + shifts >= low_end) & (bottom + length + shifts <= high_end)

    middle = np.log10(_USUAL) - length / 2
    bottom = max(bottoms, key=lambda w: (np.sum(inside(w)), -abs(w - middle)))
    chosen = range(len(temperatures))
    if not every:
        among = np.flatnonzero(inside(bottom))
        # Where few frequencies were measured, no isotherm has all velocities: that of least shift.
        among = among if len(among) else np.array([np.argmin(np.abs(shifts))])
        chosen = _overlapping(among, shifts, length)
    return ProposedLoad(
        pressure=float(f"{pressure:.0e}"),
        velocity=(float(10.0**bottom), float(10.0 ** (bottom + length))),
        temperature=tuple(round(float(temperatures[i]), 2) for i in chosen if law is not None),
    )


def _overlapping(among: np.ndarray, shifts: np.ndarray, length: int) -> list[int]:
    """Few isotherms whose velocities, times a_T, leave no gap; those about the reference."""
    chosen = [int(among[0])]
    for i, following in itertools.zip_longest(among[1:], among[2:]):
        if following is None or abs(shifts[following] - shifts[chosen[-1]]) > length:
            chosen.append(int(i))
    middle = int(np.argmin(np.abs(shifts[chosen])))
    start = max(0, min(middle - _TEMPERATURES // 2, len(chosen) - _TEMPERATURES))
    return chosen[start : start + _TEMPERATURES]
