"""Contact of a rough rigid surface with a solid given by its kernel. Knows no layers.

For custom solvers and laws this namespace has what they return and need.
"""

from .adjoint import LinearSplitting
from .law import AbstractLaw
from .operator import Solid
from .solver import AbstractContactSolver, Loading, SolverOutput, run_steps
from .splitting import Splitting
from .target import ObservableTarget

__all__ = [
    "AbstractContactSolver",
    "AbstractLaw",
    "LinearSplitting",
    "Loading",
    "ObservableTarget",
    "Solid",
    "SolverOutput",
    "Splitting",
    "run_steps",
]
