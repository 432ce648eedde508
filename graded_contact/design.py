"""Objectives for a block, and the searches for the block that meets them."""

from .core.parameters import paths, with_values
from .studies.alternatives import pareto_front, scatter, snap_to_values
from .studies.design import Design, Run, minimise
from .studies.objectives import distance, friction_between, friction_curve, loss_tangent, ripple
from .studies.stochastic import minimise_expected

__all__ = [
    "Design", "Run", "distance", "friction_between", "friction_curve", "loss_tangent", "minimise",
    "minimise_expected", "pareto_front", "paths", "ripple", "scatter", "snap_to_values",
    "with_values",
]  # fmt: skip
