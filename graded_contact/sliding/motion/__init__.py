"""Motions of the surface in time."""
