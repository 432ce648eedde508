"""Errors by the grid and by the times, estimated and true: the sections `grid` and `total`.

Run by `bench_contact.py`. A surface has waves up to a limit, so that it is the same on every finer
grid. The true error of a number is its difference from the contact on four times as many points
along each axis, at `rtol=1e-7`; for windows from the limit by four and eight times as many,
(4 f(8n) - f(4n))/3. Blocks: elastic, tread, or Prony series of contrasts 1.3 to 1000; some under an
elastic coat. Velocities along x or oblique, now and then 0. Grids have 32² or 64² points. Kinds:

    8, 4, 2     as many points for the shortest wave; area from 1 % to complete contact
    full        area above 0.9, waves up to 2 to 8 points and noise up to the corner of the spectrum
    light       8 points, area of few points
    half space  8 points, no coat
    anisotropic spectra stretched 2 to 4 times along an axis
    noise       all waves of the grid, flat spectra
    ridge       one wave or one bump, along an axis or oblique; also in one dimension
    egg box     one wave along each axis
    receding    one relaxation time on the scale of the contacts, contrast 10 to 10⁴
    line        128 to 512 points in one dimension
    gap         a prescribed mean gap
    laws        repulsion of finite range, or a hardness
    attraction  soft enough to be pulled into contact, at rest or sliding
    window      a sphere, with and without waves, or a flat punch, 64² points
    measured    parts of measured surfaces, 64² points, not smoothed
    cycle       back and forth, 32² points, 8 for the shortest wave, 64 times; truth by 512 times
"""

import time

import jax
import numpy as np
from contact_peers import Tamaas
from contact_scenes import CELL as CELL_OF_PEERS
from grid_scenes import CELL, NUMBERS, block_of, finer, measured, scene_of, window
from rows import goal, report, timed

import graded_contact as gc

KINDS = (
    "8", "4", "2", "full", "light", "half space", "anisotropic", "noise", "ridge", "egg box",
    "receding", "line", "gap", "laws", "attraction", "window",
)  # fmt: skip


