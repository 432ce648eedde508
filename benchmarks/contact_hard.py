"""Contacts that are hard to find: small ones, and moduli far apart. The section `hard`.

Run by `bench_contact.py`. Cylinders: parabolas on one relaxation, rigid against it in 1-D, pairs by
half-widths at rest, contrast of the moduli and speed (relaxation time times speed over the
half-width). Rough: `rough_surface`, one relaxation (`single`) in mid-band or ten decades (`broad`).
Random: one or ten relaxations, contrasts to 1e4, loads from 1e-6 of what closes every gap, grids
of one and two dimensions, also odd and not square; each solved in the ways of `contact_random.py`.
"""

from functools import partial

import jax.numpy as jnp
import numpy as np
from contact_random import Scene, survey
from contact_scenes import print_versions, rough_surface, timed
from rows import keep

import graded_contact as gc

RTOL = (1e-4, 1e-8)
CONTRASTS = (100.0, 1000.0, 1e4)
CYLINDERS = ((1024, 16), (8192, 64))  # points, and half-widths at rest to the cell
SPEEDS = (0.1, 1.0, 10.0)
LOADS = (0.01, 0.1)
SHAPES = ((64, 64), (1024,), (81, 64), (729,))
HALF_WIDTH = 0.01  # m


def hard(options):
    if options.count:
        survey(hard_scene, options)
        return
    print_versions()
    print("# points in contact, FFT pairs to rtol = " + ", ".join(f"{r:g}" for r in RTOL))
    print("# (!: not reached), and of the last the error claimed and the seconds when compiled")
    for points, cell in CYLINDERS:
        for contrast in CONTRASTS:
            for speed in SPEEDS:
                name = f"cylinder {points} points, {cell} a, V = {speed:g}"
                row(name, contrast, *cylinder(points, cell, contrast, speed))
    surface = rough_surface(options.size)
    for num, speed, name in ((1, 5.0, "single"), (10, 1.0, "broad")):
        for contrast in CONTRASTS:
            kernel = gc.stack_kernel(block(contrast, num), surface.grid, speed)
            for load in LOADS:
                title = f"rough {options.size}², {name}, p/E_r = {load:g}"
                row(title, contrast, kernel, surface.heights, load)


def row(name, contrast, kernel, heights, load):
    pairs = []
    for rtol in RTOL:
        solve = partial(gc.solve_contact, kernel, heights, load, rtol=rtol, throw=False)
        found = solve()
        done = found.result == gc.contacts.RESULTS.successful
        pairs.append(f"{float(found.num_fft_pairs):.0f}{'' if done else '!'}")
    touching, error = int(jnp.sum(found.pressure > 0)), float(found.error)
    seconds = timed(solve, 3)
    print(
        f"{name:42s} {contrast:6g} {touching:6d} "
        + " ".join(f"{p:>6s}" for p in pairs)
        + f" {error:7.1e} {seconds:7.3f}",
        flush=True,
    )
    keep(
        "bench_contact-hard",
        {
            "scene": name,
            "contrast": contrast,
            "points in contact": touching,
            **{f"pairs to {r:g}": p for r, p in zip(RTOL, pairs, strict=True)},
            "claimed error at the last": error,
            "time of the last [s]": seconds,
        },
    )


def cylinder(points, cell, contrast, speed):
    """Kernel, heights and load: radius and relaxed reduced modulus are 1."""
    length = cell * HALF_WIDTH
    x = (np.arange(points) - points / 2) * length / points
    rubber = gc.Prony.from_creep(contrast, [(contrast - 1) / contrast], [speed * HALF_WIDTH], 0.0)
    kernel = gc.stack_kernel(gc.Stack(base=gc.HalfSpace(rubber)), gc.Grid((points,), length), 1.0)
    return kernel, -(x**2) / 2, np.pi / 4 * HALF_WIDTH**2 / length


def block(contrast, num):
    """A half space of relaxed reduced modulus 1, and of `num` relaxations."""
    times = np.logspace(-5, 4, num) if num > 1 else [1.0]
    rubber = gc.Prony(0.75, np.full(num, 0.75 * (contrast - 1) / num), times, 0.5)
    return gc.Stack(base=gc.HalfSpace(rubber))


def hard_scene(rng, i):
    """A scene of one or ten relaxations of any contrast."""
    shape, contrast = SHAPES[i % len(SHAPES)], 10 ** rng.uniform(0, 4)
    stack = block(contrast, rng.choice([1, 10]))
    name = f"{shape}, contrast {contrast:.0f}"
    return Scene(rng, stack, shape, name, closed=(-6, 0), rms_slope=0.1)
