"""One spectrum from several scans of a surface, at different magnifications.

T. D. B. Jacobs, T. Junge, L. Pastewka, Surf. Topogr.: Metrol. Prop. 5 (2017) 013001,
doi:10.1088/2051-672X/aa51f8, describe what limits the spectrum of a scan: its length, the tip or
the optics, and noise. Each scan counts between two wavelengths, `longest` and `shortest`:

    log C
      │ ──────stylus──────
      │           ───────optical──────
      │                        ──────AFM──────
      └─────────────────────────────────────── log q

Where scans overlap, C is the geometric mean, weighted with the number of waves that each scan has
there. The factor between a scan and the others there is its mismatch.

A line sees the waves of all directions. For an isotropic surface its spectrum is

    C_line(q) = 2 ∫_q^∞ C(k) k dk / √(k² - q²),

two-sided as that of `SelfAffine` for profiles: for C = A k^-(2+2H) it is
C(q) q √π Γ(H+1/2)/Γ(H+1). This equation is solved for C, see `isotropic`.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..core.checks import check_positive, check_values, short
from ..core.display import shown, with_unit
from .rescaling import resample
from .spectrum_table import SpectrumTable
from .statistics import radial_spectrum, statistics
from .surface import Surface, check_periodic

PER_DECADE = 10  # points of a spectrum per factor 10 of q
POINTS_PER_WAVE = 4  # of the shortest wave that counts, unless given
WAVES_PER_SCAN = 2  # of the longest wave that counts: a plane is subtracted from longer ones
DOUBTED, REFUSED = 3.0, 100.0  # factors between C of scans where they overlap
_DIGITS = 1e-3  # of wavelengths that limit a scan: their digits
DIRECTED = (
    1.5  # rms slope across over that along a lay, above which a mean over directions is a warning
)
# Corrections of C from a line: more blow up noise, fewer miss a roll-off.
CORRECTIONS = 3
MEAN_OF = 12  # waves of a line: fewer scatter by a factor of 5, more blur a roll-off


@shown("name", "longest", "shortest", "points")
@dataclasses.dataclass(frozen=True)
class ScanSpectrum:
    """The spectrum of one scan, of an isotropic surface.

    **Fields:**

    - `name`: of the scan.
    - `q`: wavenumbers that count [rad/m], increasing, shape `(points,)`.
    - `density`: C at these [m⁴], of a surface also if the scan is a line.
    - `waves`: how many independent waves of the scan are behind each number.
    - `warnings`: of the scan.
    """

    name: str
    q: Float[np.ndarray, " points"]
    density: Float[np.ndarray, " points"]
    waves: Float[np.ndarray, " points"]
    warnings: tuple[str, ...] = ()

    @property
    def longest(self) -> float:
        """Longest wavelength that counts [m]."""
        return float(2 * np.pi / self.q[0])

    @property
    def shortest(self) -> float:
        """Shortest wavelength that counts [m]."""
        return float(2 * np.pi / self.q[-1])

    @property
    def points(self) -> int:
        """Number of wavenumbers."""
        return len(self.q)


@shown("spectrum", "scans", "mismatch")
class JoinedSpectrum(NamedTuple):
    """The spectrum of several scans.

    **Fields:**

    - `spectrum`: C(q), for `random_surface` and `mean_field_friction`.
    - `scans`: what it was joined from, in the order given.
    - `mismatch`: C of each scan over that of the others, the geometric mean where they overlap [1];
      NaN for a scan without an overlap.
    """

    spectrum: SpectrumTable
    scans: tuple[ScanSpectrum, ...]
    mismatch: Float[np.ndarray, " scans"]


def scan_spectrum(
    surface: Surface, name: str, *, longest: float | None = None, shortest: float | None = None
) -> ScanSpectrum:
    """Returns the spectrum of one scan between two wavelengths, for `joined_spectrum`.

    **Arguments:**

    - `surface`: the scan, as `read_surface` returns it; with the default `periodic="harmonic"` the
      cut edges hardly change C. A line must lie on an isotropic surface.
    - `name`: of the scan, for figures and messages.
    - `longest`: the longest wavelength that counts [m], at most the (longer) edge; None for half of
      the (shorter) one.
    - `shortest`: the shortest wavelength that counts [m]: what the tip or the optics resolve, and
      what stands out of the noise; at least 2 points (of the wider spacing), None for 4.

    **Returns:** C(q) of an isotropic surface, and its range.
    """
    check_periodic(surface)
    grid = surface.grid
    edges, apart = np.asarray(grid.size, float), np.asarray(grid.spacing, float)
    longest = float(np.min(edges)) / WAVES_PER_SCAN if longest is None else longest
    shortest = float(np.max(apart)) * POINTS_PER_WAVE if shortest is None else shortest
    for limit, value in (("longest", longest), ("shortest", shortest)):
        check_positive(limit, value, "[m]")
    edge, two = float(np.max(edges)), 2 * float(np.max(apart))
    allowed = f"the edge of the scan {name!r} is {edge:g} m"
    check_values("longest", longest, allowed, at_most=edge * (1 + _DIGITS))
    allowed = f"two spacings of the scan {name!r} are {two:g} m"
    check_values("shortest", shortest, allowed, at_least=two * (1 - _DIGITS))
    span = np.log10(np.max(edges) / np.max(apart) / 2)
    num_bins = max(round(PER_DECADE * float(span)), 1)
    q, density = (np.asarray(a, float) for a in radial_spectrum(surface, num_bins))
    known = (density > 0) & (q * longest >= 2 * np.pi * (1 - _DIGITS))
    known &= q * shortest <= 2 * np.pi * (1 + _DIGITS)
    if np.sum(known) < 3:
        limits = f"`longest={with_unit(longest, 'm')}` and `shortest={with_unit(shortest, 'm')}`"
        own = f"{with_unit(np.max(edges), 'm')} long, points {with_unit(np.max(apart), 'm')} apart"
        raise ValueError(f"{limits} leave too little of the scan {name!r}, {own}.")
    q, density = q[known], density[known]
    # Half of the modes in a ring or in both intervals of a line: the others are their conjugates.
    wide = np.log(10) / PER_DECADE
    if grid.ndim == 1:
        waves = wide * q * edges[0] / (2 * np.pi)
        # Single waves of a line scatter: each number is the mean of about as many around it.
        near = np.abs(np.log(q[:, None] / q)) <= np.arcsinh(
            MEAN_OF * np.pi / (q[:, None] * edges[0])
        )
        smooth = (near * waves) @ (q * density) / (near @ waves) / q
        return ScanSpectrum(name, q, isotropic(q, smooth), waves, surface.warnings)
    # Noise across the lines of a microscope, shorter than what counts, is no lay.
    seen = np.minimum(grid.shape, np.ceil(2 * edges / shortest)).astype(int)
    ratio = statistics(resample(surface, tuple(seen.tolist()))).slope_ratio
    warnings = surface.warnings
    if ratio is not None and ratio > DIRECTED:
        warnings += (
            f"Its slopes differ by {ratio:.2g} between directions, of which C is the mean.",
        )
    return ScanSpectrum(name, q, density, wide * q**2 * np.prod(edges) / (4 * np.pi), warnings)


def isotropic(q: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Returns C of an isotropic surface [m⁴] from the spectrum of a line on it [m³].

    By corrections of C with the ratio of the line's spectrum to the one that C implies, smoothed
    over neighbours: short ripples in q are noise of a single line. Where C falls as a power law the
    error is 2 %. Below a roll-off, lines tell little: C may be 1.6 times too large there.
    """
    u = np.linspace(0, 12, 600)  # k = q cosh u
    weight = np.cosh(u) * (u[1] - u[0])
    weight[0] /= 2
    x, target = np.log(q), np.log(line)
    log_k = x[:, None] + np.log(np.cosh(u))
    far = x >= x[-1] - np.log(10) / 2
    near = np.array([1, 2, 3, 2, 1])
    share = np.convolve(np.ones(len(x)), near, "same")
    found = target - x - np.log(np.pi)
    for _ in range(CORRECTIONS):
        # Waves beyond the last one follow a power law, from 1/q² to q⁻⁶.
        slope = np.clip(np.polyfit(x[far], found[far], 1)[0], -6, -2) if np.sum(far) > 1 else -4
        density = np.exp(np.interp(log_k, x, found) + slope * np.maximum(log_k - x[-1], 0))
        ratio = target - x - np.log(2 * density @ weight)
        found = found + np.convolve(ratio, near, "same") / share
    return np.exp(found)


