"""What a solve costs beside its transforms: the sections `overhead`, `many`, `gradient`, `largest`.

Run by `bench_contact.py`.
"""

import os
import resource
import subprocess
import sys
import time
from functools import partial

import jax
import jax.numpy as jnp
from contact_scenes import bare_pair, bodies, goal, print_versions, rough_surface, timed
from rows import report, where

import graded_contact as gc
from graded_contact.fields import transforms as _fft

SPEED = 0.1  # m/s
WAYS = ("single", "jit", "lax.map", "vmap")  # of many solves
# The fewest points that go through ducc0: all or none.
BOUND_FROM = {"xla": 2**62, "ducc0": 0}


def overhead(options):
    """Runs `overhead_of` for each backend in a process of its own."""
    print_versions()
    print(
        "# solve: wall time over FFT pairs times that of a bare pair in a lax loop, same backend;"
    )
    print("# slide: with kernel and observables; rtol = 1e-6; from N = 512 on the first digits are")
    print("# found in single precision, whose pairs count as whole ones")
    print(
        f"{'backend':8s} {'body':12s} {'p/E_r':>5s} {'N':>5s} {'pair ms':>8s} {'pairs':>7s} "
        f"{'solve s':>8s} {'x pairs':>8s} {'slide s':>8s} {'x pairs':>8s}",
        flush=True,
    )
    for backend in options.backends:
        command = [sys.executable, sys.argv[0], "overhead_of", backend]
        command += ["--sizes", *map(str, options.sizes), "--repeat", str(options.repeat)]
        subprocess.run(command, check=True)


def overhead_of(options):
    _fft.BOUND_FROM = BOUND_FROM[options.backend]
    reached = {}
    for n in options.sizes:
        bare, surface = bare_pair(n), rough_surface(n)
        for name, load, speed in (("elastic", 0.1, 0.0), ("single", 0.1, SPEED)):
            stack = bodies()[name]
            kernel = gc.stack_kernel(stack, surface.grid, speed)
            contact = partial(gc.solve_contact, kernel, surface.heights, load, rtol=1e-6)
            slide = partial(gc.slide, stack, surface, pressure=load, velocity=speed, rtol=1e-6)
            found = contact()
            slide()
            alone, whole = timed(contact, options.repeat), timed(slide, options.repeat)
            expected = float(found.num_fft_pairs) * bare
            reached.setdefault(n, []).append(alone / expected)
            print(
                f"{options.backend:8s} {name:12s} {load:5.2f} {n:5d} {1e3 * bare:8.3f} "
                f"{float(found.num_fft_pairs):7.1f} {alone:8.3f} {alone / expected:8.2f} "
                f"{whole:8.3f} {whole / expected:8.2f}",
                flush=True,
            )
    found = ", ".join(f"{max(ratios):.2f} at N = {n}" for n, ratios in reached.items())
    goal(f"{options.backend}: a solve takes <= 1.5 x its FFT pairs", found)


def many(options):
    """Runs `many_on` on one core and on more, in processes of their own."""
    print_versions()
    print("# ms of a solve among many of one program (loads around p/E_r = 0.1), and over its FFT")
    print(
        "# pairs times that of a bare pair in a lax loop on as many cores; rtol = 1e-6; single: one"
    )
    print("# call each, without jit; jit: one call each, a program compiled as a whole")
    where()  # once for all processes
    for cores in options.cores:
        command = [sys.executable, sys.argv[0], "many_on", str(cores)]
        command += ["--sizes", *map(str, options.sizes), "--count", str(options.count)]
        # A child has the cores of its parent, and XLA sizes its pools by them.
        allowed = os.sched_getaffinity(0)
        os.sched_setaffinity(0, sorted(allowed)[:cores])
        subprocess.run(command, check=True)
        os.sched_setaffinity(0, allowed)


