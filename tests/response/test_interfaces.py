"""Interfaces as thin layers: a transfer matrix in many digits, and a published pavement."""

import mpmath as mp
import numpy as np
import pytest
from scipy.special import j0, j1

import graded_contact as gc
from graded_contact.blocks import interface_depths, smooth_layer, spring_layer
from graded_contact.response import interior_fields, surface_compliance, surface_compliance_matrix

inf = np.inf
BASES = {"free": gc.Free(), "rigid": gc.Rigid(), "half space": gc.HalfSpace(gc.Elastic(3e6, 0.3))}
SPRINGS = [(inf, 0), (1e10, 2e9), (1e2, 1e-3), (2e14, 1e14), (inf, 1e9)]


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


@pytest.mark.parametrize("springs", SPRINGS)
@pytest.mark.parametrize("base", BASES)
def test_thin_layers_have_the_compliance_of_springs(base, springs):
    """In plane and across, of thin and thick waves; the smooth one has no shear stiffness."""
    between = smooth_layer() if springs[1] == 0 else spring_layer(*springs)
    solids = [(1e-4, 1e8, 0.3), (2e-4, 2e6, 0.45)]
    top, bottom = (gc.Layer(gc.Elastic(*solid), d) for d, *solid in solids)
    lowest = () if base == "free" else (between,)
    stack = gc.Stack(layers=(top, between, bottom, *lowest), base=BASES[base])
    q = np.array([1e2, 1e4, 1e5])
    matrix = np.asarray(surface_compliance_matrix(stack, q, 0.0, 0.0))
    np.testing.assert_allclose(surface_compliance(stack, q, 0.0), matrix[:, 2, 2].real, rtol=1e-13)
    layers = [(*solids[0], springs), (*solids[1], springs if lowest else (inf, inf))]
    for i, wave in enumerate(q):
        plane, across = transferred(wave, layers, (3e6, 0.3) if base == "half space" else base)
        plane = np.array(plane.tolist(), float)
        np.testing.assert_allclose(matrix[i, 2, 2], plane[1, 1], rtol=1e-6)
        np.testing.assert_allclose(matrix[i, 0, 0], plane[0, 0], rtol=1e-6)
        np.testing.assert_allclose(matrix[i, 1, 1], float(across), rtol=1e-6)
        size = np.sqrt(plane[0, 0] * plane[1, 1])
        np.testing.assert_allclose(matrix[i, 2, 0].imag, plane[0, 1], atol=1e-6 * size)


def test_springs_that_no_solid_has_are_refused():
    with pytest.raises(ValueError, match="normal"):
        spring_layer(1e9, 1e9)


# BISAR, KENLAYER and GAMES in the benchmark of the Belgian Road Research Centre (AMADEUS, final
# report, 2000), as `ALVA_bonding_validation1.m` of ALVA (A. Skar et al.,
# doi:10.11583/DTU.12387305) lists them: below the centre of the load and below its edge the
# horizontal strain at the bottom of layer 1 and the vertical strains at the top of layers 2 and 3
# [1e-6], positive in compression. GAMES does not have a frictionless first interface.
SLIPPING = [(-120, 1, 217, -78, -10, 205), (-120, 1, 216, -78, -10, 205)]


def test_a_pavement_that_slips_has_the_strains_of_two_programs():
    """0.7 MPa on a circle of 150.8 mm, by Hankel integrals over `interior_fields`."""
    radius, pressure = 0.1508, 0.7e6
    solids = [(5e9, 0.35), (2e8, 0.40), (5e7, 0.45)]
    top, middle, soil = (gc.Elastic(*solid) for solid in solids)
    layers = (gc.Layer(top, 0.26), smooth_layer(), gc.Layer(middle, 0.5))
    stack = gc.Stack(layers=layers, base=gc.HalfSpace(soil))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    edges = np.linspace(0, 40 / radius, 61)
    half = np.diff(edges)[:, None] / 2
    q, weights = (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()
    x = q * radius
    first, *_, second = interface_depths(stack)

    def strains(depth, side, modulus, poisson):
        """Horizontal and vertical strain of each wave of unit pressure."""
        found = interior_fields(stack, q, 0.0, 0.0, [0, 0, 1], depth, side=side)
        stress = np.asarray(found.stress)
        lateral = (stress[:, 0, 0] + stress[:, 1, 1]).real
        along = (1j * q * np.asarray(found.displacement)[:, 0]).real
        return along, (stress[:, 2, 2].real - poisson * lateral) / modulus

    along, _ = strains(first, "above", *solids[0])
    verticals = [
        strains(first, "below", *solids[1])[1],
        strains(second, "below", *solids[2])[1],
    ]
    integral = lambda f: -1e6 * pressure * radius * np.sum(weights * j1(x) * f)  # noqa: E731
    centre = [integral(along / 2), *map(integral, verticals)]
    edge = [integral(along * (j0(x) - j1(x) / x)), *(integral(v * j0(x)) for v in verticals)]
    low, high, found = np.min(SLIPPING, axis=0), np.max(SLIPPING, axis=0), [*centre, *edge]
    assert np.all(low - 0.5 < found) and np.all(found < high + 0.5)
