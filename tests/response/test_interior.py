import elasticity
import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from oracles import elasticities

import graded_contact as gc
from graded_contact.blocks.stack import interface_depths
from graded_contact.materials.material import BulkShear
from graded_contact.response.stress import interior_fields, stress_field, von_mises

OMEGA = 7.0
# Lossy and incompressible, lossy with complex ν(ω), stiff, soft and nearly incompressible.
MATERIALS = (
    gc.Prony(1.0, [9.0], [0.1], 0.5),
    BulkShear(gc.Elastic(200.0), gc.Prony(1.0, [5.0, 3.0], [0.3, 0.02])),
    gc.Elastic(1e3, 0.3),
    gc.Elastic(0.01, 0.499),
)
THICKNESSES = (0.1, 0.3, 0.05, 0.2)
BASES = {
    "halfspace": gc.HalfSpace(gc.Prony(2.0, [20.0], [0.1], 0.45)),
    "rigid": gc.Rigid(),
    "free": gc.Free(),
}
# q d up to 650
WAVES = np.array([[1e-4, 2e-4], [0.3, -0.1], [-3, 2], [0, -20], [90, -40], [800, 600]])
TRACTION = np.array([0.3 + 0.2j, -1, 0.7j])


def stack_on(base, materials=MATERIALS):
    layers = tuple(gc.Layer(m, d) for m, d in zip(materials, THICKNESSES, strict=True))
    return gc.Stack(layers=layers, base=BASES[base])


def depths_of(stack):
    """Depths with the layer meant: the surface, inside layers, interfaces, and in the base."""
    z = [float(x) for x in interface_depths(stack)]
    depths = [(0.0, 0), (0.03, 0), (z[0], 1), (0.2, 1), (z[1], 2), (0.43, 2), (z[2], 3), (0.6, 3)]
    if isinstance(stack.base, gc.HalfSpace):
        return [*depths, (z[3], 4), (0.7, 4), (1.5, 4)]
    return [*depths, (0.62, 3), (0.64, 3), (z[3], 3)]


def fields_of(stack, depths, side="below"):
    """One call for all waves and depths, so that it compiles once for each base."""
    return interior_fields(
        stack, WAVES[:, :1], WAVES[:, 1:], OMEGA, TRACTION, np.array(depths), side=side
    )


def test_propagator_of_the_oracle_is_the_matrix_exponential():
    with mp.workdps(40):
        a = elasticity.generator(mp.mpf(0.7), mp.mpf(-1.1), mp.mpc(2, 1), mp.mpc(0.4, -0.1))
        q = mp.sqrt(mp.mpf(0.7) ** 2 + mp.mpf(1.1) ** 2)
        closed, series = elasticity.propagator(a, q, mp.mpf(0.9)), mp.expm(a * mp.mpf(0.9))
        assert mp.norm(closed - series) < 1e-35 * mp.norm(series)


@pytest.mark.parametrize("base", BASES)
def test_fields_match_transfer_matrices_in_mpmath(base):
    stack = stack_on(base)
    depths = depths_of(stack)
    displacement, stress = fields_of(stack, [z for z, _ in depths])
    moduli_of = lambda m: (complex(m.complex_modulus(OMEGA)), complex(m.poisson_ratio(OMEGA)))  # noqa: E731
    moduli = [(d, *moduli_of(m)) for m, d in zip(MATERIALS, THICKNESSES, strict=True)]
    below = moduli_of(stack.base.material) if base == "halfspace" else base
    compared = 0
    for i, (qx, qy) in enumerate(WAVES):
        exact = elasticity.fields(qx, qy, moduli, below, TRACTION, depths)
        for j, (z, _) in enumerate(depths):
            # Relative to the fields at that depth, e^-qz of those above: q z is a condition number.
            tolerance = 2e-14 + 1e-14 * np.hypot(qx, qy) * z
            for value, expected in zip((displacement[i, j], stress[i, j]), exact[j], strict=True):
                size = np.max(np.abs(expected))
                if not size > 1e-290:
                    continue
                if np.all(np.asarray(value) == 0):  # the lower face of a rigid or free block
                    assert base != "halfspace" and z == depths[-1][0] and size < 1e-12
                    continue
                np.testing.assert_allclose(value, expected, rtol=0, atol=tolerance * size)
                compared += 1
    assert compared > 110


def test_tractions_are_continuous_and_lateral_stresses_jump_across_interfaces():
    stack = stack_on("halfspace")
    z = np.asarray(interface_depths(stack))
    nudge = np.concatenate([z * (1 - 1e-12), z, z[:3] * (1 + 1e-12)])
    above, below = (fields_of(stack, nudge, side) for side in ("above", "below"))
    waves = slice(0, 4)  # q z 1e-12 is far below the tolerance
    np.testing.assert_array_equal(above.stress[..., 2], below.stress[..., 2])
    np.testing.assert_array_equal(above.displacement, below.displacement)
    # Each side is the limit from within its layer; and they differ.
    size = np.max(np.abs(above.stress + below.stress)[waves, 4:8], axis=(2, 3), keepdims=True)
    limit = (above.stress[waves, 4:8] - above.stress[waves, 0:4]) / size
    assert np.max(np.abs(limit)) < 1e-9
    limit = (below.stress[waves, 4:7] - below.stress[waves, 8:11]) / size[:, :3]
    assert np.max(np.abs(limit)) < 1e-9
    jump = (above.stress[waves, 4:8, 0, 0] - below.stress[waves, 4:8, 0, 0]) / size[..., 0, 0]
    assert np.all(np.abs(jump) > 1e-2)


