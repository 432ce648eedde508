"""Fits recover known series, reach optima that SciPy cannot better, and refuse nonsense."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from oracles import maxwell as modulus
from scipy import stats
from scipy.optimize import least_squares

import graded_contact as gc
from graded_contact import fit_prony

# Loops of a fit call small functions a hundred thousand times. Other tests of fits check them all.
pytestmark = pytest.mark.usefixtures("unchecked_types")
fit_relaxation, fit_creep = (partial(fit_prony, kind=kind) for kind in ("relaxation", "creep"))
FITS = {"frequency": fit_prony, "relaxation": fit_relaxation, "creep": fit_creep}
START = 5e6  # E_eq [Pa] of moduli; its reciprocal is the glassy compliance of a creep form
STRENGTHS = np.array([2e7, 6e6, 9e7])  # [Pa]
COMPLIANCES = np.array([3e-8, 9e-7, 1.2e-7])  # [1/Pa]
TIMES = np.array([30.0, 0.2, 1e-3])  # [s]
OMEGA = np.geomspace(1e-3, 1e5, 60)
TIME = np.geomspace(1e-5, 1e3, 60)


def relaxation(time, equilibrium, strengths, times):
    return equilibrium + np.exp(-np.divide.outer(time, times)) @ strengths


def compliance(time, glassy, compliances, times):
    return 1 / glassy + (1 - np.exp(-np.divide.outer(time, times))) @ compliances


def measured(kind, terms=3):
    """Abscissa and noise-free values of the first `terms` branches."""
    if kind == "frequency":
        return OMEGA, modulus(OMEGA, START, STRENGTHS[:terms], TIMES[:terms])
    if kind == "relaxation":
        return TIME, relaxation(TIME, START, STRENGTHS[:terms], TIMES[:terms])
    return TIME, compliance(TIME, START, COMPLIANCES[:terms], TIMES[:terms])


def noisy(values, size, seed=0):
    draw = np.random.default_rng(seed)
    lines = np.exp(size * draw.standard_normal((2, len(values))))
    if np.iscomplexobj(values):
        return values.real * lines[0] + 1j * values.imag * lines[1]
    return values * lines[0]


def channels(values):
    parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    return np.concatenate(parts)


def log_residual(theta, kind, x, values):
    """ln model/measured of θ = ln (strengths, times, and the value without branches)."""
    terms = len(theta) // 2
    strengths, times, start = np.exp(theta[:terms]), np.exp(theta[terms:-1]), np.exp(theta[-1])
    model = {
        "frequency": lambda: modulus(x, start, strengths, times),
        "relaxation": lambda: relaxation(x, start, strengths, times),
        "creep": lambda: compliance(x, 1 / start, strengths, times),
    }[kind]()
    return np.log(channels(model) / channels(values))


def unknowns(fit):
    """θ of `log_residual`."""
    material = fit.material
    start, strengths, times = material.equilibrium, material.strengths, material.times
    if fit.data.kind == "creep":
        glassy, strengths, times = material.creep()
        start = 1 / glassy
    return np.log(np.concatenate([strengths, times, start[None]]))


def young(material, omega=OMEGA):
    """E(ω) of the numbers in a Prony series."""
    parts = material.equilibrium, material.strengths, material.times
    return modulus(omega, *map(np.asarray, parts))


def spread(fit, material, omega=OMEGA):
    """Greatest log distance of the fitted storage and loss moduli from those of `material`."""
    ratio = channels(young(fit.material, omega)) / channels(young(material, omega))
    return np.max(np.abs(np.log(ratio)))


@pytest.fixture(scope="module")
def tread():
    """A tyre tread over eight decades with 2 % of noise: omega, modulus, and its fit."""
    omega = np.geomspace(1e-2, 1e6, 80)
    values = noisy(young(gc.tyre_tread(), omega), 0.02)
    return omega, values, fit_prony(omega, values)


# Recovery ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", FITS)
def test_a_series_without_noise_is_recovered(kind):
    terms = 3
    x, values = measured(kind, terms)
    fit = FITS[kind](x, values, poisson=0.4)
    assert fit.terms == terms and float(fit.poisson) == 0.4
    assert fit.errors()["total"] < 1e-7
    strengths = COMPLIANCES if kind == "creep" else STRENGTHS
    expected = [strengths[:terms], TIMES[:terms], [1 / START if kind == "creep" else START]]
    found = np.exp(unknowns(fit))
    np.testing.assert_allclose(found, np.concatenate(expected), rtol=1e-5)
    assert fit.material.poisson == 0.4
    np.testing.assert_allclose(np.ravel(fit.predict(x)), channels(values), rtol=1e-6)
    if kind == "creep":  # the relaxation form is the exact reciprocal
        creep = (1 / (1 + 1j * np.multiply.outer(OMEGA, TIMES[:terms]))) @ COMPLIANCES[:terms]
        np.testing.assert_allclose(
            fit.material.complex_modulus(OMEGA), 1 / (1 / START + creep), rtol=1e-6
        )


def test_a_constant_is_a_spring():
    modulus, compliance = fit_relaxation(TIME, np.full(60, 3e6)), fit_creep(TIME, np.full(60, 2e-7))
    for fit, stiffness in ((modulus, 3e6), (compliance, 5e6)):
        assert fit.terms == 0
        np.testing.assert_allclose(young(fit.material), stiffness, rtol=1e-9)


# Optimality -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", FITS)
def test_no_other_least_squares_gets_lower(kind):
    """SciPy from the fit, and from twenty starts around the truth, finds nothing better."""
    x, values = measured(kind)
    values = noisy(values, 0.03)
    fit = FITS[kind](x, values, terms=3)
    found = unknowns(fit)
    lowest = np.sum(log_residual(found, kind, x, values) ** 2)
    draw = np.random.default_rng(1)
    for size in [0.0, *[1.0] * 20]:
        start = found + size * draw.standard_normal(len(found))
        other = least_squares(log_residual, start, args=(kind, x, values), xtol=1e-12, ftol=1e-12)
        assert lowest <= 2 * other.cost * (1 + 1e-10)
    np.testing.assert_allclose(fit.errors()["total"], np.sqrt(lowest / values.size / (
        1 + np.iscomplexobj(values))), rtol=1e-9)  # fmt: skip


# The number of terms ----------------------------------------------------------------------------


def test_the_path_has_every_length_and_the_least_criterion_is_chosen(tread):
    omega, values, fit = tread
    lengths = [length.terms for length in fit.path]
    assert lengths == list(range(lengths[0], lengths[-1] + 1)) and lengths[0] == 1
    errors = np.array([length.error for length in fit.path])
    assert np.all(np.diff(errors) <= 1e-4 * errors[1:])
    count = 2 * len(values)
    criteria = count * np.log(errors**2) + (2 * np.array(lengths) + 1) * np.log(count)
    np.testing.assert_allclose([length.bic for length in fit.path], criteria, rtol=1e-6)
    assert fit.terms == lengths[np.argmin(criteria)]
    length = fit.path[4]
    alone = fit_prony(omega, values, terms=length.terms)
    assert alone.terms == length.terms and alone.path == ()
    assert alone.errors()["total"] <= 1.02 * length.error


# Known ends -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["frequency", "relaxation"])
def test_a_known_equilibrium_modulus_is_met(kind):
    x, values = measured(kind)
    fit = FITS[kind](x, noisy(values, 0.02), terms=5, equilibrium=0.9 * START)
    assert float(fit.material.equilibrium) == 0.9 * START
    assert fit.errors()["total"] < 0.04


def test_a_liquid_has_no_equilibrium_modulus():
    values = modulus(OMEGA, 0.0, STRENGTHS, TIMES)
    fit = fit_prony(OMEGA, values, equilibrium=0)
    assert fit.terms == 3 and float(fit.material.equilibrium) == 0
    np.testing.assert_allclose(fit.material.strengths, STRENGTHS, rtol=1e-6)
    free = fit_prony(OMEGA, noisy(values, 0.01))
    assert 0 <= float(free.material.equilibrium) < np.min(values.real)


# Errors and bad values ------------------------------------------------------------------------


def test_errors_are_those_of_the_material(tread):
    omega, values, fit = tread
    errors = fit.errors()
    exact = young(fit.material, omega)
    for part, value in ((np.real, errors["storage"]), (np.imag, errors["loss"])):
        rms = np.sqrt(np.mean(np.log(part(exact) / part(values)) ** 2))
        np.testing.assert_allclose(value, rms, rtol=1e-9)


def test_bad_values_are_named_and_count_little_by_soft_l1():
    """Two of 120 values wreck least squares; by soft_l1 the fit is as near as without them."""
    exact, off = modulus(OMEGA, START, STRENGTHS, TIMES), {"good": [], "bad": [], "soft": []}
    for seed in range(3):
        good = noisy(exact, 0.01, seed)
        bad = good.copy()
        bad[20] = 2 * bad[20].real + 1j * bad[20].imag
        bad[40] = bad[40].real + 1j * bad[40].imag / 3
        for name, values, loss in (("good", good, "linear"), ("bad", bad, "linear"),
                                   ("soft", bad, "soft_l1")):  # fmt: skip
            fit = fit_prony(OMEGA, values, terms=3, loss=loss)
            off[name].append(np.log(channels(young(fit.material)) / channels(exact)))
            said = fit.warnings()
            assert bool(said) == (name != "good")
            if said:
                assert f"storage at {OMEGA[20]:.4g} rad/s" in said[0] and said[0].startswith("2")
    good, bad, soft = (np.std(values) for values in off.values())
    assert soft < 1.3 * good < 0.4 * bad


def test_soft_l1_and_its_derivatives_are_those_of_scipy():
    """At the scale of the fit, SciPy's minima of all values and of one that is changed."""
    x, values = TIME[::3], noisy(measured("relaxation")[1], 0.03)[::3]
    values[4] *= 1.5
    fit = fit_relaxation(x, values, terms=2, loss="soft_l1")

    def minimum(values):
        return least_squares(
            log_residual, fit.theta, "3-point", args=("relaxation", x, values), loss="soft_l1",
            f_scale=float(fit.data.scale), xtol=1e-15, ftol=1e-15, gtol=1e-14,
        ).x  # fmt: skip

    np.testing.assert_allclose(minimum(values), fit.theta, rtol=1e-6)
    slopes = jax.jacfwd(lambda values: fit_relaxation(x, values, terms=2, loss="soft_l1").theta)(
        jnp.asarray(values)
    )
    for changed in (4, 7):
        step = 1e-3 * values[changed] * np.eye(len(values))[changed]
        difference = minimum(values + step) - minimum(values - step)
        np.testing.assert_allclose(2 * slopes @ step, difference, rtol=1e-3, atol=1e-7)


