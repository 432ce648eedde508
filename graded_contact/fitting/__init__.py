"""From measured moduli to laws: Prony series and master curves."""

from .master import MasterCurve, master_curve
from .prony import PronyFit, fit_creep, fit_prony, fit_relaxation

__all__ = ["MasterCurve", "PronyFit", "fit_creep", "fit_prony", "fit_relaxation", "master_curve"]
