"""Cost of derivatives, and of the largest grid: the sections `gradient` and `largest`.

Run by `bench_contact.py`.
"""

import resource
import time
from functools import partial

import contact_scenes
import jax
from contact_scenes import bodies, rough_surface
from rows import goal, report, timed

import graded_contact as gc

SPEED = 0.1  # m/s


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

                both = gc.jit(jax.value_and_grad(value))
                times = []
                for function in (gc.jit(value), both):
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
            "of the solver": float(found.error_parts("friction")["solver"]), "total error": error,
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
