"""Bonds that give: a transfer matrix in many digits, limits, a published pavement, refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from scipy.special import j0, j1

import graded_contact as gc
from graded_contact.blocks import Blend, Bond, Film, interface_depths
from graded_contact.response import (
    Layering,
    Riccati,
    graded_compliance,
    interior_fields,
    sliced,
    surface_compliance,
    surface_compliance_matrix,
)

inf = np.inf
RUBBER = gc.Prony(1e6, [2e7], [1e-4], poisson=0.49)
BASES = {
    "free": gc.Free(), "rigid": gc.Rigid(), "half space": gc.HalfSpace(gc.Elastic(3e6, 0.3)),
}  # fmt: skip
BONDS = [(inf, 0), (1e9, 0), (1e10, 2e9), (1e2, 1e-3), (1e20, 1e21), (inf, 1e9), (1e9, inf)]


def two_layers(base, bond, lowest=None):
    layers = (gc.Layer(gc.Elastic(1e8, 0.3), 1e-4, bond), gc.Layer(gc.Elastic(2e6), 2e-4, lowest))
    return gc.Stack(layers=layers, base=BASES[base])


def transferred(q, layers, base):
    """In-plane and antiplane compliance by matrix exponentials upwards, springs between them.

    `layers` are (d, E, ν, (k_n, k_s)), surface first, and the base (E, ν) or its name. The columns
    of the state are two independent fields (t, s, U, w) and one (T, V), z upwards.
    """
    with mp.workdps(80):
        q = mp.mpf(q)
        if isinstance(base, str):
            below = [[1, 0], [0, 1], [0, 0], [0, 0]]
            state = mp.matrix(below if base == "rigid" else below[2:] + below[:2])
            across = mp.matrix([1, 0] if base == "rigid" else [0, 1])
        else:
            modulus, nu = base
            unit, g = 2 * (1 - nu**2) / (modulus * q), (1 - 2 * nu) / (2 - 2 * nu)
            state = mp.matrix([[1, 0], [0, 1], [unit, -unit * g], [-unit * g, unit]])
            across = mp.matrix([1, 2 * (1 + nu) / (modulus * q)])
        for d, modulus, nu, (normal, shear) in reversed(layers):
            if shear == 0:  # the mixture of both fields without shear, and a slip
                a, b = state[0, 0], state[0, 1]
                free = state[:, 0] * b - state[:, 1] * a if a or b else state[:, 0]
                state = mp.matrix([[0, 0], [0, free[1]], [1, free[2]], [0, free[3]]])
                across = mp.matrix([0, 1])
            elif shear != inf:
                state[2, :] += state[0, :] / shear
                across[1] += across[0] / shear
            if normal != inf:
                state[3, :] += state[1, :] / normal
            p, half = 1 - nu, modulus / (1 - nu**2) * q / 2
            rates = [
                [0, -nu / p, 2 * half, 0],
                [1, 0, 0, 0],
                [1 / (p * half), 0, 0, -1],
                [0, (1 - 2 * nu) / (2 * p * p * half), nu / p, 0],
            ]
            state = mp.expm(mp.matrix(rates) * (q * d)) * state
            mu = modulus / (2 * (1 + nu)) * q
            across = mp.expm(mp.matrix([[0, mu], [1 / mu, 0]]) * (q * d)) * across
        plane = state[2:, :] * state[:2, :] ** -1
        return plane, across[1] / across[0]


def numbers_of(stack):
    parts = [(layer.thickness, layer.material, layer.bond) for layer in stack.layers]
    exact = lambda value: mp.mpf(float(value))  # noqa: E731
    elastic = lambda part: (exact(part.young), exact(part.poisson))  # noqa: E731
    layers = [
        (exact(d), *elastic(part), (exact(b.normal), exact(b.shear)) if b else (inf, inf))
        for d, part, b in parts
    ]
    base = stack.base
    name = type(base).__name__.lower()
    return layers, elastic(base.material) if name == "halfspace" else name


@pytest.mark.parametrize("base", BASES)
def test_springs_between_layers_have_the_compliance_of_a_transfer_matrix(base):
    """M_zz and 3×3, soft, stiff, smooth, of thin and thick waves: to rounding."""
    q = np.array([1e-2, 1e2, 1e4, 1e5])
    for bond in BONDS:
        stack = two_layers(base, Bond(*bond), None if base == "free" else Bond(*bond))
        found = np.asarray(surface_compliance(stack, q, 0.0))
        matrix = np.asarray(surface_compliance_matrix(stack, q, 0.0, 0.0))
        layers, name = numbers_of(stack)
        for i, wave in enumerate(q):
            plane, across = transferred(wave, layers, name)
            plane, across = np.array(plane.tolist(), float), float(across)
            np.testing.assert_allclose(found[i], plane[1, 1], rtol=2e-14)
            np.testing.assert_allclose(matrix[i, 2, 2], plane[1, 1], rtol=2e-14)
            np.testing.assert_allclose(matrix[i, 0, 0], plane[0, 0], rtol=2e-14)
            np.testing.assert_allclose(matrix[i, 1, 1], across, rtol=2e-14)
            size = np.sqrt(plane[0, 0] * plane[1, 1])
            np.testing.assert_allclose(matrix[i, 2, 0].imag, plane[0, 1], atol=2e-14 * size)
    # C_xy is a difference of which no digit would be left: c11 - c_T of the last bond, at 45°.
    q45 = q[1] / np.sqrt(2)
    xy = np.asarray(surface_compliance_matrix(stack, q45, q45, 0.0))[0, 1].real
    with mp.workdps(80):
        plane, across = transferred(q[1], layers, name)
        np.testing.assert_allclose(xy, float((plane[0, 0] - across) / 2), rtol=1e-11)


def test_a_perfect_bond_is_none_in_every_response():
    found = []
    for bond in (None, Bond(), Film(gc.Elastic(1e6, 0.3), 0.0)):
        stack = two_layers("half space", bond)
        fields = interior_fields(stack, 1e4, 2e3, 0.0, [0, 1, 1], interface_depths(stack)[:1])
        found.append([*jax.tree.leaves(fields), surface_compliance(stack, 1e4, 0.0)])
    for other in found[1:]:
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-13), found[0], other)


def test_a_film_has_the_springs_of_its_material_and_is_the_limit_of_a_thin_soft_layer():
    glue = gc.Prony(1e4, [1e6], [1e-3], poisson=0.3)
    q, omega = np.array([1e2, 1e3, 1e4]), 700.0
    modulus = complex(glue.modulus(omega))
    for d in (1e-6, 1e-7):
        soft = gc.Layer(glue, d)
        layers = (gc.Layer(RUBBER, 1e-4), soft)
        exact = surface_compliance(gc.Stack(layers=layers, base=BASES["rigid"]), q, omega)
        stack = gc.Stack(layers=(gc.Layer(RUBBER, 1e-4, Film(glue, d)),), base=gc.Rigid())
        found = surface_compliance(stack, q, omega)
        np.testing.assert_allclose(found, exact, rtol=3 * d * q[-1])
        assert np.all(np.asarray(found).imag < 0)
    gives = Film(glue, d).gives(jnp.asarray(omega))
    np.testing.assert_allclose(
        gives.normal_firmness / gives.normal_give, modulus * 0.7 / (1.3 * 0.4 * d)
    )
    np.testing.assert_allclose(gives.shear_firmness / gives.shear_give, modulus / (2.6 * d))


def test_an_incompressible_film_is_stiff_along_the_normal_alone():
    film, springs = Film(gc.Elastic(3e5, 0.5), 1e-5), Bond(inf, 1e10)
    found = [surface_compliance(two_layers("rigid", bond), 1e4, 0.0) for bond in (film, springs)]
    np.testing.assert_allclose(*found, rtol=1e-14)


@pytest.mark.parametrize("graded", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_displacement_jumps_at_a_bond_and_traction_does_not(graded):
    """Jump = traction over stiffness; on the surface the fields are those of the 3×3 matrix."""
    normal, shear = 3e10, 2e9
    stack = two_layers("half space", Bond(normal, shear), Bond(normal, 0))
    if graded:
        profile = Blend(gc.Elastic(2e6, 0.4), gc.Elastic(1e8, 0.3))
        layers = (gc.GradedLayer(profile, 1e-4, stack.layers[0].bond), stack.layers[1])
        stack = dataclasses.replace(stack, layers=layers)
    traction = np.array([0.3, -0.5, 1.0])
    depths = np.array([0, *interface_depths(stack)])
    above, below = (
        interior_fields(stack, 8e3, 3e3, 0.0, traction, depths, side=side)
        for side in ("above", "below")
    )
    rtol = dict(rtol=1e-8 if graded else 1e-12)
    # In fields with z into the solid, σ_iz acts from the lower part on the upper one.
    np.testing.assert_allclose(above.stress[:, :, 2], below.stress[:, :, 2], atol=rtol["rtol"])
    jump = np.asarray(below.displacement - above.displacement)
    stress = np.asarray(above.stress[:, :, 2])
    np.testing.assert_allclose(jump[0], 0, atol=1e-20)
    np.testing.assert_allclose(jump[1, :2] * shear, stress[1, :2], **rtol)
    np.testing.assert_allclose(jump[1:, 2] * normal, stress[1:, 2], **rtol)
    assert np.all(stress[2, :2] == 0)  # smooth: nothing, not a little
    surface = np.asarray(surface_compliance_matrix(stack, 8e3, 3e3, 0.0)) @ traction
    np.testing.assert_allclose(np.asarray(above.displacement)[0], surface, **rtol)


def test_at_the_bottom_of_a_rigid_base_the_depth_lies_above_the_bond():
    stack = two_layers("rigid", None, Bond(1e9, 0))
    bottom = interface_depths(stack)[-1:]
    fields = interior_fields(stack, 1e4, 0.0, 0.0, [0, 0, 1], bottom)
    np.testing.assert_allclose(fields.displacement[0, 2] * -1e9, fields.stress[0, 2, 2], rtol=1e-12)
    assert abs(fields.displacement[0, 0]) > 1e-13 and fields.stress[0, 0, 2] == 0


@pytest.mark.parametrize("bond", [(inf, 0), (1e10, 1e8), (1e4, 1e-2)])
def test_stacks_with_bonds_are_passive_and_reciprocal(bond):
    film = Film(gc.Prony(1e3, [1e6], [1e-2], poisson=0.45), 1e-6)
    layers = (gc.Layer(RUBBER, 1e-4, Bond(*bond)), gc.Layer(gc.Elastic(1e8, 0.2), 5e-5, film))
    stack = gc.Stack(layers=layers, base=gc.HalfSpace(RUBBER))
    q = np.geomspace(1e-2, 1e8, 11)
    for omega in (1e-3, 1e3, 1e6):
        here, there = (
            np.asarray(surface_compliance_matrix(stack, s * q, s * 2 * q, omega)) for s in (1, -1)
        )
        size = np.abs(here).max(axis=(1, 2))[:, None, None]
        assert np.all(np.abs(here - there.transpose(0, 2, 1)) < 1e-13 * size)
        losses = (here - here.conj().transpose(0, 2, 1)) / 2j
        assert np.all(np.linalg.eigvalsh(losses / size) < 1e-13)


@pytest.mark.parametrize(
    "bond, solver",
    [
        (Bond(1e10, 1e9), None),
        (Bond(shear=0), None),
        pytest.param(Bond(1e10, 1e9), Riccati(), marks=pytest.mark.slow),
        pytest.param(Bond(1.0, 1e-3), Riccati(), marks=pytest.mark.slow),
        pytest.param(Bond(shear=0), Riccati(), marks=pytest.mark.slow),
    ],
)
def test_graded_layers_with_bonds_agree_with_slices(bond, solver):
    profile = Blend(gc.Elastic(2e6, 0.4), RUBBER)
    layers = (gc.GradedLayer(profile, 1e-4, bond), gc.Layer(gc.Elastic(1e7, 0.3), 1e-4, bond))
    stack = gc.Stack(layers=layers, base=gc.HalfSpace(RUBBER), graded_solver=solver)
    q, omega = np.array([1e2, 1e4, 3e5]), 2e3
    found = graded_compliance(stack, q, omega)
    coarse, fine = (np.asarray(surface_compliance(sliced(stack, n), q, omega)) for n in (40, 80))
    np.testing.assert_allclose(found.value, (4 * fine - coarse) / 3, rtol=1e-4)


def test_riccati_refuses_a_smooth_interface_on_a_rigid_base_by_name():
    profile = Blend(gc.Elastic(2e6), gc.Elastic(1e8))
    layers = (gc.GradedLayer(profile, 1e-4, Bond(shear=0)),)
    with pytest.raises(ValueError, match=r"layers\[0\].bond.*shear=0.*Riccati.*Layering"):
        gc.Stack(layers=layers, base=gc.Rigid(), graded_solver=Riccati())
    gc.Stack(layers=layers, base=gc.Rigid(), graded_solver=Layering())
    gc.Stack(layers=layers, base=BASES["half space"], graded_solver=Riccati())
    springs = (gc.GradedLayer(profile, 1e-4, Bond(1e9, 0)),)
    gc.Stack(layers=springs, base=gc.Rigid(), graded_solver=Riccati())


def test_traced_stiffnesses_that_are_refused_give_no_number():
    value = jax.jit(lambda k: surface_compliance(two_layers("rigid", Bond(*k)), 1e4, 0.0))
    assert np.isfinite(value(jnp.array([1e9, 0.0])))
    assert np.isnan(value(jnp.array([0.0, 1.0]))) and np.isnan(value(jnp.array([1.0, -1.0])))


# BISAR, KENLAYER and GAMES in the benchmark of the Belgian Road Research Centre (AMADEUS, final
# report, 2000), as `ALVA_bonding_validation1.m` of ALVA (A. Skar et al.,
# doi:10.11583/DTU.12387305) lists them: below the centre of the load and below its edge the
# horizontal strain at the bottom of layer 1 and the vertical strains at the top of layers 2 and 3
# [1e-6], positive in compression. GAMES does not have a frictionless first interface.
BONDED = [(-100.5, 251.7, 185.0, -61.9, 192.2, 177.5), (-100.5, 251.6, 185.3, -62, 192.2, 177.0),
          (-100.5, 251.6, 185.1, -61.9, 192.2, 177.5)]  # fmt: skip
SLIPPING = [(-120, 1, 217, -78, -10, 205), (-120, 1, 216, -78, -10, 205)]


@pytest.mark.parametrize(
    ("bond", "published", "digit"), [(None, BONDED, 0.1), (Bond(shear=0), SLIPPING, 1)]
)
def test_a_pavement_has_the_strains_of_three_programs(bond, published, digit):
    """0.7 MPa on a circle of 150.8 mm, by Hankel integrals over `interior_fields`."""
    radius, pressure = 0.1508, 0.7e6
    solids = [(5e9, 0.35), (2e8, 0.40), (5e7, 0.45)]
    top, middle, soil = (gc.Elastic(*solid) for solid in solids)
    layers = (gc.Layer(top, 0.26, bond), gc.Layer(middle, 0.5))
    stack = gc.Stack(layers=layers, base=gc.HalfSpace(soil))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    edges = np.linspace(0, 40 / radius, 61)
    half = np.diff(edges)[:, None] / 2
    q, weights = (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()
    x = q * radius
    first, second = interface_depths(stack)

    def strains(depth, side, modulus, poisson):
        """Horizontal and vertical strain of each wave of unit pressure."""
        found = interior_fields(stack, q, 0.0, 0.0, [0, 0, 1], depth, side=side)
        stress = np.asarray(found.stress)
        lateral = (stress[:, 0, 0] + stress[:, 1, 1]).real
        along = (1j * q * np.asarray(found.displacement)[:, 0]).real
        return along, (stress[:, 2, 2].real - poisson * lateral) / modulus

    along, _ = strains(first, "above", *solids[0])
    verticals = [strains(first, "below", *solids[1])[1], strains(second, "below", *solids[2])[1]]
    integral = lambda f: -1e6 * pressure * radius * np.sum(weights * j1(x) * f)  # noqa: E731
    centre = [integral(along / 2), *map(integral, verticals)]
    edge = [integral(along * (j0(x) - j1(x) / x)), *(integral(v * j0(x)) for v in verticals)]
    low, high, found = np.min(published, axis=0), np.max(published, axis=0), [*centre, *edge]
    assert np.all(low - digit / 2 < found) and np.all(found < high + digit / 2)
