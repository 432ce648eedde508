"""Graded layers. One profile stands for all, so that each solver is one program."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from oracles import elasticities
from stored import Given, cases_of, complex_of, layered

import graded_contact as gc
from graded_contact.blocks.profile import Blend
from graded_contact.blocks.shapes import PowerLaw
from graded_contact.blocks.stack import GradedLayer, Stack
from graded_contact.response.layering import Layering
from graded_contact.response.riccati import Riccati

KINDS = ("linear", "sinusoidal", "exponential", "power law", "step")
# As stiff or soft as the bases `Rigid` and `Free` to the last digit of these layers.
BASES = {"rigid": 1e30, "free": 1e-30}
GROUND = np.array([1e6, 0.45 + 0j])  # all moduli are complex: one program for all


class Profile(eqx.Module):
    """E(s) = unit times a shape, and a Poisson's ratio that varies linearly."""

    shape: jax.Array
    parameter: jax.Array = 0.0
    width: jax.Array = 1.0
    unit: jax.Array = 1e6 + 0j
    bottom: jax.Array = 0.45
    top: jax.Array = 0.45
    reduced: jax.Array = False

    def __call__(self, s, omega):
        among = [self.shape == i for i in range(len(KINDS))]
        parameter, poisson = self.parameter, self.bottom + (self.top - self.bottom) * s
        shapes = [
            1 + parameter * s,
            1 + s + jnp.sin(2 * jnp.pi * s),
            jnp.exp(jnp.where(among[2], parameter, 0) * s),
            1 + 999 * s ** jnp.where(among[3], parameter, 1),
            10 ** jnp.tanh((s - parameter) / self.width),
        ]
        factor = jnp.where(self.reduced, 1 - poisson**2, 1)
        return self.unit * jnp.select(among, shapes) * factor, poisson


def program(solver, **how):
    """M_zz of one graded layer on a half space of given moduli."""

    @jax.jit
    def compliance(profile, depth, ground, q):
        layers, base = (GradedLayer(profile, depth),), gc.HalfSpace(Given(*ground))
        stack = Stack(layers=layers, base=base, graded_solver=solver)
        return gc.response.surface_compliance(stack, q, 0.0, **how)

    def of(kind, *numbers, depth=1e-4, ground=GROUND, q, **more):
        profile = Profile(KINDS.index(kind), *numbers, **more)
        given = jax.tree.map(np.asarray, (profile, depth, tuple(ground), q))
        return jax.device_get(compliance(*jax.tree.map(cast, given)))

    return of


def cast(x):
    return x if x.dtype == bool else x.astype(complex if np.iscomplexobj(x) else float)


checked = program(Layering(rtol=1e-10))  # of two waves
few_cells = program(Layering(num_cells=8), error=True)  # of sixty
by_steps = program(Riccati(), error=True)  # of two
two_layers = jax.jit(layered)


def test_stored_cases_are_met_and_the_estimate_of_the_error_is_honest():
    """mpmath at 50 digits: linear, sinusoidal and exponential, three bases, ν(s) and lossy E."""
    errors, estimates = [], []
    for case in cases_of("graded"):
        profile, poisson, base = case["profile"], case["nu"], case["substrate"]
        ends = [poisson] * 2 if isinstance(poisson, str) else [poisson["bottom"], poisson["top"]]
        moduli = [complex_of(base[k]) for k in ("E", "nu")] if "E" in base else None
        given = profile["kind"], float(profile.get("a", profile.get("k", 0)))
        how = dict(
            unit=complex_of(profile["E0"]),
            bottom=float(ends[0]),
            top=float(ends[1]),
            reduced=profile["of"] == "E_r",
            depth=float(case["depth"]),
            ground=moduli or (BASES[base["kind"]] + 0j, 0.3 + 0j),
        )
        expected, q = complex_of(case["M_zz"]), np.hypot(*map(float, case["q"]))
        np.testing.assert_allclose(checked(*given, q=np.full(2, q), **how), expected, rtol=1e-10)
        found, estimate = few_cells(*given, q=np.full(60, q), **how)
        errors.append(abs(found[0] / expected - 1))
        estimates.append(estimate[0])
    assert len(errors) == 32
    assert np.max(np.divide(errors, estimates)) <= 10


def test_a_constant_profile_is_a_uniform_layer_and_no_thickness_no_layer():
    q = np.geomspace(1e-1, 1e9, 60)  # q d from 1e-4 to 1e6
    layer = np.array([1e-3, 0.0]), np.array([2e6, 1e6 + 0j]), np.array([0.45, 0.3 + 0j])
    ground = tuple(GROUND)
    found, _ = few_cells("linear", 0.0, unit=2e6 + 0j, depth=1e-3, ground=ground, q=q)
    np.testing.assert_allclose(found, two_layers(q, *layer, ground), rtol=1e-12)
    found, _ = few_cells("linear", 3.0, depth=0.0, ground=ground, q=q)
    np.testing.assert_allclose(found, 2 * (1 - 0.45**2) / (1e6 * q), rtol=1e-12)


