"""Errors by the grid and by the times, against finer grids and more times."""

import jax
import numpy as np
import pytest

import graded_contact as gc

CELL, Q0 = 8e-3, 2 * np.pi / 8e-3
RUBBER = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [9e6], [1e-3], 0.49)))


def rough(n, cut, seed=0, ndim=2):
    spectrum = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=Q0, q_roll=Q0, q_high=cut * Q0)
    return gc.random_surface(spectrum, gc.Grid((n,) * ndim, CELL), jax.random.key(seed))


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
    """With all its numbers: one program for all tests, where each set of numbers has its own."""
    found.compute(*found.numbers)
    return found


@pytest.fixture(scope="module")
def coarse():
    return known(slide(rough(32, 4)))


def test_errors_contain_the_change_to_a_finer_grid(coarse):
    fine = known(slide(finer(rough(32, 4), 4)))
    for name in ("friction", "contact_area", "mean_gap"):
        error, off = getattr(coarse, f"{name}_error"), getattr(coarse, name) - getattr(fine, name)
        assert abs(off) <= error <= 0.2 * getattr(coarse, name)
        assert getattr(fine, f"{name}_error") < error / 3
    assert coarse.contact_area_pixels > 1.05 * fine.contact_area > coarse.contact_area


def test_friction_of_the_last_octave_is_that_of_its_waves(coarse):
    qx, qy = np.meshgrid(np.fft.fftfreq(32, 1 / 32), np.fft.fftfreq(32, 1 / 32), indexing="ij")
    highest = (qx == -16) | (qy == -16)  # without a direction
    q, rate = Q0 * np.hypot(qx, qy), 1j * Q0 * qx * np.where(highest, 0, 0.5)
    q[0, 0] = np.inf
    kernel = 2 * (1 - 0.49**2) / q / (1e6 + 9e6 * rate * 1e-3 / (1 + rate * 1e-3))
    lost = np.abs(rate * kernel.imag * np.abs(np.fft.fft2(coarse.pressure)) ** 2)
    share = np.sum(lost[(q > 2.001 * Q0) & np.isfinite(q)]) / np.sum(lost)
    np.testing.assert_allclose(coarse.last_octave_friction, share, rtol=1e-9)
    np.testing.assert_allclose(coarse.shortest_wave, CELL / 4, rtol=1e-9)
    assert share > 0.1 and any("Waves shorter than 0.002 m" in one for one in coarse.warnings)


def test_near_full_contact_errors_contain_what_the_points_do_not_see():
    """The contact without the waves that half the grid lacks is full on both grids."""
    rng, n = np.random.default_rng(1), 32
    k = np.fft.fftfreq(n, 1 / n)
    q = np.hypot(k[:, None], k)
    noise = np.fft.fft2(rng.normal(size=(n, n)))
    heights = np.fft.ifft2(np.where(q > 0, np.maximum(q, 1) ** -1.5, 0) * noise).real * 1e-5
    surface = gc.Surface(heights, gc.Grid((n, n), CELL))
    for pressure in (25e3, 100e3):  # the last is full on all grids, with Nyquist waves
        found, fine = (known(slide(s, pressure)) for s in (surface, finer(surface, 4)))
        assert found.near.half.contact_area == 1
        for name, most in (("friction", 0.1), ("contact_area", 0.1), ("mean_gap", 0.6)):
            off = abs(getattr(found, name) - getattr(fine, name))
            assert off <= getattr(found, f"{name}_error") <= most * abs(getattr(found, name)) + 1e-9
    assert found.contact_area_error < 1e-12


def test_friction_at_a_gap_of_zero_has_the_error_of_its_load():
    """The least pressure that closes the contact has its lowest value between the points."""
    heights = lambda x: sum(1e-6 * np.cos(2 * np.pi * k * x + 0.7 * k * k) / k for k in (1, 3, 8))  # noqa: E731
    found = slide(gc.Surface(heights(np.arange(64) / 64 + 1 / 128), gc.Grid((64,), CELL)), None,
                  mean_gap=0.0)  # fmt: skip
    q = Q0 * np.arange(2049)
    rate = -1j * q * 0.5
    q[0] = np.inf  # its part of the pressure is free
    modulus = (1e6 + 9e6 * rate * 1e-3 / (1 + rate * 1e-3)) / (1 - 0.49**2)
    waves = np.fft.rfft(heights(np.arange(4096) / 4096)) * modulus / 2
    full = np.fft.irfft(waves * np.where(np.isinf(q), 0, q))
    traction = -np.mean(full * np.fft.irfft(1j * Q0 * np.arange(2049) * waves * 2 / modulus))
    load = -np.min(full)
    for name, true in (("mean_pressure", load), ("friction", traction / load)):
        off = abs(getattr(found, name) - true)
        assert 0.002 * true < off <= getattr(found, f"{name}_error") <= 0.1 * true


def test_a_wave_of_two_points_has_an_error_of_friction():
    """It has no direction on the grid, so no friction; on finer grids it has."""
    wave = gc.Surface(np.tile([1e-6, -1e-6], (32, 16)).T, gc.Grid((32, 32), CELL))
    found, fine = (slide(s, 2e6) for s in (wave, finer(wave, 4)))
    assert found.friction == 0 and fine.friction > 1e-6
    assert fine.friction < found.friction_error < 30 * fine.friction


