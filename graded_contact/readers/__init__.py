"""Measured files as objects. Nothing is guessed: what a file does not state, the caller gives."""

from .moduli import read_moduli, read_strain_sweep
from .source import NotPlain
from .topography import read_surface

__all__ = ["NotPlain", "read_moduli", "read_strain_sweep", "read_surface"]