def test_derivatives_match_central_differences():
    """Of elastic ends, to compile fast: complex moduli go through the same recursion."""

    def value(profile, depth, q):
        layers, how = (GradedLayer(profile, depth),), Layering(num_cells=4)
        stack = Stack(layers=layers, base=gc.Rigid(), graded_solver=how)
        return jnp.log(gc.response.surface_compliance(stack, q, 0.0, error=True)[0].real)

    ends = gc.Elastic(2e6, 0.45), gc.Elastic(5e8, 0.3)
    profile = gc.Blend(*ends, PowerLaw(1.5), "logarithmic")
    arguments = jax.tree.map(jnp.asarray, (profile, 3e-4, 2e4))
    for slope, difference in elasticities(value, arguments, 1e-4):
        assert abs(difference - slope) <= 1e-6


def test_the_derivative_of_riccati_is_the_difference_of_layering():
    profile = Blend(gc.Elastic(1.0, 0.3), gc.Elastic(5.0, 0.4))
    ground = gc.HalfSpace(gc.Elastic(2.0, 0.2))

    def value(scale):
        layers, how = (GradedLayer(profile, 0.7),), Riccati(rtol=1e-7)
        stack = Stack(layers=layers, base=ground, graded_solver=how)
        moved = jax.tree.map(lambda leaf: leaf * scale, stack)
        return gc.response.surface_compliance(moved, 2.0, 0.0).real

    def layered_at(scale):
        """The same layer, all of whose numbers are scaled."""
        ends = dict(unit=scale + 0j, bottom=0.3 * scale, top=0.4 * scale)
        ground, q = scale * np.array([2, 0.2 + 0j]), np.full(2, 2.0)
        return checked("linear", 4.0, depth=0.7 * scale, ground=ground, q=q, **ends)[0].real

    slope = jax.jit(jax.grad(value))(1.0)
    difference = (layered_at(1 + 1e-4) - layered_at(1 - 1e-4)) / 2e-4
    np.testing.assert_allclose(slope, difference, rtol=1e-6)


def test_the_estimate_is_honest_for_steep_power_laws_at_all_wavelengths():
    q = 2 * np.pi / np.geomspace(1e-10, 40.0, 60)
    pairs = [(i, i + 30) for i in range(0, 30, 3)]
    for exponent in (20.0, 100.0):
        given = dict(unit=1e6 + 0j, bottom=0.3, top=0.3, depth=1e-2, ground=(1e6 + 0j, 0.3 + 0j))
        found, claim = few_cells("power law", exponent, q=q, **given)
        of_pairs = [by_steps("power law", exponent, q=q[[*pair]], **given) for pair in pairs]
        fine, rest = np.stack(of_pairs, axis=1).reshape(2, -1)
        compared = np.ravel(pairs)
        error = np.abs(found[compared] / fine - 1)
        assert np.max(error) > 1e-9
        assert np.all(error <= 3 * claim[compared] + rest.real)


def test_narrow_steps_are_met():
    """Against `Riccati`: no part of a step hides in a wide cell."""
    q = np.array([3e3, 1e5])
    for step in ((0.5, 1e-2), (0.884, 1e-4), (0.156, 3e-4), (0.7, 1e-5)):
        expected, rest = by_steps("step", *step, q=q)
        assert np.max(rest) <= 1e-9
        np.testing.assert_allclose(checked("step", *step, q=q), expected, rtol=1e-9)


def test_a_jump_is_met_or_an_error_and_its_claim_is_honest():
    """A step too narrow to be seen, at random wavenumbers, against two homogeneous layers."""
    random, ground, met = np.random.default_rng(0), tuple(GROUND), []
    for height in random.uniform(0.1, 0.97, 6):
        q = 10 ** random.uniform(2, 7, 60)
        layers = 1e-4 * np.array([1 - height, height]), [1e7 + 0j, 1e5 + 0j], [0.45 + 0j] * 2
        exact = np.asarray(two_layers(q, *map(np.asarray, layers), ground))
        found, claim = few_cells("step", height, 1e-15, q=q)
        assert np.all(np.abs(found / exact - 1) <= 3 * claim)
        for at in range(0, 60, 6):
            try:
                found = checked("step", height, 1e-15, q=q[at : at + 2])
            except Exception as error:
                assert "tolerance was not reached in a graded layer" in str(error)
                met.append(False)
            else:
                np.testing.assert_allclose(found, exact[at : at + 2], rtol=1e-9)
                met.append(True)
    assert 0.5 < np.mean(met) < 1