@pytest.mark.parametrize("poisson", [0.2, 0.5])
def test_half_space_under_a_wave_of_pressure(poisson):
    """p cos qx: σ_zz, σ_xx = -p (1 ± qz) e^-qz cos qx, σ_xz = -p qz e^-qz sin qx (K. L. Johnson,
    Contact Mechanics, 1985), whatever ν; σ_yy = ν (σ_xx + σ_zz). The mean compresses uniaxially."""
    grid = gc.Grid((16, 8), (2e-3, 1e-3))
    stack = gc.Stack(base=gc.HalfSpace(gc.Elastic(5e6, poisson)))
    x = np.arange(16)[:, None] * 2e-3 / 16 + np.zeros(8)
    q, p, mean = 2 * np.pi / 2e-3, 3e4, 5e4
    pressure = mean + p * np.cos(q * x)
    for z in (0.0, 1e-4, 7e-4):
        wave, decay = p * np.cos(q * x), np.exp(-q * z)
        depth = jnp.asarray(z)
        _, stress = stress_field(stack, grid, jnp.asarray(pressure), depth, 0 * depth)
        zz, xx = -(1 + q * z) * decay * wave, -(1 - q * z) * decay * wave
        lateral = -poisson / (1 - poisson) * mean
        np.testing.assert_allclose(stress[..., 2, 2], zz - mean, atol=1e-9)
        np.testing.assert_allclose(stress[..., 0, 0], xx + lateral, atol=1e-9)
        np.testing.assert_allclose(stress[..., 1, 1], poisson * (xx + zz) + lateral, atol=1e-9)
        shear = -p * q * z * decay * np.sin(q * x)
        np.testing.assert_allclose(stress[..., 0, 2], shear, atol=1e-9)
        assert np.max(np.abs(stress[..., [0, 1], [1, 2]])) < 1e-9


def test_sliding_surface_moves_as_the_kernel_says():
    base, shape, velocity = "halfspace", (8, 6), np.array([0.4, -0.2])
    grid = gc.Grid(shape, 1.0)
    stack = gc.Stack(layers=(gc.Layer(MATERIALS[0], 0.1),), base=BASES[base])
    pressure = np.random.default_rng(0).normal(size=shape) + 3
    given = jnp.asarray(pressure), jnp.zeros(()), jnp.asarray(velocity)
    displacement, stress = stress_field(stack, grid, *given)
    assert displacement.shape == (*shape, 3)
    assert stress.shape == (*shape, 3, 3)
    kernel = gc.stack_kernel(stack, grid, velocity)
    expected = jnp.fft.irfftn(kernel * jnp.fft.rfftn(jnp.asarray(pressure)), shape)
    size = np.max(np.abs(expected))
    np.testing.assert_allclose(displacement[..., 2] / size, expected / size, atol=1e-14)
    np.testing.assert_allclose(stress[..., 2, 2], -pressure, rtol=1e-13)
    np.testing.assert_allclose(stress[..., 0, 2], np.zeros(shape), atol=1e-13)
    np.testing.assert_array_equal(stress, np.swapaxes(stress, -1, -2))


def test_gradient_matches_central_differences():
    """Of elastic layers, to compile fast; lossy moduli have theirs in `test_derivatives.py`."""
    layer = gc.Layer(gc.Elastic(3.0, 0.5), 0.1)
    stack = gc.Stack(layers=(layer,), base=gc.HalfSpace(gc.Elastic(2.0, 0.45)))
    real, imag = np.random.default_rng(2).normal(size=(2, 2, 3, 3))  # of two depths

    def value(stack, wave, depth):
        displacement, stress = interior_fields(stack, *wave, OMEGA, TRACTION, depth)
        return jnp.sum(real * stress.real + imag * stress.imag) + jnp.sum(
            real[:, 0] * displacement.real + imag[:, 0] * displacement.imag
        )

    arguments = (stack, jnp.array([3.0, -2.0]), jnp.array([0.05, 0.25]))
    for slope, difference in elasticities(value, arguments):
        assert abs(difference - slope) <= 1e-7 * abs(slope) + 1e-8


def test_von_mises_of_simple_stresses():
    tension, pressure, shear = np.zeros((3, 3, 3))
    tension[0, 0], shear[0, 1], shear[1, 0] = 7e6, 2e6, 2e6
    pressure += 3e8 * np.eye(3)
    stress = jnp.array([tension, pressure, shear, tension + pressure])
    np.testing.assert_allclose(
        von_mises(stress), [7e6, 0, 2e6 * np.sqrt(3), 7e6], rtol=1e-12, atol=1e-6
    )
    nothing = jnp.zeros((1, 3, 3))
    slopes = jax.jit(jax.grad(lambda s: jnp.sum(von_mises(s))))(jnp.concatenate([stress, nothing]))
    np.testing.assert_allclose(slopes[0], np.diag([1, -0.5, -0.5]), atol=1e-12)
    np.testing.assert_array_equal(slopes[4], nothing[0])
