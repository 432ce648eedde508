"""Laws of moduli E(ω) and ν(ω), with temperature and strain; the range that was measured."""

from .coverage import MeasuredRange, coverage
from .library import tyre_tread
from .material import AbstractMaterial, BulkShear, Elastic, Prony
from .measured import Measured
from .shift import WLF, AbstractShift, Arrhenius, TabulatedShift
from .softening import StrainSoftening, at_strain
from .table import Tabulated

__all__ = [
    "WLF", "AbstractMaterial", "AbstractShift", "Arrhenius", "BulkShear", "Elastic", "Measured",
    "MeasuredRange", "Prony", "StrainSoftening", "Tabulated", "TabulatedShift", "at_strain",
    "coverage", "tyre_tread",
]  # fmt: skip
