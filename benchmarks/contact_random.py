"""Random scenes and hard scenes: the sections `random` and `hard`.

Run by `bench_contact.py`. Blocks of 0 to 3 layers, each elastic or a Prony series of six branches
over ten decades, moduli over three decades, q0 d from 1e-3 to 3, ν from 0.2 to 1/2, on a half
space, a rigid base or none; self-affine surfaces, H from 0.5 to 1, random roll-off and cut-off;
loads from 1e-4 to 1.5 of what closes every gap, of free blocks (three layers, q0 d to 1, kernels
of contrasts up to 1e8) from 0.03; speeds over eight decades, along x, along y and oblique; hard
walls, some with a hardness, and the repulsive law; a fifth of the scenes in float32. To compile few
programs all blocks have three layers, some of no thickness, and elastic ones have branches of 1e-12
of their modulus.

Each scene is solved at its mean pressure and at the resulting mean gap (`rtol` from 1e-3 to 1e-6).
Their claims are compared with a solution at 1e-10 (1e-9 if that fails) in double precision.

Hard: small contacts, and moduli far apart. Cylinders: parabolas on one relaxation, rigid against it
in 1-D, pairs by half-widths at rest, contrast of the moduli and speed (relaxation time times speed
over the half-width). Rough: `rough_surface`, one relaxation (`single`) in mid-band or ten decades
(`broad`). Random hard ones: one or ten relaxations, contrasts to 1e4, loads from 1e-6 of what
closes every gap, grids of one and two dimensions, also odd and not square; each solved in the ways
above.
"""

import sys
import time
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from contact_scenes import CELL, Q0, rough_surface
from rows import goal, report, timed

import graded_contact as gc
from graded_contact.fields.grid import to_field, to_spectrum

BRANCHES = 6
CLOSEST = 1e-10
# Errors that are not compared: the best solution has as much, and rounding.
LEAST = 3e-10


def random(count=500, seed=0):
    """Random scenes: failures and broken claims."""
    survey("random", lambda rng, _: layered_scene(rng, (64, 64)), count, seed)


def survey(name, draw, num_scenes, seed):
    """Solves the scenes that `draw(rng, i)` returns and reports what came of them."""
    rng = np.random.default_rng(seed)
    start, counts, broken, ratios = time.perf_counter(), {}, {}, {}
    for i in range(num_scenes):
        scene = draw(rng, i)
        for way, outcome, found in outcomes(scene):
            counts[way, outcome] = counts.get((way, outcome), 0) + 1
            if outcome != "converged":
                print(f"  {outcome}: {way}, scene {i}, {scene}", flush=True)
            for quantity, true, claim, of_best in found:
                if true > claim + of_best + scene.least:
                    broken[way, quantity] = broken.get((way, quantity), 0) + 1
                    print(
                        f"  {quantity} {true:.1e}, claimed {claim:.1e}: {way}, scene {i}, {scene}"
                    )
                if true > 10 * scene.least:
                    ratios.setdefault((way, quantity), []).append(claim / true)
        if (i + 1) % 50 == 0:
            passed = time.perf_counter() - start
            print(f"  {i + 1} of {num_scenes}, {passed:.0f} s", file=sys.stderr)
    print(f"# {num_scenes} scenes in {time.perf_counter() - start:.0f} s")
    for (way, outcome), count in sorted(counts.items()):
        print(f"{way:30s} {outcome:40s} {count:5d}")
    print("\nclaimed over true error, percentiles")
    marks = (1, 10, 50, 90, 99)
    for (way, quantity), found in sorted(ratios.items()):
        shares = np.percentile(found, marks)
        report(f"bench_contact-{name}", {
            "prescribed": way, "claim of": quantity, "scenes": num_scenes,
            "broken": broken.get((way, quantity), 0), "true error above rounding": len(found),
            **{f"{m} %": float(s) for m, s in zip(marks, shares, strict=True)},
        })  # fmt: skip
    goal("no claim is broken", f"{sum(broken.values())} of {sum(map(len, ratios.values()))}")


def outcomes(scene):
    """Yields of each way to solve a scene its name, how it ended, and true and claimed errors."""
    given = {"pressure": scene.load}
    for name in ("pressure", "mean_gap"):
        if name == "mean_gap":
            # In full contact no load follows from the gap.
            if best is None or abs(best.mean_gap) < 1e-6 * np.std(scene.surface.heights):
                return
            # Below 0 where the body flows, other than in `mean_gap` of the result.
            given = {"mean_gap": jnp.mean(best.gap)}
        best = exact(scene, given)
        found = scene.solve(given, rtol=scene.rtol)
        if found.result != gc.contacts.RESULTS.successful:
            yield name, "not converged, and reported", ()
        elif best is None:
            yield name, "converged, the best did not", ()
        else:
            yield name, "converged", tuple(compare(scene, found, best))