# Uncertainty ------------------------------------------------------------------------------------


def test_limits_of_a_single_branch_are_those_of_a_regression():
    """ln E = ln E_1 - t/τ is linear in ln E_1 and 1/τ; E' far above 1/τ is E_1.

    The limits differ from Student's by what is not known of the correlation of neighbours.
    """
    ratios = []
    for seed in range(10):
        values = noisy(3e6 * np.exp(-TIME[:40] / 0.1), 0.05, seed)
        fit = fit_relaxation(TIME[:40], values, equilibrium=0, terms=1)
        line = stats.linregress(TIME[:40], np.log(values))
        limits = fit.confidence(1 / TIME[:1], level=0.9)
        lower, upper = (np.log(np.asarray(limit)[0].real) for limit in limits)
        np.testing.assert_allclose((lower + upper) / 2, line.intercept, rtol=1e-8)
        ratios.append((upper - lower) / 2 / (line.intercept_stderr * stats.t.ppf(0.95, 38)))
    assert 0.95 < np.median(ratios) < 1.25, np.median(ratios)


def test_limits_end_where_the_data_end():
    """Of moduli in time at their reciprocals."""
    fit, (first, last) = fit_relaxation(*measured("relaxation"), terms=2), 1 / TIME[[-1, 0]]
    omega = np.array([1e-4 * first, 0.99 * first, first, last, 1.01 * last, 1e4 * last])
    limits = fit.confidence(omega)
    for part in (np.real, np.imag):
        found = np.isfinite([part(limit) for limit in limits])
        np.testing.assert_array_equal(found, [[False, False, True, True, False, False]] * 2)
    assert f"Measured from {first:.4g} to {last:.4g} rad/s" in fit.report()


