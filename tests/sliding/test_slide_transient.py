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
from graded_contact.kernels.memory import contour, creep_of, node_count
from graded_contact.materials import StrainSoftening, Tabulated
from graded_contact.sliding import Case, Coulomb, dwell, ramp, recorded, start
from graded_contact.sliding.transient.pose import transient_problem

RUBBER = gc.Prony(1e6, [4e6, 8e6], [1e-2, 1e-3], 0.49)
BLOCK = gc.Stack(base=gc.HalfSpace(RUBBER))
COAT = gc.Stack(layers=(gc.Layer(gc.Elastic(3e6, 0.45), 3e-5),), base=gc.HalfSpace(RUBBER))
GRID = gc.Grid((64,), 1e-3)
PLACE = np.arange(64) / 64
SURFACE = gc.Surface(
    jnp.asarray(5e-5 * np.cos(2 * np.pi * PLACE) + 5e-6 * np.cos(10 * np.pi * PLACE + 1)), GRID
)
STEPS = 64  # of all solves here: they share a program


def run(stack, times, displacement, pressure=None, surface=SURFACE, **options):
    options = dict(solver=DouglasRachford(newton=False), rtol=1e-6) | options
    if pressure is not None:
        pressure = jnp.broadcast_to(jnp.asarray(pressure, float), (len(times),))
    return gc.slide_transient(
        stack, surface, times=times, displacement=displacement, pressure=pressure, **options
    )


def elastic(modulus):
    return gc.Stack(base=gc.HalfSpace(gc.Elastic(modulus, 0.49)))


def creep_compliance(t):
    glassy, compliances, times = map(np.asarray, RUBBER.creep())
    return 1 / glassy + np.sum(compliances * (1 - np.exp(-np.asarray(t)[..., None] / times)), -1)


def test_moduli_at_complex_frequencies_are_those_of_the_laplace_transform():
    s = jnp.asarray([3.0 + 40j, -5.0 + 200j, 1e4 + 0j])
    omega = -1j * s
    expected = 1e6 + sum(e * s * t / (1 + s * t) for e, t in ((4e6, 1e-2), (8e6, 1e-3)))
    np.testing.assert_allclose(RUBBER.complex_modulus(omega), expected, rtol=1e-13)
    np.testing.assert_allclose(
        RUBBER.complex_modulus(jnp.asarray([7.0 + 0j])), RUBBER.complex_modulus([7.0])
    )
    assert gc.Elastic(2e6).complex_modulus(omega).dtype == jnp.float64
    bulk = gc.BulkShear(gc.Elastic(2e9), RUBBER)
    shear, ratio = expected, expected / 6e9
    np.testing.assert_allclose(bulk.complex_modulus(omega), 3 * shear / (1 + ratio), rtol=1e-13)
    strain, factor = [0.01, 0.1], [1.0, 0.5]
    soft = StrainSoftening(RUBBER, strain, factor, factor, 0.1)
    np.testing.assert_allclose(soft.complex_modulus(omega), 0.5 * expected, rtol=1e-12)
    with pytest.raises(ValueError, match="one factor"):
        StrainSoftening(RUBBER, strain, factor, [1.0, 0.9], 0.1).complex_modulus(omega)
    # M of a half space, by the closed form.
    found = gc.surface_compliance(BLOCK, 1e4, omega)
    np.testing.assert_allclose(found, 2 * (1 - 0.49**2) / (1e4 * expected), rtol=1e-13)


@pytest.mark.parametrize(
    "ratio, count, most",
    [(1e2, 32, 1e-8), (1e3, 32, 1e-6), (1e5, 32, 2e-4), (1e8, 48, 2e-4), (1e12, 64, 2e-4)],
)
def test_the_nodes_sum_up_to_exponentials_of_every_rate(ratio, count, most):
    assert node_count(jnp.asarray([1.0, ratio - 1])) == count
    nodes, weights = map(np.asarray, contour(jnp.asarray(1.0), jnp.asarray(ratio), count))
    times, rates = np.geomspace(1, ratio, 40), np.append(0, np.geomspace(1e-3 / ratio, 1e4, 60))
    found = (np.exp(np.outer(times, nodes)) * weights @ (1 / (nodes[:, None] + rates))).real
    assert np.max(np.abs(found - np.exp(-np.outer(times, rates)))) < most


def test_the_creep_of_a_coat_is_the_inverse_laplace_transform():
    q, step = 5e4, 3e-3
    found = creep_of(COAT, jnp.asarray([1e3, 1e6]), jnp.asarray([step, step]))

    def transform(s):
        omega = jnp.asarray(complex(-1j * s))
        return mpmath.mpmathify(complex(gc.surface_compliance(COAT, q, omega))) / s

    expected = float(mpmath.invertlaplace(transform, step, method="dehoog", degree=14))
    whole = float((found.whole[0] @ found.shares(jnp.asarray([q])))[0, 0])
    assert whole == pytest.approx(expected, rel=1e-6)


