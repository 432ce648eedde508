"""Rough contact and friction of layered and graded viscoelastic solids, differentiable, in JAX.

Data flows one way: material -> stack -> response -> contact -> observables. The main job is
`slide`. SI units everywhere; `docs/theory.md` and the module docstrings state conventions.
"""

from .contact.adhesion import AdhesiveLJ, ExponentialAdhesion
from .contact.douglas_rachford import DouglasRachford
from .contact.law import HardWall, RepulsiveLJ
from .contact.observables import cumulative_friction
from .contact.path import ContactPath, follow_contact
from .contact.problem import RESULTS, ContactSolution, solve_contact
from .contact.rmd import ResidualDynamics
from .contact.solver import AbstractContactSolver
from .cutoff import CutoffCurve
from .files.moduli.reading import Measured, read_moduli
from .files.prony_cards import export_prony
from .files.topography.reading import read_surface
from .fitting.master import MasterCurve, master_curve
from .fitting.prony import fit_creep, fit_prony, fit_relaxation
from .fitting.result import PronyFit
from .grid import Grid
from .persson.mean_field import MeanField, mean_field_friction, pressure_distribution
from .response.compliance import (
    effective_modulus,
    graded_compliance,
    layered_compliance,
    surface_compliance,
)
from .response.interior import interface_depths, interior_fields, stress_field, von_mises
from .response.kernel import kernel_table, stack_kernel
from .response.layering import Layering, sliced
from .response.matrix import surface_compliance_matrix
from .response.profile import Aged, Blend, Mixture
from .response.riccati import Riccati
from .response.shape import ErrorFunction, Exponential, Linear, PowerLaw, Sinusoidal
from .response.stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack
from .rheology.library import tyre_tread
from .rheology.material import BulkShear, Elastic, Prony
from .rheology.measured import MeasuredRange, coverage
from .rheology.shift import WLF, Arrhenius
from .rheology.tabulated import Tabulated
from .rheology.tabulated_shift import TabulatedShift
from .sliding import Sliding, area_against_cutoff, slide
from .spectrum import SelfAffine
from .surface import Surface, radial_spectrum, random_surface, resample, rescale, statistics

__version__ = "0.1.0"
from .parameters import with_values
from .studies.alternatives import pareto_front, rounded, scatter
from .studies.design import Design, minimise
from .studies.objectives import loss_tangent

__all__ = [
    "RESULTS",
    "WLF",
    "AbstractContactSolver",
    "AdhesiveLJ",
    "Aged",
    "Arrhenius",
    "Blend",
    "BulkShear",
    "ContactPath",
    "ContactSolution",
    "CutoffCurve",
    "Design",
    "DouglasRachford",
    "Elastic",
    "ErrorFunction",
    "Exponential",
    "ExponentialAdhesion",
    "Free",
    "GradedLayer",
    "Grid",
    "HalfSpace",
    "HardWall",
    "Layer",
    "Layering",
    "Linear",
    "MasterCurve",
    "MeanField",
    "Measured",
    "MeasuredRange",
    "Mixture",
    "PowerLaw",
    "Prony",
    "PronyFit",
    "RepulsiveLJ",
    "ResidualDynamics",
    "Riccati",
    "Rigid",
    "SelfAffine",
    "Sinusoidal",
    "Sliding",
    "Stack",
    "Surface",
    "Tabulated",
    "TabulatedShift",
    "area_against_cutoff",
    "coverage",
    "cumulative_friction",
    "effective_modulus",
    "export_prony",
    "fit_creep",
    "fit_prony",
    "fit_relaxation",
    "follow_contact",
    "graded_compliance",
    "interface_depths",
    "interior_fields",
    "kernel_table",
    "layered_compliance",
    "loss_tangent",
    "master_curve",
    "mean_field_friction",
    "minimise",
    "pareto_front",
    "pressure_distribution",
    "radial_spectrum",
    "random_surface",
    "read_moduli",
    "read_surface",
    "resample",
    "rescale",
    "rounded",
    "scatter",
    "sliced",
    "slide",
    "solve_contact",
    "stack_kernel",
    "statistics",
    "stress_field",
    "surface_compliance",
    "surface_compliance_matrix",
    "tyre_tread",
    "von_mises",
    "with_values",
]
