"""Kernels: the response of a block at every wavevector of a grid."""

from .steady import kernel_table, stack_kernel
from .window import window_kernel

__all__ = ["kernel_table", "stack_kernel", "window_kernel"]
