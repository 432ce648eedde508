"""The cost of a scene or a design before it is run: memory, solves, seconds.

Seconds are right to a factor of about four: bodies need different numbers of transforms, and
machines differ in speed. On two cores an FFT pair, with the work around it, takes `_PER_POINT` for
each point of the grid.
"""

from typing import NamedTuple

import numpy as np

from ..core.display import shown
from ..core.memory import available_memory, in_gigabytes, memory_of
from ..sliding.shear import Coulomb, is_coupled
from .design_scene import DesignScene
from .design_search import CONTACT_STARTS, STARTS, design_fields
from .run_design import POLISHING
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
_PER_EVALUATION = 0.02  # s of the mean field at a velocity, with its derivatives
_EVALUATIONS = 30  # of a start


@shown()
class Cost(NamedTuple):
    """Estimated cost.

    **Fields:**

    - `shape`: of the grid.
    - `memory`: at the peak [bytes].
    - `num_solves`: contacts solved, those for derivatives included.
    - `seconds`: roughly, all solves and compilation included [s].
    """

    shape: tuple[int, ...]
    memory: float
    num_solves: int
    seconds: float

    def report(self) -> str:
        """Returns the cost as text."""
        free = available_memory()
        beside = "" if free is None else f", {in_gigabytes(free)} are free"
        return (
            f"{'grid':22} {' x '.join(map(str, self.shape))} points\n"
            f"{'memory':22} about {in_gigabytes(self.memory)}{beside}\n"
            f"{'contact solves':22} {self.num_solves}\n"
            f"{'time':22} about {_span(self.seconds)} on two cores, within a factor of four"
        )


def scene_cost(scene: Scene) -> Cost:
    """Returns the cost of running a scene; a surface from a file is read for its shape."""
    shape = _shape(scene)
    num_solves = scene.num_solves * (2 if scene.errors else 1)
    seconds = _COMPILING + num_solves * _seconds(scene, shape)
    return Cost(shape, memory_of(scene_fields(scene), shape), num_solves, seconds)


def design_cost(study: DesignScene) -> Cost:
    """Returns the cost of a design."""
    scene, verify, num_velocities = study.scene, study.verify, study.scene.velocity.size
    starts = study.starts or STARTS
    seconds = _COMPILING + starts * _EVALUATIONS * num_velocities * _PER_EVALUATION
    if not (verify or study.quantities):
        return Cost(_shape(scene), 0.0, 0, seconds)
    shape, source = _shape(scene), scene.surface
    num_solves = verify * num_velocities * (3 if study.polish else 2)
    if study.polish:
        # The start, and each evaluation with a derivative, which takes another solve.
        num_solves += verify * num_velocities * (1 + 2 * POLISHING)
    elif study.quantities:
        # A search by contact: the mean field seldom makes it needless.
        seeds = (source.seeds or 1) if isinstance(source, RandomSurface) else 1
        starts = study.starts or CONTACT_STARTS
        num_solves += seeds * num_velocities * starts * 2 * POLISHING
    seconds += _COMPILING * (1 + 2 * study.polish) + num_solves * _seconds(scene, shape)
    fields = design_fields(study, searched=bool(study.quantities))
    return Cost(shape, memory_of(fields, shape), num_solves, seconds)


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
