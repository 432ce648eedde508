"""Materials against direct sums in mpmath, time-domain quadrature and SciPy's PCHIP."""

from functools import partial

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import elasticities
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

from graded_contact import WLF, Arrhenius, Elastic, Prony, Tabulated

EXAMPLES = settings(max_examples=60)
BRANCHES = 7
GLASSY = st.floats(3, 10).map(lambda power: 10.0**power)
POWERS = st.lists(st.floats(-9, 0), min_size=BRANCHES, max_size=BRANCHES).map(
    lambda powers: 10.0 ** np.array(powers)
)
# Up to 17 decades of times, neighbours at least a factor 1.5 apart, in any order.
TIMES = st.tuples(
    st.lists(st.floats(0.18, 2.8), min_size=BRANCHES, max_size=BRANCHES),
    st.permutations(range(BRANCHES)),
).map(lambda steps: 10.0 ** (-14 - 2.8 + np.cumsum(steps[0]))[list(steps[1])])
OMEGA = st.floats(-20, 20).map(lambda power: 10.0**power)

modulus_of = jax.jit(lambda material, omega: material.complex_modulus(omega))
from_creep = jax.jit(Prony.from_creep)
creep_of = jax.jit(lambda material: material.creep())


def exact_sum(branch, first, values, times, omega):
    """The first number and the branches, by direct summation."""
    numbers = zip(map(mp.mpf, map(float, values)), map(mp.mpf, map(float, times)), strict=True)
    omega = mp.mpf(float(omega))
    return mp.mpf(float(first)) + sum(e * branch(mp.mpc(0, omega * t)) for e, t in numbers)


exact_prony = partial(exact_sum, lambda iwt: iwt / (1 + iwt))


def exact_compliance(glassy, compliances, times, omega):
    total = exact_sum(lambda iwt: 1 / (1 + iwt), 0, compliances, times, omega)
    return total + 1 / mp.mpf(float(glassy))


def parts_of(values):
    return jnp.stack([values.real, values.imag])


def two_branches(**changes):
    fields = {"equilibrium": 2e6, "strengths": [5e6, 3e7], "times": [1e-2, 1e-5], "poisson": 0.48}
    return Prony(**(fields | changes))


@pytest.mark.parametrize(
    "omega", [1e-200, 1e-30, 1e-3, 0.5, 1.0, 7.0, 1e5, 1e30, 1e160, 1e200, 1e300]
)
@pytest.mark.parametrize("times", [[1e-5, 1.0, 1e4], [1e-100, 1.0, 1e100], [0.9, 1.0, 1.1]])
def test_prony_modulus_matches_direct_sum(omega, times):
    material = Prony(3e6, [1e7, 2e5, 4e8], times)
    with mp.workdps(50):
        for signed in (omega, -omega):
            value = complex(material.complex_modulus(jnp.array(signed)))
            expected = exact_prony(3e6, [1e7, 2e5, 4e8], times, signed)
            assert abs(value.real / expected.real - 1) < 1e-15
            # Relative to itself: a loss of 1e-190 Pa must not drown, but may underflow.
            assert abs(value.imag - expected.imag) <= 1e-15 * abs(expected.imag) + 1e-300


def test_modulus_at_rest_is_the_equilibrium_and_at_infinite_speed_the_glass():
    material = two_branches()
    value = material.complex_modulus(jnp.array([0.0, jnp.inf, -jnp.inf]))
    np.testing.assert_array_equal(value, [2e6, 3.7e7, 3.7e7])
    assert material.glassy == 3.7e7


@pytest.mark.parametrize("omega", [1.0, 90.0, 3e4])
def test_prony_modulus_matches_relaxation_integral(omega):
    """E(ω) = E_eq + iω ∫ (E(t) - E_eq) exp(-iωt) dt over t > 0."""
    strengths, times = [5e6, 3e7], [1e-2, 1e-5]

    def relaxation(t):
        return sum(e * np.exp(-t / tau) for e, tau in zip(strengths, times, strict=True))

    parts = [
        sum(quad(relaxation, *ends, weight=kind, wvar=omega, limit=200)[0]
            for ends in ((0, 1e-4), (1e-4, 1e-2), (1e-2, 0.4)))
        for kind in ("cos", "sin")
    ]  # fmt: skip
    expected = 2e6 + 1j * omega * (parts[0] - 1j * parts[1])
    np.testing.assert_allclose(
        two_branches().complex_modulus(jnp.array(omega)), expected, rtol=1e-8
    )


@EXAMPLES
@given(GLASSY, POWERS, TIMES, OMEGA)
def test_prony_is_passive_and_real_in_time(scale, strengths, times, omega):
    material = Prony(scale * 1e-3, scale * strengths, times)
    forward, backward, slower = modulus_of(material, jnp.array([omega, -omega, omega / 3]))
    assert backward == jnp.conj(forward)
    assert forward.imag >= 0
    assert material.equilibrium <= slower.real <= forward.real <= material.glassy * (1 + 1e-15)


