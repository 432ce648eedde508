"""Stress, heat and temperature inside the bodies."""