def test_a_surface_with_waves_that_half_the_grid_lacks_has_an_error_too():
    surface = rough(32, 16)
    found, fine = known(slide(surface)), known(slide(finer(surface, 4)))
    assert 0.12 < found.near.lacking < 0.5
    # Half of the finer grid lacks nothing: the contact is not solved again.
    assert fine.near.same is None
    for name in ("friction", "contact_area"):
        off = abs(getattr(found, name) - getattr(fine, name))
        assert off <= getattr(found, f"{name}_error") <= getattr(found, name)


def test_a_body_on_a_window_has_the_error_of_its_grid():
    """Hertz: the approach R d = a² and the area."""
    n, radius, a = 24, 0.05, 1.2e-3
    x = ((np.arange(n) + 0.5) / n - 0.5) * CELL
    body = gc.Surface(-(x[:, None] ** 2 + x**2) / (2 * radius), gc.Grid((n, n), CELL),
                      periodic=False)  # fmt: skip
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(1e6, 0.5)))
    load = 4 / 3 * (1e6 / 0.75) * a**3 / radius / CELL**2
    found = gc.slide(block, body, pressure=load, velocity=0.0)
    found.compute("approach_error", "contact_area_error", "approach", "contact_area")
    off = abs(found.approach - a**2 / radius)
    assert off <= found.approach_error <= 0.1 * found.approach
    off = abs(found.contact_area - np.pi * a**2 / CELL**2)
    assert off <= found.contact_area_error <= 0.4 * found.contact_area


def test_an_elastic_block_has_no_friction_on_any_grid_and_a_load_at_its_mean_gap():
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(1e6, 0.49)))
    surface = rough(32, 4)
    found, fine = (
        gc.slide(block, s, mean_gap=1.5e-4, velocity=1.0) for s in (surface, finer(surface, 4))
    )
    known(found)
    assert abs(found.friction) <= found.friction_error < 1e-12
    off = abs(found.mean_pressure - fine.mean_pressure)
    assert off <= found.mean_pressure_error <= 0.2 * found.mean_pressure
    assert "mean_pressure_error" in found.numbers


def test_a_body_that_flows_touches_at_least_as_much_as_its_load_needs():
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(1e7, 0.49)))
    given = dict(pressure=2e5, velocity=0.0, law=gc.HardWall(1e6))
    found, fine = (gc.slide(block, s, **given) for s in (rough(32, 8), finer(rough(32, 8), 4)))
    found.compute("contact_area", "contact_area_error")
    assert found.contact_area >= 0.2 * (1 - 1e-9)
    opened = np.where(found.pressure < 1e6, found.gap, 0)  # where it flows the gap is 0
    np.testing.assert_allclose(found.mean_gap, np.mean(opened), rtol=1e-9)
    assert np.min(found.gap) < -1e-6
    assert abs(found.contact_area - fine.contact_area) <= found.contact_area_error < 1


def cycle(num_times, stroke=2e-3):
    surface = rough(32, 4, ndim=1)
    motion = gc.sliding.sinusoidal(stroke, 100.0, num_times)
    return gc.slide_cycle(
        RUBBER, surface, displacement=motion.displacement, period=motion.period, pressure=2e5,
        solver=gc.contacts.DouglasRachford(newton=False),
    )  # fmt: skip


def test_errors_of_a_cycle_contain_the_times():
    found, fine = cycle(24), cycle(48)
    names = "mean_friction", "peak_friction", "work", "contact_area"
    found.compute(*names, *(f"{name}_error" for name in names))
    numbers = dict(zip(names, fine.compute(*names), strict=True))
    off = np.abs(found.contact_area - numbers["contact_area"][::2])
    assert np.all(off <= found.error_parts("contact_area")["time"])
    assert np.all(found.contact_area_error < found.contact_area)
    for name in names[:3]:
        off = abs(getattr(found, name) - numbers[name])
        assert off <= found.error_parts(name)["time"] <= 0.5 * abs(getattr(found, name))
        total = getattr(found, f"{name}_error")
        np.testing.assert_allclose(total, sum(found.error_parts(name).values()), rtol=1e-12)


def test_claim_under_attraction_holds_where_half_the_grid_does_not_resolve_it():
    """And the contact is that of Johnson's wave: p = p* sin²(πa) - p* α √tan(πa), a range apart."""
    amplitude, modulus, alpha = 1e-5, 1e6, 0.2
    full = np.pi * modulus * amplitude / CELL
    work = alpha**2 * np.pi / 2 * amplitude * full
    law = gc.contacts.ExponentialAdhesion(5e-7, work)
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(0.75 * modulus, 0.5)))

    def wave(n):
        heights = amplitude * np.cos(2 * np.pi * np.arange(n) / n)
        surface = gc.Surface(heights, gc.Grid((n,), CELL))
        return gc.slide(block, surface, pressure=0.1 * full, velocity=0.0, law=law)

    coarse, fine = wave(256), wave(1024)
    coarse.compute("contact_area", "contact_area_error", "mean_gap", "mean_gap_error")
    assert coarse.near.half.contact.result == gc.contacts.RESULTS.unresolved
    for name in ("contact_area", "mean_gap"):
        error, off = getattr(coarse, f"{name}_error"), getattr(coarse, name) - getattr(fine, name)
        assert abs(off) <= error <= 0.1 * getattr(coarse, name)
    half = np.pi / 2 * float(fine.contact_area)
    pressure = np.sin(half) ** 2 - alpha * np.sqrt(np.tan(half))
    np.testing.assert_allclose(pressure, 0.1, atol=0.05)