# Derivatives ------------------------------------------------------------------------------------


def problem(kind):
    """A function of everything that a fit depends on, and a point to differentiate it at."""
    x, values = measured(kind)
    x, values = jnp.asarray(x[::3]), noisy(values, 0.03)[::3]
    begin = {"real": values.real, "imag": values.imag, "storage": np.full(20, 1.1), "loss": 1.0}
    begin |= {"x": x} | ({"equilibrium": 4e6} if kind != "creep" else {})
    begin = jax.tree.map(jnp.asarray, begin)

    def function(given):
        data = given["real"]
        if kind == "frequency":
            data = jax.lax.complex(data, given["imag"])
        weights = (given["storage"], given["loss"])
        fit = FITS[kind](given["x"], data, terms=3, weights=weights,
                         equilibrium=given.get("equilibrium"))  # fmt: skip
        fitted = fit.material.complex_modulus(jnp.array([0.01, 1.0, 1e2]))
        return jnp.log(jnp.stack([fitted.real, fitted.imag]))

    return function, begin


@pytest.mark.parametrize("kind", ["frequency", "creep"])
def test_derivatives_by_everything_given_match_differences(kind):
    """A relative change of every number at once, in a random direction."""
    function, begin = problem(kind)
    draw = np.random.default_rng(3)
    direction = jax.tree.map(lambda v: v * draw.standard_normal(v.shape), begin)

    def along(step):
        return function(jax.tree.map(lambda v, d: v + step * d, begin, direction))

    step = 1e-5
    differences = (along(step) - along(-step)) / (2 * step)
    _, slopes = jax.jvp(along, (0.0,), (1.0,))
    np.testing.assert_allclose(slopes, differences, rtol=1e-4, atol=1e-6)


