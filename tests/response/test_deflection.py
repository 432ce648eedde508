"""Deflection under circular loads, by Hankel transforms of M_zz, against programs for pavements.

A pressure p on a circle of radius a has the transform p a J1(qa)/q, so that the surface sinks by
w(r) = p a ∫ M_zz(q) J1(qa) J0(qr) dq. Lengths, loads and moduli are in the units of each source.

Sources: PyMastic, github.com/Mostafa-Nakhaei/PyMastic, run with 30 iterations, and the KENPAVE
results in its `Validation/Kenpave.csv`; the results of E. Levenberg's ELLEA1 and ELLVA in
`validation/` of ALVA, github.com/asmusskar/ALVA. All layers are bonded.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.special import ellipe, ellipk, j0, j1, jn_zeros
from stored import layered

import graded_contact as gc

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


def quadrature(ends):
    """Nodes and weights of Gauss's rule in every interval, shape `(intervals, nodes)`."""
    half = np.diff(ends)[:, None] / 2
    return ends[:-1, None] + half * (1 + NODES), half * WEIGHTS


def on_axis(function, pressure, radius):
    """p a ∫ f(q) J1(qa) dq, f along the last two axes.

    The integrals between zeros of J1 alternate in sign and decay slowly; repeated averages of
    their partial sums converge fast (Euler's transformation). Below the first zero the intervals
    shrink towards q = 0, where a stiff layer makes f vary.
    """
    zeros = jn_zeros(1, 50)
    ends = np.concatenate([[0], zeros[0] * 0.5 ** np.arange(8, 0, -1), zeros]) / radius
    q, weights = quadrature(ends)
    parts = pressure * radius * np.sum(weights * np.asarray(function(q)) * j1(q * radius), -1)
    sums = np.cumsum(parts, axis=-1)[..., 20:]
    while sums.shape[-1] > 1:
        sums = (sums[..., 1:] + sums[..., :-1]) / 2
    return sums[..., 0]


def compliance_of(thickness, modulus, poisson):
    """M_zz(q) of layers on a half space, which is the last entry of both moduli."""
    d, e, nu = (np.asarray(values, float) for values in (thickness, modulus, poisson))
    return lambda q: np.asarray(layered(q, d, e[:-1], nu[:-1], (e[-1], nu[-1])))


def half_space_deflection(r, pressure, radius, reduced_modulus):
    """K. L. Johnson, Contact Mechanics (1985), doi:10.1017/CBO9781139171731."""
    scale = 4 * pressure / (np.pi * reduced_modulus)
    if r <= radius:
        return scale * radius * ellipe((r / radius) ** 2)
    k = (radius / r) ** 2
    return scale * r * (ellipe(k) - (1 - k) * ellipk(k))


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
def test_a_half_space_sinks_under_the_centre_by_the_exact_amount(poisson):
    pressure, radius, modulus = 2e5, 0.15, 3e6
    value = on_axis(compliance_of([], [modulus], [poisson]), pressure, radius)
    exact = 2 * (1 - poisson**2) * pressure * radius / modulus
    np.testing.assert_allclose(value, exact, rtol=1e-13)


# (p [psi], a [in]), thicknesses [in], E [ksi], ν, w(0) [in] by mpmath, w(0) [in] by PyMastic.
PAVEMENTS = [
    ((100, 5.99), [10, 6], [500, 40, 10], [0.35, 0.4, 0.45], 0.01693533295, 0.0169258),
    ((80, 6), [6, 4], [290, 2900, 1450], [0.35, 0.35, 0.2], 0.001496706058, 0.00149935),
    ((80, 6), [6, 4, 8], [290, 2900, 1450, 725], [0.35, 0.35, 0.2, 0.45],
     0.001615185877, 0.00161784),
]  # fmt: skip


@pytest.mark.parametrize("load, thickness, modulus, poisson, exact, pymastic", PAVEMENTS)
def test_pavements_sink_as_in_pymastic(load, thickness, modulus, poisson, exact, pymastic):
    """PyMastic's matrices overflow from 40 iterations on; at 30 it is good to 0.2 %.

    The mpmath values integrate a compliance from 60-digit transfer matrices.
    """
    value = on_axis(compliance_of(thickness, 1e3 * np.array(modulus), poisson), *load)
    np.testing.assert_allclose(value, pymastic, rtol=3e-3)
    np.testing.assert_allclose(value, exact, rtol=5e-10)


# Depth [in], displacement [in], vertical and radial stress [psi], positive in compression. The
# row of depth 0 is left out: its strains contradict its stresses.
KENPAVE = np.array([
    [1, 0.02247, 95.838, 156.984], [2, 0.02246, 84.247, 88.377], [4, 0.02227, 48.805, -33.924],
    [6, 0.02186, 24.051, -166.448], [7, 0.0213, 20.789, -0.699], [10, 0.01991, 13.195, -3.682],
    [13, 0.0188, 8.273, -6.991], [16, 0.01774, 5.722, -11.87], [17, 0.01722, 5.354, 0.372],
    [20, 0.01585, 4.456, 0.295], [29, 0.01283, 2.844, 0.156],
])  # fmt: skip


