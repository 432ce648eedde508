"""The cost of a scene before it is run: memory, solves, seconds.

Seconds are right to a factor of about four: bodies need different numbers of transforms, and
machines differ in speed. On two cores an FFT pair, with the work around it, takes `_PER_POINT` for
each point of the grid.
"""

from typing import NamedTuple

import numpy as np

from ..core.display import shown
from ..core.memory import available_memory, in_gigabytes, memory_of
from ..sliding.shear import Coulomb, is_coupled
from .run_scene import build_surface, scene_fields
from .scene import Scene
from .surface_source import RandomSurface

_PER_POINT = 25e-9  # s for each point of the grid and FFT pair
_PER_PAIR = 1e-4  # s for each FFT pair, on any grid
_PAIRS = 15  # for each digit of the pressure
# FFT pairs over those of one contact: 1.8 to 4.7 with a traction that is lagged, 1.7 to 3.1 with
# heat. The heat in the block, and its temperatures, take 1e-4 s for each point of the surface.
_LAGGED, _HEATED, _PER_HEATED_POINT = 3.0, 2.5, 7e-5
_COMPILING = 20.0  # s


@shown()
class Cost(NamedTuple):
    """Estimated cost.

    **Fields:**

    - `shape`: of the grid.
    - `memory`: at the peak [bytes].
    - `num_solves`: contacts solved, those for derivatives included.
    - `seconds`: roughly, all solves and compilation included [s]; None if unknown.
    """

    shape: tuple[int, ...]
    memory: float
    num_solves: int
    seconds: float | None = None

    def report(self) -> str:
        """Returns the cost as text."""
        free = available_memory()
        beside = "" if free is None else f", {in_gigabytes(free)} are free"
        return (
            f"{'grid':22} {' x '.join(map(str, self.shape))} points\n"
            f"{'memory':22} about {in_gigabytes(self.memory)}{beside}\n"
            f"{'contact solves':22} {self.num_solves}"
            + (
                ""
                if self.seconds is None
                else f"\n{'time':22} about {_span(self.seconds)} on two cores"
            )
        )


def scene_cost(scene: Scene) -> Cost:
    """Returns the cost of running a scene; a surface from a file is read for its shape."""
    shape = _shape(scene)
    num_solves = scene.num_solves * (2 if scene.errors else 1)
    seconds = _COMPILING + num_solves * _seconds(scene, shape)
    return Cost(shape, memory_of(scene_fields(scene), shape), num_solves, seconds)


def _shape(scene: Scene) -> tuple[int, ...]:
    source = scene.surface
    if isinstance(source, RandomSurface):
        return source.grid.shape
    return build_surface(scene).grid.shape


def _seconds(scene: Scene, shape: tuple[int, ...]) -> float:
    """Seconds of one solve."""
    pairs, points = -_PAIRS * np.log10(scene.rtol), np.prod(shape, dtype=float)
    in_kernel = isinstance(scene.shear, Coulomb) and scene.motion is None
    if is_coupled(scene.shear) and not in_kernel:
        pairs *= _LAGGED
    heat = 0.0
    if scene.heating is not None:
        pairs, heat = _HEATED * pairs, _PER_HEATED_POINT * points
    return float(pairs * (_PER_PAIR + _PER_POINT * scene.num_times * points) + heat)


def _span(seconds: float) -> str:
    for unit, length in (("days", 86400), ("hours", 3600), ("minutes", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.2g} {unit}"
    return f"{seconds:.2g} s"