def grid(count=40, seed=0, kinds=KINDS, surfaces=()):
    """Estimated errors of the grid over true ones, `count` scenes of each kind.

    `surfaces` are files for `measured`. The last lines have what the errors cost in FFT pairs.
    """
    ratios, pairs = {}, []
    for kind in (*kinds, *(("measured",) if surfaces else ())):
        start, rows = time.perf_counter(), []
        for number in range(seed, seed + count):
            if kind == "window":
                row = against_limit(*window(number))
            elif kind == "measured":
                row = against_limit(*measured(number, surfaces))
            else:
                row = against_finer(*scene_of(kind, number), pairs)
            rows += [row] if row else []
        for name in dict.fromkeys(name for row in rows for name in row):
            show(kind, name, [row[name] for row in rows if name in row], ratios)
        print(f"# {kind}: {len(rows)} scenes in {time.perf_counter() - start:.0f} s")
    for name in ("mean_friction", "peak_friction") if kinds == KINDS else ():
        show("cycle", name, [cycle(seed + i, name) for i in range(max(count // 2, 1))], ratios)
    for name, found in ratios.items():
        found = np.array(found)
        text = f"median {np.median(found):.1f}, below 1 in {np.mean(found < 1):.1%}"
        goal(f"{name}: below 1 in at most 5 %, median at most 5", text)
    share = np.array(pairs)
    print(f"FFT pairs of the errors over those of the contact: median {np.median(share):.2f}")


def against_finer(solve, heights, numbers, pairs):
    """True and claimed errors of each number, relative to it, against four times as many points."""
    found, fine = solve(heights), None
    if found is not None:
        fine = solve(finer(heights, 4), rtol=1e-7)
    if fine is None:
        return None
    rows = {}
    for name in numbers:
        exact, own = float(getattr(fine, name)), float(getattr(found, name))
        claimed = float(getattr(found, f"{name}_error"))
        # An elastic block has no friction, a full contact no gap.
        sizes = {"friction": float(found.slope_in_contact), "mean_gap": float(np.std(heights))}
        if abs(exact) > 1e-9 * sizes.get(name, 0):
            plain = abs(float(found.contact_area_pixels) / exact - 1) if "area" in name else 0.0
            rows[name] = abs(own / exact - 1), claimed / abs(exact), plain
    near = found.near
    others = {id(one): one for one in near.both(found)}
    cost = sum(
        float(one.contact.num_fft_pairs) * one.pressure.size / found.pressure.size
        for one in others.values() if one is not found
    )  # fmt: skip
    pairs.append(cost / float(found.num_fft_pairs))
    return rows


def show(kind, name, rows, ratios):
    """Reports a row of one kind of scene and one number."""
    true, claimed, plain = np.array(rows).T
    ratio = claimed / np.maximum(true, 1e-17)  # a contact that is full is so exactly
    ratios.setdefault(name, []).extend(ratio)
    report("bench_contact-grid", {
        "scenes": kind, "number": name, "count": len(rows),
        "true error: median": float(np.median(true)), "largest": float(np.max(true)),
        "error of the pixel count": float(np.median(plain)),
        "estimate over true: median": float(np.median(ratio)),
        "below 1 [%]": 100 * float(np.mean(ratio < 1)), "least": float(np.min(ratio)),
    })  # fmt: skip


def against_limit(solve, heights):
    """True and claimed relative errors of each number, against the limit of finer grids."""
    found, near, far = (solve(heights(factor)) for factor in (1, 4, 8))
    if found is None or near is None or far is None:
        return None
    rows = {}
    for name in NUMBERS:
        limit = (4 * float(getattr(far, name)) - float(getattr(near, name))) / 3
        true, claimed = float(getattr(found, name)) - limit, getattr(found, f"{name}_error")
        plain = float(found.contact_area_pixels) / limit - 1 if name == "contact_area" else 0.0
        rows[name] = abs(true / limit), float(claimed) / abs(limit), abs(plain)
    return rows


def drawn(rng, number, shape, cut):
    q0 = 2 * np.pi / CELL
    spectrum = gc.SelfAffine(
        rms_slope=10 ** rng.uniform(-1.3, -0.3), hurst=rng.uniform(0.6, 0.95), q_low=q0,
        q_roll=min(rng.choice([1, 2, 4]), cut) * q0, q_high=cut * q0,
    )  # fmt: skip
    surface = gc.random_surface(spectrum, gc.Grid(shape, CELL), jax.random.key(number))
    return surface, float(gc.surfaces.statistics(surface).rms_slope)


def cycle(number, name, times=64, most=512):
    """True and claimed relative error of a number of a cycle by its times and the solver."""
    rng = np.random.default_rng((number, 4))
    surface, slope = drawn(rng, number, (32, 32), 4)
    stroke = times / 2 / np.pi * 0.5 * CELL / 32 * rng.uniform(0.5, 2)
    block, frequency = block_of(rng, "cycle", 0.1), 10 ** rng.uniform(-1, 3)
    pressure = 10 ** rng.uniform(-2.5, -0.7) * slope * 1e7

    def solve(num_times, **more):
        motion = gc.sliding.sinusoidal(stroke, frequency, num_times)
        return gc.slide_cycle(
            block, surface, displacement=motion.displacement, period=motion.period,
            pressure=pressure, **more,
        )  # fmt: skip

    found, best = solve(times), solve(most, rtol=1e-8)
    exact, own = float(getattr(best, name)), float(getattr(found, name))
    claimed = found.error_parts(name)["time"] + found.error_parts(name)["solver"]
    return abs(own / exact - 1), float(claimed) / abs(exact), 0.0


LIMITS = ("friction", "contact_area")


def total(sizes=(64, 128, 256, 512), finest=2048, cut=16, rtol=5e-5, numbers=LIMITS):
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
        if name not in numbers:
            continue
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
