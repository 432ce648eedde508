"""What a block should do, and what finds the block that does it."""

from .parameters import paths, with_values
from .studies.alternatives import pareto_front, rounded, scatter
from .studies.design import Design, Run, minimise
from .studies.objectives import distance, friction_between, loss_tangent, ripple

__all__ = [
    "Design", "Run", "distance", "friction_between", "loss_tangent", "minimise", "pareto_front",
    "paths", "ripple", "rounded", "scatter", "with_values",
]  # fmt: skip
