"""From measured moduli to laws: Prony series and master curves."""

from .master import MasterCurve, master_curve
from .prony import PronyFit, fit_prony
from .wild import wild_values, without

__all__ = ["MasterCurve", "PronyFit", "fit_prony", "master_curve", "wild_values", "without"]
