"""Errors of the surface compliance M_zz on random stacks, and times of kernels on a grid.

    python benchmarks/bench_response.py hard         errors on 20,000 random stacks
    python benchmarks/bench_response.py speed        kernels in FFT pairs

Errors are against mpmath at 100 digits, on the same doubles (`exact_stacks.py`). Random stacks: 1
to 300 layers on a half space, a rigid base or none; q d from 1e-12 to 1e8, of the stack or of each
single layer; moduli over twelve decades; loss tangents up to 10; ν from -0.9 to 1/2, with 1/2 and
1/2 - 1e-12 frequent; complex ν from passive bulk and shear moduli.
"""

import dataclasses
import multiprocessing
import sys
import time
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from exact_stacks import (
    cases_of,
    change_with_digits,
    exact_value,
    random_stacks,
)
from rows import goal, report, run, timed

import graded_contact as gc
from graded_contact.materials.material import AbstractMaterial

BASES = {"half space": None, "rigid": gc.Rigid(), "free": gc.Free()}
# Each count is compiled once.
COUNTS = (1, 3, 8, 30, 300)
KINDS = {"elastic": 0.2, "lossy": 0.6, "complex ν": 0.2}


def run_oracle(function, cases, processes):
    """function(case) of all cases as one array, in parallel, with progress on stderr."""
    results, start = [], time.perf_counter()
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for result in pool.imap(function, cases, chunksize=10):
            results.append(result)
            if len(results) % 1000 == 0:
                passed = time.perf_counter() - start
                print(f"  {len(results)} of {len(cases)}, {passed:.0f} s", file=sys.stderr)
    return np.array(results)


def relative_error(values, exact):
    """|value - exact|/|exact|, with `exact` as pairs of doubles in the last axis."""
    with np.errstate(all="ignore"):
        real = (np.real(values) - exact[..., 0]) - exact[..., 1]
        imag = (np.imag(values) - exact[..., 2]) - exact[..., 3]
        return np.hypot(real, imag) / np.hypot(exact[..., 0], exact[..., 2])


class Given(AbstractMaterial):
    """Given moduli, whatever the frequency."""

    young: jax.Array
    poisson: jax.Array

    def complex_modulus(self, omega):
        return self.young

    def poisson_ratio(self, omega):
        return self.poisson

    def at(self, temperature):
        return self


def compliance(base, q, d, e, nu, base_e, base_nu):
    """The package's M_zz of one stack."""
    below = gc.HalfSpace(Given(base_e, base_nu)) if base == "half space" else BASES[base]
    layers = tuple(gc.Layer(Given(e[i], nu[i]), d[i]) for i in range(len(d)))
    return gc.surface_compliance(gc.Stack(layers=layers, base=below), q, 0.0)


@partial(jax.jit, static_argnums=0)
def compliances(base, *group):
    return jax.vmap(partial(compliance, base))(*group)


# hard ---------------------------------------------------------------------------------------


def hard(count=20000, seed=0, processes=2):
    """Errors on random stacks."""
    rng = np.random.default_rng(seed)
    cells = [(b, n, k) for b in BASES for n in COUNTS for k in KINDS]
    chances = np.array([KINDS[k] for _, _, k in cells]) / (len(BASES) * len(COUNTS))
    sizes = rng.multinomial(count, chances / chances.sum())
    cells = [(*cell, m) for cell, m in zip(cells, sizes, strict=True) if m > 0]
    groups = [random_stacks(rng, m, n, kind) for _, n, kind, m in cells]
    cases = [
        case
        for (base, *_), group in zip(cells, groups, strict=True)
        for case in cases_of(group, base)
    ]
    start = time.perf_counter()
    exact = run_oracle(exact_value, cases, processes)
    print(f"# oracle: {len(cases)} stacks in {time.perf_counter() - start:.0f} s")
    some = cases[:: max(1, len(cases) // 200)]
    change = np.max(run_oracle(change_with_digits, some, processes))
    print(f"# twice as many digits change {len(some)} of them by at most {change:.0e}")

    pairs = zip(cells, groups, strict=True)
    ours = [np.asarray(compliances(base, *group)) for (base, _, _, _), group in pairs]
    ours = relative_error(np.concatenate(ours), exact)
    labels = [np.repeat(np.array(column), sizes[sizes > 0]) for column in zip(*cells, strict=True)]

    sets = [("all", np.full(len(ours), True))]
    for label, names in zip(labels, (BASES, COUNTS, KINDS), strict=False):
        sets += [
            (f"{name} layers" if names is COUNTS else name, label == name)
            for name in names
            if np.any(label == name)
        ]
    for name, some in sets:
        report("bench_response-hard", {
            "stacks": name, "number": int(np.sum(some)), **quantiles("error", ours[some]),
        })  # fmt: skip
    above = np.sum(~(ours <= 1e-14))
    goal("worst <= 1e-14", f"{np.max(ours):.1e}; {above} of {len(ours)} above it")


# speed --------------------------------------------------------------------------------------

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
    "1_layer": (lambda: layered(1), None),
    "3_layers": (lambda: layered(3), 1),
    "30_layers": (lambda: layered(30), 8),
    "300_layers": (lambda: layered(300), None),
    "graded": (graded, 4),
}


def speed(sizes=(1024, 2048, 4096), bodies=tuple(BODIES), repeat=5, points=4000):
    """Kernels in FFT pairs: of one rfft2 and irfft2 of the grid in a loop.

    The error is the worst of random points against `surface_compliance`.
    """
    for n in sizes:
        grid = gc.Grid((n, n), CELL)
        bare = transform_pair(n)
        print(f"# N = {n}: one FFT pair {1e3 * bare:.3g} ms")
        for name in bodies:
            make, most = BODIES[name]
            stack = make()
            run = partial(gc.stack_kernel, stack, grid, VELOCITY)
            start = time.perf_counter()
            kernel = np.asarray(run())
            first = time.perf_counter() - start
            warm = timed(run, repeat)
            error = kernel_error(stack, grid, kernel, points)
            report("bench_response-speed", {
                "body": name, "N": n, "first call [s]": first, "warm [s]": warm,
                "over an FFT pair": warm / bare, "error": float(error),
            })  # fmt: skip
            if n == 2048 and most:
                goal(f"{name}: <= {most} FFT pairs", f"{warm / bare:.2f}")


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
    sharp = dataclasses.replace(stack, graded_solver=gc.response.Layering(rtol=1e-12))
    expected = gc.surface_compliance(sharp, np.hypot(qx, qy), -qx * VELOCITY)
    return np.max(np.abs(kernel[i, j] / np.asarray(expected) - 1))


# Common -------------------------------------------------------------------------------------


def quantiles(name, errors):
    """The worst, the 99.9 % quantile and the median."""
    some = errors if len(errors) else np.full(1, np.nan)
    return {
        f"{name}: worst": float(np.max(some)),
        f"{name}: 99.9 %": float(np.quantile(some, 0.999)),
        f"{name}: median": float(np.median(some)),
    }


if __name__ == "__main__":
    run(__doc__, hard, speed)
