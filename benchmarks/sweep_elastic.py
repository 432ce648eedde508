"""Elastic contacts at many pressures, by `sweep` and point by point by Tamaas, at equal error.

Run by `bench_sweep.py`. Both get the same heights, reduced modulus and pressures. The
tolerance of each is sought at the middle pressure, for the target error of the pressures there;
the errors that are printed are those at pressures along the whole series.
"""

import time
from functools import partial

import numpy as np
from contact_scenes import BEST, bodies, errors_of, loosest, rough_surface

import graded_contact as gc

SAMPLES = 6


def elastic(size, points, target, timed):
    """Yields for each program its tolerance, seconds until it begins, points per second, errors."""
    surface = rough_surface(size)
    press = partial(gc.slide, bodies()["elastic"], surface, velocity=0.0)
    pressures = np.geomspace(1e-3, 1e-1, points)  # of the reduced modulus
    middle = pressures[points // 2]
    sample = pressures[:: max(1, points // SAMPLES)]
    exact = {pressure: press(pressure=pressure, rtol=BEST) for pressure in (*sample, middle)}

    reached, _ = loosest(lambda rtol: press(pressure=middle, rtol=rtol), exact[middle], target)
    if reached is None:
        raise RuntimeError(f"no `rtol` reaches an error of {target:g} at N = {size}")
    rtol = reached[1]

    def area(point):
        found = press(pressure=point["pressure"], rtol=rtol, throw=False)
        return {"contact_area": found.contact_area, "result": found.result}

    _, told = timed(area, {"pressure": pressures})
    ours = [press(pressure=pressure, rtol=rtol).pressure for pressure in sample]
    yield f"sweep, rtol {rtol:.1e}", told, _worst(ours, sample, exact)

    try:
        from contact_peers import Tamaas, at_equal_error
    except ImportError:
        return
    peer = Tamaas(surface.heights)
    tolerance = at_equal_error(peer, middle, target, exact[middle], target, 8, [])[0]
    start = time.perf_counter()
    for pressure in pressures:
        peer.solve(pressure, tolerance)
    rate = points / (time.perf_counter() - start)
    theirs = [peer.solve(pressure, tolerance) for pressure in sample]
    yield f"tamaas, tolerance {tolerance:.1e}", (0.0, rate), _worst(theirs, sample, exact)


def _worst(found, sample, exact):
    """Largest errors of pressure and area, relative."""
    pairs = zip(found, sample, strict=True)
    return np.max([errors_of(pressure, exact[at]) for pressure, at in pairs], axis=0)
