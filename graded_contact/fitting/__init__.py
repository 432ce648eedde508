"""From measured moduli to laws: Prony series and master curves."""

from .master import MasterCurve, master_curve
from .prony import AbstractFit, PronyFit, fit_prony

__all__ = [
    "AbstractFit", "MasterCurve", "PronyFit", "fit_prony", "master_curve",
]  # fmt: skip
