"""The periodic cell, its wavevectors, ω = −q·v, transforms and devices."""

from .grid import Grid

__all__ = ["Grid"]
