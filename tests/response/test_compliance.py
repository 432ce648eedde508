import json
import pathlib

import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from mpmath import mp, mpc, mpf

import graded_contact as gc
from graded_contact import reference

CASES = json.loads(
    (pathlib.Path(__file__).parents[1] / "data" / "compliance_cases.json").read_text()
)["cases"]


def complex_of(pair):
    return complex(float(pair[0]), float(pair[1]))


def real_if_real(values):
    values = np.array(values, complex)
    return values.real if not values.imag.any() else values


def evaluate(case):
    """The package's M_zz for a stored case; its moduli are fed as they stand."""
    layers = case["layers"][::-1]  # stored from the substrate upwards
    substrate = case["substrate"]
    if substrate["kind"] == "halfspace":
        base = (
            real_if_real(complex_of(substrate["E"])),
            real_if_real(complex_of(substrate["nu"])),
        )
    else:
        base = {"rigid": gc.Rigid(), "free": gc.Free()}[substrate["kind"]]
    mp.dps = 40
    q = float(mp.sqrt(sum(mpf(component) ** 2 for component in case["q"])))
    return complex(
        gc.layered_compliance(
            q,
            np.array([float(layer["d"]) for layer in layers]),
            np.array([complex_of(layer["E"]) for layer in layers]),
            real_if_real([complex_of(layer["nu"]) for layer in layers]),
            base,
        )
    )


def test_stored_cases_are_met_to_1e_14():
    """mpmath at 50 digits: slabs, coatings and stacks up to 300 layers on the three bases."""
    errors = {}
    for case in CASES:
        expected = mpc(*map(mpf, case["M_zz"]))
        errors[case["id"]] = float(abs(mpc(evaluate(case)) - expected) / abs(expected))
    worst = max(errors, key=errors.get)
    assert errors[worst] <= 1e-14, (worst, errors[worst])
    assert len(errors) >= 50


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
def test_one_layer_matches_the_closed_forms(poisson):
    q, d, e = np.geomspace(10, 1e5, 9), 1e-3, 3e6
    layer = ([d], [e], [poisson])
    np.testing.assert_allclose(
        gc.layered_compliance(q, *layer, gc.Rigid()),
        reference.slab_on_rigid_compliance(q, d, e, poisson),
        rtol=1e-8,  # the closed form cancels at small q d
    )
    np.testing.assert_allclose(
        gc.layered_compliance(q, *layer, gc.Free()),
        reference.free_slab_compliance(q, d, e, poisson),
        rtol=1e-8,
    )
    np.testing.assert_allclose(
        gc.layered_compliance(q, *layer, (7e6 + 2e6j, 0.4)),
        reference.coated_half_space_compliance(q, d, e, poisson, 7e6 + 2e6j, 0.4),
        rtol=1e-13,
    )


def test_half_space_of_complex_modulus_and_poisson_ratio_is_two_over_q_reduced_modulus():
    e, nu, q = 5e6 - 3e6j, 0.4 + 0.02j, np.array([1.0, 1e4])
    expected = 2 * (1 - nu**2) / (e * q)
    value = gc.layered_compliance(q, np.zeros(0), np.zeros(0), np.zeros(0), (e, nu))
    np.testing.assert_allclose(value, expected, rtol=1e-15)


def test_four_and_five_layers_agree_though_one_is_unrolled_and_the_other_scanned():
    q = np.geomspace(1e2, 1e6, 7)
    d, e, nu = [1e-5, 3e-5, 2e-4, 1e-3], [1e6, 3e7, 2e6 + 1e6j, 5e6], [0.5, 0.3, 0.49, 0.2]
    base = (2e7 + 1e6j, 0.45)
    four = gc.layered_compliance(q, d, e, nu, base)
    halves = lambda v, f: [v[0], *[x * f for x in [v[1], v[1]]], *v[2:]]  # noqa: E731
    five = gc.layered_compliance(q, halves(d, 0.5), halves(e, 1), halves(nu, 1), base)
    np.testing.assert_allclose(five, four, rtol=4e-15)


