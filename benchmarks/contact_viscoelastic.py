"""FFT pairs of viscoelastic contacts, and of the paper's method: the section `viscoelastic`.

Run by `bench_contact.py`.
"""

from functools import partial

import numpy as np
from contact_scenes import (
    BEST,
    bodies,
    errors_of,
    goal,
    growth,
    loosest,
    print_versions,
    rough_surface,
)
from rows import keep

import graded_contact as gc
from graded_contact.contact.law import RepulsiveLJ
from graded_contact.contact.rmd import ResidualDynamics

# Speeds [m/s] below, at and above that of the greatest friction.
SPEEDS = {"single": (1e-4, 4e-3, 0.1), "tread": (0.1, 1e5, 1e9), "broad": (1e-9, 1e-6, 0.1)}
TARGETS = (1e-4, 1e-8)


def viscoelastic(options):
    print_versions()
    print("# pairs: FFT pairs to a true error of the pressure of 1e-4 and 1e-8 (the loosest rtol")
    print("# of a geometric series that reaches it), and with rtol = 1e-4 and 1e-8; err μ, err A:")
    print("# at true 1e-4, friction and area, relative")
    print(
        f"{'body':12s} {'p/E_r':>5s} {'v':>7s} {'N':>5s} {'area':>7s} {'μ':>8s} {'1e-4':>7s} "
        f"{'1e-8':>7s} {'r 1e-4':>7s} {'r 1e-8':>7s} {'rtol':>7s} {'err μ':>8s} {'err A':>8s}"
    )
    counts = {}
    for name in options.bodies:
        for load in options.loads:
            for speed in speeds_of(name):
                for n in options.sizes:
                    counts[name, load, speed, n] = row(name, load, speed, n)
    with_size(counts, options.sizes)
    if options.dynamics_sizes:
        dynamics(options)


def speeds_of(name):
    return SPEEDS.get(name.removesuffix("+coat"), (0.0,))


def middle_speed(name):
    speeds = speeds_of(name)
    return speeds[len(speeds) // 2]


def row(name, load, speed, n):
    """Prints a row and returns the pairs to the true errors `TARGETS`, NaN if not reached."""
    slide = partial(gc.slide, bodies()[name], rough_surface(n), pressure=load, velocity=speed)
    best = slide(rtol=BEST, throw=False)
    found = [loosest(lambda r: slide(rtol=r, throw=False), best, target) for target in TARGETS]
    pairs = [np.nan if reached is None else float(reached[0].num_fft_pairs) for reached, _ in found]
    reported = [_pairs(reported) for _, reported in found]
    line = (
        f"{name:12s} {load:5.2f} {speed:7g} {n:5d} {float(best.contact_area):7.4f} "
        f"{float(best.friction):8.5f} " + " ".join(f"{p:7.1f}" for p in (*pairs, *reported))
    )
    if found[0][0] is not None:
        solution, rtol = found[0][0]
        mu = abs(float(solution.friction / best.friction - 1)) if best.friction > 1e-9 else 0.0
        line += f" {rtol:7.1e} {mu:8.1e} {errors_of(solution.pressure, best).area:8.1e}"
    keep(
        "bench_contact-viscoelastic",
        {
            "body": name,
            "p/E_r": load,
            "v": speed,
            "N": n,
            "area": float(best.contact_area),
            "friction": float(best.friction),
            "pairs to 1e-4": pairs[0],
            "pairs to 1e-8": pairs[1],
            "with rtol 1e-4": reported[0],
            "with rtol 1e-8": reported[1],
        },
    )
    print(
        line + ("" if best.result == gc.contacts.RESULTS.successful else "  best not found"),
        flush=True,
    )
    return pairs


def _pairs(solution):
    done = solution.result == gc.contacts.RESULTS.successful
    return float(solution.num_fft_pairs) if done else np.nan


def with_size(counts, sizes):
    """Prints how the pairs grow with N, the median and the largest exponent over all scenes."""
    if len(sizes) < 2:
        return
    scenes = sorted({key[:3] for key in counts})
    for i, target in enumerate(TARGETS):
        exponents = [
            (growth(sizes, [counts[*scene, n][i] for n in sizes]), scene) for scene in scenes
        ]
        worst, scene = max(exponents)
        middle = np.median([e for e, _ in exponents])
        goal(
            f"pairs to {target:.0e} grow with N to at most the power 0.2",
            f"{middle:.2f} (median), {worst:.2f} ({scene[0]}, p/E_r = {scene[1]:g}, "
            f"v = {scene[2]:g})",
        )


def dynamics(options):
    """The paper's method on its own law, to its own tolerance, beside ours."""
    print("\n# residuals molecular dynamics (RMD) and the package on the same law, ε of it 1e-4 as")
    print("# in the paper, ours to rtol = 1e-4; errors of the pressure against rtol = 1e-10;")
    print("# wall: pairs of the package on the hard wall; '>': not converged")
    print(
        f"{'body':12s} {'p/E_r':>5s} {'N':>5s} {'range/h':>7s} {'RMD':>8s} {'err σ':>8s} "
        f"{'ours':>7s} {'err σ':>8s} {'ratio':>7s} {'wall':>6s} {'ratio':>7s}"
    )
    ratios = {}
    for n in options.dynamics_sizes:
        surface = rough_surface(n)
        rms = float(gc.surface.statistics(surface).rms_height)
        for name in options.bodies:
            for load in options.loads:
                slide = partial(
                    gc.slide, bodies()[name], surface, pressure=load, throw=False,
                    velocity=middle_speed(name),
                )  # fmt: skip
                wall = slide(rtol=1e-4)
                for share in options.ranges:
                    law = RepulsiveLJ(share * rms, load)
                    best = slide(law=law, rtol=BEST)
                    ours = slide(law=law, rtol=1e-4)
                    solver = ResidualDynamics(
                        max_steps=options.dynamics_steps, uniform_mass=options.uniform_mass
                    )
                    theirs = slide(law=law, rtol=1e-4, solver=solver)
                    done = theirs.result == gc.contacts.RESULTS.successful
                    ratio, against_wall = (
                        float(theirs.num_fft_pairs / s.num_fft_pairs) for s in (ours, wall)
                    )
                    ratios.setdefault(share, []).append((ratio, against_wall))
                    print(
                        f"{name:12s} {load:5.2f} {n:5d} {share:7g} "
                        f"{'' if done else '>':1s}{float(theirs.num_fft_pairs):7.0f} "
                        f"{errors_of(theirs.pressure, best).pressure:8.1e} "
                        f"{float(ours.num_fft_pairs):7.1f} "
                        f"{errors_of(ours.pressure, best).pressure:8.1e} {ratio:7.0f} "
                        f"{float(wall.num_fft_pairs):6.1f} {against_wall:7.0f}",
                        flush=True,
                    )
    for share, found in ratios.items():
        least, middle = np.min(found, axis=0), np.median(found, axis=0)
        goal(
            f">= 100 x fewer pairs than RMD at ε = 1e-4, range {share:g} of the rms height",
            f"{middle[0]:.0f} x (median; least {least[0]:.0f} x), against our hard wall "
            f"{middle[1]:.0f} x (least {least[1]:.0f} x)",
        )
