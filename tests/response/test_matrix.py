import jax
import mpmath as mp
import numpy as np
import pytest
from mpmath import mpc, mpf
from stored import MIRROR, Given, cases_of, complex_of

import graded_contact as gc
from graded_contact.materials.material import BulkShear
from graded_contact.response.compliance import surface_compliance_matrix

CASES = cases_of("matrix")
BASES = {
    "halfspace": gc.HalfSpace(gc.Prony(2e6, [2e7], [1e-2], 0.45)),
    "rigid": gc.Rigid(),
    "free": gc.Free(),
}


def stack_on(base):
    """Lossy and incompressible, lossy with complex ν(ω), stiff and elastic."""
    rubber = gc.Prony(1e6, [9e6], [1e-2], 0.5)
    foam = BulkShear(gc.Elastic(1e7), gc.Prony(1e6, [5e6, 3e6], [0.3, 2e-3]))
    materials = (rubber, foam, gc.Elastic(1e9, 0.3))
    layers = tuple(gc.Layer(m, d) for m, d in zip(materials, (1e-4, 3e-4, 5e-5), strict=True))
    return gc.Stack(layers=layers, base=BASES[base])


def matrix_of(qx, qy, thickness, modulus, poisson, base):
    """The package's matrix for layers of given moduli; `base` may be (E, ν)."""
    parts = zip(thickness, modulus, poisson, strict=True)
    layers = tuple(gc.Layer(Given(e, nu), d) for d, e, nu in parts)
    base = gc.HalfSpace(Given(*base)) if isinstance(base, tuple) else base
    return surface_compliance_matrix(gc.Stack(layers=layers, base=base), qx, qy, 1.0)


def evaluate(cases):
    """The package's matrices for stored cases of one kind of base, in one call.

    Stacks are filled up with layers of no thickness.
    """
    num_layers = max(len(case["layers"]) for case in cases)
    nothing = {"d": "0", "E": ["1", "0"], "nu": ["0.3", "0"]}
    layers = [
        [nothing] * (num_layers - len(case["layers"])) + case["layers"][::-1] for case in cases
    ]
    table = lambda read: np.array([[read(x) for x in row] for row in layers]).T  # noqa: E731
    base, axis = BASES[cases[0]["substrate"]["kind"]], None
    if isinstance(base, gc.HalfSpace):
        moduli = [[complex_of(case["substrate"][name]) for case in cases] for name in ("E", "nu")]
        base, axis = tuple(map(np.array, moduli)), 0
    of_all = jax.vmap(matrix_of, (0, 0, 1, 1, 1, axis))
    return jax.jit(lambda *given: of_all(*given, base))(
        *np.array([[float(x) for x in case["q"]] for case in cases]).T,
        table(lambda x: float(x["d"])),
        table(lambda x: complex_of(x["E"])),
        table(lambda x: complex_of(x["nu"])),
    )


@pytest.mark.parametrize("base", BASES)
def test_stored_cases_are_met_in_every_entry(base):
    """mpmath at 50 digits. Each entry is met relative to itself, but for C_xy, a difference."""
    cases = [case for case in CASES if case["substrate"]["kind"] == base]
    values = np.asarray(evaluate(cases))
    errors = {}
    for case, value in zip(cases, values, strict=True):
        expected = [[mpc(*map(mpf, x)) for x in row] for row in case["C"]]
        for i, j in np.ndindex(3, 3):
            exact = expected[i][j] * int(MIRROR[i, i] * MIRROR[j, j])
            error = abs(mpc(complex(value[i, j])) - exact)
            scale = abs(expected[0][0] if {i, j} == {0, 1} else exact)
            errors[case["id"], i, j] = float(error / scale) if scale else float(error)
    worst = max(errors, key=errors.get)
    assert errors[worst] <= 1e-13, (worst, errors[worst])
    assert len(cases) >= 8


