"""Periodic motion: steady sliding, closed forms, brute force, energy.

All lines share their numbers of points and times, and so a program. Derivatives are in
`test_derivatives.py`, claimed errors in `test_resolution.py`.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import rough
from scipy.special import jv

import graded_contact as gc
from graded_contact.sliding.shear import AbstractShear

N, NT = 15, 31
GRID = gc.Grid((N,), 1.0)
TIMES = np.arange(NT) / NT
NUMBERS = (
    "mean_friction", "peak_friction", "friction", "contact_area", "work", "load_work",
    "dissipated_power", "energy_imbalance", "traction", "mean_shear_friction",
)  # fmt: skip


class PowerLaw(AbstractShear):
    """c σ^m v^n."""

    coefficient: jax.Array
    of_pressure: jax.Array
    of_speed: jax.Array

    def __call__(self, pressure, speed, temperature):
        return self.coefficient * pressure**self.of_pressure * speed**self.of_speed


def law(*numbers):
    return PowerLaw(*map(jnp.asarray, numbers))


def steady(velocity):
    """Steady sliding over one period of the surface."""
    return gc.sliding.Motion(np.sign(velocity) * TIMES, 1 / abs(velocity))


ROUGH = rough(GRID.shape, 1.0)
LOAD = 0.05
SINE = 0.2 * np.sin(2 * np.pi * TIMES)


def rubber(strength=3.0, time=0.05, poisson=0.3):
    """A half space with one relaxation time."""
    return gc.Stack(base=gc.HalfSpace(gc.Prony(1.0, [strength], [time], poisson)))


def cycle(stack=None, surface=ROUGH, s=SINE, period=1.0, **options):
    options = {"rtol": 1e-9} | options
    if "mean_gap" not in options:
        options["pressure"] = np.broadcast_to(options.get("pressure", LOAD), len(s)).astype(float)
    stack = rubber() if stack is None else stack
    found = gc.slide_cycle(stack, surface, displacement=s, period=period, **options)
    found.compute(*(name for name in NUMBERS if options.get("shear") or "shear" not in name))
    return found


def slide(stack, surface, velocity, **how):
    found = gc.slide(stack, surface, pressure=LOAD, velocity=velocity, rtol=1e-11, **how)
    names = "friction", "contact_area"
    found.compute(*names, *(["shear_friction"] if how else []))
    return found


def test_steady_sliding_is_that_of_slide():
    motion = steady(-3.0)
    found = cycle(s=motion.displacement, period=motion.period, rtol=1e-11)
    expected = slide(rubber(), ROUGH, -3.0)
    np.testing.assert_allclose(found.mean_friction, expected.friction, rtol=1e-9)
    np.testing.assert_allclose(-found.friction, expected.friction, rtol=1e-9)
    np.testing.assert_allclose(found.mean_gap, expected.mean_gap, rtol=1e-9)
    np.testing.assert_allclose(found.contact_area, expected.contact_area, rtol=1e-9)
    assert found.energy_imbalance < 1e-10


def test_steady_sliding_in_two_dimensions_is_that_of_slide():
    """And along a circle mean friction is the work over load and path."""
    grid = gc.Grid((8, 8), 1.0)
    surface = rough(grid.shape, 1.0, last=3)
    moved = np.repeat(np.arange(24.0)[:, None] / 24, 2, axis=1)
    stack = gc.Stack(layers=(gc.Layer(gc.Elastic(2.0, 0.4), 0.05),), base=rubber().base)
    found, expected = cycle(stack, surface, moved, 0.5), slide(stack, surface, (2.0, 2.0))
    np.testing.assert_allclose(found.mean_friction, expected.friction, rtol=1e-8)
    along = found.friction @ np.full(2, 0.5**0.5)
    np.testing.assert_allclose(along, expected.friction, rtol=1e-7)
    assert found.friction.shape == (24, 2) and found.energy_imbalance < 1e-10
    turn = 2 * np.pi * np.arange(24) / 24
    circle = 0.1 * np.stack([np.sin(turn), np.cos(turn)], axis=1)
    round_trip = cycle(stack, surface, circle, 0.5)
    mean = round_trip.work / (LOAD * 0.2 * np.pi)
    np.testing.assert_allclose(round_trip.mean_friction, mean, rtol=2e-6)


def test_steady_sliding_with_shear_is_that_of_slide():
    motion, own = steady(-3.0), law(0.1, 1.0, 0.5)
    found = cycle(s=motion.displacement, period=motion.period, shear=own)
    expected = slide(rubber(), ROUGH, -3.0, shear=own)
    for name in ("mean_friction", "peak_friction"):
        np.testing.assert_allclose(getattr(found, name), expected.friction, rtol=1e-8)
    np.testing.assert_allclose(-found.friction, expected.friction, rtol=1e-8)
    np.testing.assert_allclose(found.mean_shear_friction, expected.shear_friction, rtol=1e-8)
    np.testing.assert_allclose(found.traction, found.friction * LOAD, rtol=1e-12)


def test_shear_follows_from_pressure_and_speed_of_each_time():
    alone = cycle()
    np.testing.assert_allclose(alone.mean_friction, alone.work / (LOAD * 0.8), rtol=2e-6)
    coulomb = cycle(shear=law(0.3, 1.0, 0.0))
    np.testing.assert_array_equal(alone.pressure, coulomb.pressure)
    np.testing.assert_allclose(coulomb.mean_friction - alone.mean_friction, 0.3, rtol=1e-12)
    added = 0.3 * np.sign(np.cos(2 * np.pi * TIMES))
    np.testing.assert_allclose(coulomb.friction - alone.friction, added, atol=1e-12)
    # The sum over the times is exact for a stress in proportion to the speed, whose work is v².
    viscous = cycle(shear=law(0.01, 0.0, 1.0))
    velocity = 0.4 * np.pi * np.cos(2 * np.pi * TIMES)
    stress = 0.01 * velocity * np.asarray(alone.contact_area)
    np.testing.assert_allclose(viscous.work - alone.work, np.mean(stress * velocity), rtol=1e-2)
    np.testing.assert_allclose(viscous.traction - alone.traction, stress, atol=1e-12)
    for found in (coulomb, viscous):  # the block loses what it lost
        np.testing.assert_allclose(found.load_work, alone.load_work, atol=1e-15)
        np.testing.assert_allclose(found.dissipated_power, alone.dissipated_power, rtol=1e-13)


@pytest.mark.parametrize(("amplitude", "rate"), [(1, 1.0), (4, 0.3)])
def test_work_of_one_wave_in_full_contact_is_a_bessel_series(amplitude, rate):
    """s = a sin Ωt makes exp(-iqs) a sum of J_k(qa) exp(-ikΩt), each with the loss at kΩ."""
    wave = gc.Surface(np.cos(2 * np.pi * np.arange(N) / N), gc.Grid((N,), 2 * np.pi))
    moved = amplitude * np.sin(2 * np.pi * TIMES)
    found = cycle(rubber(1.0, 1.0, 0.0), wave, moved, 2 * np.pi / rate, pressure=50.0, rtol=1e-11)
    k = np.arange(-120, 121)
    loss = 0.5 * k * rate / (1 + (k * rate) ** 2)
    np.testing.assert_allclose(found.work, np.pi * np.sum(k * jv(k, amplitude) ** 2 * loss), 1e-9)
    if amplitude == 1:
        np.testing.assert_allclose(2 * found.work, 0.676918, rtol=1e-6)
    assert abs(found.load_work) < 1e-9
    assert found.energy_imbalance < 1e-10


@pytest.mark.parametrize("control", ["pressure", "mean_gap"])
def test_the_contact_is_that_of_a_dense_matrix_in_space_and_time(control):
    """The conditions of contact, by sums over all waves and frequencies; both counts are odd."""
    h = np.random.default_rng(0).normal(size=N) * 0.02
    h -= h.mean()
    s = 0.15 * np.sin(2 * np.pi * TIMES) + 0.05 * np.cos(4 * np.pi * TIMES)
    given = LOAD * (1 + 0.4 * np.sin(2 * np.pi * TIMES))
    given = given if control == "pressure" else 0.01 + 0.005 * TIMES
    found = cycle(rubber(), gc.Surface(h, GRID), s, 0.3, **{control: given}, rtol=1e-11)
    q, w = 2 * np.pi * np.fft.fftfreq(N, 1 / N), 2 * np.pi * np.fft.fftfreq(NT, 0.3 / NT)
    x = np.arange(N) / N
    modulus = 1 + 3 * 1j * w * 0.05 / (1 + 1j * w * 0.05)
    waves = q[q != 0]
    kernel = 2 * (1 - 0.3**2) / (np.abs(waves)[:, None] * modulus)
    point = np.exp(1j * waves * (x[None, :, None] + s[:, None, None]))  # of the block: t, x, q
    beat = np.exp(1j * w * (0.3 * TIMES)[:, None])
    p = np.asarray(found.pressure)
    loads = np.einsum("uyq,uw,uy->qw", point.conj(), beat.conj(), p) / (N * NT)
    gap = np.einsum("txq,tw,qw->tx", point, beat, kernel * loads).real - h
    gap += np.asarray(found.mean_gap)[:, None]
    scale = h.std()
    assert np.all(p >= 0) and np.min(gap) > -1e-7 * scale
    assert np.max(np.abs(p * gap)) < 1e-7 * scale * p.max()
    measured = p.mean(axis=1) if control == "pressure" else found.mean_gap
    np.testing.assert_allclose(measured, given, rtol=1e-12)
    assert 0.1 < np.mean(p > 0) < 0.9
    assert found.energy_imbalance < 1e-10


def test_a_load_cycle_without_motion_loses_what_load_and_approach_do():
    """-∮ σ0 dū is the dissipation, to the order of the times; derivatives by waves."""
    load = LOAD * (1 + 0.5 * np.sin(2 * np.pi * TIMES))
    found = cycle(s=0 * TIMES, pressure=load)
    assert found.mean_friction == 0 and abs(found.work) < 1e-14
    np.testing.assert_allclose(jnp.mean(found.pressure, axis=1), load, rtol=1e-12)
    np.testing.assert_allclose(found.load_work, found.dissipated_power, rtol=1e-9)
    assert found.energy_imbalance < 1e-10
    rate = np.fft.irfft(2j * np.pi * np.arange(NT // 2 + 1) * np.fft.rfft(found.mean_gap), NT)
    np.testing.assert_allclose(-np.mean(load * rate), found.load_work, rtol=3e-3)


def test_a_constant_load_does_no_work_and_a_moving_block_leaves_and_enters():
    steady = cycle()
    assert abs(steady.load_work) < 0.05 * steady.dissipated_power
    entering = cycle(mean_gap=0.06 * (1 + 0.9 * np.cos(2 * np.pi * TIMES)))
    touching = np.mean(entering.pressure, axis=1) > 0
    assert 0 < touching.mean() < 1
    np.testing.assert_array_equal(np.isnan(entering.friction), ~touching)
    assert np.isfinite(entering.mean_friction) and entering.energy_imbalance < 1e-10


def test_moduli_far_apart_and_light_contacts_converge():
    far = gc.Prony(1.0, np.full(7, 1000 / 7), np.logspace(-4, 2, 7), 0.3)
    for load in (0.3, 0.003):
        found = cycle(gc.Stack(base=gc.HalfSpace(far)), pressure=load, rtol=1e-6)
        assert found.contact.error <= 1e-6
        assert found.contact.num_fft_pairs < 2000
