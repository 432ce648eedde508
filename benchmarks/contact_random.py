"""Random scenes: which converge, and are their errors what they claim? The section `random`.

Run by `bench_contact.py`. Blocks of 0 to 3 layers, each elastic or a Prony series of six branches
over ten decades, moduli over three decades, q0 d from 1e-3 to 3, ν from 0.2 to 1/2, on a half
space, a rigid base or none; self-affine surfaces, H from 0.5 to 1, random roll-off and cut-off;
loads from 1e-4 to 1.5 of what closes every gap, of free blocks (three layers, q0 d to 1, kernels
of contrasts up to 1e8) from 0.03; speeds over eight decades; rtol from 1e-3 to 1e-6. To compile few
programs all blocks have three layers, some of no thickness, and elastic ones have branches of 1e-12
of their modulus. Every scene is solved again 100 times closer, and the
difference compared with what the first claimed.
"""

import sys
import time

import jax
import numpy as np
from contact_scenes import CELL, Q0, goal, print_versions
from rows import keep

import graded_contact as gc
from graded_contact.grid import to_field, to_spectrum

BRANCHES = 6
SHAPES = ((64, 64), (96, 80), (128, 128))
QUANTITIES = ("pressure", "friction", "area", "gap", "mean gap", "displacement")


def random(options):
    survey(lambda rng, i: Scene(rng, SHAPES[i % len(SHAPES)]), options)


def survey(draw, options):
    """Solves the scenes that `draw(rng, i)` gives, each twice, and prints what came of them."""
    print_versions()
    rng = np.random.default_rng(options.seed)
    start, outcomes, ratios, pairs, shown = time.perf_counter(), {}, [], [], []
    for i in range(options.count):
        scene = draw(rng, i)
        first, ratio = solve_twice(scene)
        outcome = judge(first, ratio)
        outcomes[outcome] = outcomes.get(outcome, 0) + 1
        if ratio is not None:
            ratios.append(ratio)
            pairs.append(float(first.num_fft_pairs))
        if outcome != "converged":
            shown.append(f"  {outcome}: scene {i}, {scene}")
        if (i + 1) % 100 == 0:
            passed = time.perf_counter() - start
            print(f"  {i + 1} of {options.count}, {passed:.0f} s", file=sys.stderr)
    print(f"# {options.count} scenes twice in {time.perf_counter() - start:.0f} s")
    for outcome, count in sorted(outcomes.items()):
        print(f"{outcome:40s} {count:5d}")
    print("\n".join(shown[: options.show]))
    marks = (50, 90, 99, 100)
    print(f"\n{'percentile':30s} " + " ".join(f"{m:>8d}" for m in marks))
    wrong = sum(count for outcome, count in outcomes.items() if outcome.startswith("wrong"))
    lost = sum(count for outcome, count in outcomes.items() if outcome.startswith("not"))
    names = [f"true error/claimed, {name}" for name in QUANTITIES]
    for name, values in zip([*names, "FFT pairs"], [*np.array(ratios).T, pairs], strict=True):
        print_percentiles(name, values, marks)
        keep(
            "bench_contact-random" if options.section == "random" else "bench_contact-hard--count",
            {
                "scenes": options.count,
                "wrong": wrong,
                "not converged": lost,
                "of the others": name,
                **{f"{m} %": float(np.percentile(values, m)) for m in marks},
            },
        )
    goal(
        "every scene converged or reported as not converged, and a closer solve agrees",
        f"{wrong} of {options.count} wrong, {lost} reported as not converged",
    )


def print_percentiles(name, values, marks):
    print(f"{name:30s} " + " ".join(f"{p:8.2g}" for p in np.percentile(values, marks)))