def many_on(options):
    for n in options.sizes:
        surface, loads = rough_surface(n), 0.1 * jnp.linspace(0.8, 1.2, options.count)
        kernel = gc.stack_kernel(bodies()["single"], surface.grid, SPEED)

        def solve(load, kernel=kernel, surface=surface):
            found = gc.solve_contact(kernel, surface.heights, load, rtol=1e-6, throw=False)
            return jnp.mean(found.pressure**2), found.num_fft_pairs

        pairs = float(solve(0.1)[1])
        one = jax.jit(solve)
        ways = [
            (solve, 0.1, 1),
            (one, 0.1, 1),
            (jax.jit(lambda loads, f=solve: jax.lax.map(f, loads)), loads, options.count),
            (jax.jit(jax.vmap(solve)), loads, options.count),
        ]
        bare, cells = bare_pair(n), {}
        for name, (function, argument, count) in zip(WAYS, ways, strict=True):
            jax.block_until_ready(function(argument))
            seconds = timed(lambda f=function, a=argument: f(a), 3 if count > 1 else 15) / count
            cells[f"{name} [ms]"] = 1e3 * seconds
            cells[f"{name} over its pairs"] = seconds / (pairs * bare)
        report(
            "bench_contact-many",
            {"on cores": options.cores, "N": n, "FFT pairs": pairs, "a pair [ms]": 1e3 * bare}
            | cells,
        )


def gradient(options):
    print_versions()
    print("# seconds of friction, and of it with its derivatives by every leaf of the block;")
    print("# rtol = 1e-6; gradient: the difference over the former")
    worst = {}
    for n in options.sizes:
        surface = rough_surface(n)
        for name in options.bodies:
            stack = bodies()[name]
            for load in options.loads:

                def value(stack, surface=surface, load=load):
                    return gc.slide(
                        stack, surface, pressure=load, velocity=SPEED, rtol=1e-6
                    ).friction

                both = jax.jit(jax.value_and_grad(value))
                seconds = []
                for function in (jax.jit(value), both):
                    jax.block_until_ready(function(stack))
                    seconds.append(timed(lambda f=function, s=stack: f(s), options.repeat))
                ratio = seconds[1] / seconds[0] - 1
                worst[n] = max(worst.get(n, 0.0), ratio)
                report(
                    "bench_contact-gradient",
                    {
                        "body": name,
                        "p/E_r": load,
                        "N": n,
                        "friction [s]": seconds[0],
                        "with gradient [s]": seconds[1],
                        "gradient over friction": ratio,
                    },
                )
    found = ", ".join(f"{ratio:.2f} at N = {n}" for n, ratio in worst.items())
    goal("a gradient costs <= 1 x its solve", found)


def largest(options):
    """The paper's finest grid; the peak is that of the process, so nothing else runs in it."""
    print_versions()
    surface = rough_surface(options.size)
    stack = bodies()["tread+coat"]
    for load in options.loads:
        start = time.perf_counter()
        found = gc.slide(
            stack, surface, pressure=load, velocity=options.velocity, rtol=1e-4, throw=False
        )
        jax.block_until_ready(found)
        minutes = (time.perf_counter() - start) / 60
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
        said = "" if found.result == gc.contacts.RESULTS.successful else ", NOT CONVERGED"
        print(
            f"# p/E_r = {load:g}, v = {options.velocity:g} m/s: friction "
            f"{float(found.friction):.5f} +- {float(found.friction_error):.0e}, area "
            f"{float(found.contact_area_smooth):.4f}, {float(found.num_fft_pairs):.0f} FFT pairs, "
            f"error {float(jnp.max(found.error)):.0e}{said}"
        )
        goal(
            "N = 8192, q1 = 1024 q0, coated tread to 1e-4 in <= 5 minutes and <= 20 GB",
            f"N = {options.size}, p/E_r = {load:g}: {minutes:.2f} minutes, compilation included, "
            f"{peak:.1f} GB",
        )
