"""Costs of a solve besides transforms.

The sections `overhead`, `many`, `gradient`, `linear` and `largest`.

Run by `bench_contact.py`.
"""

import os
import resource
import time
from functools import partial

import contact_scenes
import jax
import jax.numpy as jnp
import numpy as np
from contact_scenes import bare_pair, bodies, rough_surface
from rows import goal, report, show, timed

import graded_contact as gc
from graded_contact.contacts.adjoint import LinearSplitting

SPEED = 0.1  # m/s
# Near the greatest friction [m/s].
AT_PEAK = {"elastic": 0.0, "single": 4e-3, "tread": 1e5, "tread+coat": 1e5, "broad": 1e-6}
WAYS = ("single", "jit", "lax.map", "vmap")  # of many solves


def overhead(sizes=(256, 512, 1024, 2048), repeat=3):
    """Wall time over that of the transforms alone."""
    print("# solve: wall time over FFT pairs times that of a bare pair in a lax loop;")
    print("# slide: with kernel and observables; rtol = 1e-6; from N = 512 on the first digits are")
    print("# found in single precision, whose pairs count as whole ones")
    reached = {}
    for n in sizes:
        bare, surface = bare_pair(n), rough_surface(n)
        for name, load, speed in (("elastic", 0.1, 0.0), ("single", 0.1, SPEED)):
            stack = bodies()[name]
            kernel = gc.stack_kernel(stack, surface.grid, speed)
            contact = partial(gc.solve_contact, kernel, surface.heights, load, rtol=1e-6)
            slide = partial(gc.slide, stack, surface, pressure=load, velocity=speed, rtol=1e-6)
            pairs = float(contact().num_fft_pairs)
            slide()
            alone, whole = timed(contact, repeat), timed(slide, repeat)
            reached.setdefault(n, []).append(alone / (pairs * bare))
            show({
                "body": name, "p/E_r": load, "N": n, "pair [ms]": 1e3 * bare,
                "FFT pairs": pairs, "solve [s]": alone, "solve over pairs": alone / (pairs * bare),
                "slide [s]": whole, "slide over pairs": whole / (pairs * bare),
            })  # fmt: skip
    found = ", ".join(f"{max(ratios):.2f} at N = {n}" for n, ratios in reached.items())
    goal("a solve takes <= 1.5 x its FFT pairs", found)


def many(sizes=(64, 128, 256), count=200, cores=(1, 2)):
    """Many small solves in one program, on one core and on more."""
    for number, start in in_processes("many_on", cores, sizes=sizes, count=count):
        # A child has the cores of its parent, and XLA sizes its pools by them.
        allowed = os.sched_getaffinity(0)
        os.sched_setaffinity(0, sorted(allowed)[:number])
        start()
        os.sched_setaffinity(0, allowed)


def many_on(cores, sizes=(64, 128, 256), count=200):
    """The same on so many cores, in this process."""
    print("# ms of a solve among many of one program (loads around p/E_r = 0.1), and over its FFT")
    print(
        "# pairs times that of a bare pair in a lax loop on as many cores; rtol = 1e-6; single: one"
    )
    print("# call each, without jit; jit: one call each, a program compiled as a whole")
    for n in sizes:
        surface, loads = rough_surface(n), 0.1 * jnp.linspace(0.8, 1.2, count)
        kernel = gc.stack_kernel(bodies()["single"], surface.grid, SPEED)

        def solve(load, kernel=kernel, surface=surface):
            found = gc.solve_contact(kernel, surface.heights, load, rtol=1e-6, throw=False)
            return jnp.mean(found.pressure**2), found.num_fft_pairs

        pairs = float(solve(0.1)[1])
        one = jax.jit(solve)
        ways = [
            (solve, 0.1, 1),
            (one, 0.1, 1),
            (jax.jit(lambda loads, f=solve: jax.lax.map(f, loads)), loads, count),
            (jax.jit(jax.vmap(solve)), loads, count),
        ]
        bare, cells = bare_pair(n), {}
        for name, (function, argument, solves) in zip(WAYS, ways, strict=True):
            jax.block_until_ready(function(argument))
            each = timed(partial(function, argument), 3 if solves > 1 else 15) / solves
            cells[f"{name} [ms]"] = 1e3 * each
            cells[f"{name} over its pairs"] = each / (pairs * bare)
        report(
            "bench_contact-many",
            {"on cores": int(cores), "N": n, "FFT pairs": pairs, "a pair [ms]": 1e3 * bare} | cells,
        )