def along_less_across(q, thickness, modulus, poisson, base):
    """c11 - c_T by matrix exponentials of the Navier equations with 120 digits."""
    mp.mp.dps = 120
    plane, across = mp.eye(4), mp.eye(2)
    for d, e, nu in reversed(list(zip(thickness, modulus, poisson, strict=True))):
        x, e, nu = mp.mpf(q) * mp.mpf(d), mp.mpmathify(complex(e)), mp.mpf(nu)
        p, shear = 1 - nu, e / (2 * (1 + nu))
        soft = (1 - 2 * nu) / (2 * p * p)
        rates = [[0, -nu / p, 2, 0], [1, 0, 0, 0], [1 / p, 0, 0, -1], [0, soft, nu / p, 0]]
        rates = mp.matrix(rates)
        unit = mp.diag([shear * q / p, shear * q / p, 1, 1])
        plane = unit * mp.expm(rates * x) * unit**-1 * plane
        c, s, k = mp.cosh(x), mp.sinh(x), shear * q
        across = mp.matrix([[c, k * s], [s / k, c]]) * across
    i = 0 if base == "rigid" else 2
    compliance = plane[2:4, i : i + 2] * plane[0:2, i : i + 2] ** -1
    return compliance[0, 0] - across[1, i // 2] / across[0, i // 2]


def test_c_xy_of_stacked_free_incompressible_sheets_is_right_to_the_rounding_of_c_xx():
    q, nu = np.array([1e-8, 1e-6, 1e-4, 0.01, 1.0]), np.full(2, 0.5)
    thickness, modulus = np.array([0.3, 0.7]), np.full(2, 3e6)
    found = matrix_of(0.6 * q, 0.8 * q, thickness, modulus, nu, gc.Free())
    for x, value in zip(q, np.asarray(found), strict=True):
        exact = mpf("0.48") * along_less_across(x, thickness, modulus, nu, "free")
        assert abs(mpc(complex(value[0, 1])) - exact) <= 1e-15 * abs(value[0, 0]), x


def test_half_space_is_that_of_boussinesq_and_cerruti():
    """Fourier transforms of the fields of point forces, K. L. Johnson, Contact Mechanics (1985).

    A force P into the solid draws the surface towards itself by (1-2ν)(1+ν) P/(2πE r), and
    x/r² transforms to -2πi q_x/q².
    """
    e, nu, qx, qy = 3e6 + 1e6j, 0.4 + 0.01j, 3e3, -4e3
    q = 5e3
    value = matrix_of(qx, qy, [], [], [], (e, nu))
    shear = 2 * (1 + nu) / (e * q)
    towards = 1j * (1 - 2 * nu) * (1 + nu) / (e * q**2)
    expected = [
        [shear * (1 - nu * qx**2 / q**2), -shear * nu * qx * qy / q**2, towards * qx],
        [-shear * nu * qx * qy / q**2, shear * (1 - nu * qy**2 / q**2), towards * qy],
        [-towards * qx, -towards * qy, 2 * (1 - nu**2) / (e * q)],
    ]
    np.testing.assert_allclose(value, expected, rtol=2e-15)


def waves(num=200, seed=0):
    """Wavevectors over seven decades in all directions, and frequencies over six."""
    random = np.random.default_rng(seed)
    q, angle = 10 ** random.uniform(0, 7, num), random.uniform(0, 2 * np.pi, num)
    return q * np.cos(angle), q * np.sin(angle), 10 ** random.uniform(-1, 5, num)


def test_matrix_is_reciprocal_passive_hermitian_and_turns_with_the_wavevector():
    stack = stack_on("halfspace")
    qx, qy, omega = waves()
    forward = np.asarray(surface_compliance_matrix(stack, qx, qy, omega))
    size = np.max(np.abs(forward), axis=(1, 2), keepdims=True)

    backward = surface_compliance_matrix(stack, -qx, -qy, omega)
    np.testing.assert_allclose(np.swapaxes(forward, 1, 2) / size, backward / size, atol=1e-15)

    # Real fields: C(-q, -ω) = conj C(q, ω).
    conjugate = surface_compliance_matrix(stack, -qx, -qy, -omega)
    np.testing.assert_allclose(np.conj(forward) / size, conjugate / size, atol=1e-15)

    # The work done in a period, -π Im(Tᴴ C T), is not negative for any traction T.
    lossy = (forward - np.conj(np.swapaxes(forward, 1, 2))) / 2j / size
    assert np.max(np.linalg.eigvalsh(lossy)) <= 1e-15
    assert np.min(np.linalg.eigvalsh(lossy)) < -1e-3

    normal = gc.surface_compliance(stack, np.hypot(qx, qy), omega)
    np.testing.assert_allclose(forward[:, 2, 2], normal, rtol=2e-14)

    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    turned = surface_compliance_matrix(stack, 0.6 * qx - 0.8 * qy, 0.8 * qx + 0.6 * qy, omega)
    np.testing.assert_allclose((turn @ forward @ turn.T) / size, turned / size, atol=3e-13)


def test_shapes_broadcast_and_elastic_stacks_give_a_complex_matrix_too():
    stack = gc.Stack(base=gc.HalfSpace(gc.Elastic(1e6)))
    value = surface_compliance_matrix(stack, np.ones((4, 1)), 2.0, np.zeros(3))
    assert value.shape == (4, 3, 3, 3)
    assert value.dtype == complex
    assert surface_compliance_matrix(stack, 1.0, 0.0, 0.0).shape == (3, 3)
