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
from ..contacts.solution import RESULTS, ContactSolution, ended
from ..contacts.solve import LEAST_GAP, solve_contact
from ..contacts.window import operator_of
from ..core.checks import Numbers, as_float, check_values, is_concrete
from ..core.compilation import jit
from ..core.memory import SLIDING, check_memory
from ..fields.devices import num_devices, required
from ..fields.frequency import direction_and_speed
from ..fields.grid import Grid
from ..materials.coverage import coverage
from ..materials.softening import as_strain_per_slope
from ..surfaces.statistics import slope_up_to
from ..surfaces.surface import Surface, check_periodic
from .coupling import check_positive_kernel, lagged, steady_coupling
from .numerics import Numerics
from .result import Sliding
from .shear import is_coupled, shear_stress, unless_negative


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
    kernel, reached, kernel_error, coupling, steady = (
        kernel_of(case, numerics) if known is None else known
    )
    sheared = shear_stress(case.shear, direction_and_speed(case.velocity)[1], case.temperature)
    kernel = unless_negative(kernel, sheared)
    on_window, on_rigid = not surface.periodic, isinstance(stack.base, Rigid)

    def result(given, contact):
        case, kernel, kernel_error, sheared, coupling = given
        return Sliding(
            contact=contact, operator=operator_of(kernel, surface.heights.shape),
            heights=case.surface.heights, measured=surface.measured, grid=surface.grid,
            velocity=case.velocity, law=case.law, shear=sheared, coupling=coupling,
            measured_range=_coverage(stack), kernel_error=kernel_error,
            thickness=interface_depths(stack)[-1] if on_window and on_rigid else None,
            ground=on_window and has_ground(stack, surface.grid),
            prescribed=case.prescribed,
        )  # fmt: skip

    def solve(given, shift, start, solution):
        """The contact of the heights less a shift."""
        case, kernel, heights = given[0], given[1], given[0].surface.heights
        approach = None
        if case.approach is not None:
            approach = check_approach(case.approach, case.surface, case.law)
        contact = solve_contact(
            kernel, heights if shift is None else heights - shift, case.pressure,
            mean_gap=case.mean_gap, approach=approach, law=case.law,
            solver=numerics.solver, adjoint=numerics.adjoint, rtol=numerics.rtol,
            start=start, solution=solution, throw=numerics.throw,
        )  # fmt: skip
        return result(given, contact)

    given = case, kernel, kernel_error, sheared, coupling
    if coupling is None or coupling.in_kernel:
        found = solve(given, None, start, solution)
    else:
        none = jnp.zeros_like(surface.heights)
        found = lagged(solve, result, given, numerics, start, solution, none)
    if reached is not True or steady is not True:
        contact = ended(found.contact, steady, RESULTS.no_steady_sliding)
        contact = ended(contact, reached, RESULTS.inaccurate_kernel)
        found = dataclasses.replace(found, contact=contact)
    return found


_coverage = jit(coverage)


def kernel_of(case: Any, numerics: Numerics) -> tuple:
    """Returns the kernel of a case and more that several contacts may share.

    The others: whether the kernel is good, its errors on a window, the coupling by traction or
    None, and whether sliding with this traction may be steady.
    """
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

    cells = (grid,) if surface.periodic else (doubled(grid), long_cell(grid))
    found = [kernel_on(cell) for cell in cells]
    kernel, error = found[0][0], None
    if not surface.periodic:
        # Cells of two sizes give the kernel of a window without the images of its load.
        near, far = (one for one, _ in found)
        kernel, error = without_images(near, far, grid, has_ground(stack, grid))
    reached = found[0][1] if surface.periodic else found[0][1] & found[1][1]
    if not is_coupled(case.shear):
        return kernel, reached, error, None, True
    coupling, lift_error, good = steady_coupling(case, cells, numerics.graded_solver, strain)
    if numerics.throw:
        coupling = required(coupling, good, RESULTS.inaccurate_kernel.error_if)
    else:
        reached = reached & good
    coefficient = case.shear.coefficient if coupling.in_kernel else None
    # Without friction a real kernel stays real.
    if coefficient is None or (is_concrete(coefficient) and np.asarray(coefficient) == 0):
        return kernel, reached, error, coupling, True
    coefficient = coefficient.astype(kernel.real.dtype)
    kernel = kernel + coefficient * coupling.lift[0]
    error = None if error is None or lift_error is None else error + coefficient * lift_error
    steady = check_positive_kernel(kernel, cells[0], coefficient)
    if numerics.throw:
        kernel, steady = required(kernel, steady, RESULTS.no_steady_sliding.error_if), True
    return kernel, reached, error, coupling, steady


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
