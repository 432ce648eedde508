"""Periodic motion: reciprocating, start and stop, loads that vary; usual motions."""

from .friction.cycle import CyclicSliding, slide_cycle
from .friction.motion import Motion, recorded, sinusoidal, start_stop, steady

__all__ = [
    "CyclicSliding", "Motion", "recorded", "sinusoidal", "slide_cycle", "start_stop", "steady",
]  # fmt: skip
