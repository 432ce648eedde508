"""What a scene or a design takes before it is run: memory and contact solves."""

from typing import NamedTuple

from ..core.display import shown
from ..core.memory import available_memory, in_gigabytes


@shown()
class Cost(NamedTuple):
    """Estimated cost.

    **Fields:**

    - `shape`: of the grid.
    - `memory`: at the peak [bytes].
    - `num_solves`: contacts solved.
    """

    shape: tuple[int, ...]
    memory: float
    num_solves: int

    def report(self) -> str:
        """Returns the cost as text."""
        free = available_memory()
        beside = "" if free is None else f", {in_gigabytes(free)} are free"
        rows = {
            "grid": f"{' x '.join(map(str, self.shape))} points",
            "memory": f"about {in_gigabytes(self.memory)}{beside}",
            "contact solves": self.num_solves,
        }
        return "\n".join(f"{name:22} {text}" for name, text in rows.items())
