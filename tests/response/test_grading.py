import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import elasticities
from stored import Given, cases_of, complex_of

import graded_contact as gc
from graded_contact.blocks.profile import Blend
from graded_contact.blocks.shapes import PowerLaw, Table
from graded_contact.blocks.stack import GradedLayer, Stack
from graded_contact.response.compliance import surface_compliance
from graded_contact.response.layering import Layering
from graded_contact.response.riccati import Riccati

CASES = cases_of("graded")
# Half of the compilation, where no second attempt is expected.
FAST = Layering(num_cells=16)
KINDS, BASES = ("linear", "sinusoidal", "exponential"), ("halfspace", "rigid", "free")


class Stored(eqx.Module):
    """The profiles of the stored cases, in one formula so that all run in one batch."""

    kind: jax.Array
    unit: jax.Array
    parameter: jax.Array
    bottom: jax.Array
    top: jax.Array
    reduced: jax.Array

    def __call__(self, s, omega):
        shapes = [
            1 + self.parameter * s,
            1 + s + jnp.sin(2 * jnp.pi * s),
            jnp.exp(jnp.where(self.kind == 2, self.parameter, 0) * s),
        ]
        poisson = self.bottom + (self.top - self.bottom) * s
        factor = jnp.where(self.reduced, 1 - poisson**2, 1)
        return self.unit * jnp.select([self.kind == i for i in range(3)], shapes) * factor, poisson


def arguments(case):
    profile, poisson, base = case["profile"], case["nu"], case["substrate"]
    ends = [poisson] * 2 if isinstance(poisson, str) else [poisson["bottom"], poisson["top"]]
    stored = Stored(
        kind=KINDS.index(profile["kind"]),
        unit=complex_of(profile["E0"]),
        parameter=float(profile.get("a", profile.get("k", 0))),
        bottom=float(ends[0]),
        top=float(ends[1]),
        reduced=profile["of"] == "E_r",
    )
    below = [complex_of(base[k]) for k in ("E", "nu")] if "E" in base else [1 + 0j, 0.3 + 0j]
    q = np.hypot(float(case["q"][0]), float(case["q"][1]))
    return stored, float(case["depth"]), Given(*below), q


def by(solver, stack):
    """The stack, solved by another solver of graded layers."""
    return dataclasses.replace(stack, graded_solver=solver)


def stack_under(kind, profile, depth, material):
    base = {"rigid": gc.Rigid(), "free": gc.Free(), "halfspace": gc.HalfSpace(material)}
    return Stack(layers=(GradedLayer(profile, depth),), base=base[kind])


def stored(kind):
    """The cases of one kind of base, and the arguments of their stacks in one batch."""
    cases = [c for c in CASES if c["substrate"]["kind"] == kind]
    return cases, jax.tree.map(lambda *xs: jnp.array(xs), *map(arguments, cases))


def errors_and_estimates(solver):
    """For all stored cases, one batch for each kind of base."""
    errors, estimates = [], []
    for kind in BASES:
        cases, batch = stored(kind)

        def one(profile, depth, material, q, kind=kind):
            stack = stack_under(kind, profile, depth, material)
            return surface_compliance(by(solver, stack), q, 0.0, error=True)

        found = jax.jit(jax.vmap(one))(*batch)
        expected = np.array([complex_of(c["M_zz"]) for c in cases])
        errors.append(np.abs(found[0] - expected) / np.abs(expected))
        estimates.append(found[1])
    return np.concatenate(errors), np.concatenate(estimates)


def test_stored_cases_are_met_and_the_estimate_of_the_error_is_honest():
    """mpmath at 50 digits: linear, sinusoidal and exponential, three bases, ν(s) and lossy E."""
    errors, estimates = errors_and_estimates(FAST)
    assert len(errors) == 32
    assert np.max(errors) <= 1e-10
    assert np.max(estimates) <= 1e-10
    assert np.max(errors / estimates) <= 10


def test_a_constant_profile_is_a_uniform_layer_and_no_thickness_no_layer():
    q = np.geomspace(1e-1, 1e9, 12)  # q d from 1e-4 to 1e6
    rubber, glass = gc.Elastic(2e6, 0.49), gc.Elastic(5e8, 0.3)
    coat, layer = gc.Layer(glass, 1e-5), gc.Layer(rubber, 1e-3)
    none, constant = (
        GradedLayer(Blend(rubber, glass), 0.0),
        GradedLayer(Blend(rubber, rubber), 1e-3),
    )
    graded = Stack(layers=(coat, none, constant), base=gc.Free())
    found = surface_compliance(by(Layering(16, 1e-7), graded), q, 0.0)
    expected = surface_compliance(Stack(layers=(coat, layer), base=gc.Free()), q, 0.0)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_gradient_by_every_leaf_matches_central_differences():
    """Of elastic ends, to compile fast: complex moduli go through the same recursion."""
    shape = Table([0.0, 0.4, 1.0], [0.1, 0.5, 0.8])
    profile = Blend(gc.Elastic(2e6, 0.45), gc.Elastic(5e8, 0.3), shape, "logarithmic")
    stack = Stack(layers=(GradedLayer(profile, 3e-4),), base=gc.Rigid())

    def value(stack, q):
        few = by(Layering(num_cells=4), stack)
        return jnp.log(surface_compliance(few, q, 0.0, error=True)[0])

    # The ends of the table are 0 and 1.
    for slope, difference in elasticities(value, (stack, jnp.asarray(2e4)), 1e-4, (0.0, 1.0)):
        assert abs(difference - slope) <= 1e-6


