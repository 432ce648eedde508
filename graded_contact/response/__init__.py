"""Response of a block to one wave: M_zz(q, ω), the full matrix, and the stress inside."""

from .compliance import (
    effective_modulus,
    graded_compliance,
    layered_compliance,
    surface_compliance,
)
from .layering import Layering, sliced
from .matrix import surface_compliance_matrix
from .riccati import Riccati
from .stress import interior_fields, largest_tension, stress_field, von_mises

__all__ = [
    "Layering", "Riccati", "effective_modulus", "graded_compliance", "interior_fields",
    "largest_tension", "layered_compliance", "sliced", "stress_field", "surface_compliance",
    "surface_compliance_matrix", "von_mises",
]  # fmt: skip
