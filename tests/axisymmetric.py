"""A paraboloid on layers, and adhesive: axisymmetric oracles without code of the package.

Under a load J0(qr) each layer has Love's function Z(z) J0(qr) with four constants; one linear
system for all interfaces gives them (A. E. H. Love, A Treatise on the Mathematical Theory of
Elasticity, 1927). With M = 2(1 + g)/(E_r q), E_r of the top layer, and the Hankel transform
E_r/2 ∫ φ(t) cos(qt) dt of the pressure in a contact of radius a (after I. N. Sneddon, Mixed
Boundary Value Problems in Potential Theory, 1966),

    φ(t) + (2/π) ∫_0^a φ(s) ∫_0^∞ g(q) cos(qt) cos(qs) dq ds = (2/π)(δ - t²/R),    φ(a) = 0.

The load is π E_r ∫ φ dt, the pressure -(E_r/2) ∫_r^a φ'(t)/√(t² - r²) dt. Neither source was
opened here: without layers the integral gives Hertz's contact, and one coat the closed form of M.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize_scalar
from scipy.special import ellipe, ellipk

Layers = Sequence[tuple[float, float, float]]  # E [Pa], ν [1] and thickness [m], surface first
Base = tuple[float, float] | None  # E [Pa] and ν [1] of the half space; None: rigid
NODES, PANELS = 40, 40  # of Gauss's rule over the contact; of 32 nodes over q
LAST = 25.0  # highest q, times the smallest thickness: g has decayed there


class Paraboloid(NamedTuple):
    """Radius of the contact [m], approach [m], load [N] and highest pressure [Pa]."""

    radius: float
    approach: float
    load: float
    peak: float


def relative_compliance(q: np.ndarray, layers: Layers, base: Base) -> np.ndarray:
    """Returns q E_r M/2 [1] at wavenumbers [rad/m], E_r of the top layer."""
    size = 4 * len(layers) + (0 if base is None else 2)
    matrix, right = np.zeros((len(q), size, size)), np.zeros((len(q), size, 1))
    top = _layer(q, layers[0], 0.0)
    matrix[:, :2, :4], right[:, 0] = top[:, 2:], -1.0  # the load: σ_zz = -1, and no shear
    for i, layer in enumerate(layers):
        rows, columns = slice(4 * i + 2, min(4 * i + 6, size)), 4 * i
        count = rows.stop - rows.start  # of a rigid base only the displacements vanish
        matrix[:, rows, columns : columns + 4] = _layer(q, layer, layer[2])[:, :count]
        if i + 1 < len(layers):
            matrix[:, rows, columns + 4 : columns + 8] = -_layer(q, layers[i + 1], 0.0)
        elif base is not None:
            matrix[:, rows, columns + 4 :] = -_layer(q, (*base, np.inf), 0.0)[:, :, :2]
    constants = np.linalg.solve(matrix, right)[:, :4, 0]
    return np.sum(top[:, 1] * constants, -1) * _reduced(layers) / 2


def _layer(q, layer, depth):
    """q u, q w, σ_zz and σ_rz of the four solutions of a layer at a depth, shape `(q, 4, 4)`."""
    modulus, poisson, thickness = layer
    shear, x = modulus / (2 * (1 + poisson)), q * depth
    # Z = e^∓x and x e^∓x, and their derivatives over x up to the third.
    columns = []
    for sign, size in ((-1, np.exp(-x)), (1, np.exp(-q * (thickness - depth)))):
        columns.append([size * sign**n for n in range(4)])
        columns.append([size * (x * sign**n + n * sign ** (n + 1)) for n in range(4)])
    z = np.moveaxis(np.array(columns), (1, 2), (0, 1))  # order, q, solution
    rows = (
        z[1] / (2 * shear),
        ((1 - 2 * poisson) * z[2] - 2 * (1 - poisson) * z[0]) / (2 * shear),
        (1 - poisson) * z[3] - (2 - poisson) * z[1],
        poisson * z[2] + (1 - poisson) * z[0],
    )
    return np.stack(rows, axis=1)


def _reduced(layers: Layers) -> float:
    return layers[0][0] / (1 - layers[0][1] ** 2)


def paraboloid(
    layers: Layers, base: Base, curvature: float, *, load=None, approach=None
) -> Paraboloid:
    """Returns the contact of z = r²/(2R), R the `curvature` [m], at a load [N] or approach [m]."""
    modulus, beside = _reduced(layers), _beside_half_space(layers, base)

    def at(radius):
        return _contact(radius, curvature, modulus, *beside)

    def excess(log_radius):
        found = at(np.exp(log_radius))
        return found.load - load if approach is None else found.approach - approach

    scale = np.sqrt(approach * curvature) if load is None else np.cbrt(load * curvature / modulus)
    return at(np.exp(brentq(excess, np.log(scale / 5), np.log(scale * 5), xtol=1e-12)))


def punch_stiffness(radius: float, layers: Layers, base: Base) -> float:
    """Returns the load of a flat round punch over that on a half space of the top layer.

    At one approach: κ of W. C. Hayes et al., J. Biomech. 5 (1972) 541.
    """
    parts, width = _parts(radius, *_beside_half_space(layers, base))[:2]
    return np.pi / 2 * width @ parts[:, 0] / radius


def _beside_half_space(layers, base):
    """Nodes q, and their weights times `relative_compliance` less 1."""
    x, weight = np.polynomial.legendre.leggauss(32)
    last = LAST / min(thickness for _, _, thickness in layers)
    edges = last * np.linspace(0, 1, PANELS + 1) ** 2
    half = np.diff(edges)[:, None] / 2
    q, weight = (edges[:-1, None] + half * (1 + x)).ravel(), (half * weight).ravel()
    return q, weight * (relative_compliance(q, layers, base) - 1)


def _contact(radius, curvature, modulus, q, weight):
    """The contact of a given radius; `weight` is g times that of the nodes `q`."""
    parts, width, t, at_edge = _parts(radius, q, weight)
    approach = at_edge[1] / at_edge[0] / curvature
    phi = parts @ [approach, -1 / curvature]
    # φ is a smooth function of t², so that φ'(t)/t is one too.
    slope = np.polynomial.Chebyshev.fit(t**2, phi, 16, domain=[0, radius**2]).deriv()(t**2)
    return Paraboloid(radius, approach, np.pi * modulus * width @ phi, -modulus * width @ slope)


def _parts(radius, q, weight):
    """φ_1 and φ_2 at nodes, the weights of these, the nodes, and both at the edge."""
    nodes, width = np.polynomial.legendre.leggauss(NODES)
    t, width = radius * (nodes + 1) / 2, radius * width / 2
    cosines = np.cos(np.outer(np.append(t, radius), q))
    kernel = 2 / np.pi * (cosines * weight) @ cosines[:-1].T * width
    # φ = δ φ_1 - φ_2/R, with the right sides 1 and t².
    sides = 2 / np.pi * np.stack([np.ones(NODES + 1), np.append(t, radius) ** 2], 1)
    parts = np.linalg.solve(np.eye(NODES) + kernel[:-1], sides[:-1])
    return parts, width, t, sides[-1] - kernel[-1] @ parts


def adhesive_pull_off(tabor: float, rings: int = 400) -> float:
    """Returns the pull-off force over π w R of a sphere on a half space, by Newton's method.

    Rings of equal pressure, under σ = (8w/3ε) [(ε/u)⁹ - (ε/u)³]. A ring is the difference of two
    discs, whose displacement has elliptic integrals (A. E. H. Love, 1929, not opened). R, E* and w
    are 1 and ε is 1/`tabor`.
    """
    unit, contact = 1 / tabor, (4.5 * np.pi) ** (1 / 3)  # that of JKR without load
    edges = 1.2 * max(2 * contact, np.sqrt(72 * unit)) * np.linspace(0, 1, rings + 1) ** 1.2
    r = (edges[1:] + edges[:-1]) / 2
    outer = np.maximum.outer(r, edges)
    ratio = (np.minimum.outer(r, edges) / outer) ** 2
    outside = np.where(r[:, None] > edges, (1 - ratio) * ellipk(ratio), 0)
    moved = 4 / np.pi * np.diff(outer * (ellipe(ratio) - outside), axis=1)
    areas, gap, loads = np.pi * np.diff(edges**2), r**2 / 2 + 2 + 3 * unit, []
    # The surfaces close, and then open to beyond the least load.
    for approach in np.append(
        np.linspace(-2 - 3 * unit, 2, 60), opening := np.linspace(2, -1.4 - unit, 60)
    ):
        for _ in range(60):
            near, far = (unit / gap) ** 9, (unit / gap) ** 3
            pressure = 8 / (3 * unit) * (near - far)
            slope = -8 / unit * (3 * near - far) / gap
            excess = gap - r**2 / 2 + approach - moved @ pressure
            step = np.linalg.solve(np.eye(rings) - moved * slope, excess)
            gap = np.maximum(gap - step, 0.7 * gap)
            if np.max(np.abs(step)) < 1e-10 * unit:
                break
        loads.append(areas @ pressure)
    least = CubicSpline(-opening, loads[60:])
    found = minimize_scalar(least, bounds=(-opening[0], -opening[-1]))
    return -float(found.fun) / np.pi
