"""Response of a block to one wave: M_zz(q, ω), the full matrix, and the stress inside."""

from .compliance import effective_modulus, surface_compliance, surface_compliance_matrix
from .layering import Layering
from .riccati import Riccati
from .stress import interior_fields

__all__ = [
    "Layering", "Riccati", "effective_modulus", "interior_fields", "surface_compliance",
    "surface_compliance_matrix",
]  # fmt: skip
