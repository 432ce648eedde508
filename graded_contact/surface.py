"""Statistics and changes of a rough surface."""

from .roughness.surface import Statistics, radial_spectrum, resample, rescale, statistics

__all__ = ["Statistics", "radial_spectrum", "resample", "rescale", "statistics"]
