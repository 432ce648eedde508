from functools import partial

import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from mpmath import mp, mpc, mpf
from stored import cases_of, complex_of, layered

import graded_contact as gc

BASES = {"rigid": gc.Rigid(), "free": gc.Free()}


def evaluate(cases):
    """The package's M_zz for cases of one kind of base, in one call, from the surface downwards.

    Stacks are filled up with layers of no thickness.
    """
    count = max(1, *(len(case["layers"]) for case in cases))
    nothing = {"d": "0", "E": ["1", "0"], "nu": ["0.3", "0"]}
    layers = [[nothing] * (count - len(c["layers"])) + c["layers"][::-1] for c in cases]
    kind, axis = cases[0]["substrate"]["kind"], None
    if kind == "halfspace":
        parts = [[complex_of(case["substrate"][name]) for case in cases] for name in ("E", "nu")]
        base, axis = tuple(map(np.array, parts)), 0
    else:
        base = BASES[kind]
    q = np.array([float(mp.sqrt(sum(mpf(x) ** 2 for x in case["q"]))) for case in cases])
    table = lambda read: np.array([[read(x) for x in row] for row in layers])  # noqa: E731
    return jax.jit(lambda *given: jax.vmap(layered, (0, 0, 0, 0, axis))(*given, base))(
        q, table(lambda x: float(x["d"])), table(lambda x: complex_of(x["E"])),
        table(lambda x: complex_of(x["nu"])),
    )  # fmt: skip


def test_stored_cases_are_met_to_1e_14():
    """mpmath at 50 digits: slabs, coatings and stacks up to 300 layers on the three bases."""
    groups, errors = {}, {}
    for case in cases_of("compliance"):
        groups.setdefault(case["substrate"]["kind"], []).append(case)
    for cases in groups.values():
        for case, found in zip(cases, evaluate(cases), strict=True):
            expected = mpc(*map(mpf, case["M_zz"]))
            errors[case["id"]] = float(abs(mpc(complex(found)) - expected) / abs(expected))
    worst = max(errors, key=errors.get)
    assert errors[worst] <= 1e-14, (worst, errors[worst])
    assert len(errors) >= 50


def stack_of(thicknesses, e0=6e6, tau=1e-3):
    rubber = gc.Prony(e0, [9 * e0], [tau], 0.49)
    skin = gc.Elastic(2 * e0, 0.3)
    layers = tuple(gc.Layer(skin if i % 2 else rubber, d) for i, d in enumerate(thicknesses))
    return gc.Stack(layers=layers, base=gc.HalfSpace(gc.Prony(1e6, [2e7], [1e-4], 0.48)))


def test_thickness_zero_is_no_layer():
    q, omega = np.geomspace(1, 1e7, 20), np.geomspace(1e-3, 1e9, 20)
    with_nothing = gc.surface_compliance(stack_of([1e-4, 0.0]), q, omega)
    without = gc.surface_compliance(stack_of([1e-4]), q, omega)
    np.testing.assert_allclose(with_nothing, without, rtol=1e-15)


def test_effective_modulus_of_a_half_space_is_the_plane_strain_modulus():
    tread, omega = gc.Prony(1e6, [2e7], [1e-4], 0.45), np.geomspace(1e-2, 1e8, 20)
    value = gc.effective_modulus(gc.Stack(base=gc.HalfSpace(tread)), 123.0, omega)
    np.testing.assert_allclose(value, tread.complex_modulus(omega) / (1 - 0.45**2), rtol=1e-15)


positive = st.floats(-2, 2).map(lambda x: 10.0**x)


@settings(max_examples=50)
@given(d=st.tuples(positive, positive), omega=positive, q=positive)
def test_compliance_is_passive_and_hermitian(d, omega, q):
    """Im M <= 0 for ω > 0 (fields exp(iωt)), M(-ω) = conj M(ω), Re M > 0."""
    stack = stack_of([1e-4 * x for x in d])
    forward = complex(gc.surface_compliance(stack, 1e4 * q, 1e3 * omega))
    backward = complex(gc.surface_compliance(stack, 1e4 * q, -1e3 * omega))
    assert backward == forward.conjugate()
    assert forward.imag <= 0
    assert forward.real > 0


def test_kernel_of_elastic_materials_is_real():
    stack = gc.Stack(layers=(gc.Layer(gc.Elastic(1e6), 1e-3),), base=gc.Rigid())
    kernel = gc.stack_kernel(stack, gc.Grid((8, 8), 1e-2), 0.3)
    assert jnp.issubdtype(kernel.dtype, jnp.floating)


def test_soft_films_under_a_free_plate_do_not_spoil_its_derivatives():
    """Their tractions vanish against those above, and once came of a difference of large ones.

    Expected: mpmath at 200 digits, central differences of step 1e-40.
    """
    thickness, modulus = [1.2e-2, 5.2e-11, 2.5e-11], [6e8, 3.9e3, 0.4]
    arguments = (1.0, *map(np.array, (thickness, modulus, [0.5, 0.438, 0.5])))
    by_q, by_d, by_e, _ = jax.grad(lambda *p: layered(*p, gc.Free()), argnums=(0, 1, 2, 3))(
        *arguments
    )
    assert abs(by_q / -0.0347227222222195 - 1) < 1e-14
    expected = [-2.1701597217648527, -1.3090948810619722e-05, -1.4467731849778193e-09]
    np.testing.assert_allclose(by_d, expected, rtol=1e-14)
    expected = [-1.4468009268399845e-11, -1.7454598262866738e-19, -9.042332368434083e-20]
    np.testing.assert_allclose(by_e, expected, rtol=1e-14)


def test_float32_derivatives_of_a_lossy_plate_on_a_very_thin_film_are_right():
    """Against float64. The determinant of the film is 1e-23, whose square float32 does not have."""
    loss = np.exp(0.3j)
    thickness, modulus = np.array([5.4e-6, 1.35e-9]), np.array([7.5e5, 7e2]) * loss

    @partial(jax.jit, static_argnums=1)
    def slopes(scale, derivative):
        complex_type = jnp.result_type(scale.dtype, jnp.complex64)

        def value(scale):
            moduli = jnp.asarray(modulus, complex_type) * scale[2:4]
            poisson = jnp.asarray([0.3, 0.3], complex_type) * scale[4:]
            found = layered(
                jnp.asarray(2400, scale.dtype),
                jnp.asarray(thickness, scale.dtype) * scale[:2],
                moduli,
                poisson,
                gc.Free(),
            )
            return jnp.stack([found.real, found.imag])

        return derivative(value)(scale)

    exact = slopes(jnp.ones(6), jax.jacfwd)
    found = slopes(jnp.ones(6, jnp.float32), jax.jacrev)
    assert found.dtype == jnp.float32
    np.testing.assert_allclose(found, exact, atol=1e-6 * np.max(np.abs(exact)))