def test_both_solvers_have_the_same_gradient():
    profile = Blend(gc.Elastic(1.0, 0.3), gc.Elastic(5.0, 0.4))

    def slopes(solver):
        stack = Stack(
            layers=(GradedLayer(profile, 0.7),),
            base=gc.HalfSpace(gc.Elastic(2.0, 0.2)),
            graded_solver=solver,
        )
        return jax.grad(lambda stack: surface_compliance(stack, 2.0, 0.0).real)(stack)

    found, expected = map(jax.tree.leaves, map(slopes, (Riccati(rtol=1e-6), Layering(rtol=1e-6))))
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_estimate_is_honest_for_steep_power_laws_at_all_wavelengths():
    q = 2 * jnp.pi / jnp.geomspace(1e-10, 40.0, 48)
    ends = gc.Elastic(1e6, 0.3), gc.Elastic(1e9, 0.3)
    for exponent in (20.0, 100.0):
        profile = Blend(*ends, PowerLaw(exponent))
        stack = Stack(layers=(GradedLayer(profile, 1e-2),), base=gc.HalfSpace(ends[0]))
        (found, claim), (fine, rest) = (
            surface_compliance(by(Layering(num_cells=n), stack), q, 0.0, error=True)
            for n in (4, 120)
        )
        error = np.abs(found / fine - 1)
        assert np.max(error) > 1e-6
        assert np.all(error <= 3 * claim + rest)


def test_tolerance_that_is_not_reached_is_an_error():
    def rough(s, omega):
        return 1e6 * (1 + jnp.abs(jnp.sin(9 * s))), 0.3

    stack = Stack(layers=(GradedLayer(rough, 1e-3),), base=gc.Rigid())
    assert surface_compliance(stack, 3e3, 0.0, error=True)[1] > 1e-9
    with pytest.raises(Exception, match="tolerance was not reached in a graded layer"):
        surface_compliance(stack, 3e3, 0.0).block_until_ready()


class Step(eqx.Module):
    height: jax.Array
    width: jax.Array

    def __call__(self, s, omega):
        return 10 ** (6 + jnp.tanh((s - self.height) / self.width)), 0.45


def test_narrow_steps_are_met():
    """Against `Riccati`, between two uniform layers: no part of a step hides in a wide cell."""
    q = np.array([3e3, 1e5])

    @jax.jit
    def by_both(height, width):
        coat, ground = gc.Layer(gc.Elastic(1e8, 0.3), 1e-5), gc.Layer(gc.Elastic(3e6, 0.4), 1e-4)
        layers = coat, GradedLayer(Step(height, width), 1e-4), ground
        stack = Stack(layers=layers, base=gc.HalfSpace(gc.Elastic(1e6, 0.45)))
        return [surface_compliance(by(how, stack), q, 0.0, error=True) for how in (None, Riccati())]

    for height, width in ((0.5, 1e-2), (0.884, 1e-4), (0.156, 3e-4), (0.7, 1e-5)):
        (found, claim), (expected, rest) = by_both(height, width)
        assert np.max(claim) <= 1e-9 and np.max(rest) <= 1e-9
        np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_a_jump_is_met_or_its_claim_says_that_it_is_not():
    """A step too narrow to be seen, at random wavenumbers, against two homogeneous layers."""
    random = np.random.default_rng(0)
    soft, stiff = gc.Elastic(1e5, 0.45), gc.Elastic(1e7, 0.45)

    @jax.jit
    def by_both(height, q):
        graded = stack_under("halfspace", Step(height, 1e-15), 1e-4, gc.Elastic(1e6, 0.45))
        layers = gc.Layer(stiff, 1e-4 * (1 - height)), gc.Layer(soft, 1e-4 * height)
        exact = surface_compliance(Stack(layers=layers, base=graded.base), q, 0.0)
        return *surface_compliance(graded, q, 0.0, error=True), exact

    met = []
    for height in random.uniform(0.1, 0.97, 6):
        found, claim, exact = by_both(height, 10 ** random.uniform(2, 7, 60))
        assert np.all(np.abs(found / exact - 1) <= 3 * claim)
        met.append(claim <= 1e-9)
    assert np.mean(met) > 0.6