def test_a_load_that_stays_has_the_elastic_contact_of_the_creep_compliance():
    """E. H. Lee & J. R. M. Radok, J. Appl. Mech. 27 (1960) 438: the contact grows."""
    rest = dwell(1.0, STEPS, first=1e-5)
    found = run(BLOCK, rest.times, rest.displacement, 1e5)
    for i in (0, 40, 63):
        soft = elastic(1 / creep_compliance(rest.times[i]))
        expected = gc.slide(soft, SURFACE, pressure=1e5, velocity=0.0, rtol=1e-6)
        assert found.mean_gap[i] == pytest.approx(float(expected.mean_gap), rel=2e-3)
        assert found.contact_area[i] == pytest.approx(float(expected.contact_area), abs=0.01)
    assert np.all(np.diff(found.contact_area) > -1e-4)  # the error of the memory
    assert np.abs(found.pressure.mean() / 1e5 - 1) < 1e-10


def test_after_a_step_down_of_the_load_the_area_is_that_of_the_relaxed_modulus_and_never_falls():
    """T. C. T. Ting, J. Appl. Mech. 33 (1966) 845: what is still in contact has been since t = 0.

    So it has relaxed since then, E(t), whatever the load was. Afterwards the area only grows, as on
    any linear block (arXiv:2511.19402).
    """
    height, times = 5e-5, np.arange(1, STEPS + 1) * 2e-4
    wave = gc.Surface(jnp.asarray(height * np.cos(2 * np.pi * PLACE)), GRID)
    for end in (8, 40):
        load = np.where(np.arange(STEPS) < end, 2e5, 3e4)
        area = np.asarray(run(BLOCK, times, np.zeros(STEPS), load, wave).contact_area)
        relaxed = 1e6 + 4e6 * np.exp(-times[end] / 1e-2) + 8e6 * np.exp(-times[end] / 1e-3)
        full = np.pi * relaxed / (1 - 0.49**2) * height / 1e-3
        expected = 2 / np.pi * np.arcsin(np.sqrt(3e4 / full))  # Westergaard (1939)
        assert area[end] == pytest.approx(expected, abs=0.5 / 64)  # half a point of the grid
        assert area[end] < 0.5 * area[end - 1]
        highest = np.maximum.accumulate(area[end:])
        assert np.all(area[end:] > highest - 0.5 / 64)
        assert area[-1] > area[end]


def test_an_elastic_block_stores_the_work_of_friction_and_load():
    """Its energy is ⟨σ w⟩/2, whatever happened before."""
    times = np.arange(1, STEPS + 1) * 1e-3
    moved, load = 2e-4 * np.sin(40 * times), 1e5 * (1 + np.sin(30 * times) / 2)
    found = run(elastic(2e6), times, moved, load)
    energy = 0.5 * jnp.mean(found.pressure * found.displacement)
    work = found.work_done[-1] + found.load_work_done[-1]
    assert work == pytest.approx(float(energy), rel=1e-4)


def test_a_block_that_is_unloaded_has_taken_energy():
    times = np.arange(1, STEPS + 1) * 1e-3
    load = np.where(np.arange(STEPS) < 40, 1e5, 1.0)
    found = run(COAT, times, 1e-4 * np.sin(100 * times), load)
    taken = np.asarray(found.work_done + found.load_work_done)
    assert np.all(taken > 0)
    assert taken[-1] > 0.05 * taken[39]


def test_work_of_shear_has_the_load_of_both_ends():
    """Coulomb's law on an elastic block: 0.25 J/m² under the whole load, less half of a step."""
    load, path = 4e3, 1.25e-4
    wave = gc.Surface(2e-6 * np.cos(2 * np.pi * PLACE), GRID)
    part = np.arange(1, STEPS + 1) / STEPS
    law = Coulomb(0.5, coupled=False)
    found = run(elastic(1e6), part, path * part, load, wave, shear=law)
    exact = 0.5 * load * path * (part - 0.5 / STEPS)
    np.testing.assert_allclose(found.work_done, exact, rtol=1e-9)
    np.testing.assert_allclose(found.shear_work_done, exact, rtol=1e-9)
    assert found.mean_friction == pytest.approx(0.5, rel=1e-9)


