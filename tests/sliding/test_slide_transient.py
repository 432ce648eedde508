"""Transient motion: its memory, its contacts, and the numbers over time."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import graded_contact as gc
from graded_contact import contacts
from graded_contact.contacts import DouglasRachford
from graded_contact.kernels import window_kernel
from graded_contact.kernels.creep import contour, node_count
from graded_contact.materials import StrainSoftening
from graded_contact.sliding import Case, dwell, ramp, recorded, start
from graded_contact.sliding.transient.solve import transient_problem

N = STEPS = 32  # of all solves: they share a program
GRID = gc.Grid((N,), 1e-3)
PLACE = np.arange(N) / N
SURFACE = gc.Surface(5e-5 * np.cos(2 * np.pi * PLACE) + 5e-6 * np.cos(10 * np.pi * PLACE + 1), GRID)


def prony(modulus, strengths, poisson=0.49):
    return gc.Prony(modulus, strengths, [1e-2, 1e-3], poisson)


def coated(coat, base):
    """All blocks are of one layer on a half space: they share a program."""
    return gc.Stack(layers=(gc.Layer(coat, 3e-5),), base=gc.HalfSpace(base))


def elastic(modulus, poisson=0.49):
    return prony(modulus, [1e-12 * modulus] * 2, poisson)


RUBBER = prony(1e6, [4e6, 8e6])
BLOCK, COAT = coated(RUBBER, RUBBER), coated(elastic(3e6, 0.45), RUBBER)


def run(stack, times, displacement, pressure=None, surface=SURFACE, **options):
    options = dict(solver=DouglasRachford(newton=False), rtol=1e-6) | options
    if pressure is not None:
        pressure = jnp.broadcast_to(jnp.asarray(pressure, float), (len(times),))
    return gc.slide_transient(
        stack, surface, times=times, displacement=displacement, pressure=pressure, **options
    )


def creep_compliance(t):
    glassy, compliances, times = map(np.asarray, RUBBER.creep())
    return 1 / glassy + np.sum(compliances * (1 - np.exp(-np.asarray(t)[..., None] / times)), -1)


def test_moduli_at_complex_frequencies_are_those_of_the_laplace_transform():
    s = np.asarray([3.0 + 40j, -5.0 + 200j, 1e4 + 0j])
    soft = StrainSoftening(RUBBER, [0.01, 0.1], [1.0, 0.5], [1.0, 0.5], 0.1)
    bulk = gc.BulkShear(gc.Elastic(2e9), RUBBER)

    @jax.jit
    def moduli(omega):
        half_space = 1 / gc.surface_compliance(gc.Stack(base=gc.HalfSpace(RUBBER)), 1e4, omega)
        return [half_space, *(one.complex_modulus(omega) for one in (RUBBER, bulk, soft))]

    expected = 1e6 + sum(e * s * t / (1 + s * t) for e, t in ((4e6, 1e-2), (8e6, 1e-3)))
    of_bulk, of_block = 3 * expected / (1 + expected / 6e9), expected * 1e4 / (2 * (1 - 0.49**2))
    exact = of_block, expected, of_bulk, 0.5 * expected
    np.testing.assert_allclose(moduli(-1j * s), exact, rtol=1e-12)
    unequal = StrainSoftening(RUBBER, [0.01, 0.1], [1.0, 0.5], [1.0, 0.9], 0.1)
    with pytest.raises(ValueError, match="one factor"):
        unequal.complex_modulus(-1j * s)


def test_the_nodes_sum_up_to_exponentials_of_every_rate():
    nodes_of = jax.jit(contour, static_argnums=2)
    for ratio, count, most in ((1e2, 32, 1e-8), (1e5, 32, 2e-4), (1e8, 48, 2e-4), (1e12, 64, 2e-4)):
        assert node_count(jnp.asarray([1.0, ratio - 1])) == count
        nodes, weights = map(np.asarray, nodes_of(1.0, ratio, count))
        times, rates = np.geomspace(1, ratio, 40), np.append(0, np.geomspace(1e-3 / ratio, 1e4, 60))
        found = (np.exp(np.outer(times, nodes)) * weights @ (1 / (nodes[:, None] + rates))).real
        assert np.max(np.abs(found - np.exp(-np.outer(times, rates)))) < most


def test_the_creep_of_a_coat_is_the_inverse_laplace_transform():
    q, times = 5e4, 3e-3 * np.arange(1, STEPS + 1)
    creep = run(COAT, times, 0 * times, 1e5).problem.creeps[0]
    compliance = jax.jit(lambda omega: gc.surface_compliance(COAT, q, omega))

    def transform(s):
        return mpmath.mpmathify(complex(compliance(complex(-1j * s)))) / s

    found = creep.aged @ creep.shares(jnp.asarray([q]))
    for i in (0, 10):
        expected = float(mpmath.invertlaplace(transform, times[i], method="dehoog", degree=14))
        assert found[i, 0] == pytest.approx(expected, rel=1e-6)


def test_a_load_that_stays_has_the_elastic_contact_of_the_creep_compliance():
    """E. H. Lee & J. R. M. Radok, J. Appl. Mech. 27 (1960) 438: the contact grows."""
    rest = dwell(1.0, STEPS, first=2e-5)
    found = run(BLOCK, rest.times, rest.displacement, 1e5)
    for i in (0, 20, 31):
        soft = 1 / creep_compliance(rest.times[i])
        one = coated(elastic(soft), elastic(soft))
        expected = gc.slide(one, SURFACE, pressure=1e5, velocity=1.0, rtol=1e-6)
        assert found.mean_gap[i] == pytest.approx(float(expected.mean_gap), rel=2e-3)
        assert found.contact_area[i] == pytest.approx(float(expected.contact_area), abs=0.01)
    assert np.all(np.diff(found.mean_gap) < 0)
    assert np.abs(found.pressure.mean() / 1e5 - 1) < 1e-10


def test_after_a_step_down_of_the_load_the_area_is_that_of_the_relaxed_modulus_and_never_falls():
    """T. C. T. Ting, J. Appl. Mech. 33 (1966) 845: what is still in contact has been since t = 0.

    So it has relaxed since then, E(t), whatever the load was. Afterwards the area only grows, as on
    any linear block (arXiv:2511.19402).
    """
    height, times = 5e-5, np.arange(1, STEPS + 1) * 4e-4
    wave = gc.Surface(height * np.cos(2 * np.pi * PLACE), GRID)
    for end in (4, 20):
        load = np.where(np.arange(STEPS) < end, 2e5, 3e4)
        area = np.asarray(run(BLOCK, times, np.zeros(STEPS), load, wave).contact_area)
        relaxed = 1e6 + 4e6 * np.exp(-times[end] / 1e-2) + 8e6 * np.exp(-times[end] / 1e-3)
        full = np.pi * relaxed / (1 - 0.49**2) * height / 1e-3
        expected = 2 / np.pi * np.arcsin(np.sqrt(3e4 / full))  # Westergaard (1939)
        assert area[end] == pytest.approx(expected, abs=0.5 / N)  # half a point of the grid
        assert area[end] < 0.5 * area[end - 1]
        highest = np.maximum.accumulate(area[end:])
        assert np.all(area[end:] > highest - 0.5 / N)
        assert area[-1] > area[end]


def test_an_elastic_plate_has_the_contact_that_it_has_at_rest():
    plate = gc.Stack(layers=(gc.Layer(gc.Elastic(5e6, 0.4), 3e-4),), base=gc.Free())
    times = 1e-3 * np.arange(1, 3)
    moved = run(plate, times, 1e-2 * times, 2e5, rtol=1e-9)
    resting = gc.slide(plate, SURFACE, pressure=2e5, velocity=0.0, rtol=1e-9)
    assert 0.1 < resting.contact_area < 0.9
    scale = np.max(resting.pressure)
    np.testing.assert_allclose(moved.pressure[-1], resting.pressure, atol=1e-8 * scale)


def test_an_elastic_block_stores_the_work_of_friction_and_load_and_a_rubber_takes_more():
    """The energy of the first is ⟨σ w⟩/2, whatever happened before."""
    times = np.arange(1, STEPS + 1) * 1e-3
    moved, load = 2e-4 * np.sin(40 * times), 1e5 * (1 + np.sin(30 * times) / 2)
    found = run(coated(elastic(2e6), elastic(2e6)), times, moved, load)
    energy = 0.5 * jnp.mean(found.pressure * found.displacement)
    work = found.work_done[-1] + found.load_work_done[-1]
    assert work == pytest.approx(float(energy), rel=1e-4)
    load = np.where(np.arange(STEPS) < 20, 1e5, 1.0)
    found = run(COAT, times, 1e-4 * np.sin(100 * times), load)
    taken = np.asarray(found.work_done + found.load_work_done)
    assert np.all(taken > 0)
    assert taken[-1] > 0.05 * taken[19]


def test_after_a_long_rest_it_slides_as_after_one_in_which_all_relaxed():
    """The rest is 9e4 times as long as the shortest step; the retardation time is 9 ms."""
    fast = prony(1e6, [8e6, 1e-6])
    go = ramp(1e-2, 0.02, num_times=STEPS // 2)
    found, exact = (
        run(coated(fast, fast), motion.times, motion.displacement, 1e5)
        for rest in (90.0, 1.0)
        if (motion := dwell(rest, STEPS // 2, first=1e-3).then(go))
    )
    moving = slice(STEPS // 2, None)
    np.testing.assert_allclose(found.friction[moving], exact.friction[moving], atol=3e-4)
    np.testing.assert_allclose(found.contact_area[moving], exact.contact_area[moving], atol=3e-3)
    assert jnp.max(found.friction) > 0.02
    np.testing.assert_allclose(found.time_since_change[moving], go.times, rtol=1e-5)


def test_a_transient_of_gaps_returns_the_loads_and_traction_is_that_of_the_slopes():
    times = np.arange(1, STEPS + 1) * 1e-3
    load = 1e5 * (1 + np.sin(30 * times) / 2)
    given = run(COAT, times, 1e-4 * np.sin(100 * times), load)
    back = run(COAT, times, 1e-4 * np.sin(100 * times), None, mean_gap=given.mean_gap)
    np.testing.assert_allclose(back.load, load, rtol=1e-4)
    np.testing.assert_allclose(back.friction, given.friction, atol=1e-5)
    q = 2 * np.pi * np.fft.rfftfreq(N, 1e-3 / N) * (np.arange(N // 2 + 1) < N // 2)
    slope = np.fft.irfft(1j * q * np.fft.rfft(given.displacement[-1]), N)
    traction = -np.mean(np.asarray(given.pressure[-1]) * slope)
    assert given.traction[-1] == pytest.approx(traction, rel=1e-9)
    assert given.friction[-1] == pytest.approx(traction / load[-1], rel=1e-9)


def test_motions_that_happen_once():
    rest = dwell(1.0)
    assert rest.times[-1] == pytest.approx(1.0)
    assert np.min(np.diff(rest.times, prepend=0)) >= 0.99e-4
    whole = rest.then(start(0.02, 0.01, grid=GRID)).then(ramp(0.02, 0.01, grid=GRID))
    assert whole.times[-1] == pytest.approx(1.02)
    assert whole.displacement[-1] == pytest.approx(0.02 * (0.005 + 0.01))
    assert np.max(np.diff(whole.displacement)) < 0.51 * 1e-3 / N
    brake = start(0.0, 0.01, before=0.02, num_times=1000)
    assert brake.displacement[-1] == pytest.approx(1e-4)
    speeds = np.diff(brake.displacement) / np.diff(brake.times)
    assert speeds[0] == pytest.approx(0.02, rel=1e-3)
    assert speeds[-1] == pytest.approx(0, abs=1e-4)
    read = recorded([2.0, 3.0, 5.0], [1e-4, 1e-4, 3e-4], grid=GRID)
    assert read.times[0] == 1.0
    assert read.times[-1] == 3.0
    assert read.displacement[-1] == pytest.approx(2e-4)
    assert np.max(np.diff(read.displacement)) < 0.51 * 1e-3 / N
    with pytest.raises(ValueError, match="inside of a program"):
        jax.jit(lambda v: ramp(v, 1.0, GRID).times)(1.0)


def test_after_many_periods_it_is_the_cycle_with_an_error_of_second_order():
    period, stroke, share = 0.5, 3e-5, np.arange(N) / N
    given = dict(displacement=stroke * np.sin(2 * np.pi * share), period=period, pressure=1e5)
    friction, errors = np.asarray(gc.slide_cycle(COAT, SURFACE, **given, rtol=1e-7).friction), []
    for count in (8, 16):  # steps in a period, of 32 in all
        times = np.arange(1, STEPS + 1) * period / count
        moved = stroke * np.sin(2 * np.pi * times / period)
        found = run(COAT, times, moved, 1e5)
        place = np.arange(N // count, N + 1, N // count) % N
        errors.append(np.median(np.abs(found.friction[-count:] - friction[place])))
    assert errors[1] < 0.04 * np.max(np.abs(friction))
    assert errors[1] < 0.35 * errors[0]


def test_errors_contain_the_change_to_a_finer_grid_and_more_steps():
    """But at few times. Where nothing touches friction has no error, and others keep theirs."""
    rough = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=6284.0, q_roll=12566.0, q_high=18900.0)
    names = "friction", "contact_area", "load", "work_done", "load_work_done"
    coarse, fine = (
        gc.random_surface(rough, gc.Grid((n,), 1e-3), jax.random.key(0)) for n in (N // 2, N)
    )

    def motion(factor):
        once = dwell(0.1, 6 * factor).then(start(0.02, 0.005, num_times=3 * factor))
        return once.then(ramp(0.02, 0.01, num_times=7 * factor))

    (short, moved), (long, far) = ((motion(k).times, motion(k).displacement) for k in (1, 2))
    apart = np.arange(len(short)) == 2
    gap = np.max(coarse.heights) * np.where(apart, 2.0, 0.6)
    found = run(COAT, short, moved, None, coarse, mean_gap=gap, rtol=5e-5)
    exact = run(COAT, long, far, None, fine, mean_gap=np.interp(long, short, gap))
    errors = found.compute(*(f"{name}_error" for name in names))
    np.testing.assert_array_equal(np.isnan(errors[0]), apart)
    broken = [
        np.abs(getattr(found, name) - np.interp(short, long, getattr(exact, name))) > error
        for name, error in zip(names, errors, strict=True)
    ]
    assert np.mean(broken) < 0.05


def test_the_response_on_the_path_of_a_window_is_that_of_a_window_kernel():
    """Under a constant pressure a block is elastic, of the creep compliance of that time."""
    grid, times = gc.Grid((8,), 1e-3), jnp.asarray([1e-3, 2e-3, 4e-3])
    window = gc.Surface(jnp.zeros(8), grid, periodic=False)
    slab = lambda material: gc.Stack(layers=(gc.Layer(material, 2e-4),), base=gc.Rigid())  # noqa: E731
    moved = jnp.asarray([1e-4, -1e-4, 1e-4])
    case = Case(slab(RUBBER), window, displacement=moved, times=times, pressure=1e5)
    problem = transient_problem(case)
    assert problem.path == (10,)  # 8 points, and 1.6 spacings to and fro
    soft = slab(gc.Elastic(1 / creep_compliance(times[-1]), 0.49))
    expected = window_kernel(soft, gc.Grid((10,), 10 / 8 * 1e-3))
    found = problem.responses(problem.creeps[0], problem.creeps[0].aged[-1:])[0]
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    # A window needs no more than the distances within it.
    load = jnp.eye(16)[3]
    cut, exact = (
        np.diff(operator.displace(load)[:8])
        for operator in (
            problem.operator_of(expected, expected),
            contacts.operators.window.Window(window_kernel(soft, grid)),
        )
    )
    np.testing.assert_allclose(cut, exact, atol=2e-3 * np.max(exact))