def test_stress_and_displacement_under_the_axis_match_kenpave():
    depth, *expected = KENPAVE.T
    layers = [(500e3, 0.35, 6.0), (40e3, 0.4, 10.0)]  # E [psi], ν, thickness [in]
    stack = gc.Stack(
        layers=tuple(gc.Layer(gc.Elastic(e, nu), d) for e, nu, d in layers),
        base=gc.HalfSpace(gc.Elastic(10e3, 0.45)),
    )

    def fields(q):
        load = jnp.array([0.0, 0.0, 1.0])
        u, stress = gc.response.interior_fields(
            stack, q, 0.0, 0.0, load, depth[:, None, None], side="above"
        )
        # On the axis every direction is radial: the mean of those along and across q.
        radial = (stress[..., 0, 0] + stress[..., 1, 1]) / 2
        return np.stack([u[..., 2].real, -stress[..., 2, 2].real, -radial.real])

    found = on_axis(fields, 100, 5.99)
    for values, source, tolerance in zip(found, expected, [6e-6, 0.02, 0.02], strict=True):
        np.testing.assert_allclose(values, source, rtol=0, atol=tolerance)


# Three layers [mm, MPa]; load 1.1 MPa on a circle of radius 150 mm.
THICKNESS, MODULUS, POISSON = [150, 600], [3000, 200, 40], [0.3, 0.35, 0.4]
PRESSURE, RADIUS = 1.1, 150.0
# Distance from a pair of wheels, 300 mm apart [mm], and displacement there [mm].
ELLEA = np.array([
    [0, 1.9174], [50, 1.8929], [100, 1.8416], [150, 1.7772], [200, 1.7063], [300, 1.5614],
    [400, 1.4272], [500, 1.3101], [750, 1.0843], [1000, 0.9232], [1500, 0.6995], [2000, 0.5484],
    [3000, 0.3657],
])  # fmt: skip


def test_the_basin_of_two_wheels_matches_ellea():
    """The top layer as a half space has a closed form; the rest decays as exp(-2 q 150 mm)."""
    distance, expected = ELLEA.T
    r = np.hypot(distance, 150)
    steps = np.concatenate([[0], np.geomspace(1e-6, 1e-3, 10), np.linspace(1e-3, 0.15, 150)[1:]])
    q, weights = quadrature(steps)
    top = MODULUS[0] / (1 - POISSON[0] ** 2)
    rest = compliance_of(THICKNESS, MODULUS, POISSON)(q) - 2 / (top * q)
    waves = PRESSURE * RADIUS * weights * j1(q * RADIUS) * rest
    alone = np.array([half_space_deflection(s, PRESSURE, RADIUS, top) for s in r])
    value = 2 * (alone + np.array([np.sum(waves * j0(q * s)) for s in r]))
    np.testing.assert_allclose(value, expected, rtol=0, atol=1e-4)  # four decimals


# Distance of the load past the point [mm], displacement [mm] 300 mm aside of its path.
ELLVA = np.array([
    [-1000, 0.447], [-750, 0.518], [-500, 0.605], [-300, 0.687], [-200, 0.728], [-100, 0.763],
    [-50, 0.777], [0, 0.786], [50, 0.791], [100, 0.790], [200, 0.774], [300, 0.742], [500, 0.658],
    [750, 0.556], [1000, 0.474],
])  # fmt: skip


def asphalt():
    """Creep D(t) = D∞ + (D0 - D∞)/(1 + (t/τ)^n) as a series of retardation times, to 1e-4."""
    glassy, rubbery, time, exponent = 2.5e-5, 1e-2, 1e3, 0.35  # [1/MPa], [1/MPa], [s], [1]
    t, times = np.geomspace(1e-9, 1e3, 300), np.geomspace(1e-11, 1e6, 36)
    creep = rubbery + (glassy - rubbery) / (1 + (t / time) ** exponent)
    series = -np.expm1(-t[:, None] / times) / creep[:, None]
    strengths, _ = nnls(series, 1 - glassy / creep)
    np.testing.assert_allclose(series @ strengths + glassy / creep, 1, atol=1e-4)
    used = strengths > 0
    return gc.Prony.from_creep(1 / glassy, strengths[used], times[used], POISSON[0])


def test_the_basin_of_a_moving_wheel_lags_as_in_ellva():
    """60 km/h over viscoelastic asphalt: w(x, y) = p a/(2π) ∫∫ M(q, -q·v) J1(qa) e^{iq·x} dq dφ.

    ELLVA puts 1/D(t) for the relaxation modulus (quasi-elastic), which costs up to 2 % of the
    peak. With the wrong sign of ω the basin, mirrored, would be 6 % off.
    """
    past, expected = ELLVA.T
    layers = (gc.Layer(asphalt(), 150.0), gc.Layer(gc.Elastic(200.0, 0.35), 600.0))
    stack = gc.Stack(layers=layers, base=gc.HalfSpace(gc.Elastic(40.0, 0.4)))
    steps = np.concatenate([[0], np.geomspace(1e-6, 1e-3, 6), np.linspace(1e-3, 0.1, 40)[1:]])
    q, weights = (part.ravel()[:, None] for part in quadrature(steps))
    angle, angle_weights = (part.ravel() for part in quadrature(np.linspace(0, np.pi, 5)))
    qx, qy = q * np.cos(angle), q * np.sin(angle)
    velocity = 60 / 3.6 * 1e3  # [mm/s]
    response = np.asarray(gc.surface_compliance(stack, q, -qx * velocity))
    waves = PRESSURE * RADIUS / np.pi * j1(q * RADIUS) * weights * angle_weights * response
    waves = waves * np.cos(qy * 300)  # both signs of q_y
    value = np.array([np.sum((waves * np.exp(-1j * qx * x)).real) for x in past])
    np.testing.assert_allclose(value, expected, rtol=0, atol=0.02 * expected.max())
    assert past[np.argmax(value)] == past[np.argmax(expected)] == 50
    np.testing.assert_array_less(value[past < -50], value[past > 50][::-1])
