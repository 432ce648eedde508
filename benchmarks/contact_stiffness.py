"""Errors of the stiffness of contacts, true and claimed: the section `stiffness`.

Run by `bench_contact.py`. An elastic half space of E* = 1 Pa, cell of 1 m. Rough: self-affine
surfaces with 4 and 8 points to the shortest wave at 64², their waves the same on all grids, at
nominal contact areas from 0.01 to 0.3. The exact stiffness is that at 512² and 1024², extrapolated
to no spacing. Spheres in a square lattice and strips have closed forms: see
`tests/sliding/test_stiffness.py`.
"""

import jax
import numpy as np
from contact_scenes import CELL, Q0
from rows import goal, report

import graded_contact as gc
from graded_contact.fields.grid import resample_spectrum, to_field, to_spectrum
from graded_contact.sliding import contact_stiffness, contact_stiffness_error

BASE = 64  # points, on which surfaces are drawn
CUTS = {"8 points to a wave": 8, "4 points to a wave": 16}  # at 64²
AREAS = (0.01, 0.05, 0.12, 0.3)
DIRECTIONS = ((1, 0), (1, 1), (2, 1), (3, 2))  # periods of strips along x and y
RMS_SLOPE = 0.1
BLOCK = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, 0.0)))


def stiffness(sizes=(64, 128, 256, 512), finest=1024, num_seeds=2, seed=10):
    """Errors of the stiffness by the grid, and claims from half as many points."""
    scenes = {}
    for name, cut in CUTS.items():
        rough = [(cut, s, area) for s in range(seed, seed + num_seeds) for area in AREAS]
        scenes[name] = [rough_scene(finest, *scene) for scene in rough]
    rng = np.random.default_rng(seed)
    scenes["sphere"] = [sphere_scene(radius, rng.uniform(0, 1, 2)) for radius in (0.06, 0.1, 0.15)]
    scenes["strips"] = [strips_scene(d, a) for d in DIRECTIONS for a in (0.3, 0.52, 0.7)]
    contained = []
    for name, found in scenes.items():
        for n in sizes:
            pairs = [(slide(n), exact) for slide, exact in found]
            off = np.array([abs(contact_stiffness(s) - exact) / exact for s, exact in pairs])
            claims = np.array([contact_stiffness_error(s) / exact for s, exact in pairs])
            contained.extend(off <= claims)
            report("bench_contact-stiffness", {
                "scenes": name, "N": n, "number": len(pairs), "median error": np.median(off),
                "largest error": max(off), "broken": int(sum(off > claims)),
                "claimed over true error, median": np.median(claims / off),
            })  # fmt: skip
    goal("95 % of the claims hold", f"{np.mean(contained):.1%} of {len(contained)}")


def rough_scene(finest, cut, seed, area):
    """How to slide over a random surface on a grid, and the exact stiffness."""
    spectrum = gc.SelfAffine(
        rms_slope=RMS_SLOPE, hurst=0.8, q_low=Q0, q_roll=3 * Q0, q_high=cut * Q0
    )
    drawn = gc.random_surface(spectrum, gc.Grid((BASE, BASE), CELL), jax.random.key(seed))
    waves, load = to_spectrum(drawn.heights), area * RMS_SLOPE / np.sqrt(2 * np.pi)

    def slide(n):
        fine = resample_spectrum(waves, (BASE, BASE), (n, n)) * (n / BASE) ** 2
        return at_load(to_field(fine, (n, n)), load)

    near, nearest = (contact_stiffness(slide(n)) for n in (finest // 2, finest))
    return slide, 2 * nearest - near


def sphere_scene(radius, offset):
    """A sphere of curvature 1, off the points, in contact on a circle."""

    def slide(n):
        x, y = ((np.arange(n) - n / 2 - part * n / BASE / 4) / n for part in offset)
        return at_load(-(x[:, None] ** 2 + y**2) / 2, 4 / 3 * radius**3)

    images = (3.900265 - 9.0336 / 3 * radius**2) / np.pi
    return slide, 1 / (1 / (2 * radius) - images)


def strips_scene(direction, area):
    """A wave of a direction (Westergaard's contact)."""
    length, amplitude = CELL / np.hypot(*direction), 0.01

    def slide(n):
        x = np.arange(n) / n
        phase = 2 * np.pi * (direction[0] * x[:, None] + direction[1] * x + 0.0137)
        full = np.pi * amplitude / length
        return at_load(amplitude * np.cos(phase), full * np.sin(np.pi * area / 2) ** 2)

    return slide, np.pi / (2 * length) / np.log(1 / np.sin(np.pi * area / 2))


def at_load(heights, load):
    surface = gc.Surface(heights, gc.Grid(heights.shape, CELL))
    return gc.slide(BLOCK, surface, pressure=load, velocity=0.0, rtol=1e-5)
