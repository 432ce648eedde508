"""Mean-field friction: milliseconds, and the error of the quadrature.

python benchmarks/bench_persson.py speed      a friction curve of 50 velocities, its gradient
python benchmarks/bench_persson.py claims     `error` against the true one, in random scenes

`claims`: blocks of 0 to 3 layers (E elastic; V Prony series of up to six branches over ten decades,
or the tread; T a table of 20, 61 or 200 moduli of a V over 6 to 14 decades, without and with
scatter; the last letter is the base: R rigid, F none), q_low d from 1e-3 to 100; self-affine
spectra of up to 7 decades, or one or six powers of q from -6 to 0; loads from light to complete
contact; speeds over ten decades; all corrections. The true error, relative to the result as the
claim is, is that against at least 640 wavenumbers and 96 angles.
"""

import itertools
from functools import partial
from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
from rows import goal, report, run, seconds, timed

import graded_contact as gc
from graded_contact.mean_field.diffusion import Correction


def tread(share):
    rubber = gc.tyre_tread()
    return gc.Prony(
        equilibrium=rubber.equilibrium * (1 + share),
        strengths=rubber.strengths * (1 + share),
        times=rubber.times * 10 ** (-share),
        poisson=0.49,
    )


def three_treads(thickness):
    layers = tuple(gc.Layer(tread(i / 3), d) for i, d in enumerate(thickness))
    return gc.Stack(layers=layers, base=gc.HalfSpace(tread(1.0)))


def speed():
    """A friction curve of 50 velocities on three layers, and its gradient."""
    spectrum = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=63.0, q_roll=250.0, q_high=63e3)
    velocities = jnp.geomspace(1e-6, 30.0, 50)
    thickness = jnp.array([1e-4, 3e-4, 1e-3])

    def curve(thickness, **counts):
        stack = three_treads(thickness)

        def one(velocity):
            found = gc.mean_field_friction(
                stack, spectrum, pressure=4e5, velocity=velocity, **counts
            )
            return found.friction, found.contact_area

        return jax.lax.map(one, velocities)

    value = jax.jit(curve)
    gradient = jax.jit(jax.value_and_grad(lambda d: jnp.sum(curve(d)[0])))
    (first, warm), (first_gradient, warm_gradient) = (
        (seconds(partial(function, thickness)), timed(partial(function, thickness), 15))
        for function in (value, gradient)
    )
    exact = jax.jit(lambda d: curve(d, num_wavenumbers=192, num_angles=48))(thickness)
    error = max(
        float(np.max(np.abs(a / b - 1))) for a, b in zip(value(thickness), exact, strict=True)
    )
    report("bench_persson-speed", {
        "curve of 50 velocities, first [s]": first, "warm [ms]": 1e3 * warm,
        "with gradient, first [s]": first_gradient, "with gradient, warm [ms]": 1e3 * warm_gradient,
        "error of the quadrature": error,
    })  # fmt: skip
    goal("curve <= 50 ms", f"{1e3 * warm:.1f} ms")
    goal("quadrature error <= 1e-6 (against three times the nodes)", f"{error:.1e}")
    goal("gradient <= 3 x curve", f"{warm_gradient / warm:.2f} x")


STACKS = ("V", "VE", "EVV", "EVVR", "VVF", "T", "ET", "TTR")
SPECTRA = ("sharp", 1, 6)
BRANCHES = 18
POINTS = (20, 61, 200)  # of tables


def claims(scenes=20, seed=0):
    """`error` against the true one, in random scenes of each kind of block and spectrum."""
    rng, rows, corrections = np.random.default_rng(seed), [], get_args(Correction)
    for number, (letters, kind) in enumerate(itertools.product(STACKS, SPECTRA)):
        correction = corrections[number % len(corrections)]
        points = POINTS[number % len(POINTS)]
        drawn = [random_scene(rng, letters, kind, points) for _ in range(scenes)]
        stacked = jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(a) for a in leaves]), *drawn)

        def solve(scene, counts, correction=correction):
            stack, spectrum, pressure, velocity = scene
            found = gc.mean_field_friction(
                stack, spectrum, pressure=pressure, velocity=velocity, correction=correction,
                throw=False, **counts,
            )  # fmt: skip
            return jnp.stack([found.friction, found.contact_area]), found.error

        pieces = kind if kind in SPECTRA[2:] else 2
        fine = {"num_wavenumbers": max(640, 160 * pieces), "num_angles": 96}
        (value, claim), (exact, doubt) = (
            jax.jit(partial(jax.lax.map, partial(solve, counts=counts)))(stacked)
            for counts in ({}, fine)
        )
        true = np.max(np.abs(1 - exact / value), axis=1)
        rows += zip(true, claim, doubt, np.full(scenes, "T" in letters), strict=True)
        print(f"# {letters} {kind} {correction}: {np.sum(true > claim)} broken", flush=True)
    for moduli, tables in (("Prony series", False), ("tables", True)):
        summarize(moduli, *np.array([row[:3] for row in rows if row[3] == tables]).T)