def gradient(sizes=(512, 1024), bodies=("single", "tread+coat"), loads=(0.01, 0.1), repeat=3):
    """Cost of derivatives."""
    print("# seconds of friction, and of it with its derivatives by every leaf of the block;")
    print("# rtol = 1e-6; gradient: the difference over the former")
    worst = {}
    for n in sizes:
        surface = rough_surface(n)
        for name in bodies:
            stack = contact_scenes.bodies()[name]
            for load in loads:

                def value(stack, surface=surface, load=load):
                    return gc.slide(
                        stack, surface, pressure=load, velocity=SPEED, rtol=1e-6
                    ).friction

                both = jax.jit(jax.value_and_grad(value))
                times = []
                for function in (jax.jit(value), both):
                    jax.block_until_ready(function(stack))
                    times.append(timed(partial(function, stack), repeat))
                ratio = times[1] / times[0] - 1
                worst[n] = max(worst.get(n, 0.0), ratio)
                report("bench_contact-gradient", {
                    "body": name, "p/E_r": load, "N": n, "friction [s]": times[0],
                    "with gradient [s]": times[1], "gradient over friction": ratio,
                })  # fmt: skip
    found = ", ".join(f"{ratio:.2f} at N = {n}" for n, ratio in worst.items())
    goal("a gradient costs <= 1 x its solve", found)


def linear(n=128, loads=(0.01, 0.1, 0.5), tolerances=(1e-2, 1e-3, 5e-5)):
    """FFT pairs and errors of the linear solves of derivatives (0 pairs: eliminated)."""
    print("# of dμ/dp (elastic: of the area's): pairs and true relative error of the adjoint field")
    surface, systems, ratios = rough_surface(n), [], {}

    def recorded(*system, **keys):
        jax.debug.callback(lambda *found: systems.append(found), *system)
        return LinearSplitting(rtol=1e-2)(*system, **keys)

    solve = jax.jit(lambda *system, rtol: LinearSplitting().solve(*system, rtol=rtol))
    for name, speed in AT_PEAK.items():

        def value(load, name=name, speed=speed, **keys):
            found = gc.slide(bodies()[name], surface, pressure=load, velocity=speed, **keys)
            return (found.friction if speed else found.contact_area), found.num_fft_pairs

        for load in loads:
            jax.block_until_ready(jax.grad(value, has_aux=True)(load, adjoint=recorded))
            jax.effects_barrier()
            system, pairs = jax.tree.map(jnp.asarray, systems[-1]), float(value(load)[1])
            best = solve(*system, rtol=1e-11)[0]
            row = {"body": name, "p/E_r": load, "solve": pairs}
            for rtol in tolerances:
                tau, _, _, spent = solve(*system, rtol=rtol)
                off = jnp.linalg.norm(tau - best) / jnp.linalg.norm(best)
                row |= {f"at {rtol:g}": float(spent), f"error at {rtol:g}": float(off)}
                if spent > 0:
                    ratios.setdefault(rtol, []).append(float(spent) / pairs)
            show(row)
    found = ", ".join(f"{np.median(r):.2f} at {rtol:g}" for rtol, r in ratios.items())
    goal("a linear solve to 1e-3 takes <= 0.5 x the pairs of its contact", found)


def largest(size=8192, velocity=0.1, loads=(0.1,)):
    """N = 8192, the paper's finest grid: minutes and memory."""
    surface, stack = rough_surface(size), bodies()["tread+coat"]
    for load in loads:
        slide = partial(
            gc.slide, stack, surface, pressure=load, velocity=velocity, rtol=1e-4, throw=False
        )
        start = time.perf_counter()
        found = jax.block_until_ready(slide())
        minutes = (time.perf_counter() - start) / 60
        row = {
            "N": size, "p/E_r": load, "v": velocity, "friction": float(found.friction),
            "area": float(found.contact_area), "FFT pairs": float(found.num_fft_pairs),
            "minutes": minutes, "peak [GB]": peak_memory(),
            "result": gc.contacts.RESULTS[found.result],
        }  # fmt: skip
        # Half as many points are solved when the total error is read.
        error = float(found.friction_error)
        row |= {
            "of the solver": float(found.friction_solver_error), "total error": error,
            "minutes with it": (time.perf_counter() - start) / 60,
        }  # fmt: skip
        report("bench_contact-largest", row | {"peak with it [GB]": peak_memory()})
        goal(
            "N = 8192, q1 = 1024 q0, coated tread to 1e-4 in <= 5 minutes and <= 20 GB",
            f"N = {size}, p/E_r = {load:g}: {minutes:.2f} minutes, compilation included, "
            f"{row['peak [GB]']:.1f} GB",
        )


def peak_memory():
    """The largest resident set of this process so far [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
