"""The contact of a surface that slides steadily, at one temperature of the block.

In the frame of the surface the contact is steady, and every wavevector q of the pressure deforms
the block at the frequency ω = -q·v.
"""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..blocks.kernel import attempted_kernel, stack_kernel
from ..blocks.stack import Rigid, interface_depths
from ..blocks.window_compliance import doubled, has_ground, long_cell, without_images
from ..contacts.law import AbstractLaw, HardWall
from ..contacts.solution import RESULTS, ContactSolution
from ..contacts.solve import LEAST_GAP, solve_contact
from ..contacts.window import operator_of
from ..core.checks import Numbers, as_float, check_values, is_concrete
from ..core.compilation import jit
from ..core.memory import SLIDING, check_memory
from ..fields.devices import num_devices
from ..fields.frequency import direction_and_speed
from ..fields.grid import Grid
from ..materials.coverage import coverage
from ..materials.softening import as_strain_per_slope
from ..surfaces.statistics import slope_up_to
from ..surfaces.surface import Surface, check_periodic
from .numerics import Numerics
from .result import Sliding
from .shear import shear_stress


def solve_steady(
    case: Any,
    numerics: Numerics,
    start: Numbers | None = None,
    solution: ContactSolution | None = None,
    known: tuple | None = None,
) -> Sliding:
    """Returns the contact of a `Case` with a velocity, without its heat; see `slide`.

    `known` is the result of `kernel_of` where several contacts share it.
    """
    stack, surface = case.stack, case.surface
    approach = None if case.approach is None else check_approach(case.approach, surface, case.law)
    kernel, reached, kernel_error = kernel_of(case, numerics) if known is None else known
    sheared = shear_stress(case.shear, direction_and_speed(case.velocity)[1], case.temperature)
    contact = solve_contact(
        kernel, surface.heights, case.pressure,
        mean_gap=case.mean_gap, approach=approach, law=case.law,
        solver=numerics.solver, adjoint=numerics.adjoint, rtol=numerics.rtol,
        start=start, solution=solution, throw=numerics.throw,
    )  # fmt: skip
    if reached is not True:
        result = RESULTS.where(reached, contact.result, RESULTS.inaccurate_kernel)
        contact = dataclasses.replace(contact, result=result)
    on_window, on_rigid = not surface.periodic, isinstance(stack.base, Rigid)
    return Sliding(
        contact=contact, operator=operator_of(kernel, surface.heights.shape),
        heights=surface.heights, measured=surface.measured, grid=surface.grid,
        velocity=case.velocity, law=case.law, shear=sheared,
        measured_range=_coverage(stack), kernel_error=kernel_error,
        thickness=interface_depths(stack)[-1] if on_window and on_rigid else None,
        ground=on_window and has_ground(stack, surface.grid),
        prescribed=case.prescribed,
    )  # fmt: skip


_coverage = jit(coverage)


def kernel_of(case: Any, numerics: Numerics) -> tuple:
    """Returns the kernel of a case, whether it is good, and its errors on a window."""
    stack, surface, velocity, grid = case.stack, case.surface, case.velocity, case.surface.grid
    itemsize = surface.heights.dtype.itemsize
    check_memory("surface", "sliding", SLIDING, grid.shape, itemsize, num_devices(grid.size))
    strain = None
    if case.strain_per_slope is not None:
        check_periodic(surface)
        ratio, (q, slope) = as_strain_per_slope(case.strain_per_slope, stack), slope_up_to(surface)
        strain = q, ratio * slope
    # If the velocity is known to be 0, the kernel is real.
    at_rest = is_concrete(velocity) and not np.any(np.asarray(velocity))

    def kernel_on(cell: Grid):
        how = {"graded_solver": numerics.graded_solver, "strain": strain}
        if numerics.throw:
            kernel, reached = stack_kernel(stack, cell, velocity, **how), True
        else:
            kernel, reached = attempted_kernel(stack, cell, velocity, **how)
        return kernel.real if at_rest else kernel, reached

    if surface.periodic:
        return *kernel_on(grid), None
    # Cells of two sizes give the kernel of a window without the images of its load.
    (near, reached), (far, also) = kernel_on(doubled(grid)), kernel_on(long_cell(grid))
    kernel, error = without_images(near, far, grid, has_ground(stack, grid))
    return kernel, reached & also, error


def check_approach(approach: Numbers, surface: Surface, law: AbstractLaw) -> Array:
    """Returns an approach; refuses one of more than a window's length: of another unit.

    It is NaN if tracing hides that. At a hard wall, one that rounding hides is refused, too.
    """
    approach, heights = as_float(approach, "approach"), surface.heights
    if is_concrete(surface.grid.size):
        most = float(np.max(np.asarray(surface.grid.size)))
        allowed = f"it must be finite, in metres, and at most the window's length of {most:g} m"
        check_values("approach", approach, allowed, at_most=most)
    if isinstance(law, HardWall) and is_concrete(approach) and is_concrete(heights):
        least, known = LEAST_GAP * float(np.std(np.asarray(heights))), np.asarray(approach)
        hidden = known[(known > 0) & (known < least)]
        if hidden.size:
            raise ValueError(
                f"`approach={hidden[0]:g}` is refused: below {least:.2g} m rounding decides what "
                "touches. At an approach of 0 or less nothing does."
            )
    return jnp.where(approach <= jnp.max(surface.grid.size), approach, jnp.nan)