def summarize(moduli, true, claim, doubt):
    # A friction of 1e-15 and less of the shear is rounding, in the fine solve too.
    known = doubt < 0.1 * np.maximum(claim, true)
    ratio = claim[known] / true[known]
    row = {"moduli": moduli, "scenes": len(true), "with a known error": int(np.sum(known))}
    row |= {"broken": int(np.sum(ratio < 1)), "true error, median": np.median(true[known])}
    row |= {f"claim/true, {p} %": np.percentile(ratio, p) for p in (0, 10, 50, 90)}
    row["claims up to rtol = 1e-4 [%]"] = 100 * np.mean(claim[known] <= 1e-4)
    report("bench_persson-claims", row)


def random_scene(rng, letters, kind, points):
    """Stack, spectrum, pressure [Pa] and velocity [m/s]."""
    q_low = 10 ** rng.uniform(1, 4)
    q_roll = q_low * 10 ** rng.uniform(0, 2)
    q_high = q_roll * 10 ** rng.uniform(0.3, 5)
    layers = [
        gc.Layer(random_material(rng, letter, points), 10 ** rng.uniform(-3, 2) / q_low)
        for letter in letters[:-1]
    ]
    ends = {"R": gc.Rigid(), "F": gc.Free()}
    base = ends.get(letters[-1]) or gc.HalfSpace(random_material(rng, letters[-1], points))
    stack = gc.Stack(layers=layers, base=base)
    slope = 10 ** rng.uniform(-2, 0)
    if kind in ("sharp", "smooth"):
        spectrum = gc.SelfAffine(
            rms_slope=slope, hurst=rng.uniform(0.05, 1), q_low=q_low, q_roll=q_roll, q_high=q_high,
            roll_off=kind,
        )  # fmt: skip
    else:
        inner = q_low * (q_high / q_low) ** rng.uniform(0, 1, kind - 1)
        q = np.sort([q_low, *inner, q_high])
        c = np.exp(np.append(0, np.cumsum(rng.uniform(-6, 0, kind) * np.diff(np.log(q)))))
        dense = np.geomspace(q_low, q_high, 4001)
        powers = dense**4 * np.exp(np.interp(np.log(dense), np.log(q), np.log(c)))
        c = c * slope**2 / (2 * np.pi * np.trapezoid(powers, np.log(dense)))
        spectrum = gc.surfaces.SpectrumTable(q, c)
    speed, angle = 10 ** rng.uniform(-8, 2), rng.uniform(0, 2 * np.pi)
    q = np.geomspace(q_low, q_high, 7)
    moduli = np.abs(gc.effective_modulus(stack, q, 0.7 * speed * q))
    between = np.exp(rng.uniform(*np.log([np.min(moduli), np.max(moduli)])))
    pressure = 10 ** rng.uniform(-3.5, 0.7) * slope * between
    return stack, spectrum, pressure, speed * np.array([np.cos(angle), np.sin(angle)])


def random_material(rng, letter, points):
    poisson = rng.uniform(0.2, 0.5)
    if letter == "T":
        low, scatter = rng.uniform(-6, 0), rng.choice([0.0, 0.003, 0.03])
        omega = np.logspace(low, low + rng.uniform(6, 14), points)
        modulus = np.asarray(random_material(rng, "V", points).modulus(omega))
        storage, loss = rng.lognormal(sigma=scatter, size=(2, points)) * [
            modulus.real,
            modulus.imag,
        ]
        return gc.Tabulated(omega, storage + 1j * loss, poisson)
    if letter == "E":
        return gc.Elastic(10 ** rng.uniform(5, 9), poisson)
    equilibrium, shift = 10 ** rng.uniform(5, 8), 10 ** rng.uniform(-3, 3)
    if rng.random() < 1 / 3:
        rubber = gc.tyre_tread()
        scale = equilibrium / rubber.equilibrium
        return gc.Prony(equilibrium, rubber.strengths * scale, rubber.times * shift, poisson)
    count = rng.integers(1, 7)
    which = np.append(np.arange(count), np.full(BRANCHES - count, count - 1))
    strengths = equilibrium * 10 ** rng.uniform(-2, 3, count)[which] / np.bincount(which)[which]
    return gc.Prony(equilibrium, strengths, 10 ** rng.uniform(-8, 2, count)[which], poisson)


if __name__ == "__main__":
    run(__doc__, speed, claims)
