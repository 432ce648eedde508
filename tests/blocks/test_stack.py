import dataclasses

import jax.numpy as jnp
import numpy as np

import graded_contact as gc


class AtHeight(gc.materials.AbstractMaterial):
    """The material of a profile at one height."""

    profile: gc.Blend
    height: float

    def complex_modulus(self, omega):
        return self.profile(self.height, jnp.asarray(omega))[0]

    def poisson_ratio(self, omega):
        return self.profile(self.height, jnp.asarray(omega))[1]

    def at(self, temperature):
        raise NotImplementedError


def test_slices_of_a_graded_layer_converge_to_it_two_orders_better_when_extrapolated():
    profile = gc.Blend(gc.Prony(1e6, [9e6], [1e-2], 0.48), gc.Elastic(5e7, 0.3))
    stack = gc.Stack(
        layers=(gc.Layer(gc.Elastic(5e8, 0.3), 1e-5), gc.GradedLayer(profile, 1e-3)),
        base=gc.Rigid(),
    )
    q, omega = 2e3, -40.0
    sharp = dataclasses.replace(stack, graded_solver=gc.response.Layering(rtol=1e-11))
    expected = gc.surface_compliance(sharp, q, omega)

    def cut(n):
        heights = 1 - (np.arange(n) + 0.5) / n
        slices = [gc.Layer(AtHeight(profile, s), 1e-3 / n) for s in heights]
        whole = gc.Stack(layers=(stack.layers[0], *slices), base=gc.Rigid())
        return gc.surface_compliance(whole, q, omega)

    few, many = cut(16), cut(32)
    assert 1e-3 < abs(few / expected - 1) < 1e-2
    assert abs(many - expected) < abs(few - expected) / 3.5
    assert abs((4 * many - few) / 3 - expected) < abs(many - expected) / 8
