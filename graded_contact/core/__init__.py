"""Shared by all rooms: refusals, parameters by path, quantities, programs, memory."""

from .compilation import jit
from .memory import keep_freed_memory
from .parameters import paths, with_values

__all__ = ["jit", "keep_freed_memory", "paths", "with_values"]
