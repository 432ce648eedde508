"""Time against error of graded layers: stepwise, extrapolated, differential equation.

The two profiles of the paper (Scaraggi & Comingio, App. B; ν = 1/2, half space below) at eleven
wavenumbers, q d = 1e-3..1e2, against mpmath values of `tests/data/graded_profiles.json`. Times
are per point in a batch of 4400 (Kvaerno5: 110), compiled; the first call is timed apart. Run
from the root of the repository: `python benchmarks/bench_grading.py`.
"""

import json

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from rows import ROOT, report, run, seconds

import graded_contact as gc
from graded_contact.blocks.profile import Blend
from graded_contact.blocks.shapes import Linear, Sinusoidal
from graded_contact.blocks.stack import GradedLayer, Stack
from graded_contact.response.compliance import graded_compliance
from graded_contact.response.layering import Layering
from graded_contact.response.riccati import Riccati
from graded_contact.response.slab import factors, half_space, stack_on

COPIES, FEW_COPIES = 400, 10
SOFT = gc.Elastic(0.75, 0.5)
PROFILES = {
    "linear": Blend(SOFT, gc.Elastic(0.75 * (1 + 1e4), 0.5), Linear()),
    "sinusoidal": Blend(SOFT, gc.Elastic(1.5, 0.5), Sinusoidal()),
}


def timed(function, q, copies):
    """Values at `q`, seconds of the first call, seconds per point after it."""
    batch, function = jnp.tile(q, copies), jax.jit(function)
    first, *later = (seconds(lambda: function(batch)) for _ in range(4))
    return np.asarray(function(batch))[: len(q)], first, min(later) / len(batch)


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
    stack = Stack(
        layers=(GradedLayer(profile, 1.0),), base=gc.HalfSpace(SOFT), graded_solver=solver
    )
    return lambda q: graded_compliance(stack, q, 0.0, rtol=rtol, throw=False).value


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


def grading():
    """Errors and times of all methods."""
    stored = json.loads((ROOT / "tests" / "data" / "graded_profiles.json").read_text())
    for name, profile in PROFILES.items():
        cases = [case for case in stored["cases"] if case["kind"] == name]
        q = jnp.array([case["qd"] for case in cases])
        expected = np.array([float(case["M_zz"]) for case in cases])
        for method, setting, function in methods(profile):
            copies = FEW_COPIES if "Kvaerno5" in method else COPIES
            values, first, each = timed(function, q, copies)
            worst = np.max(np.abs(values / expected - 1))
            row = {
                "profile": name,
                "method": method,
                "setting": setting,
                # A differential equation that its solver gave up has NaN.
                "worst error": f"{worst:.1e}" if np.isfinite(worst) else "not reached",
                "time of a point [us]": 1e6 * each,
                "first call [s]": first,
            }
            report("bench_grading", row)
        needed = layers_for(profile, q, expected, 1e-6)
        print(f"{name}: stepwise midpoint needs {needed} layers for 1e-6", flush=True)


if __name__ == "__main__":
    run(__doc__, grading)
