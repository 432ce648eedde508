import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc

STEEL = gc.Elastic(2e11, 0.3)


@pytest.mark.parametrize(
    ("layers", "base", "message"),
    [
        ((), gc.Rigid(), r"`layers` is empty on a .* base"),
        ((STEEL,), gc.Rigid(), r"`layers\[0\]=.* must be a `Layer`"),
        (gc.Layer(STEEL, 1e-6), gc.Rigid(), r"write `layers=\(layer,\)`"),
    ],
)
def test_layers_and_base_must_be_what_they_say(layers, base, message):
    with pytest.raises(ValueError, match=message):
        gc.Stack(layers=layers, base=base)


def test_temperature_reaches_every_material():
    tread = gc.tyre_tread()
    stack = gc.Stack(
        layers=(gc.Layer(tread, 1e-3), gc.Layer(STEEL, 1e-3)), base=gc.HalfSpace(tread)
    )
    cold = stack.at(273.15)
    expected = tread.times * tread.shift.factor(np.asarray(273.15))
    np.testing.assert_allclose(cold.layers[0].material.times, expected, rtol=1e-15)
    np.testing.assert_allclose(cold.base.material.times, expected, rtol=1e-15)
    assert cold.layers[1].material.young == STEEL.young
    lawless = gc.Prony(1e6, [1e6], [1.0], 0.5)
    with pytest.raises(ValueError, match=r"^`base`: This material has no law"):
        gc.Stack(layers=stack.layers, base=gc.HalfSpace(lawless)).at(273.15)
    with pytest.raises(ValueError, match=r"^`layers\[0\]`: This material has no law"):
        gc.Stack(layers=(gc.Layer(lawless, 1e-3),), base=stack.base).at(273.15)


@pytest.mark.slow
def test_slices_of_a_graded_layer_converge_to_it_two_orders_better_when_extrapolated():
    profile = gc.Blend(gc.tyre_tread(), gc.Elastic(5e7, 0.3))
    stack = gc.Stack(
        layers=(gc.Layer(gc.Elastic(5e8, 0.3), 1e-5), gc.GradedLayer(profile, 1e-3)),
        base=gc.Rigid(),
    )
    q, omega = 2e3, -40.0
    expected = gc.blocks.graded_compliance(stack, q, omega, rtol=1e-11).value
    few, many = (
        gc.surface_compliance_matrix(gc.blocks.sliced(stack, n), q, 0.0, omega)[2, 2]
        for n in (8, 16)
    )
    assert 1e-3 < abs(few / expected - 1) < 1e-2
    assert abs(many - expected) < abs(few - expected) / 3.5
    assert abs((4 * many - few) / 3 - expected) < abs(many - expected) / 8


def test_slices_keep_the_other_layers_and_the_temperature():
    cold = gc.Stack(
        layers=(gc.GradedLayer(gc.Blend(gc.tyre_tread(), STEEL), 1e-3), gc.Layer(STEEL, 1e-5)),
        base=gc.Rigid(),
    ).at(273.15)
    stack = gc.blocks.sliced(cold, 4)
    assert len(stack.layers) == 5 and stack.layers[4] is cold.layers[1]
    top, _ = cold.layers[0].profile(jnp.asarray(0.875), jnp.asarray(30.0))
    assert stack.layers[0].material.modulus(30.0) == top
    with pytest.raises(ValueError, match="`num_slices=0` must be a whole number, at least 1"):
        gc.blocks.sliced(cold, 0)
