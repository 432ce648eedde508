"""Many solves: sweeps over axes, and the effect of errors of materials."""

from .sweep import sweep
from .uncertainty import Estimate, Sensitivity, propagate, sensitivity

__all__ = ["Estimate", "Sensitivity", "propagate", "sensitivity", "sweep"]
