"""Kernels: the response of a block at every wavevector of a grid."""

from .steady import stack_kernel
from .window import window_kernel

__all__ = ["stack_kernel", "window_kernel"]
