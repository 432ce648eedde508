"""What is known of a material reaches what follows from it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.core.parameters import paths
from graded_contact.studies.uncertainty import propagate, sensitivity

TRUTH = gc.Prony(1e6, [2e6, 1e7], [1e-2, 1e-4], 0.49)
OMEGA = np.geomspace(1, 1e6, 40)
Q0 = 2 * np.pi / 0.01
SPECTRUM = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=Q0, q_roll=3 * Q0, q_high=50 * Q0)


def test_any_number_of_a_stack_may_have_a_spread():
    """Against the scatter over stacks drawn at random."""
    rubber = gc.Layer(gc.Elastic(2e6, 0.45), 50e-6)
    stack = gc.Stack(layers=[rubber], base=gc.HalfSpace(gc.Elastic(1e7, 0.3)))
    deviations = {"layers[0].thickness": 1e-6, "layers[0].material.modulus": 4e4}
    deviations["base.material.poisson"] = 0.01
    q = jnp.array([1e4, 3e4, 1e5])
    compliance = lambda stack: gc.surface_compliance(stack, q, 0.0).real  # noqa: E731
    found = propagate(compliance, deviations, stack)
    draws = np.random.default_rng(0).normal(size=(2000, len(deviations)))

    def drawn(steps):
        values = {
            path: paths(stack)[path] + step * deviation
            for (path, deviation), step in zip(deviations.items(), steps, strict=True)
        }
        return compliance(gc.with_values(stack, values))

    scatter = np.std(jax.jit(jax.vmap(drawn))(jnp.asarray(draws)), axis=0)
    # That of 2000 draws is known to 1.6 %; the second order is a few parts in a thousand.
    np.testing.assert_allclose(found.standard_error, scatter, rtol=0.06)
    np.testing.assert_allclose(found.value, compliance(stack), rtol=1e-12)
    for wrong in ({"layers[0].thicknes": 1e-6}, {"layers[0].thickness": -1e-6}):
        with pytest.raises(ValueError, match="layers"):
            propagate(compliance, wrong, stack)


def test_a_fit_carries_its_errors():
    values = np.asarray(TRUTH.complex_modulus(OMEGA))
    noisy = values * np.random.default_rng(1).lognormal(sigma=0.02, size=40)
    fit = gc.fit_prony(OMEGA, noisy, terms=2, poisson=0.49)
    at = lambda material: material.complex_modulus(jnp.array([30.0])).imag  # noqa: E731
    whole = propagate(at, fit)
    lower, upper = fit.confidence([30.0], level=0.6827)
    limits = (np.log(upper.imag) - np.log(lower.imag)) / 2
    np.testing.assert_allclose(whole.standard_error / whole.value, limits, rtol=0.05)


def test_what_decides_friction_adds_up_to_what_pressure_does():
    """Moduli and pressure all times a factor leave the friction of a half space as it is."""

    @jax.jit
    def friction(material, pressure=1e5):
        stack = gc.Stack(base=gc.HalfSpace(material))
        return gc.mean_field_friction(stack, SPECTRUM, pressure=pressure, velocity=0.1).friction

    omega = np.geomspace(1e-2, 1e8, 61)
    found = sensitivity(friction, TRUTH, omega)
    total = np.trapezoid(found.storage + found.loss, np.log10(omega))
    table = gc.Tabulated(omega, TRUTH.complex_modulus(omega), 0.49)
    ends = [np.log(friction(table, 1e5 * (1 + step))) for step in (1e-4, -1e-4)]
    by_pressure = (ends[0] - ends[1]) / 2e-4
    np.testing.assert_allclose(total, -by_pressure, rtol=1e-3)
    assert np.trapezoid(found.loss, np.log10(omega)) > 0.5  # friction is loss
    excited = 0.1 * np.array([Q0, 50 * Q0])
    beyond = (omega < excited[0] / 30) | (omega > 30 * excited[1])
    assert np.all(np.abs(found.loss[beyond]) < 1e-3 * np.max(found.loss))
    i, step, width = int(np.argmax(found.loss)), 1e-4, np.log10(omega[1] / omega[0])
    for part in ("storage", "loss"):
        below, above = (
            np.log(friction(eqx.tree_at(where, table, where(table).at[i].mul(np.exp(change))), 1e5))
            for change in (-step, step)
            for where in [lambda table, part=part: getattr(table, part)]
        )
        difference = (above - below) / (2 * step) / width
        np.testing.assert_allclose(getattr(found, part)[i], difference, rtol=1e-4)
