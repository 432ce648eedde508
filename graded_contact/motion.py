"""Periodic motion: reciprocating, start and stop, loads that vary; usual motions."""

from .friction.motion import Motion, recorded, sinusoidal, start_stop, steady
from .friction.slide import slide_cycle
from .friction.sliding import CyclicSliding

__all__ = [
    "CyclicSliding", "Motion", "recorded", "sinusoidal", "slide_cycle", "start_stop", "steady",
]  # fmt: skip
