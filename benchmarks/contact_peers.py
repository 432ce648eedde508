"""Elastic contact, compared with Tamaas and ContactMechanics: sections `elastic` and `kernel`.

Run by `bench_contact.py`. Both peers get the same heights (their sign: up, towards the solid), the
same reduced modulus and the same mean pressure. Their times are of the solve alone, ours of
`slide`: kernel, solve and observables.
"""

import importlib
import time
from functools import cache, partial
from importlib.metadata import version

import jax.numpy as jnp
import numpy as np
from contact_scenes import BEST, CELL, LOADS, Q0, bodies, errors_of, loosest, rough_surface
from rows import goal, report, timed

import graded_contact as gc


@cache
def imported(name):
    """Another program, which only these sections need."""
    module = importlib.import_module(name)
    print(f"# {name} {version(name)}")
    return module


class Tamaas:
    """Polonsky and Keer's conjugate gradients on a half space, or with a kernel of ours."""

    name = "tamaas"

    def __init__(self, heights, kernel=None):
        self.peer = tamaas = imported("tamaas")
        tamaas.set_log_level(tamaas.LogLevel.error)
        self.heights = np.array(heights, order="C")  # it takes no other order
        self.model = tamaas.Model(
            tamaas.model_type.basic_2d, [CELL, CELL], list(self.heights.shape)
        )
        self.model.E, self.model.nu = 1.0, 0.0
        self.operator = None
        if kernel is not None:
            self.operator = "Westergaard::neumann"
            self.model.be_engine.registerNeumann()
            self.model.operators[self.operator]["influence"][...] = np.asarray(kernel)

    def solve(self, pressure, tolerance):
        """The pressures; the peer does not say whether it converged."""
        solver = self.peer.PolonskyKeerRey(self.model, self.heights, tolerance)
        solver.max_iter = 20_000
        if self.operator:
            # Otherwise the solver makes an operator of its own.
            solver.setIntegralOperator(self.operator)
        self.model.traction[...] = 0
        solver.solve(pressure)
        return np.array(self.model.traction)


class Mechanics:
    """Conjugate gradients of ContactMechanics; one tolerance scales its three."""

    name = "ContactMechanics"

    def __init__(self, heights):
        mechanics, topography = imported("ContactMechanics"), imported("SurfaceTopography")
        heights, shape = np.array(heights), heights.shape
        self.height, self.pixel = heights.std(), CELL**2 / heights.size
        substrate = mechanics.PeriodicFFTElasticHalfSpace(shape, 1.0, (CELL, CELL))
        surface = topography.Topography(heights, (CELL, CELL), periodic=True)
        self.system = mechanics.Systems.NonSmoothContactSystem(substrate, surface)

    def solve(self, pressure, tolerance):
        found = self.system.minimize_proxy(
            external_force=pressure * CELL**2,
            pentol=tolerance * self.height,
            forcetol=tolerance * pressure * self.pixel,
            thermotol=tolerance,
            maxiter=20_000,
        )
        return np.array(found.jac) / self.pixel


PEERS = {peer.name: peer for peer in (Tamaas, Mechanics)}


def elastic(
    sizes=(256, 512, 1024), targets=(1e-4, 1e-8), loads=LOADS, peers=tuple(PEERS),
    tamaas_up_to=1024, mechanics_up_to=512, tries=3, repeat=5,
):  # fmt: skip
    """The package, Tamaas and ContactMechanics at equal true errors (`--targets`)."""
    largest = {"tamaas": tamaas_up_to, "ContactMechanics": mechanics_up_to}
    print("# errors, and pixels that differ, against the solution of rtol = 1e-10")
    # Tolerances of a peer that met a target at one size begin its search at the next.
    ratios, differing, hints = {}, [], {}
    for n in sizes:
        for load in loads:
            chosen = [peer for peer in peers if n <= largest[peer]]
            compare(n, load, targets, chosen, tries, repeat, ratios, differing, hints)
    for (peer, n, target), values in ratios.items():
        claim = ">= 100 x faster" if (peer, n) == ("tamaas", 1024) else "faster"
        goal(
            f"{claim} than {peer} at N = {n} and an error of {target:.0e}",
            ", ".join(f"{ratio:.1f} x at p/E* = {load:g}" for load, ratio in values),
        )
    if differing:
        pixels, where = max(differing)
        goal("contact sets at 1e-8 identical to the pixel", f"{pixels} differ at most ({where})")


