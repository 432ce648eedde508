"""Rough contact and friction of layered and graded viscoelastic solids, differentiable, in JAX.

Data flows one way: material -> stack -> response -> contact -> observables. The main job is
`slide`. SI units everywhere; `docs/theory.md` and the module docstrings state conventions.
"""

from .contact.douglas_rachford import DouglasRachford
from .contact.law import HardWall
from .contact.problem import RESULTS, ContactSolution, solve_contact
from .grid import Grid
from .response.compliance import (
    effective_modulus,
    layered_compliance,
    stack_kernel,
    surface_compliance,
)
from .response.stack import Free, HalfSpace, Layer, Rigid, Stack
from .rheology.library import tyre_tread
from .rheology.material import Elastic, Prony
from .rheology.shift import WLF, Arrhenius
from .rheology.tabulated import Tabulated
from .sliding import Sliding, slide
from .spectrum import SelfAffine
from .surface import Surface, radial_spectrum, random_surface, rescale, statistics
from .topography import read_surface

__version__ = "0.1.0"

__all__ = [
    "RESULTS",
    "WLF",
    "Arrhenius",
    "ContactSolution",
    "DouglasRachford",
    "Elastic",
    "Free",
    "Grid",
    "HalfSpace",
    "HardWall",
    "Layer",
    "Prony",
    "Rigid",
    "SelfAffine",
    "Sliding",
    "Stack",
    "Surface",
    "Tabulated",
    "effective_modulus",
    "layered_compliance",
    "radial_spectrum",
    "random_surface",
    "read_surface",
    "rescale",
    "slide",
    "solve_contact",
    "stack_kernel",
    "statistics",
    "surface_compliance",
    "tyre_tread",
]
