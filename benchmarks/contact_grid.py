"""Errors by the grid and by the times, estimated and true: the sections `grid` and `total`.

Run by `bench_contact.py`. Surfaces without waves beyond a limit are the same on every grid that
resolves them, by interpolation. The true error of a number is its difference from the limit by the
grids of 4 and 8 times as many points, (4 f(8n) - f(4n))/3. Blocks: tread or two Prony series, every
other one under an elastic coat; half of the velocities along x, half oblique. Kinds:

    8, 4, 2     64² points, as many for the shortest wave; area from 1 % to complete contact
    light       8 points, loads 10 times smaller
    line        512 points in one dimension, 8 for the shortest wave
    window      a sphere, with and without waves, or a flat punch, 64² points
    measured    parts of measured surfaces, 64² points, not smoothed; truth by interpolation
    cycle       back and forth, 32² points, 8 for the shortest wave, 64 times; truth by 512 times
"""

import time
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from contact_peers import Tamaas
from contact_scenes import CELL as CELL_OF_PEERS
from rows import goal, report, timed

import graded_contact as gc
from graded_contact.sliding.half_grid import resampled

CELL = 8e-3  # m
NUMBERS = ("friction", "contact_area", "mean_gap")


def grid(count=200, seed=0, surfaces=()):
    """Estimated errors of the grid over true ones; `surfaces` are files for `measured`."""
    kinds = {
        "8": partial(rough, points=8), "4": partial(rough, points=4),
        "2": partial(rough, points=2), "light": partial(rough, points=8, light=0.1),
        "line": line, "window": window,
    }  # fmt: skip
    if surfaces:
        kinds["measured"] = partial(measured, files=surfaces)
    ratios = {}
    for kind, draw in kinds.items():
        start = time.perf_counter()
        rows = [row for i in range(-(-count // len(kinds))) if (row := ratio_of(draw(seed + i)))]
        for name in NUMBERS:
            show(kind, name, [row[name] for row in rows], ratios)
        print(f"# {kind}: {len(rows)} scenes in {time.perf_counter() - start:.0f} s")
    for name in ("mean_friction", "peak_friction"):
        rows = [cycle(seed + i, name) for i in range(-(-count // 8))]
        show("cycle", name, rows, ratios)
    for name, found in ratios.items():
        found = np.array(found)
        text = f"median {np.median(found):.1f}, below 1 in {np.mean(found < 1):.1%}"
        goal(f"{name}: below 1 in at most 5 %, median at most 5", text)


def show(kind, name, rows, ratios):
    """Reports a row of one kind of scene and one number."""
    true, claimed, plain = np.array(rows).T
    ratio = claimed / np.maximum(true, 1e-9)
    ratios.setdefault(name, []).extend(ratio)
    report("bench_contact-grid", {
        "scenes": kind, "number": name, "count": len(rows),
        "true error: median": float(np.median(true)), "largest": float(np.max(true)),
        "error of the pixel count": float(np.median(plain)),
        "estimate over true: median": float(np.median(ratio)),
        "below 1 [%]": 100 * float(np.mean(ratio < 1)), "least": float(np.min(ratio)),
    })  # fmt: skip


def ratio_of(scene):
    """True and claimed relative errors of each number, and that of the pixel count."""
    solve, heights = scene
    found = solve(heights(1))
    if found is None:
        return None
    near, far = solve(heights(4)), solve(heights(8))
    if near is None or far is None:
        return None
    rows = {}
    for name in NUMBERS:
        limit = (4 * float(getattr(far, name)) - float(getattr(near, name))) / 3
        true, claimed = float(getattr(found, name)) - limit, getattr(found, f"{name}_error")
        plain = float(found.contact_area_pixels) / limit - 1 if name == "contact_area" else 0.0
        rows[name] = abs(true / limit), float(claimed) / abs(limit), abs(plain)
    return rows


def block_of(rng, number):
    bases = (
        gc.tyre_tread(), gc.Prony(1e6, [9e6], [1e-3], 0.49),
        gc.Prony(2e6, [4e6, 8e6, 2e7], [1e-5, 1e-3, 1e-1], 0.45),
    )  # fmt: skip
    coat = gc.Layer(gc.Elastic(10 ** rng.uniform(6, 7.5), 0.49), 10 ** rng.uniform(-5, -3.5))
    layers = (coat,) if number // 3 % 2 else ()
    return gc.Stack(layers=layers, base=gc.HalfSpace(bases[number % 3]))


def solver(block, size, pressure, velocity, periodic=True):
    def solve(heights):
        surface = gc.Surface(heights, gc.Grid(heights.shape, size), periodic=periodic)
        found = gc.slide(block, surface, pressure=pressure, velocity=velocity, throw=False)
        return found if found.result == gc.contacts.RESULTS.successful else None

    return solve


def drawn(rng, number, shape, cut):
    q0 = 2 * np.pi / CELL
    spectrum = gc.SelfAffine(
        rms_slope=10 ** rng.uniform(-1.3, -0.3), hurst=rng.uniform(0.6, 0.95), q_low=q0,
        q_roll=min(rng.choice([1, 2, 4]), cut) * q0, q_high=cut * q0,
    )  # fmt: skip
    surface = gc.random_surface(spectrum, gc.Grid(shape, CELL), jax.random.key(number))
    return surface, float(gc.surfaces.statistics(surface).rms_slope)


def finer(heights, factor):
    shape = tuple(factor * n for n in heights.shape)
    return resampled(heights, shape) if factor > 1 else heights


def rough(number, points, light=1.0):
    rng = np.random.default_rng((number, points))
    surface, slope = drawn(rng, number, (64, 64), 64 // points)
    speed = 10 ** rng.uniform(-3, 1)
    velocity = speed if number % 2 else (speed * np.cos(0.5), speed * np.sin(0.5))
    pressure = light * 10 ** rng.uniform(-2.5, -0.7) * slope * 1e7
    solve = solver(block_of(rng, number), CELL, pressure, velocity)
    return solve, partial(finer, surface.heights)


def line(number):
    rng = np.random.default_rng((number, 1))
    surface, slope = drawn(rng, number, (512,), 64)
    pressure = 10 ** rng.uniform(-2.5, -0.7) * slope * 1e7
    solve = solver(block_of(rng, number), CELL, pressure, 10 ** rng.uniform(-3, 1))
    return solve, partial(finer, surface.heights)


def window(number):
    rng = np.random.default_rng((number, 2))
    radius, wave = 10 ** rng.uniform(-2, -1), 2 * np.pi / CELL * rng.integers(2, 8)

    def heights(factor):
        n = 64 * factor
        x = ((jnp.arange(n) + 0.5) / n - 0.5) * CELL
        x, y = x[:, None], x[None, :]
        sphere = -(x**2 + y**2) / (2 * radius)
        if number % 3 == 2:
            inside = (jnp.abs(x) < CELL / 4) & (jnp.abs(y) < CELL / 4)
            return jnp.where(inside, 0.0, -1e-4)
        ripple = jnp.cos(wave * x) * jnp.cos(wave * y) * 0.1 / wave
        return sphere + (number % 3) * ripple

    solve = solver(
        block_of(rng, number), CELL, 10 ** rng.uniform(4, 5.5), 10 ** rng.uniform(-3, 1), False
    )
    return solve, heights


def measured(number, files):
    rng = np.random.default_rng((number, 3))
    surface = gc.read_surface(files[number % len(files)])
    spacing, heights = np.asarray(surface.grid.spacing), np.asarray(surface.heights)
    side = min(64, min(heights.shape) // 2 * 2)
    corner = [rng.integers(0, n - side + 1) for n in heights.shape]
    part = heights[tuple(slice(c, c + side) for c in corner)]
    taper = np.sqrt(np.hanning(side + 1)[:-1])
    part = jnp.asarray((part - part.mean()) * np.outer(taper, taper))
    size = spacing * side
    slope = gc.surfaces.statistics(gc.Surface(part, gc.Grid(part.shape, size))).rms_slope
    pressure = 10 ** rng.uniform(-2.5, -0.7) * float(slope) * 1e7
    speed = 10 ** rng.uniform(-3, 1) * size[0] / CELL
    return solver(block_of(rng, number), size, pressure, speed), partial(finer, part)


def cycle(number, name, times=64, most=512):
    """True and claimed relative error of a number of a cycle by its times and the solver."""
    rng = np.random.default_rng((number, 4))
    surface, slope = drawn(rng, number, (32, 32), 4)
    stroke = times / 2 / np.pi * 0.5 * CELL / 32 * rng.uniform(0.5, 2)
    block, frequency = block_of(rng, number), 10 ** rng.uniform(-1, 3)
    pressure = 10 ** rng.uniform(-2.5, -0.7) * slope * 1e7

    def solve(num_times, **more):
        motion = gc.sliding.sinusoidal(stroke, frequency, num_times)
        return gc.slide_cycle(
            block, surface, displacement=motion.displacement, period=motion.period,
            pressure=pressure, **more,
        )  # fmt: skip

    found, best = solve(times), solve(most, rtol=1e-8)
    exact, own = float(getattr(best, name)), float(getattr(found, name))
    claimed = getattr(found, f"{name}_time_error") + getattr(found, f"{name}_solver_error")
    return abs(own / exact - 1), float(claimed) / abs(exact), 0.0


def total(sizes=(64, 128, 256, 512), finest=2048, cut=16, rtol=5e-5):
    """Seconds and total error of friction and of the elastic area: one grid, two, and Tamaas.

    Seconds are of the second call. The limit is that of the grids of `finest` points and half.
    "two grids" adds the solve that gives the errors. Tamaas counts points.
    """
    rng = np.random.default_rng(1)
    surface, slope = drawn(rng, 1, (64, 64), cut)
    rubber = gc.Stack(base=gc.HalfSpace(gc.tyre_tread()))
    elastic = gc.Stack(base=gc.HalfSpace(gc.Elastic(1e7, 0.5)))
    # 5 % of contact of the elastic body.
    pressure = 0.05 * slope * 1e7 / 0.75 / 1.6

    def slide(n, block, velocity):
        at = gc.Surface(finer(surface.heights, n // 64), gc.Grid((n, n), CELL))
        return gc.slide(block, at, pressure=pressure, velocity=velocity, rtol=rtol)

    def limit_of(block, velocity, name):
        near, far = (getattr(slide(n, block, velocity), name) for n in (finest // 2, finest))
        return float(4 * far - near) / 3

    kinds = (("friction", rubber, 0.1), ("contact_area", elastic, 0.0))
    for name, block, velocity in kinds:
        exact = limit_of(block, velocity, name)
        for n in sizes:

            def one(n=n, block=block, velocity=velocity, name=name):
                return getattr(slide(n, block, velocity), name)

            def two(n=n, block=block, velocity=velocity, name=name):
                return slide(n, block, velocity).compute(name, f"{name}_error")

            found, claimed = map(float, two())
            for way, run in (("one grid", one), ("two grids: with the error", two)):
                one_row(name, n, way, timed(run, 3), found / exact - 1, claimed / exact)
            if name == "contact_area":
                heights = np.array(finer(surface.heights, n // 64)) / CELL
                peer = Tamaas(CELL_OF_PEERS * heights)
                load = pressure * 0.75 / 1e7
                peer.solve(load, rtol)
                area = float(np.mean(peer.solve(load, rtol) > 0))
                seconds = timed(lambda peer=peer, load=load: peer.solve(load, rtol), 3)
                one_row(name, n, "Tamaas, count of points", seconds, area / exact - 1, np.nan)


def one_row(name, n, way, seconds, off, claimed):
    report("bench_contact-total", {
        "number": name, "N": n, "way": way, "time [s]": seconds, "true error": abs(off),
        "claimed error": claimed,
    })  # fmt: skip