# Properties -------------------------------------------------------------------------------------

SERIES = st.tuples(
    st.lists(st.tuples(st.floats(4, 9), st.floats(-5, 3)), min_size=1, max_size=4),
    st.floats(0, 0.3),
    st.integers(0, 1000),
)


@settings(max_examples=8)
@given(SERIES, st.sampled_from(sorted(FITS)))
@example(([(4.0, 0.0)], 0.25, 0), "creep")  # two retardation times meet
def test_every_fit_is_passive(series, kind):
    """Also where noise is large: E' grows, E'' is positive, nothing is infinite."""
    branches, noise, seed = series
    strengths, times = (10.0 ** np.array(part) for part in zip(*branches, strict=True))
    if kind == "creep":
        strengths = 1e-12 * strengths
    x = OMEGA[::3] if kind == "frequency" else TIME[::3]
    function = {"frequency": modulus, "relaxation": relaxation, "creep": compliance}[kind]
    values = noisy(function(x, START, strengths, times), noise, seed)
    material = FITS[kind](x, values, terms=2).material
    fitted = young(material, np.geomspace(1e-6, 1e8, 100))
    assert np.all(np.isfinite(fitted)) and np.all(fitted.imag >= 0)
    assert np.all(np.diff(fitted.real) >= -1e-12 * fitted.real[1:])
    assert np.all(np.asarray(material.strengths) > 0) and np.all(np.asarray(material.times) > 0)


@settings(max_examples=5)
@given(st.floats(-9, 9), st.floats(-9, 9), st.sampled_from(sorted(FITS)))
def test_a_fit_is_the_same_in_all_units(stiffness, frequency, kind):
    x, values = measured(kind)
    x, values = x[::3], noisy(values, 0.05)[::3]
    one = FITS[kind](x, values, terms=3).material
    a, b = 10.0**stiffness, 10.0**frequency
    other = FITS[kind](b * x, a * values, terms=3).material
    a, b = (1 / a if kind == "creep" else a), (1 / b if kind != "frequency" else b)
    np.testing.assert_allclose(young(other, b * OMEGA), a * young(one), rtol=1e-5)
