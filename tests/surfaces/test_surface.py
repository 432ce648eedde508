import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import elasticities
from scipy.integrate import quad, simpson

from graded_contact.fields.grid import Grid
from graded_contact.surfaces.random_surface import random_surface
from graded_contact.surfaces.rescaling import rescale
from graded_contact.surfaces.spectrum import SelfAffine
from graded_contact.surfaces.statistics import radial_spectrum, statistics
from graded_contact.surfaces.surface import Surface

LENGTH = 1e-3
Q0 = 2 * np.pi / LENGTH
KEY = jax.random.key(7)
density_of = jax.jit(lambda spectrum, q, ndim=2: spectrum.density(q, ndim), static_argnums=2)


def _spectrum(dtype=None, **changes):
    values = {
        "rms_height": 2e-6, "hurst": 0.8, "q_low": Q0, "q_roll": 3.5 * Q0, "q_high": 10.5 * Q0
    }  # fmt: skip
    values |= changes
    if "rms_slope" in changes:
        del values["rms_height"]
    return SelfAffine(**{name: jnp.asarray(v, dtype or float) for name, v in values.items()})


def _integral(function, spectrum, ndim):
    """∫ d^ndim q f(q) by quadrature in log q, piece by piece."""
    total = 0.0
    for a, b in ((spectrum.q_low, spectrum.q_roll), (spectrum.q_roll, spectrum.q_high)):
        measure = (2 * np.pi, 2)[ndim == 1]

        def integrand(y, measure=measure):
            q = np.exp(y)
            return measure * q**ndim * float(function(q))

        total += quad(integrand, np.log(float(a)), np.log(float(b)), epsrel=1e-12)[0]
    return total


def _shape(q, spectrum, ndim):
    """The definition of the spectrum, with plateau 1."""
    ratio = q / float(spectrum.q_roll)
    return 1.0 if ratio <= 1 else ratio ** -(ndim + 2 * float(spectrum.hurst))


# The spectrum


@pytest.mark.parametrize("ndim", [1, 2])
@pytest.mark.parametrize(("hurst", "order"), [(0.8, 0), (0.5, 1), (1.0, 2), (0.999, 2), (0.3, 4)])
def test_moments_match_quadrature(hurst, order, ndim):
    """Orders 1 and 2 at H = order/2 are the logarithmic cases."""
    spectrum = _spectrum(hurst=hurst, q_high=300 * Q0)
    norm = _integral(lambda q: _shape(q, spectrum, ndim), spectrum, ndim)
    moment = _integral(lambda q: q**order * _shape(q, spectrum, ndim), spectrum, ndim)
    expected = float(spectrum.amplitude) ** 2 * moment / norm
    np.testing.assert_allclose(spectrum.moment(order, ndim), expected, rtol=1e-10)


def test_the_density_has_the_plateau_the_power_law_and_the_edges():
    spectrum = _spectrum(hurst=0.7)
    low, roll, high = (float(q) for q in (spectrum.q_low, spectrum.q_roll, spectrum.q_high))
    q = np.array([0.0, 0.99 * low, low, roll, 2 * roll, high, 1.01 * high])
    relative = np.asarray(density_of(spectrum, q)) / density_of(spectrum, roll)
    expected = [0, 0, 1, 1, 2**-3.4, (high / roll) ** -3.4, 0]
    np.testing.assert_allclose(relative, expected, rtol=1e-12)
    # Without plateau, and without slope.
    for q_roll in (Q0, 10.5 * Q0):
        other = _spectrum(q_roll=q_roll)
        total = _integral(lambda q, s=other: density_of(s, q), other, 2)
        np.testing.assert_allclose(total, 4e-12, rtol=1e-9)
    m0, m2 = (float(spectrum.moment(n)) for n in (0, 2))
    found = (spectrum.rms_height, spectrum.rms_slope)
    np.testing.assert_allclose(found, [np.sqrt(m0), np.sqrt(m2)], rtol=1e-13)