@EXAMPLES
@given(GLASSY, POWERS, TIMES, OMEGA)
def test_from_creep_modulus_times_creep_compliance_is_one(glassy, ratios, times, omega):
    compliances = 1e3 * ratios / glassy
    value = modulus_of(from_creep(glassy, compliances, times), jnp.array(omega))
    with mp.workdps(40):
        product = mp.mpc(complex(value)) * exact_compliance(glassy, compliances, times, omega)
        assert abs(product - 1) < 3e-15


@EXAMPLES
@given(GLASSY, POWERS, TIMES)
def test_from_creep_undoes_creep(equilibrium, ratios, times):
    strengths = 1e3 * equilibrium * ratios
    back = from_creep(*creep_of(Prony(equilibrium, strengths, times)))
    order = np.argsort(-times)
    np.testing.assert_allclose(back.equilibrium, equilibrium, rtol=1e-12)
    np.testing.assert_allclose(back.strengths, strengths[order], rtol=1e-12)
    np.testing.assert_allclose(back.times, times[order], rtol=1e-12)


@pytest.mark.parametrize("weak", [1e-8, 1e-16, 1e-30, 1e-100])
@pytest.mark.parametrize("times", [[1.0, 1e-3], [1e-3, 1.0], [1.0, 1 + 1e-9]])
def test_negligible_branches_stay_negligible(weak, times):
    """Their zeros coincide with poles to rounding; they must not become strong branches."""
    values, times = jnp.array([1.0, weak]), jnp.array(times)
    material = from_creep(1.0, values, times)
    glassy, compliances, _ = creep_of(Prony(1.0, values, times))
    with mp.workdps(150):
        for omega in (0.3, 1.0, 1e3):
            compliance = exact_compliance(1.0, [1.0, weak], times, omega)
            value = mp.mpc(complex(modulus_of(material, jnp.array(omega))))
            assert abs(value * compliance - 1) < 3e-15
    assert glassy == 2 + weak
    assert jnp.min(compliances) < 2 * weak


def numbers_of_creep(*prony):
    glassy, compliances, times = Prony(*prony).creep()
    return jnp.log(glassy) + jnp.log(compliances) @ jnp.array([1.0, 2.0]) + times[0]


@pytest.mark.parametrize(
    "function, point",
    [
        (lambda *x: Prony(*x).complex_modulus(1.2).real, [0.1, 1.0, 2.0, -0.5, 0.8]),
        (lambda *x: Prony(*x).complex_modulus(1.2).imag, [0.1, 1.0, 2.0, -0.5, 0.8]),
        (
            lambda *x: Prony.from_creep(*x).complex_modulus(0.7).real / 5,
            [1.0, 0.3, -0.5, -1.5, 1.8],
        ),
        (
            lambda *x: Prony.from_creep(*x).complex_modulus(0.7).imag / 5,
            [1.0, 0.3, -0.5, -1.5, 1.8],
        ),
        (numbers_of_creep, [0.2, 0.5, 1.0, -1.0, 1.0]),
    ],
)
def test_gradients_of_moduli_and_creep_match_differences(function, point):
    """By the logarithms of the modulus, of two strengths and of two times."""
    x = jnp.exp(jnp.array(point))
    slopes, differences = np.transpose(elasticities(function, (x[0], x[1:3], x[3:5])))
    np.testing.assert_allclose(slopes, differences, rtol=1e-7, atol=1e-8)


def test_elastic_modulus_is_the_same_real_number_at_every_frequency():
    material = Elastic(2e6, 0.3)
    value = material.complex_modulus(jnp.array([[0.0, -1e3, 1e300]]))
    np.testing.assert_array_equal(value, np.full((1, 3), 2e6))
    assert not jnp.iscomplexobj(value) and material.at(300.0) is material
    assert jax.grad(lambda m: m.complex_modulus(jnp.ones(4)).sum())(material).modulus == 4


SHIFTS = [WLF(c1=4.57, c2=113.6, reference=298.15), Arrhenius(8e4, 298.15)]


def test_shift_factors_are_their_definitions():
    wlf, arrhenius = (float(shift.factor(jnp.array(273.15))) for shift in SHIFTS)
    assert wlf == pytest.approx(10 ** (4.57 * 25 / (113.6 - 25)), rel=1e-14)
    assert np.log10(wlf) == pytest.approx(1.29, abs=0.005)  # Ferry's SBR at 0 °C
    expected = np.exp(8e4 / 8.31446261815324 * (1 / 273.15 - 1 / 298.15))
    assert arrhenius == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("shift", SHIFTS, ids=["wlf", "arrhenius"])
def test_shift_is_one_at_reference_and_composes(shift):
    assert shift.factor(shift.reference) == 1
    warm, hot = jnp.array(280.0), jnp.array(330.0)
    chained = shift.factor(warm) * shift.rebased(warm).factor(hot)
    np.testing.assert_allclose(chained, shift.factor(hot), rtol=1e-13)
    assert shift.rebased(warm).factor(warm) == 1
    assert shift.factor(warm) > 1 > shift.factor(hot)


