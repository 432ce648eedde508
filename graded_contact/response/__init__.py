"""Response of a block to one wave: M_zz(q, ω), the full matrix, and the stress inside."""

from .compliance import effective_modulus, surface_compliance, surface_compliance_matrix
from .layering import Layering
from .riccati import Riccati
from .slices import sliced
from .stress import interior_fields, stress_field, von_mises

__all__ = [
    "Layering",
    "Riccati",
    "effective_modulus",
    "interior_fields",
    "sliced",
    "stress_field",
    "surface_compliance",
    "surface_compliance_matrix",
    "von_mises",
]