LEAVES = ("amplitude", "hurst", "q_low", "q_roll", "q_high")


@pytest.mark.parametrize("prescribed, order", [("rms_height", 1), ("rms_slope", 4)])
def test_derivatives_of_moments_match_differences(prescribed, order):
    """At H = 1/2, order 1 the power of the integral vanishes and its derivative does not."""
    names = (prescribed, *LEAVES[1:])
    start = {prescribed: 0.1, "hurst": 0.5, "q_low": 1.0, "q_roll": 3.0, "q_high": 40.0}

    def moment(*values):
        return jnp.log(SelfAffine(**dict(zip(names, values, strict=True))).moment(order))

    slopes = elasticities(moment, tuple(jnp.asarray(start[name]) for name in names))
    np.testing.assert_allclose(*np.transpose(slopes), rtol=1e-7, atol=1e-8)


# Random surfaces


def _plane_spectrum(surface):
    """|h_q|² and |q| of every mode of the full plane, from numpy."""
    shape, size = surface.grid.shape, np.asarray(surface.grid.size)
    axes = [2 * np.pi * np.fft.fftfreq(n, d / n) for n, d in zip(shape, size, strict=True)]
    q = np.sqrt(sum(a**2 for a in np.meshgrid(*axes, indexing="ij")))
    return np.abs(np.fft.fftn(np.asarray(surface.heights)) / np.prod(shape)) ** 2, q


@pytest.mark.parametrize(
    ("shape", "size"),
    [((24, 45), [LENGTH, 1.7 * LENGTH]), ((32,), [LENGTH])],
)
def test_every_mode_of_an_exact_surface_has_the_target_amplitude(shape, size):
    spectrum = _spectrum(q_high=9.9 * Q0)
    surface = random_surface(spectrum, Grid(shape, jnp.asarray(size)), KEY)
    power, q = _plane_spectrum(surface)
    cell = np.prod(2 * np.pi / np.asarray(size))
    expected = cell * np.asarray(density_of(spectrum, q, len(shape)))
    np.testing.assert_allclose(power, expected, rtol=1e-10, atol=1e-14 * expected.max())
    assert np.count_nonzero(expected) > 10


def test_modes_at_the_nyquist_wavenumber_stay_empty():
    surface = random_surface(_spectrum(q_high=12 * Q0), Grid((24, 24), LENGTH), KEY)
    power, _ = _plane_spectrum(surface)
    assert np.max(power[12]) < 1e-28 * np.max(power)
    assert np.max(power[:, 12]) < 1e-28 * np.max(power)


def test_phases_are_uniform_and_independent():
    """The mean of exp(iφ) and of exp(i(φ - φ')) of neighbouring modes, over a half plane."""
    surface = random_surface(_spectrum(q_high=60 * Q0), Grid((128, 128), LENGTH), KEY)
    modes = np.fft.rfft2(np.asarray(surface.heights))[1:40, 1:40].ravel()
    phase = modes / np.abs(modes)
    for sample in (phase, phase**2, phase[1:] * phase[:-1].conj()):
        assert abs(np.mean(sample)) < 3.5 / np.sqrt(sample.size)


def test_gaussian_amplitudes_are_complex_normal():
    """|h_q|²/<|h_q|²> is exponential: mean 1, mean square 2; phases are those of `exact`."""
    spectrum, grid = _spectrum(q_high=60 * Q0), Grid((128, 128), LENGTH)
    exact = np.fft.rfft2(random_surface(spectrum, grid, KEY).heights)[1:40, 1:40]
    normal = np.fft.rfft2(random_surface(spectrum, grid, KEY, amplitudes="gaussian").heights)
    ratio = (normal[1:40, 1:40] / exact).ravel()
    np.testing.assert_allclose(ratio.imag, 0, atol=1e-8)
    assert np.all(ratio.real > 0)
    error = 1 / np.sqrt(ratio.size)
    assert abs(np.mean(ratio.real**2) - 1) < 4 * error
    assert abs(np.mean(ratio.real**4) - 2) < 4 * np.sqrt(20) * error