def exact(scene, given):
    """The closest solution in double precision, or None."""
    for rtol in (CLOSEST, 10 * CLOSEST):
        best = scene.solve(given, rtol=rtol, double=True)
        if best.result == gc.contacts.RESULTS.successful:
            return best
    return None


def compare(scene, found, best):
    """Yields quantities with their true error, the claimed one, and what the best one claims."""
    sigma, sharp = (np.asarray(s.pressure, float) for s in (found, best))
    rms = float(np.std(np.asarray(scene.surface.heights, float)))
    wrong = np.linalg.norm(sigma - sharp) / np.linalg.norm(sharp)
    yield "pressure", wrong, float(found.error), float(best.error)
    for name in ("friction", "contact_area"):
        wrong = abs(float(getattr(found, name)) - float(getattr(best, name)))
        yield name, wrong, *(float(s.error_parts(name)["solver"]) for s in (found, best))
    gap = np.asarray(found.gap, float) - np.asarray(best.gap)
    wrong = float(np.sqrt(np.mean(gap**2))) / rms
    yield "gap", wrong, float(found.contact.gap_error), float(best.contact.gap_error)


class Scene:
    """A block with a random surface, load, speed, law, precision and tolerances.

    The load is a share of what closes every gap, between ten to the powers `closed`.
    """

    def __init__(self, rng, stack, shape, description, *, closed, rms_slope=None):
        self.stack, grid = stack, gc.Grid(shape, CELL)
        cut = rng.integers(6, min(shape) // 2 + 1)
        spectrum = gc.SelfAffine(
            rms_slope=10 ** rng.uniform(-2, 0) if rms_slope is None else rms_slope,
            hurst=rng.uniform(0.5, 1.0),
            q_low=Q0,
            q_roll=rng.uniform(1.0, cut / 2) * Q0,
            q_high=cut * Q0,
        )
        self.surface = gc.random_surface(spectrum, grid, jax.random.key(rng.integers(2**31)))
        speed, share = 10 ** rng.uniform(-4, 4), 10 ** rng.uniform(*closed)
        kernel = gc.stack_kernel(stack, grid, speed)
        kernel = kernel.at[(0,) * kernel.ndim].set(np.inf)
        full = to_field(to_spectrum(self.surface.heights) / kernel, shape)
        self.load = -share * float(full.min())
        self.description = f"{description}, cut-off {cut} q0, p = {share:.1e} of full contact"
        self._draw_way(rng, speed)

    def _draw_way(self, rng, speed):
        angle = rng.choice([0.0, np.pi / 2, rng.uniform(0, 2 * np.pi)])
        velocity = speed * np.array([np.cos(angle), np.sin(angle)])
        self.velocity = np.where(abs(velocity) > 1e-12 * speed, velocity, 0)
        if self.surface.grid.ndim == 1:
            self.velocity = speed
        rms = float(np.std(self.surface.heights))
        laws = (
            gc.HardWall(),
            gc.HardWall(hardness=self.load * 10 ** rng.uniform(0.3, 1.5)),
            gc.RepulsiveLJ(
                rms * 10 ** rng.uniform(-2.5, -0.5), self.load * 10 ** rng.uniform(-1, 1)
            ),
        )
        which = rng.choice(3, p=[0.6, 0.2, 0.2])
        self.law, self.is_plain = laws[which], which == 0
        self.single = rng.random() < 0.2
        self.rtol = 10 ** rng.uniform(-6, -3)
        rng.uniform()  # later scenes stay those of stored rows
        self.least = LEAST
        if self.single:
            single = lambda tree: jax.tree.map(lambda a: a.astype(jnp.float32), tree)  # noqa: E731
            self.stack, self.surface, self.law = map(single, (self.stack, self.surface, self.law))
            self.load = np.float32(self.load)
            self.rtol = max(self.rtol, 1e-4)
            self.least = 1e-6

    def __repr__(self):
        law = type(self.law).__name__ + ("" if self.is_plain else " of its own settings")
        return (
            f"{self.description}, velocity {self.velocity}, {law}, "
            f"{'float32' if self.single else 'float64'}, rtol {self.rtol:.1e}"
        )

    def solve(self, given, double=False, **tolerance):
        scene = self.stack, self.surface, self.law, given
        if double:
            widen = lambda a: jnp.asarray(a, jnp.float64)  # noqa: E731
            scene = jax.tree.map(widen, scene)
        stack, surface, law, given = scene
        velocity = jnp.asarray(self.velocity, surface.heights.dtype)
        return gc.slide(
            stack, surface, velocity=velocity, law=law, throw=False, **tolerance, **given
        )


def layered_scene(rng, shape):
    """A scene of a block of 0 to 3 layers."""
    base = rng.choice(["half space", "rigid", "free"], p=[0.4, 0.4, 0.2])
    free = base == "free"
    num_layers = rng.integers({"half space": 0, "rigid": 1, "free": 3}[base], 4)
    materials = [random_material(rng) for _ in range(4)]
    thickness = 10 ** rng.uniform(-3, 0 if free else 0.5, 3) / Q0 * (np.arange(3) < num_layers)
    bases = {"half space": gc.HalfSpace(materials[-1]), "rigid": gc.Rigid(), "free": gc.Free()}
    layers = tuple(gc.Layer(m, d) for m, d in zip(materials, thickness, strict=False))
    stack = gc.Stack(layers=layers, base=bases[base])
    closed = (-1.5 if free else -4, np.log10(1.5))
    return Scene(rng, stack, shape, f"{num_layers} layers, {base}, {shape}", closed=closed)


def random_material(rng):
    modulus, poisson = 10 ** rng.uniform(-1.5, 1.5), rng.uniform(0.2, 0.5)
    strengths = modulus * 10 ** rng.uniform(-2, 2, BRANCHES)
    if rng.random() < 0.4:
        strengths = np.full(BRANCHES, 1e-12 * modulus)
    return gc.Prony(modulus, strengths, 10 ** rng.uniform(-5, 5, BRANCHES), poisson)


# hard ---------------------------------------------------------------------------------------

HARD_RTOL = (1e-4, 1e-8)
CONTRASTS = (100.0, 1000.0, 1e4)
CYLINDERS = ((1024, 16), (8192, 64))  # points, and half-widths at rest to the cell
SPEEDS = (0.1, 1.0, 10.0)
HARD_LOADS = (0.01, 0.1)
SHAPES = ((64, 64), (1024,), (81, 64), (729,))
HALF_WIDTH = 0.01  # m


def hard(size=128, count=0, seed=0):
    """Small contacts, moduli far apart; with `--count` random scenes in place of the tables."""
    if count:
        survey("hard--count", hard_scene, count, seed)
        return
    for points, cell in CYLINDERS:
        for contrast in CONTRASTS:
            for speed in SPEEDS:
                name = f"cylinder {points} points, {cell} a, V = {speed:g}"
                row(name, contrast, *cylinder(points, cell, contrast, speed))
    surface = rough_surface(size)
    for num, speed, name in ((1, 5.0, "single"), (10, 1.0, "broad")):
        for contrast in CONTRASTS:
            kernel = gc.stack_kernel(block(contrast, num), surface.grid, speed)
            for load in HARD_LOADS:
                title = f"rough {size}², {name}, p/E_r = {load:g}"
                row(title, contrast, kernel, surface.heights, load)


def row(name, contrast, kernel, heights, load):
    """Reports points in contact, and FFT pairs to each tolerance (!: not reached)."""
    pairs = {}
    for rtol in HARD_RTOL:
        solve = partial(gc.solve_contact, kernel, heights, load, rtol=rtol, throw=False)
        found = solve()
        done = found.result == gc.contacts.RESULTS.successful
        pairs[f"pairs to {rtol:g}"] = f"{float(found.num_fft_pairs):.0f}{'' if done else '!'}"
    report("bench_contact-hard", {
        "scene": name, "contrast": contrast, "points in contact": int(jnp.sum(found.pressure > 0)),
        **pairs, "claimed error at the last": float(found.error),
        "time of the last [s]": timed(solve, 3),
    })  # fmt: skip


def cylinder(points, cell, contrast, speed):
    """Kernel, heights and load: radius and relaxed reduced modulus are 1."""
    length = cell * HALF_WIDTH
    x = (np.arange(points) - points / 2) * length / points
    rubber = gc.Prony.from_creep(contrast, [(contrast - 1) / contrast], [speed * HALF_WIDTH], 0.0)
    kernel = gc.stack_kernel(gc.Stack(base=gc.HalfSpace(rubber)), gc.Grid((points,), length), 1.0)
    return kernel, -(x**2) / 2, np.pi / 4 * HALF_WIDTH**2 / length


def block(contrast, num):
    """A half space of relaxed reduced modulus 1, and of `num` relaxations."""
    times = np.logspace(-5, 4, num) if num > 1 else [1.0]
    rubber = gc.Prony(0.75, np.full(num, 0.75 * (contrast - 1) / num), times, 0.5)
    return gc.Stack(base=gc.HalfSpace(rubber))


def hard_scene(rng, i):
    """A scene of one or ten relaxations of any contrast."""
    shape, contrast = SHAPES[i % len(SHAPES)], 10 ** rng.uniform(0, 4)
    stack = block(contrast, rng.choice([1, 10]))
    name = f"{shape}, contrast {contrast:.0f}"
    return Scene(rng, stack, shape, name, closed=(-6, 0), rms_slope=0.1)
