"""Periodic motion: steady sliding, closed forms, brute force, energy, derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import jv

import graded_contact as gc
from graded_contact.sliding import (
    PeakedShear,
    sinusoidal,
    slide_cycle,
    steady,
)

N = 32
GRID = gc.Grid((N,), 1.0)


def rough(grid, cut, seed=0):
    """A self-affine surface with wavelengths down to the `cut`-th part of the cell."""
    q0 = 2 * np.pi
    spectrum = gc.SelfAffine(
        rms_slope=0.2, hurst=0.8, q_low=q0, q_roll=min(4, 0.9 * cut) * q0, q_high=cut * q0
    )
    return gc.random_surface(spectrum, grid, jax.random.key(seed))


ROUGH = rough(GRID, cut=6)
LOAD = 0.05
TIMES = np.arange(N) / N
SINE = 0.2 * np.sin(2 * np.pi * TIMES)


PLAIN = gc.contacts.DouglasRachford(newton=False)  # compiles in two thirds of the time


def rubber(strength=3.0, time=0.05, poisson=0.3):
    """A half space with one relaxation time."""
    return gc.Stack(base=gc.HalfSpace(gc.Prony(1.0, [strength], [time], poisson)))


def cycle(stack=None, surface=ROUGH, s=SINE, period=1.0, **options):
    given = {"pressure": LOAD} if "mean_gap" not in options else {}
    job = {"rtol": 1e-9} | given | options
    stack = rubber() if stack is None else stack
    return slide_cycle(stack, surface, displacement=s, period=period, **job)


def test_steady_sliding_is_that_of_slide():
    motion = steady(-3.0, GRID)
    found = cycle(s=motion.displacement, period=motion.period, rtol=1e-11)
    expected = gc.slide(rubber(), ROUGH, pressure=LOAD, velocity=-3.0, rtol=1e-11)
    found.compute("mean_friction", "friction", "mean_gap", "contact_area", "energy_imbalance")
    expected.compute("friction", "contact_area")
    np.testing.assert_allclose(found.mean_friction, expected.friction, rtol=1e-9)
    np.testing.assert_allclose(-found.friction, expected.friction, rtol=1e-9)
    np.testing.assert_allclose(found.mean_gap, expected.mean_gap, rtol=1e-9)
    np.testing.assert_allclose(found.contact_area, expected.contact_area, rtol=1e-9)
    assert found.energy_imbalance < 1e-10


def test_steady_sliding_in_two_dimensions_is_that_of_slide():
    grid = gc.Grid((16, 16), 1.0)
    surface = rough(grid, cut=4)
    moved = np.repeat(np.arange(32.0)[:, None] / 32, 2, axis=1)
    stack = gc.Stack(layers=(gc.Layer(gc.Elastic(2.0, 0.4), 0.05),), base=rubber().base)
    found = cycle(stack, surface, moved, 0.5, rtol=1e-11)
    expected = gc.slide(stack, surface, pressure=LOAD, velocity=(2.0, 2.0), rtol=1e-11)
    found.compute("mean_friction", "friction", "energy_imbalance", "largest_step")
    np.testing.assert_allclose(found.mean_friction, expected.friction, rtol=1e-9)
    along = found.friction @ np.full(2, 0.5**0.5)
    np.testing.assert_allclose(along, expected.friction, rtol=1e-8)
    assert found.friction.shape == (32, 2) and found.largest_step == 1
    assert found.energy_imbalance < 1e-10


@pytest.mark.parametrize(
    "law", [PeakedShear(0.05, 1.0, 0.5), lambda p, v, t: 0.1 * p * v**0.5], ids=["peak", "own"]
)
def test_steady_sliding_with_shear_is_that_of_slide(law):
    motion = steady(-3.0, GRID)
    found = cycle(s=motion.displacement, period=motion.period, shear=law)
    expected = gc.slide(rubber(), ROUGH, pressure=LOAD, velocity=-3.0, shear=law, rtol=1e-9)
    names = "mean_friction", "peak_friction", "friction", "mean_shear_friction", "traction"
    found.compute(*names)
    expected.compute("friction", "shear_friction")
    for name in ("mean_friction", "peak_friction"):
        np.testing.assert_allclose(getattr(found, name), expected.friction, rtol=1e-8)
    np.testing.assert_allclose(-found.friction, expected.friction, rtol=1e-8)
    np.testing.assert_allclose(found.mean_shear_friction, expected.shear_friction, rtol=1e-8)
    np.testing.assert_allclose(found.traction, found.friction * LOAD, rtol=1e-12)


def test_shear_follows_from_pressure_and_speed_of_each_time():
    alone = cycle()
    coulomb = cycle(shear=lambda p, v, t: 0.3 * p)
    np.testing.assert_array_equal(alone.pressure, coulomb.pressure)
    np.testing.assert_allclose(coulomb.mean_friction - alone.mean_friction, 0.3, rtol=1e-12)
    moving = np.abs(np.cos(2 * np.pi * TIMES)) > 1e-9
    added = np.where(moving, 0.3 * np.sign(np.cos(2 * np.pi * TIMES)), 0)
    np.testing.assert_allclose(coulomb.friction - alone.friction, added, atol=1e-12)
    # The sum over the times is exact for a stress in proportion to the speed, whose work is v².
    viscous = cycle(shear=lambda p, v, t: 0.01 * v)
    velocity = 0.4 * np.pi * np.cos(2 * np.pi * TIMES)
    stress = 0.01 * velocity * np.asarray(alone.contact_area)
    np.testing.assert_allclose(viscous.work - alone.work, np.mean(stress * velocity), rtol=1e-2)
    np.testing.assert_allclose(viscous.traction - alone.traction, stress, atol=1e-12)
    for found in (coulomb, viscous):  # the block loses what it lost
        np.testing.assert_allclose(found.load_work, alone.load_work, atol=1e-15)
        assert found.dissipated_power == alone.dissipated_power


@pytest.mark.parametrize(("amplitude", "rate"), [(1, 1.0), (5, 0.3), (20, 0.1)])
def test_work_of_one_wave_in_full_contact_is_a_bessel_series(amplitude, rate):
    """s = a sin Ωt makes exp(-iqs) a sum of J_k(qa) exp(-ikΩt), each with the loss at kΩ."""
    grid = gc.Grid((8,), 2 * np.pi)
    wave = gc.Surface(np.cos(2 * np.pi * np.arange(8) / 8), grid)
    motion = sinusoidal(2 * amplitude, rate / (2 * np.pi))
    stack = rubber(1.0, 1.0, 0.0)
    found = cycle(stack, wave, motion.displacement, motion.period, pressure=50.0, rtol=1e-10)
    found.compute("work", "load_work", "energy_imbalance")
    k = np.arange(-120, 121)
    loss = 0.5 * k * rate / (1 + (k * rate) ** 2)
    np.testing.assert_allclose(found.work, np.pi * np.sum(k * jv(k, amplitude) ** 2 * loss), 1e-9)
    listed = {1: 0.676918, 5: 4.655967, 20: 17.366306}[amplitude]
    np.testing.assert_allclose(2 * found.work, listed, rtol=1e-6)
    assert abs(found.load_work) < 1e-9
    assert found.energy_imbalance < 1e-10


@pytest.mark.parametrize("control", ["pressure", "mean_gap"])
def test_the_contact_is_that_of_a_dense_matrix_in_space_and_time(control):
    """The conditions of contact, by sums over all waves and frequencies; both counts are odd."""
    n, nt = 11, 9
    grid, rng = gc.Grid((n,), 1.0), np.random.default_rng(0)
    h = rng.normal(size=n) * 0.02
    h -= h.mean()
    t = np.arange(nt) / nt
    s = 0.15 * np.sin(2 * np.pi * t) + 0.05 * np.cos(4 * np.pi * t)
    given = 0.05 * (1 + 0.4 * np.sin(2 * np.pi * t)) if control == "pressure" else 0.01 + 0.005 * t
    found = cycle(rubber(), gc.Surface(h, grid), s, 0.3, **{control: given}, rtol=1e-11)
    q, w = 2 * np.pi * np.fft.fftfreq(n, 1 / n), 2 * np.pi * np.fft.fftfreq(nt, 0.3 / nt)
    modulus = 1 + 3 * 1j * w * 0.05 / (1 + 1j * w * 0.05)
    waves = q[q != 0]
    kernel = 2 * (1 - 0.3**2) / (np.abs(waves)[:, None] * modulus)
    x = np.arange(n) / n
    point = np.exp(1j * waves * (x[None, :, None] + s[:, None, None]))  # of the block: t, x, q
    beat = np.exp(1j * w * (0.3 * t)[:, None])
    matrix = np.einsum("txq,uyq,qw,tw,uw->txuy", point, point.conj(), kernel, beat, beat.conj())
    p = np.asarray(found.pressure)
    gap = np.einsum("txuy,uy->tx", matrix.real / (n * nt), p) - h
    gap += np.asarray(found.mean_gap)[:, None]
    scale = h.std()
    assert np.all(p >= 0) and np.min(gap) > -1e-7 * scale
    assert np.max(np.abs(p * gap)) < 1e-7 * scale * p.max()
    measured = p.mean(axis=1) if control == "pressure" else found.mean_gap
    np.testing.assert_allclose(measured, given, rtol=1e-12)
    assert 0.1 < np.mean(p > 0) < 0.9
    assert found.energy_imbalance < 1e-10


def test_slow_motion_is_the_relaxed_contact_and_fast_sliding_the_glassy_one():
    slow = cycle(period=1e8)
    relaxed = gc.slide(rubber(), ROUGH, pressure=LOAD, velocity=0.0, rtol=1e-10)
    np.testing.assert_allclose(slow.mean_gap, relaxed.mean_gap, rtol=1e-6)
    assert abs(slow.mean_friction) < 1e-6
    fast = cycle(period=1e-8)
    assert 0 <= fast.mean_friction < 1e-6
    assert slow.energy_imbalance < 1e-10 and fast.energy_imbalance < 1e-10
    motion = steady(1e8, GRID)
    glassy = gc.Stack(base=gc.HalfSpace(gc.Elastic(4.0, 0.3)))
    expected = gc.slide(glassy, ROUGH, pressure=LOAD, velocity=0.0, rtol=1e-10)
    gliding = cycle(s=motion.displacement, period=motion.period)
    np.testing.assert_allclose(gliding.mean_gap, expected.mean_gap, rtol=1e-5)


def test_a_load_cycle_without_motion_loses_what_load_and_approach_do():
    """-∮ σ0 dū is the dissipation, to the order of the times."""
    lost = []
    for count in (32, 128):
        t = np.arange(count) / count
        load = LOAD * (1 + 0.5 * np.sin(2 * np.pi * t))
        found = cycle(s=0 * t, pressure=load)
        assert found.mean_friction == 0 and abs(found.work) < 1e-14
        np.testing.assert_allclose(found.load, load, rtol=1e-12)
        np.testing.assert_allclose(found.load_work, found.dissipated_power, rtol=1e-9)
        assert found.energy_imbalance < 1e-10
        gap = np.asarray(found.mean_gap)
        by_gap = -np.sum((load + np.roll(load, -1)) / 2 * (np.roll(gap, -1) - gap))
        lost.append(by_gap / found.load_work - 1)
    assert abs(lost[1]) < 3e-3 and abs(lost[1]) < 0.3 * abs(lost[0])


@pytest.mark.slow
def test_a_constant_load_does_no_work_and_a_moving_block_leaves_and_enters():
    steady = cycle()
    assert abs(steady.load_work) < 0.05 * steady.dissipated_power
    gap = 0.06 * (1 + 0.9 * np.cos(2 * np.pi * TIMES))
    entering = cycle(mean_gap=gap)
    touching = np.asarray(entering.load) > 0
    assert 0 < touching.mean() < 1
    np.testing.assert_array_equal(np.isnan(entering.friction), ~touching)
    assert np.isfinite(entering.mean_friction) and entering.energy_imbalance < 1e-10


@pytest.mark.parametrize("control", ["pressure", pytest.param("mean_gap", marks=pytest.mark.slow)])
def test_claimed_errors_hold(control):
    """The gap nearly closes at some times: a mean gap that is off costs far more load there."""
    for seed, contrast in enumerate((2.0, 30.0)):
        surface = rough(GRID, cut=10, seed=seed)
        stack = rubber(contrast)
        size = LOAD if control == "pressure" else jnp.std(surface.heights)
        given = {control: size * (1.02 + np.sin(2 * np.pi * TIMES))}
        given["shear"] = PeakedShear(0.02, 1.0, 0.5)
        names = "mean_friction", "peak_friction"
        needed = (*names, *(f"{name}_error" for name in names))
        close = cycle(stack, surface, rtol=1e-9, **given)
        close.compute(*needed)  # by the program of the others
        for rtol in (1e-3, 1e-4):
            loose = cycle(stack, surface, **given, rtol=rtol)
            loose.compute(*needed)
            for name in names:
                error = abs(getattr(loose, name) - getattr(close, name))
                assert error <= loose.error_parts(name)["solver"]
            wrong = loose.pressure - close.pressure
            size = jnp.sqrt(jnp.mean(close.pressure**2))
            assert jnp.sqrt(jnp.mean(wrong**2)) <= loose.contact.error * size


def test_moduli_far_apart_and_light_contacts_converge():
    stack = gc.Stack(
        base=gc.HalfSpace(gc.Prony(1.0, np.full(7, 1000 / 7), np.logspace(-4, 2, 7), 0.3))
    )
    for load in (0.3, 0.003):
        found = cycle(stack, pressure=load, rtol=1e-6)
        assert found.contact.error <= 1e-6
        assert found.contact.num_fft_pairs < 2000


@pytest.mark.slow
def test_a_table_of_a_graded_kernel_is_as_good_as_it_says(monkeypatch):
    from graded_contact.kernels import steady as kernels
    from graded_contact.kernels.periodic import periodic_kernel

    monkeypatch.setattr(kernels, "_FEW_POINTS", 100)
    grid, period = gc.Grid((64,), 1.0), jnp.asarray(0.71)
    graded = gc.GradedLayer(gc.Blend(gc.Elastic(1.0, 0.4), rubber().base.material), 0.1)
    solver = gc.response.Layering(rtol=1e-6)
    stack = gc.Stack(layers=(graded,), base=rubber().base, graded_solver=solver)
    kernel, error = periodic_kernel(stack, grid, 16, period)
    q, omega = 2 * np.pi * np.arange(1, 33), 2 * np.pi * np.arange(9) / 0.71
    expected = gc.surface_compliance(stack, q, omega[:, None], rtol=1e-8)
    off = np.max(np.abs(kernel[:9, 1:] / expected - 1))
    assert off <= error <= 1e-6


def pressure_by_steps(surface, displacement, tau, branch, num_cycles=3):
    """Pressures of the last cycle, by steps in time with an internal variable.

    Waves of a branch's stretch r relax as τ ṙ = w - r, and σ = q/2 (w + E1 (w - r)): a step is an
    elastic contact of the heights less what is remembered, which is carried back as the surface
    moves. With w linear in a step of τ x, r' = e r + (m - e) w + (1 - m) w', m = (1 - e)/x.
    """
    n, num_times = surface.grid.shape[0], len(displacement)
    q = 2 * np.pi * np.arange(n // 2 + 1)
    left = np.exp(-1 / (num_times * tau))
    mean = (1 - left) * tau * num_times
    stiff = 1 + mean * branch
    kernel = 2 / (np.maximum(q, 1) * stiff)

    def advance(state, by):
        remembered, start = state
        pushed = jnp.fft.irfft(jnp.exp(1j * q * by) * remembered, n)
        memory = branch / stiff * pushed
        found = gc.solve_contact(kernel, surface.heights - memory, LOAD, rtol=1e-7, start=start)
        w = found.displacement + memory
        remembered = jnp.fft.rfft(left * (pushed + (1 - mean) * w) + (mean - left) * w)
        return (remembered, found.pressure), found.pressure

    one_cycle = jax.jit(lambda state: jax.lax.scan(advance, state, moved))
    moved = jnp.asarray(displacement - np.roll(displacement, 1))
    state, pressures = (jnp.zeros(len(q), complex), jnp.full(n, LOAD)), None
    for _ in range(num_cycles):
        state, pressures = one_cycle(state)
    return np.asarray(pressures)


@pytest.mark.slow
def test_time_steps_go_to_the_cycle_with_second_order():
    """An odd count of points: steps treat waves on Nyquist lines in another way."""
    surface = rough(gc.Grid((33,), 1.0), cut=6)
    stack = rubber(9.0, 0.05, 0.0)
    fine = 0.2 * np.sin(2 * np.pi * np.arange(256) / 256)
    best = np.asarray(cycle(stack, surface, fine).pressure)
    errors = []
    for every in (4, 2):
        stepped = pressure_by_steps(surface, fine[::every], 0.05, 9.0)
        wrong = np.linalg.norm(stepped - best[::every]) / np.linalg.norm(best[::every])
        errors.append(wrong)
    assert errors[1] < 5e-3
    np.testing.assert_allclose(errors[0] / errors[1], 4, rtol=0.2)


def test_cycles_work_under_jit_and_vmap():
    def work(load):
        return cycle(pressure=load, rtol=1e-6, solver=PLAIN).work

    loads = jnp.array([0.04, 0.06])
    batch = jax.jit(jax.vmap(work))(loads)
    np.testing.assert_allclose(batch, [cycle(pressure=load).work for load in loads], rtol=1e-4)
