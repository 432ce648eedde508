"""From measured moduli to laws: Prony series and master curves."""

from .master import MasterCurve, master_curve
from .prony import AbstractFit, PronyFit, fit_prony
from .wild import wild_values, without

__all__ = [
    "AbstractFit", "MasterCurve", "PronyFit", "fit_prony", "master_curve", "wild_values", "without",
]  # fmt: skip
