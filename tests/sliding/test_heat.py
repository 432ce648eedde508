"""Heat of friction over the depth is the work of friction; temperatures follow closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import rough
from scipy.linalg import solve_banded

import graded_contact as gc
from graded_contact.fields.grid import multiplicity, to_field, to_spectrum, wavenumber
from graded_contact.materials import StrainSoftening
from graded_contact.sliding import (
    Coulomb,
    Heating,
)
from graded_contact.sliding.interior.conduction import Heat, temperatures, thermal_wavenumber
from graded_contact.sliding.interior.heat_source import (
    gauss_within,
    heat_source,
    intervals,
    shear_heat,
)

CELL = 4e-3  # m
Q0 = 2 * np.pi / CELL
SURFACE = rough((15, 15), CELL, rms_slope=0.3)
RUBBER = gc.Prony(1e6, [9e6, 2e7], [1e-2, 1e-4], 0.49)
COAT = gc.Prony(5e6, [1e7], [1e-3], 0.4)
HALF_SPACE = gc.Stack(base=gc.HalfSpace(RUBBER))
COATED = gc.Stack(layers=(gc.Layer(COAT, 2e-4),), base=gc.HalfSpace(RUBBER))
LOAD, VELOCITY = 4e5, np.array([0.3, 0.4])
wavenumber_of_heat = jax.jit(thermal_wavenumber)


def softened(coat, base):
    """All blocks are alike: they share a program."""
    soft = StrainSoftening(coat, [1e-3, 0.1], [1.0, 0.4], [1.0, 0.7], amplitude=0.03)
    layers = (gc.Layer(soft, 2e-4), gc.Layer(gc.Elastic(6e6, 0.3), 1e-4))
    return gc.Stack(layers=layers, base=gc.HalfSpace(base))


SOFTENED = softened(COAT, RUBBER)


def slid(stack, coefficient, load=LOAD):
    shear = Coulomb(coefficient)
    return gc.slide(stack, SURFACE, pressure=load, velocity=VELOCITY, shear=shear, rtol=1e-9)


@pytest.fixture(scope="module")
def sheared():
    """Its shear is in proportion to the pressure."""
    how = dict(pressure=LOAD, velocity=0.5, shear=Coulomb(0.5, coupled=False))
    return gc.slide(HALF_SPACE, SURFACE, **how)


def test_heat_over_the_depth_is_the_work_of_friction():
    """Along an oblique velocity, with a traction and without; elastic blocks make none.

    The count of points is odd: the heat has the highest wave of an even one, the work has not.
    """
    edges = jax.jit(intervals, static_argnums=2)(*np.array([CELL / 300, 3 * CELL]), 18)
    depths, weights = gauss_within(SOFTENED, edges)
    for s in (slid(SOFTENED, 0.3), slid(SOFTENED, 0.0)):
        source = heat_source(s, depths, weights > 0)
        assert np.min(source) >= 0
        made = np.sum(np.mean(source, (1, 2)) * np.asarray(weights))
        friction, block = s.compute("friction", "block_friction")
        np.testing.assert_allclose(made, block * LOAD * 0.5, rtol=2e-4)
        of_shear = jnp.mean(shear_heat(s))
        np.testing.assert_allclose(of_shear, (friction - block) * LOAD * 0.5, atol=1e-8 * LOAD)
    elastic = softened(gc.Prony(5e6, [1e-6], [1e-3], 0.4), gc.Prony(1e6, [1e-6] * 2, [1, 2], 0.49))
    none = heat_source(slid(elastic, 0.3), depths, weights > 0)
    assert np.max(none) < 1e-9 * np.max(source)


def moving_band(peclet):
    """Max and mean of T κ/(q b) under a band of half width b, above the temperature far ahead."""
    half, n = 256, 2**21  # points
    grid = gc.Grid(n, float(n) / half)
    k = wavenumber_of_heat(grid, 2 * peclet, 1.0)
    q = 2 * np.pi * np.arange(n // 2 + 1) / float(grid.size[0])
    # A band about x = 0, at rest in the frame of the surface.
    flux = 2 * np.sin(q) / np.where(q == 0, 1, q) * n / float(grid.size[0])
    waves = flux / np.asarray(k)
    waves[0] = 0
    rise = np.fft.irfft(waves, n)
    ahead = rise[int(half * (1 + min(200, 30 / peclet)))]
    under = np.concatenate([rise[-half:], rise[: half + 1]]) - ahead
    return np.max(under), (np.sum(under) - (under[0] + under[-1]) / 2) / (2 * half)


@pytest.mark.parametrize(
    ("peclet", "highest", "mean"), [(0.1, 2.20033, 2.06162), (100.0, 0.112436, 0.07535)]
)
def test_a_moving_band_is_as_hot_as_carslaw_and_jaeger_say(peclet, highest, mean):
    """Conduction of Heat in Solids, 10.7; with the formula of high speed, (2/√π)/√(vb/2D)."""
    found = moving_band(peclet)
    np.testing.assert_allclose(found, (highest, mean), rtol=2e-3)
    if peclet == 100:
        np.testing.assert_allclose(found[0], 2 / np.sqrt(np.pi * peclet), rtol=5e-3)


EDGES = np.array([0.0, 1e-5, 1e-4, 2.5e-4])  # of slices with heat
LAYERED = gc.Stack(layers=(gc.Layer(COAT, 5e-5), gc.Layer(RUBBER, 3e-4)), base=gc.HalfSpace(RUBBER))
DIFFERENT = Heating([0.25, 5.0, 0.04], [1e-4, 2e-5, 3e-4])


def one_wave(s, stack, heating, depths, sources=1.0):
    """Temperatures of a wave by random sources in slices, the sources and k in each layer."""
    source = sources * jax.random.normal(jax.random.key(1), (3, *s.grid.shape))
    heat = Heat(source, jnp.diff(EDGES), (1 - sources) * shear_heat(s))
    (found,) = temperatures(s, (stack,), heating, heat, [jnp.asarray(depths)])
    k = [
        complex(np.asarray(wavenumber_of_heat(s.grid, s.velocity, d))[1, 2])
        for d in np.atleast_1d(heating.diffusivity)
    ]
    waves = [np.fft.rfft2(part)[1, 2] for part in source]
    return np.asarray(found[:, 1, 2]), waves, k


def test_temperature_of_sources_at_depth_solves_the_heat_equation(sheared):
    """Against finite volumes over the depth, for one wave, with an insulated surface."""
    at = np.array([0.0, 3e-5, 2e-4, 4e-4])
    found, waves, k = one_wave(sheared, LAYERED, DIFFERENT, at)
    n, bottom = 40000, 2e-3
    h = bottom / n
    z = (np.arange(n) + 0.5) * h
    heat = sum(np.where((z > EDGES[i]) & (z < EDGES[i + 1]), w, 0) for i, w in enumerate(waves))
    layer = np.searchsorted([5e-5, 3.5e-4], z)
    kappa = DIFFERENT.conductivity[layer]
    between = 2 / (1 / kappa[1:] + 1 / kappa[:-1]) / h**2
    bands = np.zeros((3, n), complex)
    bands[0, 1:] = bands[2, :-1] = -between
    bands[1] = kappa * np.array(k)[layer] ** 2
    bands[1, :-1] += between
    bands[1, 1:] += between
    rise = solve_banded((1, 1), bands, heat)
    np.testing.assert_allclose(found, np.interp(at, z, rise), rtol=1e-4)


def test_a_coat_reflects_heat_of_the_surface(sheared):
    """Flux on a coat of another conductivity, by its images: R = (y - y')/(y + y'), y = κk."""
    coat, at = 2e-4, np.array([0.0, 1e-4, 3e-4])
    heating = Heating([0.25, 2.0], [1e-4, 1e-3])
    found, _, (k, below) = one_wave(sheared, COATED, heating, at, 0.0)
    y, other = 0.25 * k, 2.0 * below
    reflected = (y - other) / (y + other)
    flux = np.fft.rfft2(shear_heat(sheared))[1, 2]
    scale = flux / y / (1 - reflected * np.exp(-2 * k * coat))
    inside = np.exp(-k * at) + reflected * np.exp(-k * (2 * coat - at))
    beyond = (1 + reflected) * np.exp(-k * coat - below * (at - coat))
    np.testing.assert_allclose(found, scale * np.where(at < coat, inside, beyond), rtol=1e-12)


def of_shear(sheared, lost=0.0):
    none = jnp.zeros((1, *sheared.grid.shape)), jnp.array([1e-4])
    return Heat(*none, shear_heat(sheared), lost)


def test_heat_divides_between_a_moving_block_and_a_coated_counterface_at_rest(sheared):
    """1/T = 1/T_b + 1/T_c of the temperatures that each has alone (J. C. Jaeger, 1942)."""
    q = np.array(wavenumber(sheared.grid))
    q[0, 0] = 1.0
    k = np.array(wavenumber_of_heat(sheared.grid, sheared.velocity, 1.1e-7))
    # Of a coat on a half space, by images.
    image = (0.25 - 40.0) / (0.25 + 40.0) * np.exp(-2 * q * 1e-4)
    coated = (1 + image) / (1 - image) / (0.25 * q)
    weight = np.abs(to_spectrum(sheared.pressure / jnp.mean(sheared.pressure))) ** 2
    weight = weight * np.asarray(multiplicity(sheared.grid.shape)) / sheared.pressure.size**2
    weight[0, 0] = 0
    alone = [np.sum(weight * one.real) for one in (1 / (0.25 * k), coated)]
    power, lost = float(jnp.mean(shear_heat(sheared))), 30.0
    expected = (power + lost) / sum(1 / one for one in alone)
    counterface = gc.Stack(layers=(gc.Layer(COAT, 1e-4),), base=gc.Rigid())
    heating, depths = Heating(0.25, 1.1e-7, [0.25, 40.0]), jnp.array([0.0, 3e-5])
    bodies, heat = (HALF_SPACE, counterface), of_shear(sheared, lost)
    found = temperatures(sheared, bodies, heating, heat, [depths] * 2)
    pressure = sheared.pressure / jnp.mean(sheared.pressure)
    block, other = (to_field(body[0], sheared.grid.shape) for body in found)
    np.testing.assert_allclose([jnp.mean(one * pressure) for one in (block, other)], expected)
    # Below the surface the coat's waves decay, and are reflected.
    share = (np.exp(-q * 3e-5) + image * np.exp(q * 3e-5)) / (1 + image)
    np.testing.assert_allclose(found[1][1], found[1][0] * share, atol=1e-9)
