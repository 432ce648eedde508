"""Scenes of published results, solved by the package: numbers to put beside those of others.

Sources and verdicts are on the site's page "Published results"; `bench_published.py` stores the
rows, and `tests/test_published.py` checks them.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.special import gamma, kve

import graded_contact as gc

POISSON = 0.3
REDUCED = 1 / (1 - POISSON**2)  # of a base of modulus 1 Pa


def ball(points: int, size: float, curvature: float) -> gc.Surface:
    """The paraboloid of a sphere on a window [m]; its lowest place is a point of the grid."""
    x = (np.arange(points) - points // 2) * (size / points)
    heights = -(x[:, None] ** 2 + x**2) / (2 * curvature)
    return gc.Surface(heights, gc.Grid((points, points), size), periodic=False)


def press(stack, surface: gc.Surface, *, velocity=0.0, rtol=1e-6, **given) -> gc.Sliding:
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


def layers_under_hertz(layers, curvature: float, points: int = 256) -> tuple[float, float]:
    """Highest pressure and radius over those of Hertz on the bare base of 1 Pa.

    `layers` are (E, ν, thickness); the radius of Hertz is the unit of length.
    """
    load, peak = 4 / 3 * REDUCED / curvature, 2 * REDUCED / (np.pi * curvature)
    coats = tuple(gc.Layer(gc.Elastic(e, nu), d) for e, nu, d in layers)
    stack = gc.Stack(layers=coats, base=gc.HalfSpace(gc.Elastic(1.0, POISSON)))
    found = press(stack, ball(points, 4.0, curvature), load=load)
    return float(jnp.max(found.pressure)) / peak, radius_of(found)


def bonded_layer(poisson: float, points: int = 256) -> float:
    """The load of a sphere of 1 m, 0.5 µm deep in a bonded layer of 2 mm and 10 GPa [N]."""
    slab = gc.Stack(layers=(gc.Layer(gc.Elastic(1e10, poisson), 2e-3),), base=gc.Rigid())
    return load_of(press(slab, ball(points, 2.4e-3, 1.0), approach=0.5e-6))


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


def gradient_paraboloid(exponent: float, poisson: float, radius: float) -> tuple[float, ...]:
    """Approach [m], load [N] and highest pressure [Pa] of R = 1 m on E = (z/c0)^k, exactly.

    The pressure is p0 (1 - r²/a²)^((1+k)/2), the approach a²/((1+k)R).
    """
    k = exponent
    approach = radius**2 / (1 + k)
    shape = np.pi * radius ** (1 - k) * gamma((1 - k) / 2) * gamma((3 + k) / 2)
    peak = approach / (gradient_compliance(k, poisson)[1] * shape)
    return approach, 2 * np.pi * radius**2 * peak / (3 + k), peak


def gradient_contact(
    exponent: float, poisson: float, points: int = 128
) -> tuple[float, float, float]:
    """Load, highest pressure and radius on E = (z/c0)^k over those of `gradient_paraboloid`."""
    approach, load, peak = gradient_paraboloid(exponent, poisson, 1.0)
    stack = power_gradient(exponent, poisson, 1e3, 1e-5, gc.blocks.Layering(rtol=1e-6))
    found = press(stack, ball(points, 4.0, 1.0), approach=approach)
    return load_of(found) / load, float(jnp.max(found.pressure)) / peak, radius_of(found)


JKR_RADIUS = 0.1  # of a sphere of radius 1 m and E* = 1 Pa without load [m]
WORK = JKR_RADIUS**3 / (4.5 * np.pi)  # J/m²


def adhesive_sphere(tabor: float, points: int = 256) -> tuple[float, float]:
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
    path = unit * (np.linspace(2.3, -1.4, 13) - 1 / tabor)
    found = gc.contacts.follow_contact(
        gc.blocks.window_kernel(stack, surface.grid), surface.heights, approach=path,
        law=gc.contacts.AdhesiveLJ(unit / tabor, WORK, contact_gap=1.2), rtol=1e-4,
    )  # fmt: skip
    loads = np.asarray(found.mean_pressure) * size**2 / (np.pi * WORK)
    radii = np.sqrt(np.asarray(found.contact_area) / np.pi) * size / JKR_RADIUS
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


def moving_band(peclet: float, half: int = 32, points: int = 2**19) -> float:
    """Highest temperature under a uniform band of half-width b, over q b/κ, at a Péclet number.

    The number is v b/(2 D). A flat punch in one dimension slides under a constant shear stress; the
    temperature is that above the place far ahead.
    """
    x = np.arange(points) - points // 2
    heights = np.where(np.abs(x) <= half, 0.0, -1.0)
    # The punch ends half way between its last points and their neighbours.
    surface = gc.Surface(heights, gc.Grid(points, points / (half + 0.5)))
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, POISSON)))
    shear = gc.sliding.ConstantShear(1.0)
    found = gc.slide(block, surface, pressure=1e-6, velocity=1.0, shear=shear, rtol=1e-3)
    heating = gc.sliding.Heating(conductivity=1.0, diffusivity=0.5 / peclet)
    rise = gc.sliding.flash_temperature(found, block, heating, jnp.zeros(1))[0]
    ahead = int(half * (1 + min(1000, 30 / peclet)))
    return float(jnp.max(rise) - rise[points // 2 + ahead])


def jaeger_band(peclet: float) -> float:
    """The same by the integral of J. C. Jaeger (1942), of line sources moving with the band."""

    def rise(x):
        def source(s):
            u = peclet * (x - s)
            return kve(0, abs(u)) * np.exp(-u - abs(u))

        return quad(source, -1, 1, points=[x], epsabs=1e-12)[0] / np.pi

    return -float(minimize_scalar(lambda x: -rise(x), bounds=(-1, 1)).fun)


def closing_area(seed: int, points: int = 256, halvings: int = 7) -> float:
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
