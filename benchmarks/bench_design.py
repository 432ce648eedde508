"""Inverse design: a flat loss tangent, and a coating for friction.

    python benchmarks/bench_design.py composite   the paper's composite against a designed one
    python benchmarks/bench_design.py coating     30 % more friction, verified by contact
    python benchmarks/bench_design.py unseen      the same coat on frozen and on ever new surfaces

`composite` compares with the three hand-made layers of the paper's Fig. composite
(`paper/response.py`) over the two decades, or `--decades`, in which those are flattest, at no less
mean loss. `coating` runs the study of examples/design_coating.toml. `unseen`: see
`design_unseen.py`.
"""

import dataclasses
import sys
import time
from itertools import pairwise

import jax.numpy as jnp
import numpy as np
from design_unseen import unseen
from rows import ROOT, goal, run, show

import graded_contact as gc
from graded_contact.files.design_scene import read_design
from graded_contact.studies.design import minimise
from graded_contact.studies.design_report import report
from graded_contact.studies.objectives import loss_tangent, ripple
from graded_contact.studies.run_design import run_design

sys.path.append(str(ROOT / "benchmarks" / "paper"))
from response import CONTRAST, INCOMPRESSIBLE, Q0, RELAXED, TAU, VELOCITY, rubber

SHARES = np.array([1e-3, 1e-2, 1e-1])  # of the paper's layers, surface first


# composite ----------------------------------------------------------------------------------


def layered(times, thickness):
    """Three layers of the paper's rubber on its half space, surface first."""
    relaxed = RELAXED * (1 - INCOMPRESSIBLE**2)
    missing = (1 - 1 / CONTRAST) / relaxed
    layers = tuple(
        gc.Layer(gc.Prony.from_creep(CONTRAST * relaxed, [missing], time[None], INCOMPRESSIBLE), d)
        for time, d in zip(jnp.asarray(times), thickness, strict=True)
    )
    return gc.Stack(layers=layers, base=gc.HalfSpace(rubber(TAU)))


def from_parameters(p):
    """Each layer is slower and thicker than the one above: times and thicknesses are products."""
    return layered(jnp.cumprod(p["time"]), jnp.cumprod(p["thickness"]))


def flattest(stack, decades):
    """Ends [rad/m] of the band of some decades where max/min of the loss tangent is least."""
    q = np.geomspace(1e-1, 1e5, 1201) * Q0
    tangent = np.asarray(loss_tangent(stack, q, VELOCITY))
    width = 200 * decades
    spans = np.lib.stride_tricks.sliding_window_view(tangent, width + 1)
    first = int(np.argmin(spans.max(axis=1) / spans.min(axis=1)))
    return q[first], q[first + width]


def show_tangent(name, tangent, evaluations):
    """Prints a row, and returns max/min of a loss tangent."""
    ratio = tangent.max() / tangent.min()
    show({"layers": name, "max/min": ratio, "mean": tangent.mean(), "evaluations": evaluations})
    return ratio


def composite(starts=10, decades=2, waves=61, seed=0):
    """A flat loss tangent over so many decades."""
    paper = layered(2 * np.pi * SHARES / (Q0 * VELOCITY), 2 * np.pi * SHARES / Q0)
    ends = flattest(paper, decades)
    fine, coarse = np.geomspace(*ends, 2001), np.geomspace(*ends, waves)
    mean = jnp.mean(loss_tangent(paper, coarse, VELOCITY))
    lower = {"time": np.array([1e-6, 1, 1]), "thickness": np.array([1e-5, 1, 1])}
    upper = {"time": np.array([1e-3, 30, 30]), "thickness": np.array([1e-3, 30, 30])}
    tangents = lambda p: loss_tangent(from_parameters(p), coarse, VELOCITY)  # noqa: E731
    draws = np.random.default_rng(seed).random(6)
    first = {
        "time": lower["time"] * (upper["time"] / lower["time"]) ** draws[:3],
        "thickness": lower["thickness"] * (upper["thickness"] / lower["thickness"]) ** draws[3:],
    }
    begin = time.perf_counter()
    design = minimise(
        lambda p: ripple(tangents(p)), lower, upper, first,
        constraints=lambda p: jnp.mean(tangents(p)) / mean - 1,
        num_starts=starts, seed=seed,
    )  # fmt: skip
    spent = time.perf_counter() - begin
    print(f"band q/q0 = {ends[0] / Q0:.3g} to {ends[1] / Q0:.3g}; bounds: times 1 µs to 1 ms and")
    print(
        "thicknesses 10 µm to 1 mm of the layer at the surface, 1 to 30 times from one to the next"
    )
    by_hand = np.asarray(loss_tangent(paper, fine, VELOCITY))
    least = show_tangent("by hand", by_hand, 0)
    ratios = []
    for i, found in enumerate(design.runs):
        # The order of a dict's leaves is that of its sorted keys.
        p = dict(zip(("thickness", "time"), np.split(np.array(found.parameters), 2), strict=True))
        tangent = np.asarray(loss_tangent(from_parameters(p), fine, VELOCITY))
        ratio = show_tangent(f"random start {i}", tangent, found.num_evaluations)
        ratios.append(ratio if found.feasible else np.inf)
    best = from_parameters(design.parameters)
    for layer in best.layers:
        moduli = layer.material
        print(f"layer: {1e3 * layer.thickness:.4g} mm, relaxation time {moduli.times[0]:.4g} s")
    flat = sum(ratio < least for ratio in ratios)
    goal("max/min less than by hand", f"{min(ratios):.3f} < {least:.3f}")
    share = f"{starts * 8 // 10} of {starts}"
    goal(f"success from >= {share} random starts", f"{flat} of {starts}")
    goal("< 60 s", f"{spent:.1f} s, {design.num_evaluations} evaluations, compilation included")


# coating ------------------------------------------------------------------------------------


def coating(size=256, surfaces=8):
    """30 % more friction of a coat, verified by contact."""
    study = read_design(ROOT / "examples" / "design_coating.toml")
    surface = study.scene.surface
    grid = gc.Grid((size, size), surface.grid.size)
    scene = dataclasses.replace(study.scene, surface=surface._replace(grid=grid))
    study = dataclasses.replace(study, scene=scene, verify=surfaces)
    begin = time.perf_counter()
    clock = [("", begin)]
    results = run_design(
        study, progress=lambda text, *_: clock.append((text.split(",")[0], time.perf_counter()))
    )
    seconds = time.perf_counter() - begin
    print(report(results))
    print()
    for stage in ("design", "polish", "contact"):
        spent = [b[1] - a[1] for a, b in pairwise(clock) if b[0] == stage]
        print(f"{stage:8s} {sum(spent):6.1f} s, compilation included")
    before = results.candidates["before"]
    for name, candidate in list(results.candidates.items())[1:]:
        gain = candidate.friction[:, 0] / before.friction[:, 0]
        field = float(candidate.field.friction[0] / before.field.friction[0])
        mean = candidate.friction.mean() / before.friction.mean()
        goal(
            f"{name}: friction 1.3 times that before, on {surfaces} unseen surfaces, N = {size}",
            f"{mean:.4f} of the means, {gain.mean():.4f} +- {gain.std():.4f} surface by surface; "
            f"mean field {field:.4f}",
        )
    goal("design, polish and verification < 600 s", f"{seconds:.1f} s")


if __name__ == "__main__":
    run(__doc__, composite, coating, unseen)
