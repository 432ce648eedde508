"""Designs: what makes a block better."""

from .objectives import distance, friction_curve, loss_tangent, ripple
from .plan import DesignPlan, plan_design
from .results import DesignResults
from .table import read_design

__all__ = [
    "DesignPlan", "DesignResults", "distance", "friction_curve", "loss_tangent", "plan_design",
    "read_design", "ripple",
]  # fmt: skip
