"""Designs: what makes a block better."""

from .objectives import distance, friction_curve, loss_tangent, ripple
from .results import DesignResults
from .run import run_design
from .table import read_design

__all__ = [
    "DesignResults", "distance", "friction_curve", "loss_tangent",
    "read_design", "ripple", "run_design",
]  # fmt: skip
