"""Where the surfaces of a scene come from: [surface], [block_surface] and [grid]."""

from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

import jax
import numpy as np
from jaxtyping import ArrayLike, PRNGKeyArray

from ..core.checks import check_values, check_whole, within
from ..core.display import shown
from ..core.memory import check_points
from ..fields.grid import Grid
from ..readers.topography import read_surface
from ..surfaces.joined_spectrum import joined_spectrum, scan_spectrum
from ..surfaces.random_surface import CUT, random_surface
from ..surfaces.rescaling import rescale
from ..surfaces.spectrum import SelfAffine
from ..surfaces.spectrum_table import Spectrum, SpectrumTable
from ..surfaces.surface import Surface
from .schema import ROOT, Key, TableReader, keys_of, kind_of


@shown()
class RandomSurface(NamedTuple):
    """A surface to be drawn: arguments of `random_surface`, with the seed of its key.

    **Fields:**

    - `spectrum`, `grid`: of the surface.
    - `seed`: of the random surface, or of the first.
    - `amplitudes`: as in `random_surface`.
    - `seeds`: number of surfaces, drawn from `seed`, `seed` + 1, ...; one axis of the results.
    """

    spectrum: Spectrum
    grid: Grid
    seed: int = 0
    amplitudes: Literal["exact", "gaussian"] = "exact"
    seeds: int | None = None

    def build(self) -> Surface:
        """Returns the (first) surface, drawn anew; the same one each time."""
        with within("[surface]"):
            return self.drawn(self.seed)

    def drawn(self, seed: ArrayLike) -> Surface:
        """Returns the surface of another seed, which JAX may trace."""
        return self.of_key(jax.random.key(seed))

    def of_key(self, key: PRNGKeyArray) -> Surface:
        """Returns the surface of a random key."""
        try:
            return random_surface(self.spectrum, self.grid, key, amplitudes=self.amplitudes)
        except ValueError as error:
            raise ValueError(str(error).replace(CUT, " in [surface]")) from error


@shown(unset=False)
class SurfaceFile(NamedTuple):
    """A surface to be read: arguments of `read_surface` and of `rescale`."""

    arguments: dict[str, Any]
    target: dict[str, float]

    def build(self) -> Surface:
        """Returns the surface, read and rescaled."""
        with within("[surface]"):
            surface = read_surface(**self.arguments)
            return rescale(surface, **self.target) if self.target else surface


# Of the window's length: the heights -r²/(2R) of a smaller sphere are no sphere's.
LEAST_RADIUS = 1e-3


@shown()
class Sphere(NamedTuple):
    """A smooth sphere on a window; on a grid in one dimension, a cylinder.

    **Fields:**

    - `radius`: R [m]; the heights are those of Hertz's theory, -r²/(2R).
    - `grid`: the window.
    """

    radius: float
    grid: Grid

    def build(self) -> Surface:
        """Returns the surface, highest in the middle of the window."""
        grid = self.grid
        # Symmetric about the middle, where an even number has no point.
        axes = [
            (np.arange(n) - (n - 1) / 2) * dx
            for n, dx in zip(grid.shape, np.asarray(grid.spacing), strict=True)
        ]
        squared = sum(x**2 for x in np.meshgrid(*axes, indexing="ij"))
        return Surface(-squared / (2 * self.radius), grid, periodic=False)


# Of one scan: how it is read, and what of it counts. It is called as its file, unless named.
SCAN = {
    read_surface: keys_of(read_surface),
    scan_spectrum: tuple(
        key._replace(default=None) if key.name == "name" else key
        for key in keys_of(scan_spectrum, "surface")
    ),
}


def spectrum_of_scans(
    reader: TableReader,
    grid: Grid,
    scans: list[dict],
    q_high: float,
    q_low: float | None = None,
) -> SpectrumTable:
    """Returns the spectrum of files, cut to what a grid has.

    **Arguments:**

    - `reader`, `grid`: of the scene, and of the surface.
    - `scans`: tables [[surface.scans]], at least one, lines and areas at any magnification.
    - `q_high`: highest wavenumber [rad/m], at most what the scans have.
    - `q_low`: lowest wavenumber [rad/m], see `SelfAffine`.
    """
    found = []
    for i, table in enumerate(scans):
        place = f"[surface.scans[{i}]]"
        reading, counts = reader.arguments(place, table, *SCAN.values())
        counts.setdefault("name", reading["path"].name)
        with within(place):
            found.append(scan_spectrum(read_surface(**reading), **counts))
    with within("[surface]"):
        spectrum = joined_spectrum(found).spectrum
        longest = max(2 * np.pi / float(np.max(grid.size)), float(spectrum.q_low))
        return spectrum.between(longest if q_low is None else q_low, q_high)


