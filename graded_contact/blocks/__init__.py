"""Blocks: layers, homogeneous or graded, on a base.

`shapes` has the shapes φ(s) of graded layers.
"""

from . import shapes
from .interfaces import smooth_layer, spring_layer
from .profile import AbstractProfile, Blend
from .stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack, interface_depths
from .tolerance import AbstractGradedSolver

__all__ = [
    "AbstractGradedSolver",
    "AbstractProfile",
    "Blend",
    "Free",
    "GradedLayer",
    "HalfSpace",
    "Layer",
    "Rigid",
    "Stack",
    "interface_depths",
    "shapes",
    "smooth_layer",
    "spring_layer",
]
