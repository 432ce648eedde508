"""What friction, area and gap cost, and what is claimed of them: the section `observables`.

Run by `bench_contact.py`.
"""

from functools import partial
from typing import Any

import jax
import numpy as np
from contact_scenes import bodies, goal, print_versions, rough_surface
from contact_viscoelastic import middle_speed
from rows import keep

import graded_contact as gc

# Today's way, by the error of the pressure, and the new one, by that of friction and area.
WAYS: tuple[dict[str, Any], ...] = (
    {"rtol": 1e-6}, {"rtol": 5e-5}, {"friction_rtol": 1e-3}, {"friction_rtol": 1e-4},
)  # fmt: skip


def observables(options):
    print_versions()
    print("# errors against rtol = 1e-9, relative (of gaps: over the rms height), true / claimed;")
    print("# grid: a tenth of what the grid leaves, below which nothing is asked for; dμ/dp: true")
    print("# error of the derivative of friction by the load (elastic: of friction over 1)")
    print(
        f"{'body':11s} {'p/E_r':>5s} {'N':>4s} {'tolerance':>20s} {'pairs':>6s} {'ratio':>5s} "
        f"{'friction':>17s} {'area':>17s} {'mean gap':>17s} {'grid':>7s} {'dμ/dp':>7s}"
    )
    ratios, broken = {}, 0
    for name in options.bodies:
        for load in options.loads:
            for n in options.sizes:
                for way, ratio, held in rows(name, load, n, options.gradients):
                    ratios.setdefault(way, []).append(ratio)
                    broken += not held
    for way, found in ratios.items():
        goal(
            f"{way}: a third of the pairs of rtol = 1e-6 or less",
            f"{np.median(found):.2f} (median), {min(found):.2f} to {max(found):.2f}",
        )
    goal("no claim broken", f"{broken} broken")


def rows(name, load, n, gradients):
    """Prints a row a way; yields its name, its pairs over the first's, and if claims held."""
    surface, stack, speed = rough_surface(n), bodies()[name], middle_speed(name)
    slide = partial(gc.slide, stack, surface, velocity=speed, throw=False)
    best, first = slide(pressure=load, rtol=1e-9), None
    rms, mu = float(np.std(surface.heights)), float(best.friction) if speed else 1.0
    slope = derivative(slide, load, rtol=1e-8) if gradients else np.nan
    for way in WAYS:
        s = slide(pressure=load, **way)
        first = float(s.num_fft_pairs) if first is None else first
        pairs = [
            (abs(float(s.friction - best.friction)) / mu, float(s.friction_error) / mu),
            tuple(
                float(x / best.contact_area_smooth)
                for x in (
                    abs(s.contact_area_smooth - best.contact_area_smooth),
                    s.contact_area_error,
                )
            ),
            (abs(float(s.mean_gap - best.mean_gap)) / rms, float(s.contact.gap_error)),
        ]
        found = derivative(slide, load, **way) if gradients else np.nan
        grid = 0.1 * abs(float(s.geometric_friction - s.friction)) / mu
        ratio = float(s.num_fft_pairs) / first
        text = ", ".join(f"{key} = {value:g}" for key, value in way.items())
        print(
            f"{name:11s} {load:5.2f} {n:4d} {text:>20s} {float(s.num_fft_pairs):6.0f} {ratio:5.2f} "
            + " ".join(f"{true:8.1e}/{claim:8.1e}" for true, claim in pairs)
            + f" {grid:7.0e} {abs(found / slope - 1):7.0e}"
            + ("" if s.result == gc.contacts.RESULTS.successful else "  not reached"),
            flush=True,
        )
        found = dict(zip(("friction", "area", "mean gap"), pairs, strict=True))
        keep(
            "bench_contact-observables",
            {
                "body": name,
                "p/E_r": load,
                "N": n,
                "tolerance": text,
                "FFT pairs": float(s.num_fft_pairs),
                "over those of rtol = 1e-6": ratio,
                **{f"{key}: error": true for key, (true, _) in found.items()},
                **{f"{key}: claimed": claim for key, (_, claim) in found.items()},
            },
        )
        # With `rtol` the claim for the area is that of the count of points.
        claims = pairs if "friction_rtol" in way else pairs[::2]
        yield text, ratio, all(true <= claim or true < 1e-9 for true, claim in claims)


def derivative(slide, load, **way):
    return float(jax.grad(lambda p: slide(pressure=p, **way).friction)(load))
