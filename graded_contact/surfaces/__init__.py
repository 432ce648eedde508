"""Spectra, random surfaces, statistics, and the preparation of measured heights."""

from .preparation import surface_from_heights
from .random_surface import random_surface
from .rescaling import resample, rescale
from .spectrum import CutoffCurve, SelfAffine
from .spectrum_table import SpectrumTable
from .statistics import Statistics, isotropic_spectrum, radial_spectrum, statistics
from .surface import Surface

__all__ = [
    "CutoffCurve", "SelfAffine", "SpectrumTable", "Statistics", "Surface", "isotropic_spectrum",
    "radial_spectrum", "random_surface", "resample", "rescale", "statistics",
    "surface_from_heights",
]  # fmt: skip
