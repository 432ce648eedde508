"""Published results that no one here wrote, beside those of the package.

    python benchmarks/bench_published.py layers     spheres on coats, and an axisymmetric integral
    python benchmarks/bench_published.py rubber     a sphere that slides on rubber
    python benchmarks/bench_published.py gradient   E = E0 (z/c0)^k, waves and a paraboloid
    python benchmarks/bench_published.py adhesion   a sphere between DMT and JKR
    python benchmarks/bench_published.py heat       Jaeger's moving band
    python benchmarks/bench_published.py leakage    the area at which a gap closes
    python benchmarks/bench_published.py pavement   a load that moves on a layered road
    python benchmarks/bench_published.py wavy       an adhesive wave of shorter and shorter range
    python benchmarks/bench_published.py challenge  the system of the contact-mechanics challenge

The page "Published results" of the site has the sources. The scenes are in `published.py`, the
integral is in `axisymmetric.py`.
"""

import numpy as np
import published
from axisymmetric import adhesive_pull_off, paraboloid
from rows import report, run

import graded_contact as gc

NU = published.POISSON
READ = {0.0107135: 0.00851, 0.117818: 0.04028, 0.800539: 0.01587}  # m/s: friction, from a figure
RATIOS = {0.25: 0.55, 0.5: 0.72, 1.0: 1.0, 2.0: 1.52, 4.0: 2.35}  # moduli: peak, from a figure
# Moduli of two layers: peak and radius over those of Hertz.
TWO = {(0.25, 0.5): {"peak": 0.582, "radius": 1.373}, (4.0, 2.0): {"radius": 0.695}}
SERIES = {0.3: 7.464, 0.45: 9.263, 0.49: 10.130}  # Poisson's ratio: load [N]
GRADED = ((0.2, 0.3), (0.5, 0.3), (0.5, 0.49), (0.8, 0.2))  # k and ν


def percent(found: float, expected: float) -> str:
    return f"{100 * (found / expected - 1):+.3f}"


def layers(points: int = 128):
    """Spheres on one coat, on two layers and on a bonded layer."""

    def keep(scene, number, here, read, exact):
        report("bench_published-layers", {
            "scene": scene, "number": number, "here": f"{here:.5g}", "published": f"{read:.5g}",
            "integral": f"{exact:.5g}", "here from published [%]": percent(here, read),
            "here from integral [%]": percent(here, exact),
            "published from integral [%]": percent(read, exact),
        })  # fmt: skip

    def on_base(coats, curvature):
        """Peak and radius over those of Hertz, by the package and by the integral."""
        here = published.layers_under_hertz(coats, curvature, points)
        load = 4 / 3 * published.REDUCED / curvature
        exact = paraboloid(coats, (1.0, NU), curvature, load=load)
        peak = 2 * published.REDUCED / (np.pi * curvature)
        return zip(("peak", "radius"), here, (exact.peak / peak, exact.radius), strict=True)

    for ratio, read in RATIOS.items():
        number, here, exact = next(on_base([(ratio, NU, 1.0)], 10.0))
        keep(f"one coat, E/E_base = {ratio:g}", number, here, read, exact)
    for (upper, lower), read in TWO.items():
        for number, here, exact in on_base([(upper, NU, 0.5), (lower, NU, 0.5)], 200.0):
            if number in read:
                scene = f"two layers, E/E_base = {upper:g}, {lower:g}"
                keep(scene, number, here, read[number], exact)
    for poisson, read in SERIES.items():
        exact = paraboloid([(1e10, poisson, 2e-3)], None, 1.0, approach=0.5e-6).load
        here = published.bonded_layer(poisson, points)
        keep(f"bonded layer, ν = {poisson}", "load [N]", here, read, exact)


def rubber(points: int = 128):
    """The friction of a sphere over its velocity."""
    for velocity in sorted([*READ, *np.geomspace(1e-3, 10, 13)]):
        found = published.sliding_sphere(velocity, points)
        read = READ.get(velocity)
        beside = ("", "") if read is None else (str(read), percent(found.friction, read))
        report("bench_published-rubber", {
            "velocity [m/s]": velocity, "friction": float(found.friction),
            "its error": float(found.friction_error), "published": beside[0],
            "difference [%]": beside[1],
        })  # fmt: skip


def gradient(points: int = 128):
    """M of a wave by both graded solvers; load, peak and radius of a paraboloid."""

    def keep(k, poisson, number, exact, error):
        report("bench_published-gradient", {
            "k": k, "Poisson's ratio": poisson, "number": number, "closed form": f"{exact:.9g}",
            "relative error": error,
        })  # fmt: skip

    for k, poisson in GRADED:
        exact, stack = published.gradient_compliance(k, poisson)[0], published.power_gradient
        for solver in (gc.response.Layering(), gc.response.Riccati()):
            found = gc.surface_compliance(stack(k, poisson, 40.0, solver=solver), 1.0, 0.0)
            name = f"M at q = 1/m [m/Pa], {type(solver).__name__}"
            keep(k, poisson, name, exact, float(found) / exact - 1)
    for k, poisson in GRADED:
        _, load, peak = published.gradient_paraboloid(k, poisson, 1.0)
        found = published.gradient_contact(k, poisson, points)
        names = ("load at a given approach [N]", "peak pressure [Pa]", "radius [m]")
        for name, exact, ratio in zip(names, (load, peak, 1.0), found, strict=True):
            keep(k, poisson, name, exact, ratio - 1)


