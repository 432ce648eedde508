"""How often the standard errors of friction by a measured material enclose the truth.

    python benchmarks/bench_uncertainty.py

Synthetic data with errors of 2 %, each correlated with its neighbour by ρ (AR(1)), are fitted; the
friction is that of the mean field on a self-affine road. Counts how often the truth lies within 1
and 1.96 standard errors of `propagate`.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
from rows import report, run
from scipy.stats import binom

import graded_contact as gc
from graded_contact.fitting.master import master_curve

POISSON = 0.49
BRANCHES = 40  # of every material: one program serves fits of any length
Q0 = 2 * np.pi / 1e-2
ROAD = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=100 * Q0)
OMEGA = np.geomspace(1, 1e6, 40)
TEMPERATURES = (268.0, 278.0, 288.0, 298.0, 308.0, 323.0)
SWEEP = np.geomspace(0.1, 100, 15)
TWO = gc.Prony(1e6, [2e6, 1e7], [1e-2, 1e-4], POISSON)
FOUR = gc.Prony(
    3e6, [2e6, 9e6, 4e7, 1.5e8], [30.0, 0.3, 4e-3, 3e-5], POISSON,
    shift=gc.WLF(c1=6.0, c2=110.0, reference=298.0),
)  # fmt: skip
QUANTITIES = ("storage modulus", "loss modulus", "friction")


def padded(material):
    """The same material with `BRANCHES` branches: the last one is divided into equal parts."""
    more = BRANCHES - len(material.times)
    strengths = jnp.append(material.strengths[:-1], jnp.repeat(material.strengths[-1], more + 1))
    parts = jnp.ones(BRANCHES).at[-more - 1 :].set(1 / (more + 1))
    times = jnp.append(material.times, jnp.repeat(material.times[-1], more))
    return gc.Prony(material.equilibrium, strengths * parts, times, POISSON)


@jax.jit
def friction_of(material, pressure, velocities):
    stack = gc.Stack(base=gc.HalfSpace(material))

    def one(velocity):
        return gc.mean_field_friction(stack, ROAD, pressure=pressure, velocity=velocity).friction

    return jax.vmap(one)(velocities)


def coverage(sets=120):
    """Counts how often 1 and 1.96 standard errors enclose the truth."""

    def series(terms):
        return lambda noisy: gc.fit_prony(OMEGA, noisy(TWO, OMEGA), terms=terms, poisson=POISSON)

    def isotherms(noisy):
        sweeps = [(t, SWEEP, noisy(FOUR.at(t), SWEEP)) for t in TEMPERATURES]
        return master_curve(sweeps, reference=298.0, poisson=POISSON)

    cases = {
        "two branches, 40 points": (TWO, series(2), 6e5, 1e-2, 1e3),
        "the same, terms by BIC": (TWO, series(None), 6e5, 1e-2, 1e3),
        "six isotherms of 15 points": (FOUR, isotherms, 3e6, 3e-4, 10.0),
    }
    bands = [binom.interval(0.95, sets, p) for p in (0.6827, 0.95)]
    for (name, case), alike in itertools.product(cases.items(), (0.0, 0.5, 0.8)):
        off = np.array([deviation(*case, alike, seed) for seed in range(sets)])
        for quantity, column in zip(QUANTITIES, off.T, strict=True):
            cells = {"data": name, "ρ": alike, "sets": sets, "quantity": quantity}
            for reach, (low, high) in zip((1, 1.96), bands, strict=True):
                cells[f"within {reach} standard error [%]"] = 100 * np.mean(abs(column) < reach)
                expected = f"{100 * low / sets:.0f} to {100 * high / sets:.0f}"
                cells[f"expected for {reach} [%]"] = expected
            cells["bias over standard error"] = np.mean(column)
            report("bench_uncertainty-coverage", cells)


def deviation(truth, fit, pressure, velocity, omega, alike, seed):
    """Deviations of a fit to noisy data from the truth over their standard errors."""
    generator = np.random.default_rng(seed)

    def noisy(material, x):
        errors = 0.02 * generator.normal(size=(2, len(x)))
        for i in range(1, len(x)):
            errors[:, i] = alike * errors[:, i - 1] + np.sqrt(1 - alike**2) * errors[:, i]
        modulus = np.asarray(material.complex_modulus(x))
        return modulus.real * np.exp(errors[0]) + 1j * modulus.imag * np.exp(errors[1])

    def quantities(material):
        modulus = material.complex_modulus(jnp.array([omega]))
        friction = friction_near(padded(material), pressure, velocity)
        return jnp.log(jnp.concatenate([modulus.real, modulus.imag, friction[None]]))

    found = gc.propagate(quantities, fit(noisy))
    return (found.value - quantities(truth)) / found.standard_error


def friction_near(material, pressure, velocity):
    """Friction with its first derivatives, by one program for all fits."""
    here = jax.lax.stop_gradient(material)
    value, slopes = friction_and_slopes(here, pressure, np.array(velocity))
    changes = jax.tree.map(lambda s, a, b: jnp.sum(s * (a - b)), slopes, material, here)
    return value + sum(jax.tree.leaves(changes))


@jax.jit
def friction_and_slopes(material, pressure, velocity):
    return jax.value_and_grad(lambda m: friction_of(m, pressure, velocity[None])[0])(material)


if __name__ == "__main__":
    run(__doc__, coverage)
