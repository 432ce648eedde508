"""Sliding contact: the case, its observables and results, motion in time, shear and heat."""

from .case import Case, Heating
from .interior.conduction import flash_temperature
from .interior.heat_source import heat_depths, heat_source
from .interior.stress import ContactStress, LargestStress, contact_stress
from .motion.motion import Motion
from .motion.periodic import recorded, sinusoidal, start_stop, steady
from .motion.transient import dwell, listed, ramp, start
from .numbers.gap_flow import Fluid, GapFlow, gap_flow
from .numerics import Numerics
from .result import CyclicSliding, Sliding, TransientSliding
from .shear import AbstractShear, ConstantShear, Coulomb, PeakedShear
from .slide import slide, slide_case, slide_cycle, slide_transient
from .solve.magnification import area_against_cutoff, cumulative_friction

__all__ = [
    "AbstractShear", "Case", "ConstantShear", "ContactStress", "Coulomb", "CyclicSliding",
    "Fluid", "GapFlow", "Heating", "LargestStress", "Motion", "Numerics", "PeakedShear",
    "Sliding", "TransientSliding", "area_against_cutoff", "contact_stress", "cumulative_friction",
    "dwell", "flash_temperature", "gap_flow", "heat_depths", "heat_source", "listed", "ramp",
    "recorded", "sinusoidal", "slide", "slide_case", "slide_cycle",
    "slide_transient", "start", "start_stop", "steady",
]  # fmt: skip
