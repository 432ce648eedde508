"""Scenes of published results, solved by the package: numbers to put beside published ones.

Sources and differences are on the page "Validation"; `tests/test_published.py` checks them.
"""

import axisymmetric
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.special import gamma, j1

import graded_contact as gc

POISSON = 0.3
REDUCED = 1 / (1 - POISSON**2)  # of a base of modulus 1 Pa


def ball(points: int, size: float, curvature: float) -> gc.Surface:
    """The paraboloid of a sphere on a window [m]; its lowest place is a point of the grid."""
    x = (np.arange(points) - points // 2) * (size / points)
    heights = -(x[:, None] ** 2 + x**2) / (2 * curvature)
    return gc.Surface(heights, gc.Grid((points, points), size), periodic=False)


def press(stack, surface: gc.Surface, *, velocity=1.0, rtol=1e-6, **given) -> gc.Sliding:
    """The contact of a ball under a `load` [N], or at an approach [m]."""
    if "load" in given:
        given["pressure"] = given.pop("load") / float(jnp.prod(surface.grid.size))
    return gc.slide(stack, surface, velocity=velocity, rtol=rtol, **given)


def radius_of(found: gc.Sliding) -> float:
    """Radius of a round contact [m], from its area."""
    return float(jnp.sqrt(found.contact_area * jnp.prod(found.grid.size) / jnp.pi))


def load_of(found: gc.Sliding) -> float:
    return float(found.contact.mean_pressure * jnp.prod(found.grid.size))


def sliding_sphere(velocity: float, points: int = 256) -> gc.Sliding:
    """A sphere of 1 cm under 0.15 N on a rubber of one relaxation time of 1 ms."""
    rubber = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [9e6], [1e-3], POISSON)))
    return press(rubber, ball(points, 2.6e-3, 1e-2), load=0.15, velocity=velocity)


def elastic(modulus: float, poisson: float) -> gc.Prony:
    """With a branch without strength: it shares programs with viscoelastic solids."""
    return gc.Prony(modulus, [1e-12 * modulus], [1.0], poisson)


def layers_under_hertz(layers, curvature: float, points: int = 256) -> tuple[float, float]:
    """Highest pressure and radius over those of Hertz on the bare base of 1 Pa.

    `layers` are (E, ν, thickness); the radius of Hertz is the unit of length.
    """
    load, peak = 4 / 3 * REDUCED / curvature, 2 * REDUCED / (np.pi * curvature)
    coats = tuple(gc.Layer(elastic(e, nu), d) for e, nu, d in layers)
    stack = gc.Stack(layers=coats, base=gc.HalfSpace(elastic(1.0, POISSON)))
    found = press(stack, ball(points, 4.0, curvature), load=load)
    return float(jnp.max(found.pressure)) / peak, radius_of(found)


def bonded_layer(poisson: float, points: int = 256) -> float:
    """The load of a sphere of 1 m, 0.5 µm deep in a bonded layer of 2 mm and 10 GPa [N]."""
    slab = gc.Stack(layers=(gc.Layer(gc.Elastic(1e10, poisson), 2e-3),), base=gc.Rigid())
    return load_of(press(slab, ball(points, 2.4e-3, 1.0), approach=0.5e-6))


CARTILAGE = gc.Stack(layers=(gc.Layer(gc.Elastic(1.0, 0.5), 1.0),), base=gc.Rigid())


def punch_on_a_layer(radius: float, points: int) -> tuple[float, float]:
    """κ of a flat round punch on a bonded layer of thickness 1 and ν = 1/2, and its error [1].

    W. C. Hayes, L. M. Keer, G. Herrmann, L. F. Mockros, J. Biomech. 5 (1972) 541: the load over 8/3
    E a δ. As many points are inside as the area has.
    """
    grid = gc.Grid((points, points), 2.4 * radius)
    x = np.asarray(grid.spacing)[0] * (np.arange(points) - (points - 1) / 2)
    inside = x[:, None] ** 2 + x**2 < radius**2
    surface = gc.Surface(np.where(inside, 0.0, -1.0), grid, periodic=False)
    found = press(CARTILAGE, surface, approach=1e-3)
    cell = float(jnp.prod(grid.size))
    unit = 8 / 3 * np.sqrt(np.mean(inside) * cell / np.pi) * 1e-3 / cell
    return float(found.mean_pressure) / unit, float(found.mean_pressure_error) / unit


