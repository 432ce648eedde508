"""More about contact: stiffness, flow through the gap, laws, loading paths, cut-off curves.

And solvers, and parts of custom ones.
"""

from .contact.adhesion import AdhesiveLJ, ExponentialAdhesion
from .contact.adjoint import LinearSplitting
from .contact.law import AbstractLaw, HardWall, RepulsiveLJ
from .contact.nested_solve import DouglasRachford
from .contact.observables import cumulative_friction
from .contact.operator import Solid
from .contact.path import ContactPath, follow_contact
from .contact.rmd import ResidualDynamics
from .contact.solution import RESULTS
from .contact.solver import AbstractContactSolver, Loading, SolverOutput, run_steps
from .contact.splitting import Splitting
from .contact.target import ObservableTarget
from .friction.gap_flow import GapFlow, gap_flow
from .friction.magnification import area_against_cutoff
from .friction.stiffness import contact_conductance, contact_stiffness
from .persson.mean_field import MeanField, pressure_distribution
from .roughness.spectrum import CutoffCurve

__all__ = [
    "RESULTS", "AbstractContactSolver", "AbstractLaw", "AdhesiveLJ", "ContactPath", "CutoffCurve",
    "DouglasRachford", "ExponentialAdhesion", "GapFlow", "HardWall", "LinearSplitting", "Loading",
    "MeanField", "ObservableTarget", "RepulsiveLJ", "ResidualDynamics", "Solid", "SolverOutput",
    "Splitting", "area_against_cutoff", "contact_conductance", "contact_stiffness",
    "cumulative_friction", "follow_contact", "gap_flow", "pressure_distribution", "run_steps",
]  # fmt: skip
