"""Friction and contact area by Persson's theory, without a grid."""

from .mean_field import MeanField, mean_field_friction, pressure_distribution

__all__ = ["MeanField", "mean_field_friction", "pressure_distribution"]
