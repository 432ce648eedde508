"""More about blocks: custom profiles, solvers of graded layers, stress at depth, slices."""

from .response.compliance import graded_compliance
from .response.grading import AbstractGradedSolver
from .response.interior import interior_fields, stress_field, von_mises
from .response.kernel import kernel_table
from .response.layering import Layering, sliced
from .response.profile import AbstractProfile
from .response.riccati import Riccati
from .response.stack import interface_depths
from .response.window import window_kernel

__all__ = [
    "AbstractGradedSolver", "AbstractProfile", "Layering", "Riccati", "graded_compliance",
    "interface_depths", "interior_fields", "kernel_table", "sliced", "stress_field", "von_mises",
    "window_kernel",
]  # fmt: skip
