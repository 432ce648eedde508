"""Blocks: layers, homogeneous or graded, on a base.

`shapes` has the shapes φ(s) of graded layers.
"""

from . import shapes
from .bond import AbstractBond, Bond, Film
from .profile import AbstractProfile, Aged, Blend, Mixture
from .stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack, interface_depths
from .tolerance import AbstractGradedSolver

__all__ = [
    "AbstractBond", "AbstractGradedSolver", "AbstractProfile", "Aged", "Blend", "Bond", "Film",
    "Free", "GradedLayer", "HalfSpace", "Layer", "Mixture", "Rigid", "Stack",
    "interface_depths", "shapes",
]  # fmt: skip
