"""Many solves: sweeps, searches, uncertainty, tables of friction."""

from .alternatives import pareto_front, scatter, snap_to_values
from .friction_tables import friction_table
from .parameter_covariance import read_errors
from .search import Descent, Design, minimise
from .stochastic import minimise_expected
from .sweep import sweep
from .uncertainty import propagate, sensitivity

__all__ = [
    "Descent", "Design", "friction_table", "minimise", "minimise_expected", "pareto_front",
    "propagate", "read_errors", "scatter", "sensitivity", "snap_to_values", "sweep",
]  # fmt: skip
