"""Measured files as objects: moduli, Prony series and topographies."""

from .measured_friction import MeasuredFriction, read_friction
from .moduli import read_moduli, read_strain_sweep
from .prony import read_prony
from .topography import read_surface

__all__ = [
    "MeasuredFriction", "read_friction", "read_moduli", "read_prony", "read_strain_sweep",
    "read_surface",
]  # fmt: skip
