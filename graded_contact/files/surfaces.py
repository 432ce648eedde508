"""Where the surface of a scene comes from: drawn from a spectrum, or read from a file."""

from typing import Any, Literal, NamedTuple

import jax
import numpy as np
from jaxtyping import ArrayLike

from ..core.checks import check_whole
from ..core.display import shown
from ..core.memory import check_points
from ..fields.grid import Grid
from ..roughness.spectrum import SelfAffine
from ..roughness.surface import Surface, random_surface, rescale
from .signatures import Builder, keys_of
from .toml import Section, within
from .topography.reading import read_surface


@shown()
class RandomSurface(NamedTuple):
    """A surface to be drawn: arguments of `random_surface`, with the seed of its key.

    With `seeds` there are as many, drawn from `seed`, `seed` + 1, ...
    """

    spectrum: SelfAffine
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
        key = jax.random.key(seed)
        return random_surface(self.spectrum, self.grid, key, amplitudes=self.amplitudes)


@shown()
class SurfaceFile(NamedTuple):
    """A surface to be read: arguments of `read_surface` and of `rescale`."""

    arguments: dict[str, Any]
    target: dict[str, float]

    def build(self) -> Surface:
        """Returns the surface, read and rescaled."""
        with within("[surface]"):
            surface = read_surface(**self.arguments)
            return rescale(surface, **self.target) if self.target else surface


def parse_surface(scene: Section, builder: Builder) -> RandomSurface | SurfaceFile:
    """Returns where the surface of a scene comes from, see `scene.py` for the keys."""
    target = ("rms_height", "rms_slope")
    keys = {
        "self_affine": (*keys_of(SelfAffine), "seed", "amplitudes", "seeds"),
        "file": (*keys_of(read_surface), *target),
    }
    section, kind = Section.of_kind("[surface]", scene.get("surface"), keys)
    if kind == "self_affine":
        grid = builder.build(Section("[grid]", scene.get("grid"), keys_of(Grid)), Grid)
        # Unless given, the longest wave is as long as the longest edge.
        whole = {"q_low": 2 * np.pi / float(np.max(grid.size)), **section.content}
        spectrum = builder.build(Section(section.place, whole, whole), SelfAffine)
        found = builder.build(section, RandomSurface, spectrum=spectrum, grid=grid)
        if found.seeds is not None:
            with within(section.place):
                check_whole("seeds", found.seeds, 1)
                check_points("seeds", found.seeds)
        return found
    if "grid" in scene.content:
        raise ValueError(
            '[grid] belongs to a surface of kind "self_affine"; the points of a file are '
            "resampled by `shape` in [surface]."
        )
    if all(key in section.content for key in target):
        raise ValueError("[surface] takes `rms_height` or `rms_slope` to rescale to, not both.")
    arguments = builder.arguments(section, read_surface)
    return SurfaceFile(arguments, builder.arguments(section, rescale, given=("surface",)))
