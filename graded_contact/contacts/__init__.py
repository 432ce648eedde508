"""The contact of a solid, given by its kernel, with a rigid surface: laws, solvers, errors.

No file of this room knows layers.
"""

from .adhesion import AdhesiveLJ, ExponentialAdhesion
from .law import AbstractLaw, HardWall, RepulsiveLJ
from .operators.operator import AbstractOperator, Solid, Steady
from .solution import RESULTS, ContactSolution
from .solve import solve_contact
from .solver.abstract_solver import AbstractContactSolver, Loading, SolverOutput, run_steps
from .solver.nested_solve import DouglasRachford
from .solver.rmd import ResidualDynamics
from .solver.splitting import Splitting

__all__ = [
    "RESULTS", "AbstractContactSolver", "AbstractLaw", "AbstractOperator", "AdhesiveLJ",
    "ContactSolution", "DouglasRachford", "ExponentialAdhesion", "HardWall",
    "Loading", "RepulsiveLJ", "ResidualDynamics", "Solid", "SolverOutput",
    "Splitting", "Steady", "run_steps", "solve_contact",
]  # fmt: skip
