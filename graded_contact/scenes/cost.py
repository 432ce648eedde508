"""What a design takes before it is run: memory and contact solves."""

from typing import NamedTuple

from ..core.display import shown
from ..core.memory import memory_of
from .design_scene import DesignScene
from .design_search import CONTACT_STARTS, design_fields
from .plan import cost_text
from .run_design import POLISHING
from .surface_source import RandomSurface


@shown()
class Cost(NamedTuple):
    """Estimated cost.

    **Fields:**

    - `shape`: of the grid.
    - `memory`: at the peak [bytes].
    - `num_solves`: contacts solved, those for derivatives included.
    """

    shape: tuple[int, ...]
    memory: float
    num_solves: int

    def report(self) -> str:
        """Returns the cost as text."""
        return cost_text(*self)


def design_cost(study: DesignScene) -> Cost:
    """Returns the cost of a design."""
    verify, num_velocities = study.verify, study.scene.velocity.size
    shape, source = study.grid.shape, study.scene.surface
    if not (verify or study.quantities):
        return Cost(shape, 0.0, 0)
    num_solves = verify * num_velocities * (3 if study.polish else 2)
    if study.polish:
        # The start, and each evaluation with a derivative, which takes another solve.
        num_solves += verify * num_velocities * (1 + 2 * POLISHING)
    elif study.quantities:
        # A search by contact: the mean field seldom makes it needless.
        seeds = (source.seeds or 1) if isinstance(source, RandomSurface) else 1
        num_solves += seeds * num_velocities * (study.starts or CONTACT_STARTS) * 2 * POLISHING
    fields = design_fields(study, searched=bool(study.quantities))
    return Cost(shape, memory_of(fields, shape), num_solves)
