"""Surfaces, bodies and measures shared by the sections of `bench_contact.py`."""

from functools import cache
from typing import NamedTuple

import jax
import numpy as np

import graded_contact as gc

CELL = 1.0  # m
Q0 = 2 * np.pi / CELL
BEST = 1e-10  # tolerance of what counts as exact
LOADS = (0.01, 0.1, 0.3)  # p/E_r
BODIES = ("elastic", "single", "single+coat", "tread", "tread+coat", "broad", "broad+coat")


@cache
def rough_surface(n, seed=0):
    """H = 0.8, roll-off 4 q0, cut-off (n/8) q0, rms slope 0.1; phases are the same for all n."""
    grid = gc.Grid((n, n), CELL)
    spectrum = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=n / 8 * Q0)
    return gc.surfaces.rescale(
        gc.random_surface(spectrum, grid, jax.random.key(seed)), rms_slope=0.1
    )


def tread():
    """The package's tread at -10 °C, in units of its relaxed reduced modulus."""
    real = gc.tyre_tread().at(263.15)
    unit = real.equilibrium / 0.75
    return gc.Prony(real.equilibrium / unit, real.strengths / unit, real.times, 0.5)


def bodies():
    """Name -> stack; all have the reduced modulus 1 at rest, and coats q0 d = 6e-3 keep it."""
    elastic = gc.Elastic(0.75, 0.5)
    single = gc.Prony(0.75, [0.75 * 9], [1.0], 0.5)
    broad = gc.Prony(0.75, np.full(10, 75.0), np.logspace(-5, 4, 10), 0.5)
    coat = gc.Layer(elastic, 6e-3 / Q0)
    found = {"elastic": gc.Stack(base=gc.HalfSpace(elastic))}
    for name, material in {"single": single, "tread": tread(), "broad": broad}.items():
        base = gc.HalfSpace(material)
        found[name] = gc.Stack(base=base)
        found[f"{name}+coat"] = gc.Stack(layers=(coat,), base=base)
    return found


class Errors(NamedTuple):
    """Of a pressure field: root mean square over root mean square, and area, relative."""

    pressure: float
    area: float


def errors_of(pressure, best):
    """Errors of a pressure field against the solution that counts as exact."""
    found, exact = np.asarray(pressure), np.asarray(best.pressure)
    sigma = np.linalg.norm(found - exact) / np.linalg.norm(exact)
    return Errors(sigma, abs(np.mean(found > 0) / np.mean(exact > 0) - 1))


def loosest(run, best, target, *, ratio=10**0.25, tries=16):
    """The solve of the loosest `rtol` of a geometric series whose true error is within `target`.

    `run(rtol)` returns a `Sliding`; the series goes through `target`. Returns that solve and its
    `rtol`, or None if none reached it, and the solve with `rtol = target`.
    """

    def attempt(power):
        rtol = target * ratio**power
        found = run(rtol)
        return found, rtol, errors_of(found.pressure, best).pressure <= target

    reported, rtol, good = attempt(0)
    reached, step = ((reported, rtol) if good else None), (1 if good else -1)
    for power in range(step, step * tries, step):
        # Neither a tolerance of 1 nor one below what the best was solved to means anything.
        if not BEST < target * ratio**power < 0.5:
            break
        found, rtol, good = attempt(power)
        if good:
            reached = found, rtol
        if good != (step > 0):
            break
    return reached, reported


def growth(sizes, counts):
    """The exponent of counts over sizes, by least squares in logarithms."""
    return np.polyfit(np.log(sizes), np.log(counts), 1)[0] if len(sizes) > 1 else np.nan