@pytest.mark.parametrize("shift", SHIFTS, ids=["wlf", "arrhenius"])
def test_temperature_moves_the_modulus_along_frequency(shift):
    omega = jnp.logspace(-2, 6, 9)
    nodes = jnp.logspace(-12, 16, 60)
    material = two_branches(shift=shift)
    table = Tabulated(nodes, material.complex_modulus(nodes), 0.48, shift=shift)
    factor = shift.factor(jnp.array(268.15))
    for original in (material, table):
        cold = original.at(268.15)
        np.testing.assert_allclose(
            modulus_of(cold, omega), modulus_of(original, factor * omega), rtol=1e-12
        )
        twice, once = original.at(350.0).at(268.15), cold
        for a, b in zip(jax.tree.leaves(twice), jax.tree.leaves(once), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12)
    cold = material.at(268.15)
    np.testing.assert_allclose(cold.at(shift.reference).times, material.times, rtol=1e-13)


VOGEL = 298.15 - 113.6


def test_a_body_so_cold_that_its_shift_overflows_is_glassy_with_finite_derivatives():
    """A series with the WLF law, and a table with the law of Arrhenius."""
    wlf, arrhenius = SHIFTS[0], Arrhenius(2e6, 298.15)
    table = Tabulated(TABLE_OMEGA, TABLE_MODULUS, shift=arrhenius)
    bodies = (two_branches(shift=wlf), 2e6, 3.7e7, VOGEL + 1e-3), (table, 1e6, 9e6, 100.0)
    for body, relaxed, glassy, temperature in bodies:
        assert np.isinf(body.shift.factor(temperature))
        parts = jax.jit(lambda body, t, w: parts_of(body.at(t).complex_modulus(w)))
        slopes = jax.jit(jax.jacrev(parts, (0, 1, 2)))
        for omega, expected in ((0.0, relaxed), (1e-6, glassy), (-1e9, glassy)):
            found = parts(body, temperature, omega)
            np.testing.assert_allclose(found, [expected, 0], rtol=1e-14, atol=1e-100)
            for leaf in jax.tree.leaves(slopes(body, temperature, omega)):
                assert np.all(np.isfinite(leaf))
        # Its times cannot be kept: a way back would be silently wrong.
        with pytest.raises(ValueError, match="`temperature` cannot be changed again"):
            body.at(temperature).at(298.15)
        back = jax.jit(lambda body, t: body.at(t).at(298.15).complex_modulus(1.0))
        assert np.all(np.isnan(back(body, temperature)))


def test_wlf_has_no_answer_below_its_vogel_temperature_where_tracing_hides_it():
    times = jax.jit(lambda t: two_branches(shift=SHIFTS[0]).at(t).times)
    assert np.all(np.isnan(times(VOGEL - 1.0)))
    assert np.all(np.isfinite(times(VOGEL + 1.0)))


TABLE_OMEGA = np.array([1e-2, 1e-1, 0.5, 7.0, 1e2, 3e4])
TABLE_MODULUS = np.array([1 + 0.1j, 1.3 + 0.3j, 2 + 0.8j, 6 + 0.7j, 5.5 + 0.75j, 9 + 0.1j]) * 1e6


def test_tabulated_matches_scipy_pchip():
    table = Tabulated(TABLE_OMEGA, TABLE_MODULUS)
    omega = np.concatenate([np.geomspace(1e-2, 3e4, 301), TABLE_OMEGA])
    omega = np.clip(omega, 1e-2, 3e4)
    value = modulus_of(table, jnp.asarray(omega))
    for part in ("real", "imag"):
        spline = PchipInterpolator(np.log(TABLE_OMEGA), np.log(getattr(TABLE_MODULUS, part)))
        np.testing.assert_allclose(getattr(value, part), np.exp(spline(np.log(omega))), rtol=1e-13)
    np.testing.assert_allclose(value[-6:], TABLE_MODULUS, rtol=1e-14)
    np.testing.assert_array_equal(modulus_of(table, -jnp.asarray(omega)), np.conj(value))


def test_tabulated_plateau_extends_like_a_single_relaxation():
    table = Tabulated(TABLE_OMEGA, TABLE_MODULUS)
    value = modulus_of(table, jnp.array([1e-5, 3e7, -3e7]))
    np.testing.assert_allclose(value[0], 1e6 + 0.1e6j * 1e-3, rtol=1e-13)
    np.testing.assert_allclose(value[1], 9e6 + 0.1e6j * 1e-3, rtol=1e-13)
    assert value[2] == jnp.conj(value[1])
    extremes = modulus_of(table, jnp.array([0.0, 1e-300, 1e300]))
    assert np.all(np.isfinite(extremes)) and np.all(extremes.imag >= 0)


def test_tabulated_at_rest_is_elastic():
    table = Tabulated(TABLE_OMEGA, TABLE_MODULUS)
    np.testing.assert_allclose(modulus_of(table, jnp.array(0.0)), 1e6, rtol=1e-14)
    slope = jax.jit(jax.grad(lambda m: m.complex_modulus(jnp.zeros(2)).real.sum()))(table)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slope))
