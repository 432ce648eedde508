"""From measured moduli to laws: Prony series and master curves."""

from .cards import abaqus_card, toml_table
from .master import MasterCurve, master_curve
from .prony import AbstractFit, PronyFit, fit_prony

__all__ = [
    "AbstractFit", "MasterCurve", "PronyFit", "abaqus_card", "fit_prony", "master_curve",
    "toml_table",
]  # fmt: skip