def test_after_a_rest_of_1000_hours_it_slides_as_after_one_in_which_all_relaxed():
    """3.6e9 times as long as the shortest step; the retardation time of the block is 9 ms."""
    block = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [8e6], [1e-3], 0.49)))
    go = ramp(1e-2, 0.02, num_times=STEPS // 2)
    found, exact = (
        run(block, (motion := dwell(rest, STEPS // 2, first=1e-3).then(go)).times,
            motion.displacement, 1e5)
        for rest in (3.6e6, 1.0)
    )  # fmt: skip
    moving = slice(STEPS // 2, None)
    np.testing.assert_allclose(found.friction[moving], exact.friction[moving], atol=3e-4)
    np.testing.assert_allclose(found.contact_area[moving], exact.contact_area[moving], atol=3e-3)
    assert jnp.max(found.friction) > 0.02
    np.testing.assert_allclose(found.time_since_change[moving], go.times, rtol=1e-5)
    slow = gc.Prony(1e6, [4e6], [1e5], 0.49)
    rest = dwell(3.6e6, STEPS, first=1e-3)
    crept = run(gc.Stack(base=gc.HalfSpace(slow)), rest.times, rest.displacement, 1e5)
    for i in (40, 63):  # 7 h, 1000 h; the retardation time is 139 h
        soft = elastic(1 / (1e-6 - 0.8e-6 * np.exp(-rest.times[i] / 5e5)))
        expected = gc.slide(soft, SURFACE, pressure=1e5, velocity=0.0, rtol=1e-6)
        assert crept.mean_gap[i] == pytest.approx(float(expected.mean_gap), rel=2e-3)


def test_a_transient_of_gaps_returns_the_loads():
    times = np.arange(1, STEPS + 1) * 1e-3
    load = 1e5 * (1 + np.sin(30 * times) / 2)
    moved = 1e-4 * np.sin(100 * times)
    given = run(COAT, times, moved, load)
    back = run(COAT, times, moved, None, mean_gap=given.mean_gap)
    np.testing.assert_allclose(back.load, load, rtol=1e-4)
    np.testing.assert_allclose(back.friction, given.friction, atol=1e-5)


def test_the_traction_is_that_of_the_slopes():
    times = np.arange(1, STEPS + 1) * 1e-3
    found = run(COAT, times, 8e-6 * np.arange(1, STEPS + 1), 1e5)
    q = 2 * np.pi * np.fft.rfftfreq(64, 1e-3 / 64)
    slope = np.fft.irfft(1j * q * np.fft.rfft(found.displacement[-1]) * (np.arange(33) < 32), 64)
    traction = -np.mean(np.asarray(found.pressure[-1]) * slope)
    assert found.traction[-1] == pytest.approx(traction, rel=1e-9)
    assert found.friction[-1] == pytest.approx(traction / 1e5, rel=1e-9)


WINDOW = gc.Surface(SURFACE.heights, GRID, periodic=False)
TABLE = Tabulated([1.0, 1e3], [1e6 + 1e5j, 2e6 + 1e5j])


def test_motions_that_happen_once():
    rest = dwell(1.0)
    assert rest.times[-1] == pytest.approx(1.0)
    assert np.min(np.diff(rest.times, prepend=0)) >= 0.99e-4
    whole = rest.then(start(0.02, 0.01, grid=GRID)).then(ramp(0.02, 0.01, grid=GRID))
    assert whole.times[-1] == pytest.approx(1.02)
    assert whole.displacement[-1] == pytest.approx(0.02 * (0.005 + 0.01))
    assert np.max(np.diff(whole.displacement)) < 0.51 * 1e-3 / 64
    brake = start(0.0, 0.01, before=0.02, num_times=1000)
    assert brake.displacement[-1] == pytest.approx(1e-4)
    speeds = np.diff(brake.displacement) / np.diff(brake.times)
    assert speeds[0] == pytest.approx(0.02, rel=1e-3)
    assert speeds[-1] == pytest.approx(0, abs=1e-4)
    read = recorded([2.0, 3.0, 5.0], [1e-4, 1e-4, 3e-4], grid=GRID)
    assert read.times[0] == 1.0
    assert read.times[-1] == 3.0
    assert read.displacement[-1] == pytest.approx(2e-4)
    assert np.max(np.diff(read.displacement)) < 0.51 * 1e-3 / 64
    with pytest.raises(ValueError, match="inside of a program"):
        jax.jit(lambda v: ramp(v, 1.0, GRID).times)(1.0)


def test_after_many_periods_it_is_the_cycle_with_an_error_of_second_order():
    period, stroke = 0.5, 3e-5
    moved = stroke * np.sin(2 * np.pi * np.arange(64) / 64)
    given = dict(displacement=moved, period=period, pressure=1e5)
    cycle = gc.slide_cycle(COAT, SURFACE, **given, rtol=1e-7)
    friction, errors = cycle.friction, []
    for count in (16, 32):  # steps in a period, of 64 in all
        times = np.arange(1, STEPS + 1) * period / count
        moved = stroke * np.sin(2 * np.pi * times / period)
        found = run(COAT, times, moved, 1e5)
        place = np.arange(64 // count, 65, 64 // count) % 64
        errors.append(np.median(np.abs(found.friction[-count:] - friction[place])))
    assert errors[1] < 0.01 * np.max(np.abs(friction))
    assert errors[1] < 0.35 * errors[0]


def test_the_error_of_friction_contains_the_change_to_a_finer_grid_and_more_steps():
    rough = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=6284.0, q_roll=12566.0, q_high=37700.0)

    def at(factor):
        grid = gc.Grid((32 * factor,), 1e-3)
        surface = gc.random_surface(rough, grid, jax.random.key(0))
        motion = dwell(0.1, 12 * factor).then(start(0.02, 0.005, num_times=6 * factor))
        motion = motion.then(ramp(0.02, 0.01, num_times=14 * factor))
        given = motion.times, motion.displacement, 1e5, surface
        return run(COAT, *given, rtol=5e-5 if factor == 1 else 1e-6)

    coarse, fine = at(1), at(2)
    change = np.abs(coarse.friction - np.interp(coarse.times, fine.times, fine.friction))
    assert np.mean(change > coarse.friction_error) < 0.05


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
