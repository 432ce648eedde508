"""Errors by the grid and by the times, against finer grids and more times."""

import jax
import numpy as np
import pytest

import graded_contact as gc

CELL, Q0 = 8e-3, 2 * np.pi / 8e-3
N = 16  # points of the coarse planes, with waves down to half of the cell
RUBBER = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [9e6], [1e-3], 0.49)))


def rough(n, cut, seed=0):
    """With a small wave that half the grid lacks: so the errors of all are one program."""
    spectrum = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=Q0, q_roll=Q0, q_high=cut * Q0)
    surface = gc.random_surface(spectrum, gc.Grid((n, n), CELL), jax.random.key(seed))
    small = 8e-7 * np.cos(10 * np.pi * np.arange(n) / n)[:, None]
    return gc.Surface(surface.heights + small, surface.grid)


def finer(surface, factor):
    """The same waves at more points; a Nyquist wave is half of each direction."""
    heights = np.asarray(surface.heights)
    for axis, n in enumerate(heights.shape):
        waves = np.moveaxis(np.fft.fft(heights, axis=axis), axis, 0)
        finer = np.zeros((factor * n, *waves.shape[1:]), complex)
        finer[: n // 2], finer[1 - n // 2 :] = waves[: n // 2], waves[n // 2 + 1 :]
        finer[n // 2] = finer[-(n // 2)] = waves[n // 2] / 2
        heights = np.moveaxis(np.fft.ifft(finer, axis=0).real * factor, 0, axis)
    return gc.Surface(heights, gc.Grid(heights.shape, CELL))


def slide(surface, pressure=2e5, velocity=0.5, **more):
    return gc.slide(RUBBER, surface, pressure=pressure, velocity=velocity, **more)


def known(found):
    """With all numbers of all tests: one program, where each set of numbers has its own."""
    names = "friction", "contact_area"
    also = "contact_area_pixels", "last_octave_friction", "shortest_wave"
    found.compute(*names, *(f"{name}_error" for name in (*names, "mean_gap")), *also)
    return found


def fine_of(surface, *load, **more):
    """On a grid four times finer, without errors."""
    found = slide(finer(surface, 4), *load, **more)
    found.compute("friction", "contact_area")
    return found


@pytest.fixture(scope="module")
def coarse():
    return known(slide(rough(N, 2)))


def test_errors_contain_the_change_to_a_finer_grid(coarse):
    fine = fine_of(rough(N, 2))
    for name in ("friction", "contact_area", "mean_gap"):
        error, off = getattr(coarse, f"{name}_error"), getattr(coarse, name) - getattr(fine, name)
        assert abs(off) <= error <= 0.2 * getattr(coarse, name)
    assert coarse.contact_area_pixels > 1.05 * fine.contact_area > coarse.contact_area


def test_friction_of_the_last_octave_is_that_of_its_waves(coarse):
    qx, qy = np.meshgrid(*[np.fft.fftfreq(N, 1 / N)] * 2, indexing="ij")
    highest = (qx == -N // 2) | (qy == -N // 2)  # without a direction
    q, rate = Q0 * np.hypot(qx, qy), 1j * Q0 * qx * np.where(highest, 0, 0.5)
    q[0, 0] = np.inf
    kernel = 2 * (1 - 0.49**2) / q / (1e6 + 9e6 * rate * 1e-3 / (1 + rate * 1e-3))
    lost = np.abs(rate * kernel.imag * np.abs(np.fft.fft2(coarse.pressure)) ** 2)
    share = np.sum(lost[(q > 2.501 * Q0) & np.isfinite(q)]) / np.sum(lost)
    np.testing.assert_allclose(coarse.last_octave_friction, share, rtol=1e-9)
    np.testing.assert_allclose(coarse.shortest_wave, CELL / 5, rtol=1e-9)
    assert share > 0.05


def test_near_full_contact_errors_contain_what_the_points_do_not_see():
    """The contact without the waves that half the grid lacks is full on both grids.

    The errors of friction and area are below 0.1 of them on 32² points.
    """
    rng, n = np.random.default_rng(1), N
    k = np.fft.fftfreq(n, 1 / n)
    q = np.hypot(k[:, None], k)
    noise = np.fft.fft2(rng.normal(size=(n, n)))
    heights = np.fft.ifft2(np.where(q > 0, np.maximum(q, 1) ** -1.5, 0) * noise).real * 1e-5
    surface = gc.Surface(heights, gc.Grid((n, n), CELL))
    for pressure in (25e3, 100e3):  # the last is full on all grids, with Nyquist waves
        found, fine = known(slide(surface, pressure)), fine_of(surface, pressure)
        assert found.near.half.contact_area == 1
        for name, most in (("friction", 0.2), ("contact_area", 0.15), ("mean_gap", 0.6)):
            off = abs(getattr(found, name) - getattr(fine, name))
            assert off <= getattr(found, f"{name}_error") <= most * abs(getattr(found, name)) + 1e-9
    assert found.contact_area_error < 1e-12


def test_friction_at_a_gap_of_zero_has_the_error_of_its_load():
    """The least pressure that closes the contact has its lowest value between the points."""

    def heights(x):
        return sum(1e-6 * np.cos(2 * np.pi * k * x + 0.7 * k * k) / k for k in (1, 2))

    ridges = np.broadcast_to(heights((np.arange(N) + 0.5) / N)[:, None], (N, N))
    found = at_gap(RUBBER, gc.Surface(ridges, gc.Grid((N, N), CELL)), 0.0)
    q = Q0 * np.arange(2049)
    rate = -1j * q * 0.5
    q[0] = np.inf  # its part of the pressure is free
    modulus = (1e6 + 9e6 * rate * 1e-3 / (1 + rate * 1e-3)) / (1 - 0.49**2)
    waves = np.fft.rfft(heights(np.arange(4096) / 4096)) * modulus / 2
    full = np.fft.irfft(waves * np.where(np.isinf(q), 0, q))
    traction = -np.mean(full * np.fft.irfft(1j * Q0 * np.arange(2049) * waves * 2 / modulus))
    load = -np.min(full)
    # Of 8 points to a wave the error is an eighth.
    for name, true in (("mean_pressure", load), ("friction", traction / load)):
        off = abs(getattr(found, name) - true)
        assert 0.002 * true < off <= getattr(found, f"{name}_error") <= true / 8


def at_gap(block, surface, gap):
    found = gc.slide(block, surface, mean_gap=gap, velocity=0.5)
    found.compute("friction", "friction_error", "mean_pressure_error")
    return found


def test_an_elastic_block_has_no_friction_on_any_grid():
    # Of a branch without strength, whose kernel is complex: it shares a program.
    block = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [1e-9], [1e-3], 0.49)))
    found = known(gc.slide(block, rough(N, 2), pressure=2e5, velocity=0.5))
    assert abs(found.friction) <= found.friction_error < 1e-12


