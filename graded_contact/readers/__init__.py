"""Measured files as objects. Nothing is guessed: what a file does not state, the caller gives."""

from .moduli import read_moduli, read_strain_sweep
from .prony import read_prony
from .series import MeasuredFriction, read_friction
from .source import NotPlain
from .topography import read_surface

__all__ = [
    "MeasuredFriction",
    "NotPlain",
    "read_friction",
    "read_moduli",
    "read_prony",
    "read_strain_sweep",
    "read_surface",
]