def adhesion(tabor: tuple = (0.1, 0.3, 1.0, 2.0)):
    """Pull-off force over π w R: 2 of Bradley and DMT, 3/2 of JKR, between them Maugis."""
    for number in tabor:
        points = max(64, 2 ** int(np.ceil(np.log2(26 * number**2))))
        pull_off, radius = published.adhesive_sphere(number, points)
        rings = adhesive_pull_off(number)
        report("bench_published-adhesion", {
            "Tabor parameter": number, "points": points, "pull-off": pull_off,
            "rings": rings, "here from rings [%]": percent(pull_off, rings),
            "constant tension": published.dugdale_pull_off(1.16 * number),
            "radius at zero load over JKR": radius,
        })  # fmt: skip


def heat():
    """The highest temperature under a band over q b/κ."""
    for peclet in (0.01, 0.1, 1.0, 10.0, 100.0):
        here, exact = published.moving_band(peclet), published.jaeger_band(peclet)
        slow = 2 / np.pi * (1 - np.euler_gamma - np.log(peclet / 2))
        report("bench_published-heat", {
            "Péclet number": peclet, "here": here, "Jaeger": exact,
            "difference [%]": percent(here, exact), "slow limit": slow,
            "fast limit": 2 / np.sqrt(np.pi * peclet),
        })  # fmt: skip


def leakage(seeds: int = 8):
    """The contact area at which the gap closes along x, of random surfaces."""
    areas = [published.closing_area(seed) for seed in range(seeds)]
    report("bench_published-leakage", {
        "surfaces": seeds, "mean area": float(np.mean(areas)),
        "standard error": float(np.std(areas, ddof=1) / np.sqrt(seeds)),
        "least": min(areas), "largest": max(areas), "published": "0.42 and 0.415",
    })  # fmt: skip


def pavement():
    """Deflections over the place of a load that moves, and at rest."""

    def keep(place, read, top, here):
        report("bench_published-pavement", {
            "load from the point [mm]": place, "published [mm]": str(read), "asphalt": top,
            "here [mm]": f"{1e3 * here:.4f}", "difference [%]": percent(1e3 * here, read),
        })  # fmt: skip

    rest = published.pavement(gc.Elastic(3e9, 0.3), [0.0], nodes=1)[0]
    keep(0, published.AT_REST, "3 GPa, load at rest", rest)
    for kind, top in (("creep", "D(t)"), ("relaxation", "E(t) = 1/D(t)")):
        places = [-place / 1e3 for place in published.MOVING]
        found = published.pavement(published.asphalt(kind), places, *published.DRIVEN)
        for (place, read), here in zip(published.MOVING.items(), found, strict=True):
            keep(place, read, top, here)


def wavy(points: tuple = (256, 1024)):
    """Widths of the contact of an adhesive wave over its period."""
    for number in points:
        for width in published.WIDTHS:
            load = published.wavy_load(width)
            length, found = published.wavy_contact(load, number)
            report("bench_published-wavy", {
                "points": number, "range over h": length, "load over p_w": f"{load:.3f}",
                "here": f"{found.contact_area:.4f}", "its error": found.contact_area_error,
                "Johnson": f"{width:.4f}", "difference [%]": percent(found.contact_area, width),
            })  # fmt: skip


def challenge(points: tuple = (512, 1024, 2048), seed: int = 0):
    """Areas, gaps and pressures of the challenge's system, with 8 points to a shortest wave.

    Errors of quantiles are the differences from half the points.
    """

    def quantiles(found):
        """Of the pressure in contact [kPa], and of the gap outside [nm]."""
        touching = np.asarray(found.gap) <= 1e-12
        inside = np.quantile(np.asarray(found.pressure)[touching], (0.5, 0.9)) * 1e-3
        return [*inside, *(np.quantile(np.asarray(found.gap)[~touching], (0.1, 0.5, 0.9)) * 1e9)]

    for number in points:
        shortest = 8 * published.CELL / number
        slope, length, found = published.challenge(seed, number, shortest)
        coarse = published.challenge(seed, number // 2, shortest)[2]
        pairs = zip(quantiles(found), quantiles(coarse), strict=True)
        shown = [f"{fine:.4g} ± {abs(fine - other):.2g}" for fine, other in pairs]
        names = ("median pressure [kPa]", "90 % pressure [kPa]", "10 % gap [nm]",
                 "median gap [nm]", "90 % gap [nm]")  # fmt: skip
        report("bench_published-challenge", {
            "points": number, "shortest wave [nm]": 1e9 * shortest,
            "slope": slope, "range [nm]": 1e9 * length,
            "area": f"{found.contact_area:.4f} ± {found.contact_area_error:.1g}",
            "mean gap [nm]": f"{1e9 * found.mean_gap:.1f} ± {1e9 * found.mean_gap_error:.1g}",
            **dict(zip(names, shown, strict=True)),
        })  # fmt: skip


if __name__ == "__main__":
    run(__doc__, layers, rubber, gradient, adhesion, heat, leakage, pavement, wavy, challenge)