def test_a_wave_of_two_points_has_an_error_of_friction():
    """It has no direction on the grid, so no friction; on finer grids it has."""
    wave = gc.Surface(np.tile([1e-6, -1e-6], (N, N // 2)).T, gc.Grid((N, N), CELL))
    found, fine = slide(wave, 2e6), fine_of(wave, 2e6)
    assert found.friction == 0 and fine.friction > 1e-6
    assert fine.friction < found.friction_error < 30 * fine.friction


def test_a_surface_with_waves_that_half_the_grid_lacks_has_an_error_too():
    surface = rough(N, 8)
    found, fine = known(slide(surface)), fine_of(surface)
    assert 0.12 < found.near.lacking < 0.5
    for name in ("friction", "contact_area"):
        off = abs(getattr(found, name) - getattr(fine, name))
        assert off <= getattr(found, f"{name}_error") <= getattr(found, name)


def test_a_body_that_flows_touches_at_least_as_much_as_its_load_needs():
    found = slide(rough(N, 4), law=gc.HardWall(1e6))
    assert found.contact_area >= 0.2 * (1 - 1e-9)
    opened = np.where(found.pressure < 1e6, found.gap, 0)  # where it flows the gap is 0
    np.testing.assert_allclose(found.mean_gap, np.mean(opened), rtol=1e-9)
    assert np.min(found.gap) < -1e-6


PLACE = 2 * np.pi * np.arange(32) / 32
WAVES = gc.Surface(
    sum(2e-4 / k * np.cos(k * PLACE + k * k) for k in (1, 2, 3, 4)), gc.Grid(32, CELL)
)


def cycle(num_times, amplitude=2e-3, pulse=0.0, phase=0.0, errors=True, **how):
    """With all numbers of all tests, which share two programs: with errors and without."""
    motion = gc.sliding.sinusoidal(amplitude, 100.0, num_times)
    given = dict(displacement=motion.displacement, period=motion.period)
    pressure = 2e5 * (1 + pulse * np.sin(2 * np.pi * np.arange(num_times) / num_times + phase))
    found = gc.slide_cycle(RUBBER, WAVES, **given, pressure=pressure, **how)
    names = "mean_friction", "contact_area", "load_work", "dissipated_power"
    found.compute(*names, *(f"{name}_error" for name in names if errors))
    return found


def test_errors_of_a_cycle_contain_those_of_the_times_and_of_the_solver():
    found, loose, close = (cycle(16, rtol=rtol) for rtol in (None, 2e-3, 1e-9))
    fine = cycle(32, errors=False)
    off = np.abs(found.contact_area - fine.contact_area[::2])
    assert np.all(off <= found.error_parts("contact_area")["time"])
    assert np.all(found.contact_area_error < found.contact_area)
    parts = found.error_parts("mean_friction")
    missed = abs(found.mean_friction - fine.mean_friction)
    assert missed <= parts["time"] <= 0.5 * abs(fine.mean_friction)
    np.testing.assert_allclose(found.mean_friction_error, sum(parts.values()), rtol=1e-12)
    missed = abs(loose.mean_friction - close.mean_friction)
    assert 0 < missed <= loose.error_parts("mean_friction")["solver"]
    rms = lambda field: np.sqrt(np.mean(np.square(field)))  # noqa: E731
    assert rms(loose.pressure - close.pressure) <= loose.contact.error * rms(close.pressure)


@pytest.mark.parametrize("phase", [0.0, 1.0])
def test_errors_of_the_work_of_a_load_contain_those_of_the_times(phase):
    """The block rests, so that friction has no power; at each time most power is elastic."""
    found, fine = (cycle(n, 0.0, 0.5, phase, errors=n == 16) for n in (16, 32))
    for name in ("load_work", "dissipated_power"):
        off = abs(getattr(found, name) - getattr(fine, name))
        error = found.error_parts(name)["time"]
        assert off <= error <= 0.02 * getattr(found, name)