@pytest.mark.parametrize("num_layers", [3, 6])
def test_properties_may_vary_with_frequency_or_not(num_layers):
    """Moduli of shape (n,) and (n, *w) mean the same where they are the same."""
    q, d = np.geomspace(1e2, 1e5, 7), np.full(num_layers, 1e-4)
    e, nu = np.linspace(1e6, 2e6, num_layers) + 1e5j, np.linspace(0.2, 0.5, num_layers)
    plain = gc.layered_compliance(q, d, e, nu, (1e7, 0.3))
    wide = np.broadcast_to(e[:, None], (num_layers, 7))
    np.testing.assert_allclose(gc.layered_compliance(q, d, wide, nu, (1e7, 0.3)), plain, rtol=4e-15)
    wide_nu = np.broadcast_to(nu[:, None], (num_layers, 7))
    np.testing.assert_allclose(
        gc.layered_compliance(q, d, e, wide_nu, (1e7, 0.3)), plain, rtol=4e-15
    )


def stack_of(thicknesses, e0=6e6, tau=1e-3):
    rubber = gc.Prony(e0, [9 * e0], [tau], 0.49)
    skin = gc.Elastic(2 * e0, 0.3)
    layers = tuple(gc.Layer(skin if i % 2 else rubber, d) for i, d in enumerate(thicknesses))
    return gc.Stack(layers=layers, base=gc.HalfSpace(gc.tyre_tread(0.48)))


def test_thickness_zero_is_no_layer():
    q, omega = np.geomspace(1, 1e7, 20), np.geomspace(1e-3, 1e9, 20)
    with_nothing = gc.surface_compliance(stack_of([1e-4, 0.0]), q, omega)
    without = gc.surface_compliance(stack_of([1e-4]), q, omega)
    np.testing.assert_allclose(with_nothing, without, rtol=1e-15)


def test_equal_layers_are_one_layer():
    tread = gc.tyre_tread()
    q, omega = np.geomspace(1, 1e7, 20), np.geomspace(1e-3, 1e9, 20)
    for base in (gc.Rigid(), gc.Free(), gc.HalfSpace(gc.Elastic(1e9, 0.3))):
        parts = gc.Stack(layers=tuple(gc.Layer(tread, d) for d in (1e-4, 3e-4, 6e-4)), base=base)
        whole = gc.Stack(layers=(gc.Layer(tread, 1e-3),), base=base)
        np.testing.assert_allclose(
            gc.surface_compliance(parts, q, omega),
            gc.surface_compliance(whole, q, omega),
            rtol=3e-15 if not isinstance(base, gc.Free) else 1e-14,
        )


def test_effective_modulus_of_a_half_space_is_the_plane_strain_modulus():
    tread, omega = gc.tyre_tread(0.45), jnp.geomspace(1e-2, 1e8, 11)
    value = gc.effective_modulus(gc.Stack(base=gc.HalfSpace(tread)), 123.0, omega)
    np.testing.assert_allclose(value, tread.modulus(omega) / (1 - 0.45**2), rtol=1e-15)


positive = st.floats(-2, 2).map(lambda x: 10.0**x)


@settings(max_examples=50)
@given(
    d=st.tuples(positive, positive),
    omega=positive,
    q=positive,
    lossless=st.booleans(),
)
def test_compliance_is_passive_and_hermitian(d, omega, q, lossless):
    """Im M <= 0 for ω > 0 (fields exp(iωt)), M(-ω) = conj M(ω), Re M > 0."""
    stack = stack_of([1e-4 * x for x in d])
    forward = complex(gc.surface_compliance(stack, 1e4 * q, 1e3 * omega))
    backward = complex(gc.surface_compliance(stack, 1e4 * q, -1e3 * omega))
    assert backward == forward.conjugate()
    assert forward.imag <= 0
    assert forward.real > 0


@settings(max_examples=20)
@given(length=positive, stress=positive)
def test_units_scale_out(length, stress):
    q, d = np.array([1e2, 1e4]), np.array([1e-4, 2e-3])
    e, nu = np.array([1e6 + 1e5j, 3e7]), np.array([0.5, 0.3])
    value = gc.layered_compliance(q, d, e, nu, (5e6, 0.4))
    scaled = gc.layered_compliance(q / length, d * length, e * stress, nu, (5e6 * stress, 0.4))
    np.testing.assert_allclose(scaled, value * length / stress, rtol=2e-14)


