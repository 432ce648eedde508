"""More about contact: laws, solvers (custom ones too), loading paths, cut-off curves."""

from .contact.adhesion import AdhesiveLJ, ExponentialAdhesion
from .contact.douglas_rachford import DouglasRachford
from .contact.law import AbstractLaw, HardWall, RepulsiveLJ
from .contact.observables import cumulative_friction
from .contact.path import ContactPath, follow_contact
from .contact.rmd import ResidualDynamics
from .contact.solution import RESULTS
from .contact.solver import AbstractContactSolver
from .friction.magnification import area_against_cutoff
from .persson.mean_field import MeanField, pressure_distribution
from .roughness.spectrum import CutoffCurve

__all__ = [
    "RESULTS", "AbstractContactSolver", "AbstractLaw", "AdhesiveLJ", "ContactPath", "CutoffCurve",
    "DouglasRachford", "ExponentialAdhesion", "HardWall", "MeanField", "RepulsiveLJ",
    "ResidualDynamics", "area_against_cutoff", "cumulative_friction", "follow_contact",
    "pressure_distribution",
]  # fmt: skip
