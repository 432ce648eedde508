"""FFT pairs for an error, true and claimed: the sections `viscoelastic` and `observables`.

Run by `bench_contact.py`.
"""

from functools import partial

import jax
import numpy as np
from contact_scenes import BEST, BODIES, LOADS, bodies, errors_of, growth, loosest, rough_surface
from rows import goal, keep, report, show

import graded_contact as gc

# Speeds [m/s] below, at and above that of the greatest friction.
SPEEDS = {"single": (1e-4, 4e-3, 0.1), "tread": (0.1, 1e5, 1e9), "broad": (1e-9, 1e-6, 0.1)}
TARGETS = (1e-4, 1e-8)
RTOLS = (1e-6, 5e-5)


def speeds_of(name):
    return SPEEDS.get(name.removesuffix("+coat"), (0.0,))


def successful(solution):
    return solution.result == gc.contacts.RESULTS.successful


# viscoelastic -------------------------------------------------------------------------------


def viscoelastic(sizes=(256, 512, 1024, 2048), bodies=BODIES, loads=LOADS):
    """FFT pairs to a true error of the pressure, and their growth with N."""
    print("# pairs to a true error: the loosest rtol of a geometric series that reaches it")
    scenes = [(name, load, v) for name in bodies for load in loads for v in speeds_of(name)]
    counts = {scene: np.array([pairs_to(*scene, n) for n in sizes]) for scene in scenes}
    if len(sizes) < 2:
        return
    for i, target in enumerate(TARGETS):
        exponents = [(growth(sizes, found[:, i]), scene) for scene, found in counts.items()]
        worst, (name, load, speed) = max(exponents)
        goal(
            f"pairs to {target:.0e} grow with N to at most the power 0.2",
            f"{np.median([e for e, _ in exponents]):.2f} (median), {worst:.2f} ({name}, "
            f"p/E_r = {load:g}, v = {speed:g})",
        )


def pairs_to(name, load, speed, n):
    """Reports a row and returns the pairs to the true errors `TARGETS`, NaN if not reached."""
    slide = partial(
        gc.slide, bodies()[name], rough_surface(n), pressure=load, velocity=speed, throw=False
    )
    best = slide(rtol=BEST)
    found = [loosest(lambda rtol: slide(rtol=rtol), best, target) for target in TARGETS]
    pairs = [np.nan if reached is None else float(reached[0].num_fft_pairs) for reached, _ in found]
    with_rtol = [float(s.num_fft_pairs) if successful(s) else np.nan for _, s in found]
    note = "" if successful(best) else "  best not found"
    if found[0][0] is not None:
        solution, rtol = found[0][0]
        off = abs(float(solution.friction / best.friction - 1)) if best.friction > 1e-9 else 0.0
        area = errors_of(solution.pressure, best).area
        note += f"  at true 1e-4: rtol {rtol:.1e}, friction off by {off:.1e}, area by {area:.1e}"
    row = {
        "body": name,
        "p/E_r": load,
        "v": speed,
        "N": n,
        "area": float(best.contact_area),
        "friction": float(best.friction),
        "pairs to 1e-4": pairs[0],
        "pairs to 1e-8": pairs[1],
        "with rtol 1e-4": with_rtol[0],
        "with rtol 1e-8": with_rtol[1],
    }
    report("bench_contact-viscoelastic", row, note)
    return pairs


# observables --------------------------------------------------------------------------------


def observables(sizes=(128, 256, 512), bodies=BODIES, loads=LOADS, gradients=False):
    """Friction, area and gap: errors, claims, pairs; `--gradients` of friction by the load too."""
    print("# errors against rtol = 1e-9, relative (of gaps: over the rms height; elastic: of")
    print("# friction over 1); grid: a tenth of what the grid leaves of friction")
    ratios, broken = {}, 0
    for name in bodies:
        for load in loads:
            for n in sizes:
                for rtol, ratio, held in errors_and_claims(name, load, n, gradients):
                    ratios.setdefault(rtol, []).append(ratio)
                    broken += not held
    for rtol, found in ratios.items():
        goal(
            f"rtol = {rtol:g}: pairs over those of rtol = 1e-6",
            f"{np.median(found):.2f} (median), {min(found):.2f} to {max(found):.2f}",
        )
    goal("no claim broken", f"{broken} broken")


def errors_and_claims(name, load, n, gradients):
    """Reports a row a tolerance; yields it, its pairs over the first's, and if claims held."""
    speeds, surface = speeds_of(name), rough_surface(n)
    speed = speeds[len(speeds) // 2]
    slide = partial(gc.slide, bodies()[name], surface, velocity=speed, throw=False)
    best, first = slide(pressure=load, rtol=1e-9), None
    rms, mu = float(np.std(surface.heights)), float(best.friction) if speed else 1.0
    slope = derivative(slide, load, rtol=1e-8) if gradients else np.nan
    for rtol in RTOLS:
        s = slide(pressure=load, rtol=rtol)
        pairs = float(s.num_fft_pairs)
        first = first or pairs
        area, exact = s.contact_area, best.contact_area
        true = {
            "friction": abs(float(s.friction - best.friction)) / mu,
            "area": abs(float((area - exact) / exact)),
            "mean gap": abs(float(s.mean_gap - best.mean_gap)) / rms,
        }
        claimed = {
            "friction": float(s.friction_solver_error) / mu,
            "area": float(s.contact_area_solver_error / exact),
            "mean gap": float(s.contact.gap_error),
        }
        row = {
            "body": name,
            "p/E_r": load,
            "N": n,
            "rtol": rtol,
            "FFT pairs": pairs,
            "over those of rtol = 1e-6": pairs / first,
            **{f"{key}: error": error for key, error in true.items()},
            **{f"{key}: claimed": claim for key, claim in claimed.items()},
        }
        keep("bench_contact-observables", row)
        row["grid"] = 0.1 * abs(float(s.geometric_friction - s.friction)) / mu
        if gradients:
            row["dμ/dp: error"] = abs(derivative(slide, load, rtol=rtol) / slope - 1)
        show(row, "" if successful(s) else "  not reached")
        # The claim for the area is that of the count of points.
        names = ("friction", "mean gap")
        yield rtol, pairs / first, all(true[k] <= claimed[k] or true[k] < 1e-9 for k in names)


def derivative(slide, load, rtol):
    return float(jax.grad(lambda p: slide(pressure=p, rtol=rtol).friction)(load))