def test_kernel_is_hermitian_dissipates_along_x_and_is_empty_at_rest():
    grid = gc.Grid((16, 12), (1e-2, 2e-2))
    stack = stack_of([1e-3])
    kernel = np.asarray(gc.stack_kernel(stack, grid, 0.3))
    assert kernel.shape == (16, 7)
    assert kernel[0, 0] == 0
    np.testing.assert_array_equal(kernel[1:8], np.conj(kernel[:8:-1]))
    # A surface moving to +x excites ω = -q_x v < 0 for q_x > 0, where Im M >= 0.
    assert np.all(kernel[1:8, :-1].imag > 0)
    assert not kernel[8].imag.any()
    assert not kernel[:, 6].imag.any()
    assert not np.asarray(gc.stack_kernel(stack, grid, 0.0)).imag.any()


@pytest.mark.parametrize("shape", [(16, 12), (15, 9), (15, 12)])
def test_kernel_of_a_scalar_velocity_is_that_of_the_vector_along_x(shape):
    grid = gc.Grid(shape, (1e-2, 2e-2))
    stack = stack_of([1e-3])
    np.testing.assert_allclose(
        gc.stack_kernel(stack, grid, 0.3), gc.stack_kernel(stack, grid, [0.3, 0.0]), rtol=1e-15
    )


def test_kernel_of_a_line_is_that_of_the_row_at_qy_zero():
    stack = stack_of([1e-3])
    line = gc.stack_kernel(stack, gc.Grid((16,), 1e-2), 0.3)
    plane = gc.stack_kernel(stack, gc.Grid((16, 8), 1e-2), 0.3)
    np.testing.assert_allclose(line, plane[:9, 0], rtol=1e-15)


def test_kernel_of_elastic_materials_is_real():
    stack = gc.Stack(layers=(gc.Layer(gc.Elastic(1e6), 1e-3),), base=gc.Rigid())
    kernel = gc.stack_kernel(stack, gc.Grid((8, 8), 1e-2), 0.3)
    assert jnp.issubdtype(kernel.dtype, jnp.floating)


@pytest.mark.parametrize("num_layers", [0, 2, 6])
def test_gradient_by_every_leaf_matches_central_differences(num_layers):
    stack = stack_of(np.geomspace(1e-5, 1e-3, num_layers))

    @jax.jit
    def value(stack, q, omega):
        m = gc.surface_compliance(stack, q, omega)
        return 1e12 * (m.real + 3 * m.imag)

    arguments = (stack, jnp.asarray(2e4), jnp.asarray(50.0))
    gradient = jax.jit(jax.grad(value, (0, 1, 2)))(*arguments)
    leaves, treedef = jax.tree.flatten(arguments)
    for i, (leaf, slope) in enumerate(zip(leaves, jax.tree.leaves(gradient), strict=True)):
        for index in np.ndindex(leaf.shape):
            if leaf[index] == 0:
                continue
            step = 1e-5 * abs(float(leaf[index]))
            ends = []
            for sign in (1, -1):
                moved = leaf.at[index].add(sign * step)
                ends.append(
                    float(value(*treedef.unflatten([*leaves[:i], moved, *leaves[i + 1 :]])))
                )
            difference = (ends[0] - ends[1]) / (2 * step)
            scale = abs(float(value(*arguments)) / float(leaf[index]))
            assert abs(difference - slope[index]) <= 1e-7 * abs(slope[index]) + 3e-10 * scale


def test_soft_films_under_a_free_plate_do_not_spoil_its_derivatives():
    """Their tractions vanish against those above, and once came of a difference of large ones.

    Expected: mpmath at 200 digits, central differences of step 1e-40.
    """
    thickness, modulus = [1.2e-2, 5.2e-11, 2.5e-11], [6e8, 3.9e3, 0.4]
    arguments = (1.0, *map(np.array, (thickness, modulus, [0.5, 0.438, 0.5])))
    by_q, by_d, by_e, _ = jax.grad(
        lambda *p: gc.layered_compliance(*p, gc.Free()), argnums=(0, 1, 2, 3)
    )(*arguments)
    assert abs(by_q / -0.0347227222222195 - 1) < 1e-14
    expected = [-2.1701597217648527, -1.3090948810619722e-05, -1.4467731849778193e-09]
    np.testing.assert_allclose(by_d, expected, rtol=2e-14)
    expected = [-1.4468009268399845e-11, -1.7454598262866738e-19, -9.042332368434083e-20]
    np.testing.assert_allclose(by_e, expected, rtol=1e-14)