@pytest.mark.parametrize(
    ("coarse", "factors", "amplitudes"),
    [((22, 27), (2, 3), "gaussian"), ((26,), (4,), "exact")],
)
def test_refining_the_grid_gives_the_same_surface(coarse, factors, amplitudes):
    spectrum, size = _spectrum(), jnp.full(len(coarse), LENGTH)
    fine = tuple(n * f for n, f in zip(coarse, factors, strict=True))
    one = random_surface(spectrum, Grid(coarse, size), KEY, amplitudes=amplitudes)
    two = random_surface(spectrum, Grid(fine, size), KEY, amplitudes=amplitudes)
    shared = np.asarray(two.heights)[tuple(slice(None, None, f) for f in factors)]
    np.testing.assert_allclose(shared, one.heights, rtol=0, atol=1e-12 * np.std(one.heights))


def test_keys_give_different_surfaces_and_vmap_gives_those_of_a_loop():
    spectrum, grid = _spectrum(), Grid((24, 24), LENGTH)
    keys = jax.random.split(KEY, 2)
    many = jax.jit(jax.vmap(lambda key: random_surface(spectrum, grid, key).heights))(keys)
    for key, heights in zip(keys, many, strict=True):
        expected = random_surface(spectrum, grid, key).heights
        np.testing.assert_allclose(heights, expected, atol=1e-18)
    assert abs(np.corrcoef(np.ravel(many[0]), np.ravel(many[1]))[0, 1]) < 0.5


def test_derivatives_of_a_random_surface_match_differences():
    """The edges of the band lie between modes, so that differences admit no new ones."""
    grid = Grid((24, 24), LENGTH)
    weights = jnp.asarray(np.random.default_rng(0).normal(size=grid.shape))
    names = ("rms_slope", *LEAVES[1:])
    x = tuple(map(jnp.asarray, (1.0, 0.8, 1.1 * Q0, 3.3 * Q0, 9.77 * Q0)))

    def observable(*values):
        spectrum = SelfAffine(**dict(zip(names, values, strict=True)))
        return jnp.sum(weights * random_surface(spectrum, grid, KEY).heights)

    slopes = np.transpose(elasticities(observable, x))
    np.testing.assert_allclose(*slopes, rtol=1e-6, atol=1e-9 * abs(observable(*x)))


# Surfaces, statistics, rescaling, resampling


@pytest.mark.parametrize("shape", [(27,), (16, 21)])
def test_statistics_of_noise_match_the_full_plane(shape):
    size = np.array([1.0, 1.6])[: len(shape)]
    heights = np.random.default_rng(1).normal(size=shape)
    s = statistics(Surface(heights, Grid(shape, jnp.asarray(size))))
    modes = np.fft.fftn(heights)
    axes = [2 * np.pi * np.fft.fftfreq(n, d / n) for n, d in zip(shape, size, strict=True)]
    q = np.meshgrid(*axes, indexing="ij")
    inner = [
        np.where(abs(k) > np.pi * n / d * 0.999, 0, k)
        for k, n, d in zip(q, shape, size, strict=True)
    ]
    slopes = [np.std(np.fft.ifftn(1j * k * modes).real) for k in inner]
    laplace = np.fft.ifftn(-sum(k**2 for k in q) * modes).real
    np.testing.assert_allclose(s.rms_height, np.std(heights), rtol=1e-12)
    np.testing.assert_allclose(s.rms_slope_along, slopes, rtol=1e-12)
    np.testing.assert_allclose(s.rms_curvature, np.std(laplace) / len(shape), rtol=1e-12)


def test_a_flat_surface_has_zero_statistics_and_finite_derivatives():
    grid = Grid((8, 8), 1.0)

    def total(heights):
        s = statistics(Surface(heights, grid))
        return s.rms_height + s.rms_slope + s.rms_curvature

    value, gradient = jax.value_and_grad(total)(jnp.full((8, 8), 3.0))
    assert value == 0
    assert np.all(np.isfinite(gradient))


