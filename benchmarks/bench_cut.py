"""The error of a part of a rough surface, made periodic, compared with the whole surface.

    python benchmarks/bench_cut.py

Parts are cut at random from known surfaces: random periodic ones four times as long as the part,
whose spectrum rolls off at 24, 8 or 1 waves per length of the whole, and with `--data FOLDER`
measured ones, whose reference is the mirrored whole. Each part is levelled and made periodic by
each choice of `surface_from_heights`, and left as it is ("cut"). A tyre tread slides over it. The
benchmark prints the bias of friction, contact area and rms slope against the whole [%] with its
standard error, and the standard deviation of the parts; 200 parts of each kind.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from rows import report, run

import graded_contact as gc

PART, PARTS, WHOLES = 96, 200, 8
PRESSURES = (5e4, 5e5)  # areas of 4 and 40 % on a rms slope of 0.1
WAYS = ("harmonic", "mirror", "window", "cut")
MEASURED = {
    "belgian_block_open.npz": {"unit": "m", "size": (5.0, 3.08)},
    "matrix-3.txt": {},
    "tmd-1.tmd": {},
    "di-5.di": {},
}
STACK = gc.Stack(base=gc.HalfSpace(gc.tyre_tread()))


class Whole(NamedTuple):
    """A surface, and heights [m] from which parts are cut, at the same spacing [m]."""

    surface: gc.Surface
    heights: np.ndarray
    spacing: float
    wraps: bool

    def part(self, rng: np.random.Generator) -> np.ndarray:
        room = [n if self.wraps else n - PART + 1 for n in self.heights.shape]
        rolled = np.roll(self.heights, [-rng.integers(n) for n in room], range(len(room)))
        return rolled[(slice(PART),) * len(room)]


def drawn(roll_off: int, ndim: int = 2) -> Iterator[Whole]:
    """Random surfaces of rms slope 0.1 and their own length of 4 mm."""
    grid, unit = gc.Grid((4 * PART,) * ndim, 4e-3), 2 * np.pi / 4e-3
    spectrum = gc.SelfAffine(
        rms_slope=0.1, hurst=0.8, q_low=unit, q_roll=roll_off * unit, q_high=PART * unit
    )
    for seed in range(WHOLES):
        surface = gc.random_surface(spectrum, grid, jax.random.key(seed))
        yield Whole(surface, np.asarray(surface.heights), 4e-3 / (4 * PART), wraps=True)


def measured(folder: Path) -> Iterator[Whole]:
    """Measured surfaces, scaled to a rms slope of 0.1 and a spacing of 10 µm."""
    for name, options in MEASURED.items():
        mirrored = gc.read_surface(folder / name, periodic="mirror", **options)
        grid = gc.Grid(mirrored.grid.shape, 1e-5 * np.array(mirrored.grid.shape))
        surface = gc.surfaces.rescale(gc.Surface(mirrored.heights, grid), rms_slope=0.1)
        tile = tuple(slice(n // 2) for n in grid.shape)
        yield Whole(surface, np.asarray(surface.heights)[tile], 1e-5, wraps=False)


def closed(part: np.ndarray, spacing: float, way: str) -> gc.Surface:
    size = spacing * np.array(part.shape)
    if way != "cut":
        return gc.surfaces.surface_from_heights(part, size, periodic=way)
    mirrored = gc.surfaces.surface_from_heights(part, size, periodic="mirror")
    levelled = mirrored.heights[tuple(slice(n) for n in part.shape)]
    return gc.Surface(levelled - jnp.mean(levelled), gc.Grid(part.shape, size))


@eqx.filter_jit
def _numbers(heights, size, pressure):
    surface = gc.Surface(heights, gc.Grid(heights.shape, size))
    found = gc.slide(STACK, surface, pressure=pressure, velocity=1.0, rtol=1e-3, throw=False)
    slope = gc.surfaces.statistics(surface).rms_slope
    return jnp.stack([found.friction, found.contact_area, slope])


def numbers(surface: gc.Surface, pressure: float) -> np.ndarray:
    return np.asarray(_numbers(surface.heights, surface.grid.size, jnp.array(pressure)))


def measure(name: str, wholes: Callable[[], Iterator[Whole]], pressure: float) -> None:
    found: dict[str, list[np.ndarray]] = {way: [] for way in WAYS}
    sources = list(wholes())
    rng = np.random.default_rng(0)
    for whole in sources:
        truth = numbers(whole.surface, pressure)
        for _ in range(PARTS // len(sources)):
            part = whole.part(rng)
            for way in WAYS:
                here = numbers(closed(part, whole.spacing, way), pressure)
                found[way].append(100 * (here / truth - 1))
    for way, parts in found.items():
        row: dict[str, str | float] = {
            "surface": name,
            "pressure [kPa]": pressure / 1e3,
            "way": way,
        }
        for column, of in zip(("friction", "area", "slope"), np.transpose(parts), strict=True):
            row[f"{column} [%]"] = f"{np.mean(of):+.1f} ± {np.std(of) / np.sqrt(len(of)):.1f}"
            row[f"{column}, scatter [%]"] = float(np.std(of))
        report("bench_cut", row)


def cut(data: str | None = None) -> None:
    """Random surfaces, and the measured ones in the folder `--data`."""
    for pressure in PRESSURES:
        for roll_off in (24, 8, 1):
            measure(f"roll-off at {roll_off} waves", lambda n=roll_off: drawn(n), pressure)
        measure("profile, roll-off at 24 waves", lambda: drawn(24, 1), pressure)
        if data is not None:
            measure("measured", lambda: measured(Path(data)), pressure)


if __name__ == "__main__":
    run(__doc__, cut)
