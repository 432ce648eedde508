"""Many solves: sweeps over axes, and what errors of materials do to results."""

from .sweep import sweep
from .uncertainty import Estimate, Sensitivity, propagate, sensitivity

__all__ = ["Estimate", "Sensitivity", "propagate", "sensitivity", "sweep"]