@pytest.mark.parametrize("shape", [(15, 20), (33,)])
def test_the_radial_spectrum_averages_the_full_plane(shape):
    size = [1.0, 1.3][: len(shape)]
    heights = np.random.default_rng(3).normal(size=shape)
    surface = Surface(heights, Grid(shape, jnp.asarray(size)))
    q, density = (np.asarray(v) for v in radial_spectrum(surface, 5))
    power, full = _plane_spectrum(surface)
    power *= np.prod(np.asarray(size) / (2 * np.pi))
    nyquist = np.zeros(shape, bool)
    for axis, n in enumerate(shape):
        if n % 2 == 0:
            np.moveaxis(nyquist, axis, 0)[n // 2] = True
    low = 2 * np.pi / max(size)
    high = min(np.pi * n / d for n, d in zip(shape, size, strict=True))
    edges = low * (high / low) ** (np.arange(6) / 5)
    edges *= 1 - 1e-5
    for i in range(5):
        chosen = (full >= edges[i]) & (full < edges[i + 1]) & ~nyquist
        np.testing.assert_allclose(q[i], np.mean(full[chosen]), rtol=1e-12)
        np.testing.assert_allclose(density[i], np.mean(power[chosen]), rtol=1e-12)


@settings(max_examples=10)
@given(st.floats(-9, 0), st.sampled_from(["rms_height", "rms_slope"]))
def test_rescaling_prescribes_the_actual_value(log_target, name):
    surface = random_surface(_spectrum(), Grid((24, 24), LENGTH), KEY)
    scaled = rescale(surface, **{name: 10**log_target})
    np.testing.assert_allclose(getattr(statistics(scaled), name), 10**log_target, rtol=1e-12)
    ratio = np.asarray(scaled.heights / surface.heights)
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-12)
    assert name in scaled.history[-1]


EDGES = dict(hurst=0.8, q_low=2.0, q_roll=4.0, q_high=9.0)


def roughness(name, value, roll_off="sharp", phases=0):
    """A sum over the heights of a random surface in a cell of 2π, whose modes are whole numbers."""
    grid = Grid((24, 24), 2 * np.pi)
    spectrum = SelfAffine(rms_height=1.0, **(EDGES | {name: value}), roll_off=roll_off)
    return jnp.mean(random_surface(spectrum, grid, jax.random.key(phases)).heights ** 4)


def test_a_smooth_roll_off_has_its_derivative_moments_and_slope():
    both = jax.jit(jax.value_and_grad(lambda value: roughness("q_roll", value, "smooth")))
    (_, found), *ends = (both(4 + step) for step in (0.0, 1e-5, -1e-5))
    ends = [value for value, _ in ends]
    np.testing.assert_allclose(found, (ends[0] - ends[1]) / 2e-5, rtol=1e-7)
    wide = dict(hurst=0.7, q_low=1e2, q_roll=3e3, q_high=1e8)
    for ndim in (1, 2):
        spectrum = SelfAffine(rms_height=2e-6, **wide, roll_off="smooth")
        y = np.linspace(np.log(1e2), np.log(1e8), 2001)
        q, c = np.exp(y), np.asarray(density_of(spectrum, np.exp(y), ndim))
        for order in (0, 2, 4):
            exact = simpson((2 * np.pi * q if ndim == 2 else 2) * q ** (order + 1) * c, x=y)
            np.testing.assert_allclose(spectrum.moment(order, ndim), exact, rtol=1e-8)
        np.testing.assert_allclose(spectrum.moment(0, ndim), 4e-12, rtol=1e-12)
        ratio = np.asarray(density_of(spectrum, np.array([1e6, 1e7]), ndim))
        np.testing.assert_allclose(ratio[1] / ratio[0], 10.0 ** -(ndim + 1.4), rtol=1e-4)
    with pytest.raises((ValueError, TypeError), match="roll_off"):
        SelfAffine(rms_height=1.0, **EDGES, roll_off="round")
