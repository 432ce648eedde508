"""Measured files as objects: moduli and topographies."""

from .moduli import read_moduli, read_strain_sweep
from .topography import read_surface

__all__ = ["read_moduli", "read_strain_sweep", "read_surface"]
