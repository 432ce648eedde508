"""Moduli that depend on the strain amplitude, in the mean field and in contact."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from oracles import gauss_over_angles, maxwell, persson, rough
from scipy.interpolate import PchipInterpolator

import graded_contact as gc
from graded_contact.materials import StrainSoftening, at_strain

CELL = 0.01  # m
Q0 = 2 * np.pi / CELL
SPECTRUM = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=60 * Q0)
RUBBER = gc.Prony(1e6, [4e6, 2e7], [1e-2, 1e-4], 0.49, shift=gc.WLF(5.0, 80.0, 300.0))
STRAIN, STORAGE, LOSS = [1e-3, 1e-2, 0.1, 0.5], [1.0, 0.8, 0.45, 0.3], [1.0, 1.1, 0.7, 0.35]
SOFT = StrainSoftening(RUBBER, STRAIN, STORAGE, LOSS)
GRID = gc.Grid((64,), CELL)
PROFILE = rough(GRID.shape, CELL, last=12, seed=3, rms_slope=0.15)


def on(material):
    layer = gc.Layer(gc.Elastic(4e6, 0.4), 1e-4)
    return gc.Stack(layers=(layer,), base=gc.HalfSpace(material))


WINDOW = gc.Surface(PROFILE.heights, GRID, periodic=False)
PLAIN = gc.contacts.DouglasRachford(newton=False)
slide = partial(gc.slide, pressure=2e5, velocity=0.05, rtol=1e-8, solver=PLAIN)
mean_field = jax.jit(partial(gc.mean_field_friction, pressure=3e5, throw=False))


def test_factors_follow_the_sweep_and_end_with_it():
    omega = np.array([1.0, 1e3])
    soft = jax.jit(lambda soft, strain: at_strain(soft, strain).complex_modulus(omega))
    linear_of = jax.jit(lambda kelvin: RUBBER.at(kelvin).complex_modulus(omega))
    linear = linear_of(300.0)
    for strain in (0.0, 1e-4, 3e-3, 0.2, 2.0):
        clipped = np.log(np.clip(strain, 1e-3, 0.5))
        f, g = (
            np.exp(PchipInterpolator(np.log(STRAIN), np.log(values))(clipped))
            for values in (STORAGE, LOSS)
        )
        modulus = soft(SOFT, strain)
        np.testing.assert_allclose(modulus.real, f * linear.real, rtol=1e-13)
        np.testing.assert_allclose(modulus.imag, g * linear.imag, rtol=1e-13)
    warm = soft(SOFT.at(320.0), 0.1)
    np.testing.assert_allclose(warm.real, 0.45 * linear_of(320.0).real, rtol=1e-12)
    assert at_strain(on(SOFT), 0.1).base.material.amplitude == 0.1
    elastic = StrainSoftening(gc.Elastic(1e6), STRAIN, STORAGE, LOSS, 0.1)
    np.testing.assert_allclose(elastic.complex_modulus(omega), 4.5e5)


def test_mean_field_matches_the_differential_equations():
    """Each wave has the strain of the slope up to it, an integral in closed form."""
    f, g = (PchipInterpolator(np.log(STRAIN), np.log(v)) for v in (STORAGE, LOSS))
    cosine, weight = gauss_over_angles()
    plateau, roll = float(SPECTRUM.density(jnp.array(Q0))), 4 * Q0

    def sums(q):
        below, above = min(q, roll), max(q, roll)
        square = (below**4 - Q0**4) / 4 + roll**3.6 * (above**0.4 - roll**0.4) / 0.4
        strain = 0.7 * np.sqrt(2 * np.pi * plateau * max(square, 0))
        strain = np.log(np.clip(strain, 1e-3, 0.5))
        modulus = maxwell(q * 0.05 * cosine, 1e6, [4e6, 2e7], [1e-2, 1e-4]) / (1 - 0.49**2)
        real, imag = np.exp(f(strain)) * modulus.real, np.exp(g(strain)) * modulus.imag
        density = plateau * min(1, (q / roll) ** -3.6) * q**4
        spreading = density / 4 * np.sum(weight * (real**2 + imag**2)) / 9e10
        return spreading, density / 2 * np.sum(weight * cosine * imag) / 3e5

    area, friction = persson(sums, (Q0, roll, 60 * Q0))
    half_space = gc.Stack(base=gc.HalfSpace(SOFT))
    result = mean_field(half_space, SPECTRUM, velocity=0.05, strain_per_slope=0.7)
    np.testing.assert_allclose(result.friction, friction, rtol=1e-5)
    np.testing.assert_allclose(result.contact_area, area, rtol=1e-5)
    linear = mean_field(half_space, SPECTRUM, velocity=0.05, strain_per_slope=1e-9)
    assert result.contact_area > 1.2 * linear.contact_area


def test_each_wave_has_the_modulus_at_its_strain():
    """Against stacks at one strain each, and sums over all modes by NumPy."""
    shape, velocity = (16, 12), (0.03, 0.04)
    grid = gc.Grid(shape, CELL)
    surface = gc.Surface(1e-5 * jax.random.normal(jax.random.key(1), shape), grid)
    layer = gc.Layer(
        StrainSoftening(gc.Prony(3e6, [4e6], [1e-3], 0.4), STRAIN, LOSS, STORAGE), 1e-4
    )
    stack = gc.Stack(layers=(layer,), base=gc.HalfSpace(SOFT))
    kernel = slide(stack, surface, velocity=velocity, strain_per_slope=0.6).kernel
    number = np.meshgrid(*(np.fft.fftfreq(n, 1 / n) for n in shape), indexing="ij")
    q = 2 * np.pi / CELL * np.sqrt(sum(k**2 for k in number))
    power = np.abs(np.fft.fftn(surface.heights) / np.prod(shape)) ** 2
    power[np.any([2 * np.abs(k) == n for k, n in zip(number, shape, strict=True)], axis=0)] = 0
    edges = np.linspace(Q0, q.max(), max(shape))
    slope = [np.sqrt(np.sum((q**2 * power)[q <= edge * (1 + 1e-9)])) for edge in edges]
    for wave in [(1, 0), (3, 2), (-2, 4)]:
        strain = 0.6 * np.interp(q[wave], edges, slope)
        alone = gc.stack_kernel(at_strain(stack, strain), grid, velocity)
        np.testing.assert_allclose(kernel[wave], alone[wave], rtol=1e-12)
    softest = gc.stack_kernel(at_strain(stack, 0.6 * slope[-1]), grid, velocity)
    assert abs(softest[1, 1]) > 1.05 * abs(kernel[1, 1])