SURFACES: dict[str, Mapping[Callable, tuple[Key, ...]]] = {
    "self_affine": {
        SelfAffine: tuple(
            key._replace(default=None) if key.name == "q_low" else key
            for key in keys_of(SelfAffine)
        ),
        RandomSurface: keys_of(RandomSurface, "spectrum", "grid"),
    },
    "sphere": {Sphere: keys_of(Sphere, "grid")},
    "scans": {
        spectrum_of_scans: keys_of(spectrum_of_scans, "reader", "grid"),
        RandomSurface: keys_of(RandomSurface, "spectrum", "grid"),
    },
    "file": {read_surface: keys_of(read_surface), rescale: keys_of(rescale, "surface")},
}


# The block's own surface rests on the block: it is no window, and no axis of the results.
OF_BLOCK = {
    "self_affine": {
        SelfAffine: SURFACES["self_affine"][SelfAffine],
        # Another surface than [surface] with the same spectrum.
        RandomSurface: tuple(
            key._replace(default=1) if key.name == "seed" else key
            for key in keys_of(RandomSurface, "spectrum", "grid", "seeds")
        ),
    },
    "file": SURFACES["file"],
}


def surface_of_block(
    table: dict[str, Any], own: Grid | None, surface: Any, reader: TableReader
) -> RandomSurface | SurfaceFile:
    """Returns where the block's own surface comes from, by its table [block_surface].

    `own` is the [grid] of the scene, or None for a `surface` from a file.
    """
    is_file = isinstance(table, dict) and table.get("kind") == "file"
    grid = None if is_file else own
    if not is_file and grid is None:
        grid = surface.build().grid
    return surface_source(table, grid, reader, "[block_surface]", OF_BLOCK)


def surface_source(
    table: dict[str, Any],
    grid: Grid | None,
    reader: TableReader,
    place: str = "[surface]",
    kinds: Mapping[str, Mapping[Callable, tuple[Key, ...]]] = SURFACES,
) -> Any:
    """Returns where a surface of a scene comes from, by its table and [grid].

    A `RandomSurface`, a `SurfaceFile` or a `Sphere`.
    """
    kind, entries = kind_of(place, table, kinds)
    keys = [*kinds[kind].values()]
    if kind == "file":
        if grid is not None:
            raise ValueError(
                '[grid] is not for surfaces of kind "file"; `shape` in [surface] sets the number '
                "of points of a file."
            )
        return SurfaceFile(*reader.arguments(place, entries, *keys))
    if grid is None:
        raise ValueError(f"{ROOT} lacks the key `grid`.")
    if kind == "sphere":
        (sphere,) = reader.arguments(place, entries, *keys)
        with within(place):
            least = LEAST_RADIUS * float(np.max(grid.size))
            allowed = f"[m] must be at least {LEAST_RADIUS:g} of the window's length, {least:.2g} m"
            check_values("radius", sphere["radius"], f"a radius {allowed}", at_least=least)
        return Sphere(**sphere, grid=grid)
    spectrum, drawn = reader.arguments(place, entries, *keys)
    if kinds is OF_BLOCK:
        drawn.setdefault("seed", 1)
    if kind == "scans":
        made = spectrum_of_scans(reader, grid, **spectrum)
    else:
        # Unless given, the longest wave is as long as the longest edge.
        spectrum.setdefault("q_low", 2 * np.pi / float(np.max(grid.size)))
        with within(place):
            made = SelfAffine(**spectrum)
    with within(place):
        found = RandomSurface(made, grid, **drawn)
        if found.seeds is not None:
            check_whole("seeds", found.seeds, 1)
            check_points("seeds", found.seeds)
    return found
