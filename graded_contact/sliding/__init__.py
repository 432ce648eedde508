"""Sliding contact: the case, its observables and results, motion in time, shear and heat."""

from . import observables  # noqa: F401 (first: it decides their order)
from .case import Case, Heating
from .conduction import flash_temperature
from .contact_stress import ContactStress, LargestStress, contact_stress
from .gap_flow import Fluid, GapFlow, gap_flow
from .heat_source import heat_depths, heat_source
from .magnification import area_against_cutoff, cumulative_friction
from .motion import Motion, recorded, sinusoidal, start_stop, steady
from .numerics import Numerics
from .result import CyclicSliding, Sliding, TransientSliding, describe
from .shear import AbstractShear, ConstantShear, Coulomb, PeakedShear
from .single_motion import SingleMotion, dwell, listed, ramp, recorded_once, start
from .slide import slide, slide_cycle, slide_history, solve
from .stiffness import contact_conductance, contact_stiffness, contact_stiffness_error

__all__ = [
    "AbstractShear", "Case", "ConstantShear", "ContactStress", "Coulomb", "CyclicSliding",
    "Fluid", "GapFlow", "Heating", "LargestStress", "Motion", "Numerics", "PeakedShear",
    "SingleMotion", "Sliding", "TransientSliding", "area_against_cutoff", "contact_conductance",
    "contact_stiffness", "contact_stiffness_error", "contact_stress", "cumulative_friction",
    "dwell", "flash_temperature", "gap_flow", "heat_depths", "heat_source", "listed", "ramp",
    "recorded", "recorded_once", "sinusoidal", "slide", "slide_cycle", "slide_history", "solve",
    "start", "start_stop", "steady",
]  # fmt: skip

describe(Sliding)
describe(CyclicSliding)
describe(TransientSliding)
