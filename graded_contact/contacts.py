"""More about contact: laws, solvers, cut-off curves, stiffness, flow through the gap, tables of
friction, parts of custom solvers."""

from .contact.adhesion import AdhesiveLJ, ExponentialAdhesion
from .contact.adjoint import LinearSplitting
from .contact.law import AbstractLaw, HardWall, RepulsiveLJ
from .contact.nested_solve import DouglasRachford
from .contact.operator import AbstractOperator, Solid, Steady
from .contact.path import ContactPath, follow_contact
from .contact.rmd import ResidualDynamics
from .contact.solution import RESULTS
from .contact.solver import AbstractContactSolver, Loading, SolverOutput, run_steps
from .contact.splitting import Splitting
from .files.friction_cards import export_friction
from .friction.gap_flow import GapFlow, gap_flow
from .friction.heat import heat_depths, heat_source
from .friction.heating import Heating, flash_temperature
from .friction.magnification import area_against_cutoff, cumulative_friction
from .friction.numerics import Numerics
from .friction.stiffness import contact_conductance, contact_stiffness
from .persson.mean_field import MeanField, pressure_distribution
from .rheology.shear import AbstractShear, ConstantShear, PeakedShear
from .roughness.cutoff import CutoffCurve
from .studies.friction_table import friction_table

__all__ = [
    "RESULTS", "AbstractContactSolver", "AbstractLaw", "AbstractOperator", "AbstractShear",
    "AdhesiveLJ", "ConstantShear", "ContactPath", "CutoffCurve", "DouglasRachford",
    "ExponentialAdhesion", "GapFlow", "HardWall", "Heating", "LinearSplitting", "Loading",
    "MeanField", "Numerics", "PeakedShear", "RepulsiveLJ", "ResidualDynamics", "Solid",
    "SolverOutput", "Splitting", "Steady", "area_against_cutoff", "contact_conductance",
    "contact_stiffness", "cumulative_friction", "export_friction", "flash_temperature",
    "follow_contact", "friction_table", "gap_flow", "heat_depths", "heat_source",
    "pressure_distribution", "run_steps",
]  # fmt: skip
