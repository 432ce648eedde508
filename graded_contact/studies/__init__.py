"""Many solves: sweeps, searches for a design, uncertainty, tables of friction."""

from .alternatives import pareto_front, scatter, snap_to_values
from .friction_tables import friction_table
from .objectives import distance, friction_between, friction_curve, loss_tangent, ripple
from .parameter_covariance import read_errors
from .search import Design, Run, minimise
from .stochastic import minimise_expected
from .sweep import sweep
from .uncertainty import propagate, sensitivity

__all__ = [
    "Design", "Run", "distance", "friction_between", "friction_curve",
    "friction_table", "loss_tangent", "minimise", "minimise_expected", "pareto_front", "propagate",
    "read_errors", "ripple", "scatter", "sensitivity", "snap_to_values", "sweep",
]  # fmt: skip