def sphere_on_a_layer(chi: float, points: int) -> tuple[float, float, float]:
    """The load of a sphere on that layer over that of the integral, its error, and of a formula.

    E. K. Dimitriadis et al., Biophys. J. 82 (2002) 2798, by χ = √(R δ)/h.
    """
    curvature = 100.0
    approach = chi**2 / curvature
    exact = axisymmetric.paraboloid([(1.0, 0.5, 1.0)], None, curvature, approach=approach)
    surface = ball(points, 2.4 * exact.radius, curvature)
    found = press(CARTILAGE, surface, approach=approach)
    unit = exact.load / float(jnp.prod(surface.grid.size))
    series = np.polynomial.Polynomial([1, 1.133, 1.283, 0.769, 0.0975])(chi)
    printed = 16 / 9 * np.sqrt(curvature) * approach**1.5 * series / exact.load
    return float(found.mean_pressure) / unit, float(found.mean_pressure_error) / unit, printed


class PowerGradient(eqx.Module):
    """E = (z/c0)^k [Pa] at depths z from `top` to the bottom of a layer, c0 = 1 m."""

    exponent: Float[Array, ""]
    poisson: Float[Array, ""]
    top: Float[Array, ""]
    bottom: Float[Array, ""]

    def __call__(self, s, omega):
        depth = self.bottom + s * (self.top - self.bottom)
        return depth**self.exponent, self.poisson


def power_gradient(
    exponent: float, poisson: float, bottom: float, top: float = 1e-6, solver=None
) -> gc.Stack:
    """A block with E = (z/c0)^k, homogeneous above the depth `top` and below `bottom` [m].

    At the surface E is 0: the skin above `top` has the harmonic mean there, so that it is squeezed
    as much.
    """
    profile = PowerGradient(*map(jnp.asarray, (exponent, poisson, top, bottom)))
    skin = gc.Layer(gc.Elastic((1 - exponent) * top**exponent, poisson), top)
    return gc.Stack(
        layers=(skin, gc.GradedLayer(profile, bottom - top)),
        base=gc.HalfSpace(gc.Elastic(bottom**exponent, poisson)),
        graded_solver=solver,
    )


def gradient_compliance(exponent: float, poisson: float) -> tuple[float, float]:
    """M at q = 1/m [m/Pa] of E = (z/c0)^k, and B of u_z = B P/s^(1+k) under a force P.

    The point force: J. R. Booker, N. P. Balaam, E. H. Davis (1985), as given by E. Willert,
    arXiv:2207.13166. M is its Fourier transform.
    """
    k, nu = exponent, poisson
    beta = np.sqrt((1 - k * nu / (1 - nu)) * (1 + k))
    force = (1 - nu**2) * np.sin(np.pi * beta / 2) * beta / ((1 + k) ** 2 * np.pi)
    force *= gamma((3 + k + beta) / 2) * gamma((3 + k - beta) / 2) / gamma(1 + k / 2) ** 2
    wave = 2 ** (1 - k) * np.pi * gamma((1 - k) / 2) / gamma((1 + k) / 2)
    return force * wave, force


JKR_RADIUS = 0.1  # of a sphere of radius 1 m and E* = 1 Pa without load [m]
WORK = JKR_RADIUS**3 / (4.5 * np.pi)  # J/m²


def adhesive_sphere(tabor: float, points: int = 256, steps: int = 13) -> tuple[float, float]:
    """Pull-off force over π w R, and radius at zero load over that of JKR, of a sphere.

    The Tabor parameter is R^(1/3) w^(2/3)/(E*^(2/3) ε) with the range ε of `AdhesiveLJ`. The law is
    resolved if `points` is at least 26 times its square. The approach falls through the least load,
    not as far as the jump out of contact.
    """
    unit = WORK ** (2 / 3)
    # At the rim the gap is 36 ε, beyond which 0.1 % of the attraction acts.
    size = 2 * max(2 * JKR_RADIUS, np.sqrt(72 * unit / tabor))
    surface = ball(points, size, 1.0)
    stack = gc.Stack(base=gc.HalfSpace(gc.Elastic(1 - POISSON**2, POISSON)))
    path = unit * (np.linspace(2.3, -1.4, steps) - 1 / tabor)
    kernel = gc.kernels.window_kernel(stack, surface.grid)
    law = gc.contacts.AdhesiveLJ(unit / tabor, WORK, contact_gap=1.2)
    # All solves start from a pressure, the first from Hertz's: they share a program.
    pressure = 2 / np.pi * np.sqrt(np.maximum(path[0] + 2 * surface.heights, 0))
    loads, areas = [], []
    for approach in path:
        how = dict(law=law, rtol=1e-4, start=pressure)
        found = gc.solve_contact(kernel, surface.heights, approach=approach, **how)
        pressure = found.pressure
        loads.append(found.mean_pressure)
        areas.append(np.mean(law.contact_indicator(pressure, found.gap, 1.0) > 0))
    loads = np.asarray(loads) * size**2 / (np.pi * WORK)
    radii = np.sqrt(np.asarray(areas) / np.pi) * size / JKR_RADIUS
    least = CubicSpline(-path, loads)
    pull_off = -minimize_scalar(least, bounds=(-path[0], -path[-1])).fun
    return float(pull_off), float(np.interp(0, -loads, radii))