def joined_spectrum(scans: Sequence[Any]) -> JoinedSpectrum:
    """Returns the spectrum of a surface from the spectra of its scans.

    Where scans overlap, C is their geometric mean, weighted with the number of waves that each has.

    **Arguments:**

    - `scans`: of `scan_spectrum`, in any order; lines and areas may be mixed.

    **Returns:** the spectrum, and how well the scans fit each other. A mismatch by more than a
    factor of 3 is a warning of the spectrum and of surfaces drawn from it.

    **Raises:** `ValueError` if no scan covers a part of the range, or if two scans differ by a
    factor of more than 100 where they overlap, as with a wrong unit.
    """
    scans = tuple(scans)
    if not scans or not all(isinstance(scan, ScanSpectrum) for scan in scans):
        raise ValueError(
            f"`scans={short(scans)}` must be spectra of `scan_spectrum`, at least one."
        )
    _check_gaps(scans)
    q = _thinned(np.sort(np.concatenate([scan.q for scan in scans])))
    # The weight of a scan is 0 outside of its range.
    logs, weights = np.zeros((2, len(scans), len(q)))
    for i, scan in enumerate(scans):
        logs[i] = np.interp(np.log(q), np.log(scan.q), np.log(scan.density))
        weights[i] = np.interp(q, scan.q, scan.waves, left=0, right=0)
    total = np.sum(weights, 0)
    mean = np.sum(weights * logs, 0) / total
    others = total - weights
    overlap = (weights > 0) & (others > 0)
    # The scan's logarithm less the mean of the others, weighted with the waves of both.
    apart = np.where(overlap, (logs - mean) * total / np.where(overlap, others, 1), 0)
    both = overlap * weights * others / total
    sums = np.sum(both, 1)
    mismatch = np.exp(
        np.where(sums > 0, np.sum(both * apart, 1) / np.where(sums > 0, sums, 1), np.nan)
    )
    table = SpectrumTable(q, np.exp(mean), *_told(scans, mismatch, _largest_factor(logs, weights)))
    return JoinedSpectrum(table, scans, mismatch)


