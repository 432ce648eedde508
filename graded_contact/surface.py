"""Statistics and changes of a rough surface; surfaces from measured heights."""

from .files.topography.preparation import surface_from_heights
from .roughness.rescaling import resample, rescale
from .roughness.statistics import Statistics, radial_spectrum, statistics

__all__ = [
    "Statistics", "radial_spectrum", "resample", "rescale", "statistics", "surface_from_heights",
]  # fmt: skip