def dugdale_pull_off(transition: float) -> float:
    """Pull-off force over π w R of a sphere under a constant tension around its contact, exactly.

    The parameter λ is 1.16 times that of Tabor, if the tension is the greatest of `AdhesiveLJ`. D.
    Maugis, J. Colloid Interface Sci. 150 (1992) 243, doi:10.1016/0021-9797(92)90285-T.
    """

    def load(ratio):
        """At a ratio of the radii of tension and contact."""
        edge, angle = np.sqrt(ratio**2 - 1), np.arccos(1 / ratio)
        square = transition / 2 * (edge + (ratio**2 - 2) * angle)
        linear = 4 * transition**2 / 3 * (edge * angle - ratio + 1)
        radius = (np.sqrt(linear**2 + 4 * square) - linear) / (2 * square)
        return radius**3 - transition * radius**2 * (edge + ratio**2 * angle)

    return -float(minimize_scalar(lambda x: load(1 + np.exp(x)), bounds=(-12, 7)).fun)


def closing_area(seed: int, points: int = 128, halvings: int = 5) -> float:
    """The contact area at which the gap of a random elastic contact closes along x."""
    q = 2 * np.pi
    spectrum = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=4 * q, q_roll=4 * q, q_high=32 * q)
    surface = gc.random_surface(spectrum, gc.Grid((points, points), 1.0), jax.random.key(seed))
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, POISSON)))
    area, low, high = 1.0, 0.015, 0.04  # loads [Pa] that leave the gap open, and that close it
    for _ in range(halvings):
        load = float(np.sqrt(low * high))
        found = gc.slide(block, surface, pressure=load, velocity=0.0, rtol=1e-4)
        flow = gc.sliding.gap_flow(found.gap, surface.grid, contact=found.pressure > 0)
        if flow.percolates[0]:
            low = load
        else:
            area, high = float(found.contact_area), load
    return area


# Deflections [mm] of ELLVA_VD over the place of the load [mm], and of ELLEA1 at rest, as ALVA has
# them (`validation_ve.m`, `validation_let.m`).
MOVING = {-5000: 0.106, -1000: 0.447, -500: 0.605, -100: 0.763, 0: 0.786, 50: 0.791, 100: 0.790,
          150: 0.784, 400: 0.702, 900: 0.504, 1400: 0.379, 1900: 0.297, 2900: 0.197,
          4900: 0.112}  # fmt: skip
AT_REST = 1.0508
DRIVEN = 0.3, 60 / 3.6  # beside the point [m], velocity [m/s]


def creep(t):
    """Creep compliance of the asphalt of ELLVA_VD [1/Pa] after the time t [s]."""
    return 1e-8 - (1e-8 - 2.5e-11) / (1 + (t / 1e3) ** 0.35)


def asphalt(kind: str) -> gc.Prony:
    """Fitted to the creep compliance, or to its inverse as the "relaxation" modulus."""
    t = np.geomspace(1e-7, 1e7, 71)
    values = creep(t) if kind == "creep" else 1 / creep(t)
    return gc.fit_prony(t, values, kind=kind, terms=12, poisson=0.3).material