def _thinned(q: np.ndarray) -> np.ndarray:
    """Increasing wavenumbers without those close above another one, and with both ends."""
    kept = [q[0]]
    for each in q[:-1]:
        if each > kept[-1] * 10 ** (0.5 / PER_DECADE):
            kept.append(each)
    if q[-1] < kept[-1] * 10 ** (0.5 / PER_DECADE):
        del kept[-1]
    return np.array([*kept, q[-1]])


def _check_gaps(scans: Sequence[ScanSpectrum]) -> None:
    """Refuses ranges between which no scan counts."""
    first, *rest = sorted(scans, key=lambda scan: scan.q[0])
    for scan in rest:
        if scan.q[0] > first.q[-1] * 10 ** (2 / PER_DECADE):
            ends = with_unit(first.shortest, "m"), with_unit(scan.longest, "m")
            raise ValueError(
                f"`scans` have a gap: {first.name!r} ends at wavelengths of {ends[0]}, and "
                f"{scan.name!r} begins at {ends[1]}. Add a scan between them, lower `shortest` of "
                f"{first.name!r}, raise `longest` of {scan.name!r} up to its edge, or check units."
            )
        first = max(first, scan, key=lambda scan: scan.q[-1])


def _largest_factor(logs: np.ndarray, weights: np.ndarray) -> tuple[float, int, int]:
    """C of a scan over that of another one where they overlap, for the two that differ most."""
    found = [(1.0, 0, 0)]
    for i, j in itertools.permutations(range(len(logs)), 2):
        if np.any(both := (weights[i] > 0) & (weights[j] > 0)):
            of_i, of_j = weights[i][both], weights[j][both]
            apart = np.average((logs[i] - logs[j])[both], weights=of_i * of_j / (of_i + of_j))
            found.append((float(np.exp(apart)), i, j))
    return max(found)


def _told(
    scans: Sequence[ScanSpectrum], mismatch: np.ndarray, largest: tuple[float, int, int]
) -> tuple[tuple[str, ...], ...]:
    """What was joined, and what makes it doubtful; refuses scans that differ by too much."""
    history, doubts = [], []
    for scan, factor in zip(scans, mismatch, strict=True):
        ends = f"{with_unit(scan.longest, 'm')} to {with_unit(scan.shortest, 'm')}"
        fits = "" if np.isnan(factor) else f"; C is {factor:.3g} times that of the others there"
        history.append(f"Spectrum of {scan.name}: wavelengths of {ends}{fits}.")
        doubts += [f"{scan.name}: {sentence}" for sentence in scan.warnings]
    if len(scans) > 1:
        doubts += [
            f"The range of {scan.name} overlaps with no other: nothing shows that they fit."
            for scan, factor in zip(scans, mismatch, strict=True)
            if np.isnan(factor)
        ]
    factor, high, low = largest
    if factor > DOUBTED:
        sentence = (
            f"C of {scans[high].name} is {factor:.3g} times that of {scans[low].name} where they "
            "overlap: another place or surface, noise, a blunt tip, or a wrong unit of one of them."
        )
        if factor > REFUSED:
            raise ValueError(f"`scans` do not fit. {sentence}")
        doubts.append(sentence)
    return tuple(history), tuple(doubts)