def solve_twice(scene):
    """A scene's solution, and its true over its claimed errors if a closer one converged too."""
    first, closer = scene.solve(scene.rtol), scene.solve(scene.rtol / 100)
    if any(s.result != gc.RESULTS.successful for s in (first, closer)):
        return first, None
    sigma, exact = np.asarray(first.pressure), np.asarray(closer.pressure)
    rms = float(np.std(scene.surface.heights))
    true = (
        np.linalg.norm(sigma - exact) / np.linalg.norm(exact),
        abs(float(first.friction - closer.friction)),
        abs(float(first.contact_area - closer.contact_area)),
        float(np.sqrt(np.mean((first.gap - closer.gap) ** 2))) / rms,
        abs(float(first.mean_gap - closer.mean_gap)) / rms,
        float(np.std(first.displacement - closer.displacement)) / rms,
    )
    gap_error = first.contact.gap_error
    claimed = (first.error, first.friction_error, first.contact_area_error, *3 * [gap_error])
    # Agreement to rounding needs no claim.
    return first, [
        t / max(float(c), 1e-300) if t > 1e-12 else 0.0 for t, c in zip(true, claimed, strict=True)
    ]


def judge(first, ratio):
    if first.result != gc.RESULTS.successful:
        return "not converged, and says so"
    if ratio is None:
        return "converged, the closer solve did not"
    # Numbers of points, divided, may differ in the last digit.
    worse = [name for name, r in zip(QUANTITIES, ratio, strict=True) if not r <= 1 + 1e-9]
    return f"wrong: {', '.join(worse)}" if worse else "converged"


class Scene:
    """A random block, surface, load, speed and tolerance."""

    def __init__(self, rng, shape):
        base = rng.choice(["half space", "rigid", "free"], p=[0.4, 0.4, 0.2])
        free = base == "free"
        num_layers = rng.integers({"half space": 0, "rigid": 1, "free": 3}[base], 4)
        materials = [random_material(rng) for _ in range(4)]
        thickest = 0 if free else 0.5
        thickness = 10 ** rng.uniform(-3, thickest, 3) / Q0 * (np.arange(3) < num_layers)
        bases = {"half space": gc.HalfSpace(materials[-1]), "rigid": gc.Rigid(), "free": gc.Free()}
        self.stack = gc.Stack(
            layers=tuple(gc.Layer(m, d) for m, d in zip(materials, thickness, strict=False)),
            base=bases[base],
        )
        cut = rng.integers(6, min(shape) // 2 + 1)
        spectrum = gc.SelfAffine(
            rms_slope=10 ** rng.uniform(-2, 0),
            hurst=rng.uniform(0.5, 1.0),
            q_low=Q0,
            q_roll=rng.uniform(1.0, cut / 2) * Q0,
            q_high=cut * Q0,
        )
        grid = gc.Grid(shape, CELL)
        key = jax.random.key(rng.integers(2**31))
        self.surface = gc.random_surface(spectrum, grid, key)
        self.speed = 10 ** rng.uniform(-4, 4)
        self.closed = 10 ** rng.uniform(-1.5 if free else -4, np.log10(1.5))
        self.rtol = 10 ** rng.uniform(-6, -3)
        kernel = gc.stack_kernel(self.stack, grid, self.speed).at[0, 0].set(np.inf)
        full = to_field(to_spectrum(self.surface.heights) / kernel, shape)
        self.load = -self.closed * float(full.min())
        self.description = f"{num_layers} layers, {base}, {shape}, cut-off {cut} q0"

    def __repr__(self):
        return (
            f"{self.description}, p = {self.closed:.1e} of full contact, v = {self.speed:.1e}, "
            f"rtol = {self.rtol:.1e}"
        )

    def solve(self, rtol):
        return gc.slide(
            self.stack, self.surface, pressure=self.load, velocity=self.speed, rtol=rtol,
            throw=False,
        )  # fmt: skip


def random_material(rng):
    modulus, poisson = 10 ** rng.uniform(-1.5, 1.5), rng.uniform(0.2, 0.5)
    strengths = modulus * 10 ** rng.uniform(-2, 2, BRANCHES)
    if rng.random() < 0.4:
        strengths = np.full(BRANCHES, 1e-12 * modulus)
    return gc.Prony(modulus, strengths, 10 ** rng.uniform(-5, 5, BRANCHES), poisson)