def compare(n, load, targets, peers, tries, repeat, ratios, differing, hints):
    """Prints the rows of one surface and load, and notes what was found."""
    surface = rough_surface(n)
    slide = partial(gc.slide, bodies()["elastic"], surface, pressure=load, velocity=0.0)
    best = slide(rtol=BEST)

    def row(solver, target, tolerance, pairs, seconds, pressure, ratio=""):
        errors = errors_of(pressure, best)
        differ = int(np.sum((np.asarray(pressure) > 0) != np.asarray(best.pressure > 0)))
        report("bench_contact-elastic", {
            "p/E*": load, "N": n, "solver": solver, "target error": target,
            "error of the pressure": float(errors.pressure),
            "error of the area": float(errors.area), "pixels that differ": differ,
            "FFT pairs": pairs, "time [s]": seconds, "over our time": ratio,
        }, f"  tolerance {tolerance:.1e}")  # fmt: skip
        if target <= 1e-8:
            differing.append((differ, f"{solver}, N = {n}, p/E* = {load:g}"))

    for target in targets:
        reached, _ = loosest(lambda rtol: slide(rtol=rtol), best, target)
        if reached is None:
            print(f"# N = {n}, p/E* = {load:g}: no rtol reached {target:.0e}")
            continue
        found, rtol = reached
        ours = timed(lambda r=rtol: slide(rtol=r), repeat)
        pairs = f"{float(found.num_fft_pairs):.1f}"
        row("graded_contact", target, rtol, pairs, ours, found.pressure)
        for name in peers:
            hint = hints.get((name, load, target), target)
            tolerance, _, seconds, pressure = at_equal_error(
                PEERS[name](surface.heights), load, target, best, hint, tries
            )
            hints[name, load, target] = tolerance
            ratio = seconds / ours
            row(name, target, tolerance, "", seconds, pressure, f"{ratio:.1f}")
            ratios.setdefault((name, n, target), []).append((load, ratio))


def at_equal_error(peer, load, target, best, tolerance, tries):
    """The run of a peer whose true error is nearest to `target`, its tolerance sought for that.

    Returns its tolerance, true error, seconds and pressures.
    """
    runs = []
    for _ in range(tries):
        start = time.perf_counter()
        pressure = peer.solve(load, tolerance)
        seconds = time.perf_counter() - start
        error = errors_of(pressure, best).pressure
        runs.append((tolerance, error, seconds, pressure))
        if 0.3 * target <= error <= target or not np.isfinite(error):
            break
        tolerance *= 0.6 * target / max(error, 1e-3 * target)
    return min(runs, key=lambda run: abs(np.log(run[1] / target)))


def block(layers, base):
    """Elastic layers (E, ν, q0 d) on a base."""
    layers = tuple(gc.Layer(gc.Elastic(e, nu), depth / Q0) for e, nu, depth in layers)
    return gc.Stack(layers=layers, base=base)


def kernel(sizes=(128, 256), loads=(0.01, 0.1)):
    """Layered contacts as Tamaas finds them, with its operator overwritten."""
    stacks = {
        "soft coat": block([(0.1, 0.49, 0.3)], gc.HalfSpace(gc.Elastic(0.75, 0.5))),
        "stiff coat": block([(10.0, 0.3, 0.02)], gc.HalfSpace(gc.Elastic(0.75, 0.5))),
        "three layers on rigid": block(
            [(5.0, 0.45, 0.05), (0.1, 0.3, 0.2), (2.0, 0.4, 0.5)], gc.Rigid()
        ),
    }
    worst, pixels = 0.0, 0
    for n in sizes:
        surface = rough_surface(n)
        for name, stack in stacks.items():
            ours = gc.stack_kernel(stack, surface.grid)
            theirs = Tamaas(surface.heights, kernel=ours)
            for load in loads:
                expected = gc.solve_contact(ours, surface.heights, load, rtol=BEST).pressure
                found = theirs.solve(load, 1e-10)
                error = float(jnp.linalg.norm(found - expected) / jnp.linalg.norm(expected))
                differ = int(np.sum((found > 0) != np.asarray(expected > 0)))
                worst, pixels = max(worst, error), pixels + differ
                area = float(jnp.mean(expected > 0))
                report("bench_contact-kernel", {
                    "block": name, "N": n, "mean pressure": load, "area": area,
                    "difference of the pressures": error, "pixels that differ": differ,
                })  # fmt: skip
    goal(
        "layered contacts as Tamaas finds them, to the pixel",
        f"pressures within {worst:.1e}, {pixels} pixels differ in all",
    )
