"""Rough contact and friction of layered and graded viscoelastic solids, differentiable, in JAX.

Data flows one way: material -> stack -> response -> contact -> observables. The main job is
`slide`. SI units everywhere; `docs/theory.md` and the module docstrings state conventions.

Besides the names below there are `shapes` (of graded layers), `surface` (`statistics`, `rescale`,
`resample`, `radial_spectrum`), `design` (searches and objectives) and `plot` (figures).
"""

import importlib
from typing import TYPE_CHECKING

from . import design, shapes, surface
from .contact.adhesion import AdhesiveLJ, ExponentialAdhesion
from .contact.law import AbstractLaw, HardWall, RepulsiveLJ
from .contact.nested_solve import DouglasRachford
from .contact.observables import cumulative_friction
from .contact.path import ContactPath, follow_contact
from .contact.problem import solve_contact
from .contact.rmd import ResidualDynamics
from .contact.solution import RESULTS, ContactSolution
from .contact.solver import AbstractContactSolver
from .core.parameters import with_values
from .fields.grid import Grid
from .files.errors import read_errors
from .files.moduli.measured import Measured
from .files.moduli.reading import read_moduli
from .files.prony_cards import export_prony
from .files.topography.preparation import surface_from_heights
from .files.topography.reading import read_surface
from .fitting.master import MasterCurve, master_curve
from .fitting.prony import fit_creep, fit_prony, fit_relaxation
from .fitting.result import PronyFit
from .friction.magnification import area_against_cutoff
from .friction.sliding import Sliding, slide
from .persson.mean_field import MeanField, mean_field_friction, pressure_distribution
from .response.compliance import (
    effective_modulus,
    graded_compliance,
    layered_compliance,
    surface_compliance,
)
from .response.grading import AbstractGradedSolver
from .response.interior import interior_fields, stress_field, von_mises
from .response.kernel import kernel_table, stack_kernel
from .response.layering import Layering, sliced
from .response.matrix import surface_compliance_matrix
from .response.profile import AbstractProfile, Aged, Blend, Mixture
from .response.riccati import Riccati
from .response.stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack, interface_depths
from .rheology.library import tyre_tread
from .rheology.material import AbstractMaterial, BulkShear, Elastic, Prony
from .rheology.measured import MeasuredRange, coverage
from .rheology.shift import WLF, AbstractShift, Arrhenius
from .rheology.tabulated import Tabulated
from .rheology.tabulated_shift import TabulatedShift
from .roughness.cutoff import CutoffCurve
from .roughness.random_surfaces import random_surface
from .roughness.spectrum import SelfAffine
from .roughness.surface import Surface
from .shapes import AbstractShape
from .studies.design import Design, minimise
from .studies.objectives import friction_curve
from .studies.uncertainty import propagate, sensitivity

if TYPE_CHECKING:
    from . import plot
    from .files.results import read_results
    from .files.scene import read_scene
    from .files.study import Study, read_study
    from .page.serving import explore
    from .studies.checkpoint import checkpointed
    from .studies.run import run_scene
    from .studies.sweep import sweep

__version__ = "1.0.0rc1"

__all__ = [  # noqa: RUF022 (grouped by room)
    # rheology
    "AbstractMaterial", "Elastic", "Prony", "BulkShear", "Tabulated", "tyre_tread",
    "AbstractShift", "WLF", "Arrhenius", "TabulatedShift", "MeasuredRange", "coverage",
    # response
    "Stack", "Layer", "GradedLayer", "HalfSpace", "Rigid", "Free", "sliced",
    "AbstractProfile", "Blend", "Mixture", "Aged", "AbstractShape", "shapes",
    "AbstractGradedSolver", "Layering", "Riccati", "graded_compliance",
    "surface_compliance", "surface_compliance_matrix", "effective_modulus", "layered_compliance",
    "stack_kernel", "kernel_table",
    "interior_fields", "stress_field", "interface_depths", "von_mises",
    # surfaces
    "Grid", "SelfAffine", "Surface", "random_surface", "surface",
    # contact and sliding
    "AbstractLaw", "HardWall", "RepulsiveLJ", "AdhesiveLJ", "ExponentialAdhesion",
    "AbstractContactSolver", "DouglasRachford", "ResidualDynamics", "RESULTS",
    "solve_contact", "ContactSolution", "follow_contact", "ContactPath",
    "slide", "Sliding", "area_against_cutoff", "CutoffCurve", "cumulative_friction",
    # mean field
    "mean_field_friction", "MeanField", "friction_curve", "pressure_distribution",
    # files
    "read_moduli", "Measured", "read_surface", "surface_from_heights", "export_prony",
    "read_errors", "read_scene", "run_scene", "read_results",
    # fitting
    "fit_prony", "fit_relaxation", "fit_creep", "PronyFit", "master_curve", "MasterCurve",
    # studies
    "sweep", "Study", "read_study", "minimise", "Design", "with_values", "design", "propagate",
    "sensitivity", "checkpointed", "explore",
    # figures
    "plot",
]  # fmt: skip

# Imported when they are asked for: HDF5 and figures take time that a script may not need.
_LATER = {
    "explore": ".page.serving",
    "plot": ".plot",
    "read_results": ".files.results",
    "read_scene": ".files.scene",
    "read_study": ".files.study",
    "run_scene": ".studies.run",
    "Study": ".files.study",
    "checkpointed": ".studies.checkpoint",
    "sweep": ".studies.sweep",
}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(_LATER[name], __name__)
    found = module if name == "plot" else getattr(module, name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
