"""Sliding contact: the case, its observables and results, motion in time, shear and heat."""

from .case import Case, Heating, Numerics
from .interior.stress import ContactStress, contact_stress
from .motion.motion import Motion
from .motion.periodic import recorded, sinusoidal, start_stop
from .motion.transient import dwell, ramp, start
from .numbers.friction import cumulative_friction
from .numbers.gap_flow import Fluid, GapFlow, gap_flow
from .result import CyclicSliding, Sliding, TransientSliding
from .shear import AbstractShear, ConstantShear, Coulomb, PeakedShear
from .slide import slide, slide_case, slide_cycle, slide_transient

__all__ = [
    "AbstractShear", "Case", "ConstantShear", "ContactStress", "Coulomb", "CyclicSliding",
    "Fluid", "GapFlow", "Heating", "Motion", "Numerics", "PeakedShear",
    "Sliding", "TransientSliding", "contact_stress", "cumulative_friction",
    "dwell", "gap_flow", "ramp",
    "recorded", "sinusoidal", "slide", "slide_case", "slide_cycle",
    "slide_transient", "start", "start_stop",
]  # fmt: skip
