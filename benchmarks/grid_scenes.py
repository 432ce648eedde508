"""The scenes of `bench_contact.py grid`: kinds of surfaces, blocks, loads and laws."""

from functools import partial

import jax.numpy as jnp
import numpy as np

import graded_contact as gc

CELL = 8e-3  # m
NUMBERS = ("friction", "contact_area", "mean_gap")
HALF_SPACES = "half space", "receding"


def scene_of(kind, number):
    """Returns a function from heights to a contact or None, heights, and the numbers to judge."""
    rng = np.random.default_rng((number, *kind.encode()))
    n, speed = int(rng.choice([32, 64])), 10 ** rng.uniform(-3, 1)
    if kind == "line":
        n *= int(rng.choice([4, 8]))
    heights = sloped(shape_of(kind, n, rng), 10 ** rng.uniform(-1.5, -0.3))
    angle = rng.uniform(0, 2 * np.pi) if heights.ndim == 2 and rng.random() < 0.4 else 0.0
    speed = 0.0 if rng.random() < 0.05 else speed
    velocity = (speed * np.cos(angle), speed * np.sin(angle)) if angle else speed
    block = block_of(rng, kind, speed)
    size = np.std(heights)
    if kind == "attraction":
        law = gc.AdhesiveLJ(range=0.5 * size, work=10 ** rng.uniform(-2, 0.5) * 1e4 * size)
        return solver(block, CELL, velocity, pressure=1e5, law=law), heights, NUMBERS
    full = pressure_in_full_contact(block, heights, velocity)
    low, high = {
        "light": (-2.8, -1.5), "full": (0.25, 0.65), "egg box": (-2.8, 0.2), "ridge": (-2, 0.2)
    }.get(kind, (-2, 0.3))  # fmt: skip
    pressure = full * 10 ** rng.uniform(low, high)
    if kind == "gap":
        found = solver(block, CELL, velocity, pressure=pressure)(heights)
        given = float(found.mean_gap) if found is not None else 1.0
        solve = solver(block, CELL, velocity, mean_gap=given)
        return solve, heights, ("friction", "contact_area", "mean_pressure")
    law = gc.HardWall()
    if kind == "laws":
        soft = gc.RepulsiveLJ(0.05 * size, pressure)
        law = soft if number % 2 else gc.HardWall(hardness=pressure * rng.uniform(2, 8))
    return solver(block, CELL, velocity, pressure=pressure, law=law), heights, NUMBERS


def shape_of(kind, n, rng):
    """Heights of a kind, of no particular size."""
    x = np.arange(n) / n
    if kind == "egg box":
        (a, b), size, (u, v) = rng.integers(1, 3, 2), rng.uniform(0.5, 2), rng.uniform(0, 1, 2)
        wave = np.cos(2 * np.pi * (a * x + u))[:, None]
        return wave + size * np.cos(2 * np.pi * (b * x + v))
    if kind == "ridge":
        way, width = rng.integers(4), rng.uniform(0.08, 0.3)
        if way == 1:
            return np.cos(2 * np.pi * (x[:, None] + x))
        if way == 3:
            return np.exp(-((np.arange(4 * n) / (4 * n) - 0.5) ** 2) / 2 / width**2)
        wave = np.cos(2 * np.pi * x) if way == 0 else np.exp(-((x - 0.5) ** 2) / 2 / width**2)
        return np.broadcast_to(wave[:, None], (n, n))
    if kind == "noise":
        return noise(rng, n, np.inf, hurst=rng.uniform(0, 0.9))
    if kind == "anisotropic":
        return noise(rng, n, n / rng.choice([2, 4, 8]), stretched=rng.choice([0.25, 0.5, 2, 4]))
    if kind == "full":
        return noise(rng, n, rng.choice([np.inf, n / 2 - 0.1, n / 3, n / 4, n / 8]))
    points = {"2": 2, "4": 4, "line": rng.choice([2, 4, 8, 16]), "receding": rng.choice([4, 8])}
    points |= dict.fromkeys(("gap", "laws"), rng.choice([2, 4, 8]))
    return noise(rng, n, n / points.get(kind, 8), ndim=1 if kind == "line" else 2)


def noise(rng, n, cut, hurst=None, stretched=1.0, ndim=2):
    """A self-affine surface with waves up to `cut` of the cell."""
    hurst, roll = rng.uniform(0.5, 0.95) if hurst is None else hurst, rng.choice([1, 2, 4])
    k = np.fft.fftfreq(n, 1 / n)
    q = np.abs(k) if ndim == 1 else np.hypot(k[:, None], stretched * k)
    size = np.where(q <= cut, np.maximum(q, min(roll, cut)) ** (-hurst - ndim / 2), 0)
    size = np.where(q > 0, size, 0)
    return np.fft.ifftn(size * np.fft.fftn(rng.normal(size=(n,) * ndim))).real


