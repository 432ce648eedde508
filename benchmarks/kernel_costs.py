"""What a kernel on a grid costs, and its gradient: the sections `speed` and `gradient`.

Run by `bench_response.py`.
"""

import statistics
import time
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from rows import keep

import graded_contact as gc

CELL, VELOCITY = 0.1, 0.1  # m, m/s


def rubber(share):
    """A tread between soft and slow (share 0) and stiff and fast (1), real ν."""
    tread = gc.tyre_tread()
    return gc.Prony(
        equilibrium=tread.equilibrium * (1 + share),
        strengths=tread.strengths * (1 + 3 * share),
        times=tread.times * 10 ** (-2 * share),
        poisson=0.45 + 0.05 * share,
    )


def layered(num_layers):
    """A millimetre of layers on a half space; one layer of it is 0.1 mm."""
    share = (np.arange(num_layers) + 0.5) / num_layers
    thickness = np.full(num_layers, 1e-3 / num_layers) if num_layers > 1 else [1e-4]
    layers = tuple(gc.Layer(rubber(s), d) for s, d in zip(share, thickness, strict=True))
    return gc.Stack(layers=layers, base=gc.HalfSpace(rubber(1.0)))


def graded():
    profile = gc.Blend(rubber(1.0), rubber(0.0), gc.shapes.Linear())
    return gc.Stack(layers=(gc.GradedLayer(profile, 1e-3),), base=gc.HalfSpace(rubber(1.0)))


# Name -> (stack, goal in FFT pairs at N = 2048)
BODIES = {
    "1 layer": (lambda: layered(1), None),
    "3 layers": (lambda: layered(3), 1),
    "30 layers": (lambda: layered(30), 8),
    "300 layers": (lambda: layered(300), None),
    "graded 1e-9": (graded, 4),
}


def speed(options):
    print("# first: seconds of the first call, compilation included; x fft: warm seconds over one")
    print("# rfft2 + irfft2 of the grid in a loop; error: worst of random points against")
    print("# surface_compliance")
    goals = []
    for n in options.sizes:
        grid = gc.Grid((n, n), CELL)
        bare = transform_pair(n)
        print(f"\n# N = {n}: one FFT pair {1e3 * bare:.3g} ms")
        print(f"{'body':12s} {'first s':>8s} {'warm s':>8s} {'x fft':>7s} {'error':>8s}")
        for name in options.bodies:
            make, goal = BODIES[name]
            stack = make()
            run = partial(gc.stack_kernel, stack, grid, VELOCITY)
            start = time.perf_counter()
            kernel = np.asarray(run())
            first = time.perf_counter() - start
            warm = timed(run, options.repeat)
            error = kernel_error(stack, grid, kernel, options.points)
            line = f"{name:12s} {first:8.2f} {warm:8.3f} {warm / bare:7.2f} {error:8.1e}"
            print(line, flush=True)
            keep(
                "bench_response-speed",
                {
                    "body": name,
                    "N": n,
                    "first call [s]": first,
                    "warm [s]": warm,
                    "over an FFT pair": warm / bare,
                    "error": float(error),
                },
            )
            if n == 2048 and goal:
                goals.append(f"{name}: <= {goal} FFT pairs | reached: {warm / bare:.2f}")
    print("\n" + "\n".join(f"goal: {line}" for line in goals))


def transform_pair(n):
    count = max(4, 2 * (2048 // n) ** 2)

    @jax.jit
    def pairs(field):
        one = lambda _, f: jnp.fft.irfft2(jnp.fft.rfft2(f), f.shape)  # noqa: E731
        return jax.lax.fori_loop(0, count, one, field)

    field = jax.random.normal(jax.random.key(0), (n, n))
    jax.block_until_ready(pairs(field))
    return timed(partial(pairs, field), 3) / count


def kernel_error(stack, grid, kernel, num_points):
    """The worst relative error at random points off the Nyquist lines and off q = 0."""
    n = grid.shape[0]
    rng = np.random.default_rng(0)
    i, j = rng.integers(1 - n // 2, n // 2, num_points), rng.integers(1, n // 2, num_points)
    qx, qy = (2 * np.pi / CELL * k for k in (i, j))
    rtol = 1e-12 if any(isinstance(layer, gc.GradedLayer) for layer in stack.layers) else None
    expected = gc.surface_compliance(stack, np.hypot(qx, qy), -qx * VELOCITY, rtol=rtol)
    return np.max(np.abs(kernel[i, j] / np.asarray(expected) - 1))


def timed(function, repeat):
    """Median time of a call that was made before [s]."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        jax.block_until_ready(function())
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def gradient(options):
    print(f"{'N':>5s} {'what':10s} {'first s':>8s} {'warm s':>8s} {'x value':>8s} {'temp MB':>8s}")
    reached = []
    for n in options.sizes:
        grid = gc.Grid((n, n), CELL)
        weights = jax.random.uniform(jax.random.key(0), (n, n // 2 + 1))
        start_at = (jnp.array([1e-4, 3e-4, 6e-4]), jnp.array([1.0, 2.0, 3.0]))

        def value(parameters, weights, grid=grid):
            thickness, modulus = parameters
            layers = []
            for i in range(3):
                material = rubber(i / 3)
                material = gc.Prony(
                    equilibrium=material.equilibrium * modulus[i],
                    strengths=material.strengths,
                    times=material.times,
                    poisson=material.poisson,
                )
                layers.append(gc.Layer(material, thickness[i]))
            stack = gc.Stack(layers=tuple(layers), base=gc.HalfSpace(rubber(1.0)))
            kernel = gc.stack_kernel(stack, grid, VELOCITY) * 1e12
            return jnp.sum(weights * (kernel.real**2 + kernel.imag**2))

        alone = None
        for name, function in (("value", value), ("gradient", jax.value_and_grad(value))):
            start = time.perf_counter()
            compiled = jax.jit(function).lower(start_at, weights).compile()
            jax.block_until_ready(compiled(start_at, weights))
            first = time.perf_counter() - start
            warm = timed(partial(compiled, start_at, weights), options.repeat)
            alone = alone or warm
            temporaries = compiled.memory_analysis().temp_size_in_bytes / 1e6
            print(
                f"{n:5d} {name:10s} {first:8.2f} {warm:8.3f} {warm / alone:8.2f} "
                f"{temporaries:8.1f}",
                flush=True,
            )
        reached.append(f"goal: gradient <= 4 x value | reached at N = {n}: {warm / alone:.2f} x")
    print("\n" + "\n".join(reached))
