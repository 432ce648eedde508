"""Inverse design: a coating for the most friction, on fixed surfaces and on new ones in each step.

    python benchmarks/bench_design.py unseen

All searches begin with the block of examples/design_coating.toml and make the mean of ln friction
large under its limits of stiffness and thickness. The gain is the friction of a design over that of
the block (geometric means), on surfaces that no search used. First the speed is that of the block,
then it is drawn with every surface, 1 mm/s to 10 m/s. The benchmark counts contact solves, each
with its derivatives.
"""

import time

import jax
import jax.numpy as jnp
import numpy as np
from rows import ROOT, run, show

import graded_contact as gc
from graded_contact.core.parameters import with_values
from graded_contact.designs.problem import design_problem
from graded_contact.designs.table import read_design
from graded_contact.studies.search import minimise
from graded_contact.studies.stochastic import minimise_expected

SPEEDS = np.log([1e-3, 10.0])
CHECKS = 8
FROZEN = (8, 32)


def unseen(points=64, unseen=32, seed=0):
    """Gain in friction on surfaces that no search has seen, of points² points.

    "seen": as the search sees it, on its own surfaces; "limits": the least, negative if broken.
    """
    study = read_design(ROOT / "examples" / "design_coating.toml")
    for what, speeds in (("one speed", None), ("all speeds", SPEEDS)):
        gains_of(study, points, unseen, seed, what, speeds)
    warm_starts(study, points)


def gains_of(study, points, num_unseen, seed, what, speeds):
    """Reports a row for each search."""
    scene, own = study.scene, study.start
    _, constraints = design_problem(study, {})
    grid = gc.Grid((points, points), scene.surface.grid.size)
    bounds = *study.bounds, own

    def loss(values, key):
        ours, other = jax.random.split(key)
        surface = gc.random_surface(scene.surface.spectrum, grid, ours)
        speed = scene.velocity[0]
        if speeds is not None:
            speed = jnp.exp(jax.random.uniform(other, minval=speeds[0], maxval=speeds[1]))
        return -jnp.log(
            gc.slide(
                with_values(scene.stack, values), surface, pressure=scene.pressure[0],
                velocity=speed, rtol=scene.rtol,
            ).friction
        )  # fmt: skip

    def losses(values, keys):
        return jax.lax.map(lambda key: loss(values, key), keys)

    all_losses = jax.jit(losses)
    new = jax.random.split(jax.random.key(seed + 1), num_unseen)
    before = np.asarray(all_losses(own, new))

    def row(name, search, contacts, reference):
        begin = time.perf_counter()
        design = search()
        seconds = time.perf_counter() - begin
        gains = before - np.asarray(all_losses(design.parameters, new))
        error = np.exp(gains.mean()) * gains.std(ddof=1) / np.sqrt(len(gains))
        note = "" if design.converged else f"  {design.runs[0].message}"
        show({
            "drawn": what, "search": f"{name:34s}", "contacts": contacts * design.num_evaluations,
            "seconds": seconds, "gain": np.exp(gains.mean()), "+-": error,
            "seen": np.exp(reference - design.value),
            "limits": min(map(float, constraints(design.parameters).values())),
        }, note)  # fmt: skip

    for frozen in FROZEN:
        keys = jax.random.split(jax.random.key(seed + 2), frozen)
        reference = float(np.mean(all_losses(own, keys)))
        for steps in (8, 32):
            row(
                f"SLSQP, {frozen} frozen, {steps} steps",
                lambda keys=keys, steps=steps: minimise(
                    lambda values: jnp.mean(losses(values, keys)), *bounds,
                    constraints=constraints, num_starts=1, max_steps=steps, rtol=1e-5,
                ),
                frozen, reference,
            )  # fmt: skip
    for steps in (50, 100, 200, 400):
        row(
            f"stochastic, {steps} steps + {CHECKS} checks",
            lambda steps=steps: minimise_expected(
                loss, *bounds, constraints=lambda values, _: constraints(values),
                num_steps=steps, num_checks=CHECKS, seed=seed,
            ),
            1, before.mean(),
        )  # fmt: skip


def warm_starts(study, points):
    """What a contact saves that begins with the pressure of a neighbour."""
    scene, own = study.scene, study.start
    grid = gc.Grid((points, points), scene.surface.grid.size)
    one, other = (
        gc.random_surface(scene.surface.spectrum, grid, jax.random.key(seed)) for seed in (0, 1)
    )

    def pairs(change, start=None, surface=one):
        stack = with_values(scene.stack, {path: change * value for path, value in own.items()})
        return gc.slide(
            stack, surface, pressure=scene.pressure[0], velocity=scene.velocity[0],
            rtol=scene.rtol, start=start,
        )  # fmt: skip

    cold, begin = pairs(1.05).num_fft_pairs, pairs(1.0).pressure
    print(f"\npairs of FFTs of a contact: {cold} from nothing; from the pressure of another design")
    for change in (1.001, 1.01, 1.05, 1.2):
        print(f"on its surface, parameters {change:5.3f} times as large: ", end="")
        print(pairs(change, begin).num_fft_pairs)
    print(f"on another surface: {pairs(1.0, pairs(1.0, surface=other).pressure).num_fft_pairs}")


if __name__ == "__main__":
    run(__doc__, unseen)