def sloped(heights, slope):
    """Heights with this rms slope."""
    surface = gc.Surface(heights, gc.Grid(heights.shape, CELL))
    return heights * slope / float(gc.surfaces.statistics(surface).rms_slope)


def finer(heights, factor):
    """The same waves on more points; a wave of two points is half of each direction."""
    heights = np.asarray(heights)
    for axis, n in enumerate(heights.shape):
        waves = np.moveaxis(np.fft.fft(heights, axis=axis), axis, 0)
        padded = np.zeros((factor * n, *waves.shape[1:]), complex)
        padded[: n // 2], padded[1 - n // 2 :] = waves[: n // 2], waves[n // 2 + 1 :]
        padded[n // 2] = padded[-(n // 2)] = waves[n // 2] / 2
        heights = np.moveaxis(np.fft.ifft(padded, axis=0).real * factor, 0, axis)
    return heights


def block_of(rng, kind, speed):
    """A block: elastic, the tread or a Prony series, most of them bare."""
    way, contrast = rng.integers(5), 10 ** rng.uniform(-0.5, 3)
    time = 10 ** rng.uniform(-6, -1)
    if kind == "receding":  # relaxes while a contact passes
        contrast, way = 10 ** rng.uniform(1, 4), 1
        time = CELL / 10 ** rng.uniform(0.5, 2) / max(speed, 1e-3)
    material = (
        gc.Elastic(1e6, 0.49), gc.Prony(1e6, [contrast * 1e6], [time], 0.49), gc.tyre_tread(),
        gc.Prony(1e6, [0.4e6 * contrast, 0.6e6 * contrast], [time, time / 30], 0.49),
        gc.Prony(2e6, [4e6, 8e6, 2e7], [1e-5, 1e-3, 1e-1], 0.45),
    )[way]  # fmt: skip
    if kind in HALF_SPACES or rng.random() > 0.4:
        return gc.Stack(base=gc.HalfSpace(material))
    coat = gc.Layer(gc.Elastic(10 ** rng.uniform(6, 7.5), 0.49), 10 ** rng.uniform(-4.6, -3.1))
    return gc.Stack(layers=(coat,), base=gc.HalfSpace(material))


def pressure_in_full_contact(block, heights, velocity):
    """The root mean square [Pa] of the varying pressure in full contact."""
    kernel = np.array(gc.stack_kernel(block, gc.Grid(heights.shape, CELL), velocity))
    kernel.flat[0] = np.inf
    waves = np.fft.rfftn(heights) / kernel
    return np.std(np.fft.irfftn(waves, heights.shape))


def solver(block, size, velocity, periodic=True, **given):
    """Returns the function from heights to a contact, None where the solve failed."""

    def solve(heights, **more):
        surface = gc.Surface(heights, gc.Grid(heights.shape, size), periodic=periodic)
        found = gc.slide(block, surface, velocity=velocity, throw=False, **given, **more)
        return found if found.result == gc.contacts.RESULTS.successful else None

    return solve


def window(number):
    rng = np.random.default_rng((number, 2))
    radius, wave = 10 ** rng.uniform(-2, -1), 2 * np.pi / CELL * rng.integers(2, 8)

    def heights(factor):
        n = 64 * factor
        x = ((jnp.arange(n) + 0.5) / n - 0.5) * CELL
        x, y = x[:, None], x[None, :]
        sphere = -(x**2 + y**2) / (2 * radius)
        if number % 3 == 2:
            inside = (jnp.abs(x) < CELL / 4) & (jnp.abs(y) < CELL / 4)
            return jnp.where(inside, 0.0, -1e-4)
        ripple = jnp.cos(wave * x) * jnp.cos(wave * y) * 0.1 / wave
        return sphere + (number % 3) * ripple

    pressure, speed = 10 ** rng.uniform(4, 5.5), 10 ** rng.uniform(-3, 1)
    block = block_of(rng, "window", speed)
    return solver(block, CELL, speed, periodic=False, pressure=pressure), heights


def measured(number, files):
    rng = np.random.default_rng((number, 3))
    surface = gc.read_surface(files[number % len(files)])
    spacing, heights = np.asarray(surface.grid.spacing), np.asarray(surface.heights)
    side = min(64, min(heights.shape) // 2 * 2)
    corner = [rng.integers(0, n - side + 1) for n in heights.shape]
    part = heights[tuple(slice(c, c + side) for c in corner)]
    taper = np.sqrt(np.hanning(side + 1)[:-1])
    part = jnp.asarray((part - part.mean()) * np.outer(taper, taper))
    size = spacing * side
    slope = gc.surfaces.statistics(gc.Surface(part, gc.Grid(part.shape, size))).rms_slope
    pressure = 10 ** rng.uniform(-2.5, -0.7) * float(slope) * 1e7
    speed = 10 ** rng.uniform(-3, 1) * size[0] / CELL
    block = block_of(rng, "measured", speed)
    return solver(block, size, speed, pressure=pressure), partial(finer, part)
