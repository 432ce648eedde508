"""More about materials: classes to extend, measured ranges, fits, other programs' formats."""

from .files.moduli.measured import Measured
from .files.moduli.reading import read_strain_sweep
from .files.parameter_covariance import read_errors
from .files.prony_cards import export_prony
from .fitting.master import MasterCurve
from .fitting.prony import PronyFit
from .rheology.material import AbstractMaterial
from .rheology.measured import MeasuredRange, coverage
from .rheology.shift import AbstractShift, TabulatedShift
from .rheology.softening import StrainSoftening, at_strain

__all__ = [
    "AbstractMaterial", "AbstractShift", "MasterCurve", "Measured", "MeasuredRange", "PronyFit",
    "StrainSoftening", "TabulatedShift", "at_strain", "coverage", "export_prony", "read_errors",
    "read_strain_sweep",
]  # fmt: skip
