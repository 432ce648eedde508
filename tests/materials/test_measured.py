"""Where materials were measured, however they are put together, and the friction from outside."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.core.parameters import paths
from graded_contact.materials.coverage import check_frequencies

SHIFT = gc.WLF(4.57, 113.6, 298.15)
RANGE = gc.materials.MeasuredRange([1e-2, 1e4], [250.0, 350.0])
FITTED = gc.Prony(1e6, [4e6, 2e7], [1e-1, 1e-3], 0.5, SHIFT, RANGE)
FAST = gc.Prony(1e6, [2e7], [1e-6], 0.4, SHIFT, gc.materials.MeasuredRange([1.0, 1e7]))
TABLE = gc.Tabulated([1e-1, 1e3], np.array([1e6 + 1e5j, 2e6 + 1e5j]), shift=SHIFT)
STEEL = gc.Elastic(2e11, 0.3)
HAND_WRITTEN = gc.Prony(1e6, [2e7], [1e-6])


class Homemade(eqx.Module):
    """A profile of a user, who has never heard of ranges."""

    material: gc.Prony

    def __call__(self, s, omega):
        return self.material.modulus(omega) * (1 + s), self.material.poisson_ratio(omega)


@pytest.mark.parametrize(
    ("tree", "expected"),
    [
        (STEEL, None),
        (HAND_WRITTEN, (0.0, np.inf)),
        (FITTED, (1e-2, 1e4)),
        (TABLE, (1e-1, 1e3)),
        (gc.BulkShear(FAST, FITTED), (1.0, 1e4)),
        (gc.Blend(TABLE, STEEL), (1e-1, 1e3)),
        (gc.Mixture(FITTED, FAST, gc.shapes.Linear()), (1.0, 1e4)),
        # Times that are up to 100 times longer at the top work at frequencies that much higher.
        (gc.Aged(FITTED, 0.1, 100.0), (1e-1, 1e2)),
        (gc.Aged(STEEL, 0.1, 100.0), (0.0, np.inf)),
        (Homemade(FITTED), (1e-2, 1e4)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_the_range_of_a_composite_is_what_all_its_parts_were_measured_at(tree, expected):
    if not isinstance(tree, gc.Elastic | gc.Prony | gc.Tabulated | gc.BulkShear):
        tree = gc.Stack(layers=[gc.GradedLayer(tree, 1e-3)], base=gc.Rigid())
    found = gc.materials.coverage(tree)
    assert found == expected or np.allclose(found, expected, rtol=1e-12)


def test_the_range_moves_with_the_times_and_is_empty_beyond_the_measured_temperatures():
    warm = FITTED.at(330.0)
    factor = float(SHIFT.factor(330.0))
    traced = jax.jit(lambda kelvin: FITTED.at(kelvin).coverage())(330.0)
    np.testing.assert_allclose(traced, warm.coverage())
    np.testing.assert_allclose(
        gc.materials.coverage(warm), np.array([1e-2, 1e4]) / factor, rtol=1e-12
    )
    lowest, highest = gc.materials.coverage(FITTED.at(240.0))
    assert lowest > highest
    np.testing.assert_allclose(
        gc.materials.coverage(FITTED.at(240.0).at(298.15)), [1e-2, 1e4], rtol=1e-12
    )
    np.testing.assert_allclose(
        gc.materials.coverage(TABLE.at(330.0)), np.array([0.1, 1e3]) / factor
    )


@pytest.mark.parametrize("bottom", [TABLE, gc.Elastic(1e9)])
def test_a_table_inside_a_graded_layer_or_bulk_and_shear_refuses_like_one_alone(bottom):
    material = gc.BulkShear(gc.Elastic(1e9), TABLE)
    layers = [gc.GradedLayer(gc.Blend(bottom, TABLE), 1e-3), gc.Layer(material, 1e-3)]
    for layer in layers:
        stack = gc.Stack(layers=[layer], base=gc.Rigid())
        check_frequencies(stack, np.array([0.0, 0.1, -1e3]))
        with pytest.raises(ValueError, match=r"`omega` from .* covers 0\.1 to 1000 rad/s"):
            gc.surface_compliance(stack, 1e3, 1e4)
    aged = gc.Stack(layers=[gc.GradedLayer(gc.Aged(TABLE, 1.0, 10.0), 1e-3)], base=gc.Rigid())
    with pytest.raises(ValueError, match=r"covers 0\.1 to 1000 rad/s"):
        gc.surface_compliance(aged, 1e3, 2e2)


def test_ranges_have_no_derivative_and_pass_through_maps_scans_and_new_values():
    slope = jax.jit(jax.grad(lambda m: m.at(330.0).modulus(30.0).imag))(FITTED)
    assert np.all(slope.measured.omega == 0) and np.all(slope.times != 0)
    pair = jax.tree.map(lambda *leaves: jnp.stack(leaves), FITTED, dataclasses.replace(
        FITTED, measured=gc.materials.MeasuredRange([1.0, 2.0], [200.0, 400.0])))  # fmt: skip
    mapped = jax.vmap(lambda m: jnp.stack(gc.materials.coverage(m)))(pair)
    _, scanned = jax.lax.scan(lambda _, m: (None, jnp.stack(gc.materials.coverage(m))), None, pair)
    np.testing.assert_array_equal(mapped, [[1e-2, 1e4], [1.0, 2.0]])
    np.testing.assert_array_equal(scanned, mapped)
    other = gc.with_values(FITTED, {"times[0]": 0.5})
    np.testing.assert_array_equal(other.measured.omega, RANGE.omega)
    assert "measured.omega" in paths(FITTED)


def test_a_range_from_high_to_low_is_refused():
    with pytest.raises(ValueError, match=r"`omega` from 2 to 1 \[rad/s\] is refused"):
        gc.materials.MeasuredRange([2.0, 1.0])


CELL = 1e-3
GRID = gc.Grid((16, 16), CELL)
WAVE = 2 * np.pi / CELL
SPECTRUM = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=WAVE, q_roll=WAVE, q_high=5 * WAVE)
SURFACE = gc.random_surface(SPECTRUM, GRID, jax.random.key(1))


def test_the_share_of_friction_from_outside_is_that_of_its_waves():
    """In complete contact the pressure of each wave is h_q/M, and its work q Im M |h_q/M|²."""
    speed, limit = 0.1, 2.5 * WAVE * 0.1
    measured = dataclasses.replace(FITTED, measured=gc.materials.MeasuredRange([1e-2, limit]))
    stack = gc.Stack(base=gc.HalfSpace(measured))
    found = gc.slide(stack, SURFACE, pressure=1e8, velocity=speed, rtol=1e-9)
    assert found.contact_area == 1
    kernel = np.array(gc.stack_kernel(stack, GRID, speed))
    numbers = np.fft.fftfreq(16, 1 / 16)[:, None] * np.ones(9)
    count = np.where(np.isin(np.arange(9), (0, 8)), 1, 2)
    heights = np.fft.rfft2(np.asarray(SURFACE.heights))
    kernel[0, 0] = 1
    work = np.abs(heights / kernel) ** 2 * np.abs(kernel.imag * numbers) * count
    expected = np.sum(work[np.abs(numbers) > 2.5]) / np.sum(work)
    assert 0.05 < expected < 0.95
    np.testing.assert_allclose(found.extrapolated_friction, expected, rtol=1e-6)
    field = gc.mean_field_friction(stack, SURFACE, pressure=1e8, velocity=speed)
    np.testing.assert_allclose(field.extrapolated_friction, expected, rtol=1e-6)
    inside = gc.mean_field_friction(stack.at(290.0), SPECTRUM, pressure=1e5, velocity=1e-4)
    beyond = gc.mean_field_friction(stack, SPECTRUM, pressure=1e5, velocity=10.0)
    assert inside.extrapolated_friction < 1e-6
    assert 0.9 < beyond.extrapolated_friction <= 1