def test_float32_gradients_have_the_right_sign_and_size():
    """In pascals and metres a careless backward pass overflows float32, silently."""

    def slopes(dtype):
        stack = jax.tree.map(lambda x: x.astype(dtype), stack_of([2e-5]))
        q, omega = jnp.asarray(1e5, dtype), jnp.asarray(1e4, dtype)
        return jax.grad(lambda s: gc.surface_compliance(s, q, omega).real)(stack)

    for single, double in zip(
        jax.tree.leaves(slopes(jnp.float32)), jax.tree.leaves(slopes(jnp.float64)), strict=True
    ):
        assert single.dtype == jnp.float32
        visible = np.abs(double) > 1e-4 * np.max(np.abs(double))
        np.testing.assert_allclose(
            np.where(visible, single, 0), np.where(visible, double, 0), rtol=1e-3
        )


def test_vmap_over_thickness_and_jit_give_the_same_numbers():
    q, omega = 1e4, 1e2
    thicknesses = jnp.array([1e-5, 1e-4, 1e-3])
    one = lambda d: gc.surface_compliance(stack_of([1e-4, d]), q, omega)  # noqa: E731
    batch = jax.vmap(one)(thicknesses)
    np.testing.assert_allclose(batch, [one(d) for d in thicknesses], rtol=1e-15)
    np.testing.assert_allclose(jax.jit(one)(thicknesses[1]), batch[1], rtol=1e-15)


def test_frequencies_and_wavenumbers_broadcast():
    stack = stack_of([1e-4])
    q, omega = np.geomspace(1e3, 1e5, 4)[:, None], np.geomspace(1, 1e3, 3)
    table = gc.surface_compliance(stack, q, omega)
    assert table.shape == (4, 3)
    np.testing.assert_allclose(
        table[2, 1], gc.surface_compliance(stack, q[2, 0], omega[1]), rtol=1e-15
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((-1.0, [1e-3], [1e6], [0.3], gc.Rigid()), "`q=-1` is refused: it must be a positive"),
        ((1.0, [-1e-3], [1e6], [0.3], gc.Rigid()), r"`thickness\[0\]=-0.001` is refused"),
        ((1.0, [1e-3], [1e6, 1e6], [0.3], gc.Rigid()), "`modulus` has shape"),
        ((1.0, [1e-3], [np.nan], [0.3], gc.Rigid()), r"`modulus\[0\]=nan`"),
        ((1.0, [1e-3], [0.0], [0.3], gc.Rigid()), "`modulus` holds a zero"),
        ((1.0, [1e-3], [1e6], [0.6], gc.Rigid()), r"`poisson\[0\]=0.6` is refused"),
        ((1.0, [], [], [], gc.Free()), "`thickness` is empty"),
        ((1.0, 1e-3, [1e6], [0.3], gc.Rigid()), "`thickness` has shape"),
    ],
)
def test_layered_compliance_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        gc.layered_compliance(*arguments)


def test_bad_wavenumbers_frequencies_and_velocities_are_refused():
    stack = stack_of([1e-4])
    with pytest.raises(ValueError, match="`q=0` is refused"):
        gc.surface_compliance(stack, 0.0, 1.0)
    with pytest.raises(ValueError, match="`omega=nan` is refused"):
        gc.surface_compliance(stack, 1.0, np.nan)
    grid = gc.Grid((8, 8), 1.0)
    with pytest.raises(ValueError, match=r"`velocity` has shape \(3,\)"):
        gc.stack_kernel(stack, grid, [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="`velocity=inf` is refused"):
        gc.stack_kernel(stack, grid, np.inf)
    with pytest.raises(ValueError, match=r"`velocity` has shape \(2,\)"):
        gc.stack_kernel(stack, gc.Grid((8,), 1.0), [1.0, 2.0])


def test_derivatives_beside_a_nan_keep_their_sign():
    """What is computed once and stored passes a loop, which a first NaN makes run."""
    d, e, nu = np.array([1e-4, 1e-3]), np.array([1e6 + 1e5j, 3e7]), np.array([0.5, 0.3])

    @jax.jit
    def slope(q):
        compliance = lambda d: gc.layered_compliance(q, d, e, nu, (5e6, 0.4))  # noqa: E731
        return jax.jvp(compliance, (jnp.asarray(d),), (jnp.ones(2),))[1]

    q = jnp.array([1e2, 1e3, 1e4])
    for place in range(3):
        beside = np.arange(3) != place
        found = slope(q.at[place].set(jnp.nan))
        np.testing.assert_allclose(found[beside], slope(q)[beside], rtol=1e-12)
        assert np.isnan(found[place])
