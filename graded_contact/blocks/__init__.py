"""Stacks of homogeneous and graded layers, their response M_zz(q, ω), and the stress inside.

`shapes` has the shapes φ(s) of graded layers.
"""

from . import shapes
from .bond import AbstractBond, Bond, Film
from .compliance import effective_modulus, graded_compliance, layered_compliance, surface_compliance
from .graded_solver import AbstractGradedSolver
from .kernel import kernel_table, stack_kernel
from .layering import Layering, sliced
from .matrix import surface_compliance_matrix
from .profile import AbstractProfile, Aged, Blend, Mixture
from .riccati import Riccati
from .stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack, interface_depths
from .stress import interior_fields, largest_tension, stress_field, von_mises
from .window_compliance import window_kernel

__all__ = [
    "AbstractBond", "AbstractGradedSolver", "AbstractProfile", "Aged", "Blend", "Bond", "Film",
    "Free", "GradedLayer", "HalfSpace", "Layer", "Layering", "Mixture", "Riccati", "Rigid", "Stack",
    "effective_modulus",
    "graded_compliance", "interface_depths", "interior_fields", "kernel_table",
    "largest_tension", "layered_compliance", "shapes", "sliced", "stack_kernel", "stress_field",
    "surface_compliance", "surface_compliance_matrix", "von_mises", "window_kernel",
]  # fmt: skip
