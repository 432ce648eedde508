"""How much time a graded layer costs for an error: stepwise, extrapolated, differential equation.

The two profiles of the paper (Scaraggi & Comingio, App. B; ν = 1/2, half space below) at eleven
wavenumbers, q d = 1e-3..1e2, against mpmath values of `tests/data/graded_profiles.json`. Times
are per point in a batch of 4400 (Kvaerno5: 110), compiled; the first call is timed apart. Run
from the root of the repository: `python benchmarks/bench_grading.py`.
"""

import argparse
import json
import pathlib
import platform
import time

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from rows import keep

import graded_contact as gc
from graded_contact.response.compliance import graded_compliance
from graded_contact.response.layering import Layering
from graded_contact.response.profile import Blend
from graded_contact.response.riccati import Riccati
from graded_contact.response.shape import Linear, Sinusoidal
from graded_contact.response.slab import factors, half_space, stack_on
from graded_contact.response.stack import GradedLayer, Stack

jax.config.update("jax_enable_x64", True)
ROOT = pathlib.Path(__file__).parents[1]
COPIES, FEW_COPIES = 400, 10
SOFT = gc.Elastic(0.75, 0.5)
PROFILES = {
    "linear": Blend(SOFT, gc.Elastic(0.75 * (1 + 1e4), 0.5), Linear()),
    "sinusoidal": Blend(SOFT, gc.Elastic(1.5, 0.5), Sinusoidal()),
}


def timed(function, q, copies):
    """Values at `q`, seconds of the first call, seconds per point after it."""
    batch = jnp.tile(q, copies)
    start = time.perf_counter()
    function = jax.jit(function)
    values = jax.block_until_ready(function(batch))
    first = time.perf_counter() - start
    times = []
    for _ in range(3):
        start = time.perf_counter()
        jax.block_until_ready(function(batch))
        times.append(time.perf_counter() - start)
    return np.asarray(values)[: len(q)], first, min(times) / len(batch)


def stepwise(profile, num_layers):
    """The whole depth in equal layers with the moduli of their middles, as in the paper."""
    s = (jnp.arange(num_layers) + 0.5) / num_layers
    modulus, poisson = profile(s, jnp.zeros(()))
    reduced = modulus / (1 - poisson**2)
    e = jnp.broadcast_to(1 - 2 * poisson, reduced.shape)

    def value(q):
        def add(below, layer):
            state, reduced_below = below
            reduced, e = layer
            slab = factors(q / num_layers, e)
            return (stack_on(state, slab, reduced / reduced_below), reduced), None

        state = jax.tree.map(lambda c: jnp.broadcast_to(c, q.shape), half_space(jnp.zeros(())))
        (state, last), _ = jax.lax.scan(add, (state, jnp.ones(())), (reduced, e))
        return state.c22 * 2 / (last * q)

    return value


def solved(profile, solver, rtol):
    stack = Stack(layers=(GradedLayer(profile, 1.0),), base=gc.HalfSpace(SOFT))
    return lambda q: (
        graded_compliance(stack, q, 0.0, rtol=rtol, graded_solver=solver, throw=False).value
    )


def methods(profile):
    for num_layers in (10, 100, 1000, 10000):
        yield "stepwise midpoint", f"{num_layers} layers", stepwise(profile, num_layers)
    for rtol in (1e-4, 1e-7, 1e-10, 1e-12):
        yield "extrapolated", f"rtol {rtol:g}", solved(profile, Layering(retry=False), rtol)
    for solver in (diffrax.Dopri8(), diffrax.Tsit5(), diffrax.Kvaerno5()):
        for rtol in (1e-4, 1e-7, 1e-10):
            name = f"diffrax {type(solver).__name__}"
            yield name, f"rtol {rtol:g}", solved(profile, Riccati(solver), rtol)


def layers_for(profile, q, expected, error):
    """The number of uniform midpoint layers that the stepwise form needs, by doubling."""
    num_layers = 2
    while num_layers < 10**6:
        worst = np.max(np.abs(np.asarray(jax.jit(stepwise(profile, num_layers))(q)) / expected - 1))
        if worst <= error:
            return num_layers
        num_layers *= 2
    return None


def main():
    stored = json.loads((ROOT / "tests" / "data" / "graded_profiles.json").read_text())
    print(f"jax {jax.__version__}, diffrax {diffrax.__version__}, {jax.devices()[0].device_kind},")
    print(f"{platform.processor() or platform.machine()}, q d = 1e-3..1e2, float64\n")
    header = ("profile", "method", "setting", "worst error", "us/point", "first call s")
    print("{:11s} {:19s} {:13s} {:>11s} {:>9s} {:>12s}".format(*header))
    for name, profile in PROFILES.items():
        cases = [case for case in stored["cases"] if case["kind"] == name]
        q = jnp.array([case["qd"] for case in cases])
        expected = np.array([float(case["M_zz"]) for case in cases])
        for method, setting, function in methods(profile):
            copies = FEW_COPIES if "Kvaerno5" in method else COPIES
            values, first, each = timed(function, q, copies)
            worst = np.max(np.abs(values / expected - 1))
            # A differential equation that its solver gave up has NaN.
            reached = f"{worst:.1e}" if np.isfinite(worst) else "not reached"
            print(
                f"{name:11s} {method:19s} {setting:13s} {reached:>11s} {1e6 * each:9.1f} "
                f"{first:12.1f}",
                flush=True,
            )
            keep(
                "bench_grading",
                {
                    "profile": name,
                    "method": method,
                    "setting": setting,
                    "worst error": reached,
                    "time of a point [us]": 1e6 * each,
                    "first call [s]": first,
                },
            )
        needed = layers_for(profile, q, expected, 1e-6)
        print(f"{name:11s} stepwise midpoint needs {needed} layers for 1e-6\n", flush=True)


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.partition("\n\n")[0]).parse_args()
    main()
