"""Rough contact and friction of layered and graded viscoelastic solids, differentiable, in JAX.

Data flows one way: material -> stack -> response -> contact -> observables. The main job is
`slide`. SI units everywhere; `docs/theory.md` and the module docstrings state conventions.

The names below are the main ones. The others are in `materials`, `blocks`, `contacts`, `motion`
(back and forth, start and stop), `surface`, `shapes` (of graded layers), `design` (searches and
objectives), `plot` (figures) and `reference` (closed forms).
"""

import importlib
from typing import TYPE_CHECKING

from . import blocks, contacts, design, materials, motion, reference, shapes, surface
from .contact.adhesion import AdhesiveLJ
from .contact.law import HardWall, RepulsiveLJ
from .contact.problem import solve_contact
from .contact.solution import ContactSolution
from .core.parameters import with_values
from .fields.grid import Grid
from .files.moduli.reading import read_moduli
from .files.topography.reading import read_surface
from .fitting.master import master_curve
from .fitting.prony import fit_creep, fit_prony, fit_relaxation
from .friction.case import Case
from .friction.slide import slide
from .friction.sliding import Sliding
from .persson.mean_field import mean_field_friction
from .response.compliance import effective_modulus, layered_compliance, surface_compliance
from .response.kernel import stack_kernel
from .response.matrix import surface_compliance_matrix
from .response.profile import Aged, Blend, Mixture
from .response.stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack
from .rheology.library import tyre_tread
from .rheology.material import BulkShear, Elastic, Prony
from .rheology.shift import WLF, Arrhenius
from .rheology.tabulated import Tabulated
from .roughness.random_surface import random_surface
from .roughness.spectrum import SelfAffine
from .roughness.surface import Surface
from .studies.design import Design, minimise
from .studies.uncertainty import propagate, sensitivity

if TYPE_CHECKING:
    from . import plot
    from .files.results import read_results
    from .files.scene_reading import read_scene
    from .page.serving import explore
    from .studies.checkpoint import checkpointed
    from .studies.run_scene import run_scene
    from .studies.sweep import sweep

__version__ = "1.0.0rc1"

__all__ = [  # noqa: RUF022 (grouped by subject, the main ones first)
    # contact and sliding
    "slide", "Sliding", "Case", "solve_contact", "ContactSolution",
    "HardWall", "RepulsiveLJ", "AdhesiveLJ", "contacts", "motion",
    # mean field
    "mean_field_friction",
    # rheology
    "Elastic", "Prony", "BulkShear", "Tabulated", "tyre_tread", "WLF", "Arrhenius", "materials",
    # response
    "Stack", "Layer", "GradedLayer", "HalfSpace", "Rigid", "Free", "Blend", "Mixture", "Aged",
    "surface_compliance", "surface_compliance_matrix", "effective_modulus", "layered_compliance",
    "stack_kernel", "shapes", "blocks", "reference",
    # surfaces
    "Grid", "SelfAffine", "Surface", "random_surface", "read_surface", "surface",
    # fitting
    "read_moduli", "fit_prony", "fit_relaxation", "fit_creep", "master_curve",
    # studies
    "sweep", "minimise", "Design", "with_values", "design", "propagate",
    "sensitivity", "checkpointed", "read_scene", "run_scene", "read_results", "explore",
    # figures
    "plot",
]  # fmt: skip

# Imported when first needed: HDF5 and figures take time that a script may not need.
_LATER = {
    "explore": ".page.serving",
    "plot": ".plot",
    "read_results": ".files.results",
    "read_scene": ".files.scene_reading",
    "run_scene": ".studies.run_scene",
    "checkpointed": ".studies.checkpoint",
    "sweep": ".studies.sweep",
}


def __getattr__(name: str) -> object:
    for space in (materials, blocks, contacts, motion, surface, design, shapes):
        if name in space.__all__:
            return getattr(space, name)
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(_LATER[name], __name__)
    found = module if name == "plot" else getattr(module, name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