def pavement(top, x, y: float = 0.0, velocity: float = 0.0, nodes: int = 32) -> np.ndarray:
    """Deflections [m] at places x, y [m] from a circle of 1.1 MPa that moves along x.

    The circle has the radius 150 mm, the road two layers on a half space. In the frame of the load
    u = (1/π²) ∫ q dq ∫ dφ Re[M σ exp(iqx cos φ)] cos(qy sin φ), φ from 0 to π/2.
    """
    radius, pressure = 0.15, 1.1e6
    layers = (gc.Layer(top, 0.15), gc.Layer(gc.Elastic(200e6, 0.35), 0.6))
    stack = gc.Stack(layers=layers, base=gc.HalfSpace(gc.Elastic(40e6, 0.4)))
    inner, weights = np.polynomial.legendre.leggauss(8)
    edges = np.concatenate([[0], np.geomspace(0.02, 2, 8), np.linspace(2, 1080, 360)[1:]])
    half = np.diff(edges)[:, None] / 2
    q, weights = (edges[:-1, None] + half * (1 + inner)).ravel()[:, None], (half * weights).ravel()
    angles, shares = np.polynomial.legendre.leggauss(nodes)
    along, across = q * np.cos(np.pi / 4 * (1 + angles)), q * np.sin(np.pi / 4 * (1 + angles))
    load = 2 * np.pi * pressure * radius * j1(q * radius)  # q times that of the wave
    wave = load * np.asarray(gc.surface_compliance(stack, q, -velocity * along))
    found = [(wave * np.exp(1j * along * place)).real * np.cos(across * y) for place in x]
    return np.stack([weights @ part @ shares for part in found]) / (4 * np.pi)


WIDTHS = 0.22730, 0.33514, 0.5, 0.68223  # at 0, 0.1, 0.3, 0.5 of p_w
WAVY = 0.2  # α² = 2w/(π h p_w) of the adhesive wave


def wavy_load(width: float) -> float:
    """Mean pressure over p_w of an adhesive wave in contact over a share `width` = 2a, exactly.

    K. L. Johnson, Int. J. Solids Struct. 32 (1995) 423: sin²(πa) - α sqrt(tan(πa)).
    """
    half = np.pi * width / 2
    return float(np.sin(half) ** 2 - WAVY * np.sqrt(np.tan(half)))


def wavy_contact(load: float, points: int, longer=1.0, **how) -> tuple[float, gc.Sliding]:
    """Range over the height h of the wave h cos(2πx), and its contact; p_w = π E* h = 1 Pa.

    The range is the shortest that a grid of so many points resolves, times `longer`.
    """
    height, work = 1 / np.pi, WAVY**2 / 2
    surface = gc.Surface(
        height * np.cos(2 * np.pi * np.arange(points) / points), gc.Grid(points, 1.0)
    )
    length = longer * np.sqrt(work / (0.3 * np.pi * points / 2))
    law = gc.contacts.ExponentialAdhesion(length, work)
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(1 - POISSON**2, POISSON)))
    return length / height, gc.slide(block, surface, pressure=load, velocity=0.0, law=law, **how)


CHALLENGE = {"modulus": 25e6, "work": 50e-3, "range": 2.071e-9, "pressure": 250e3}  # E*, SI units
CELL = 1e-4  # m


def challenge(seed: int, points: int, shortest: float) -> tuple[float, float, gc.Sliding]:
    """Rms slope, range [m] and contact of the contact-mechanics challenge.

    Waves are cut below the `shortest` [m]; with those of 0.1 µm the slope is 1. The range is the
    least that four points to this wave resolve.
    """
    q, e, work = 2 * np.pi, CHALLENGE["modulus"], CHALLENGE["work"]
    band = dict(hurst=0.8, q_low=q / CELL, q_roll=q / 2e-5)
    whole = gc.SelfAffine(rms_slope=1.0, q_high=q / 1e-7, **band)
    part = gc.SelfAffine(rms_slope=1.0, q_high=q / shortest, **band)
    slope = jnp.sqrt(whole.density(band["q_roll"]) / part.density(band["q_roll"]))
    part = gc.SelfAffine(rms_slope=slope, q_high=q / shortest, **band)
    surface = gc.random_surface(part, gc.Grid((points, points), CELL), jax.random.key(seed))
    # A point pulls with 0.3 of the stiffness of the block to a wave of two points.
    length = max(np.sqrt(work * shortest / (0.3 * q * e)), CHALLENGE["range"])
    law = gc.contacts.ExponentialAdhesion(length, work)
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(e * (1 - POISSON**2), POISSON)))
    load = CHALLENGE["pressure"]
    found = gc.slide(block, surface, pressure=load, velocity=0.0, law=law)
    return float(slope), float(length), found
