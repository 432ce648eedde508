"""What all rooms share: refusals, parameters by path, the registry of quantities, programs."""

from .compilation import jit
from .parameters import paths, with_values

__all__ = ["jit", "paths", "with_values"]
