"""The problem of a surface that slides steadily, at one temperature of the block.

In the frame of the surface the contact is steady, and every wavevector q of the pressure deforms
the block at the frequency ω = -q·v, and the counterface at rest.

In gross sliding the shear stress τ acts on the block along the motion e. It moves the surface by
M_ze τ along z, so that

    w = M_zz σ + M_ze τ(σ).

On the counterface, if there is one, it acts in the opposite direction (`bodies.py`).

Under Coulomb's law, w = (M_zz + f M_ze) σ: a contact without traction, of another kernel, whose
real part may be negative for some waves. Under other laws the traction lags (`isothermal.py`).
"""

import functools
import operator as operators
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Array, Bool

from ...blocks.stack import Stack
from ...contacts.operators.window import operator_of
from ...core.checks import as_float, is_concrete, within
from ...core.compilation import compiled
from ...core.memory import SLIDING, check_memory
from ...fields.devices import num_devices
from ...fields.frequency import direction_and_speed
from ...fields.grid import Grid, Waves
from ...kernels.steady import attempted_kernel
from ...kernels.tangential import tangential_kernels
from ...kernels.window import doubled, has_ground, long_cell, without_images
from ...materials.softening import as_strain_per_slope, softens
from ...surfaces.statistics import slope_up_to
from ...surfaces.surface import check_periodic
from ..bodies import Counterface, Coupling
from ..case import Case, facts_of
from ..problem import SteadyProblem
from ..shear import Coulomb, is_coupled, shear_stress


def steady_problem(case: Case) -> tuple[SteadyProblem, Array | bool]:
    """Returns the problem of a case with a velocity, and whether its kernel is good."""
    stack, surface, grid = case.stack, case.surface, case.surface.grid
    itemsize = surface.heights.dtype.itemsize
    check_memory("surface", "sliding", SLIDING, grid.shape, itemsize, num_devices(grid.size))
    strain = _strain_of(case)
    kernel, kernel_error, coupling, reached = _response(case, stack, case.velocity, strain)
    counterface = None
    if case.counterface is not None:
        with within("`counterface`:"):
            other, error, traction, good = _response(
                case, case.counterface, np.zeros(()), strain, opposite=True
            )
        kernel, reached = kernel + other, reached & good
        if kernel_error is not None:
            kernel_error = kernel_error + error
        operator = operator_of(other, surface.heights.shape)
        counterface = Counterface(operator, other, traction)
    sheared = shear_stress(case.shear, case.velocity, case.temperature)
    problem = SteadyProblem(
        operator=operator_of(kernel, surface.heights.shape), heights=surface.heights,
        measured=surface.measured, grid=surface.grid, velocity=case.velocity, law=case.law,
        shear=sheared, coupling=coupling, counterface=counterface,
        kernel_error=kernel_error, prescribed=case.prescribed, facts=facts_of(case),
    )  # fmt: skip
    return problem, reached


def _strain_of(case: Case) -> tuple[Array, Array] | None:
    """The strain amplitudes of the waves, by their wavenumbers, or None."""
    if case.strain_per_slope is None:
        return None
    check_periodic(case.surface)
    ratio = as_strain_per_slope(case.strain_per_slope, case.bodies)
    q, slope = slope_up_to(case.surface)
    return q, ratio * slope


def _response(
    case: Case, stack: Stack, velocity: Any, strain, opposite: bool = False
) -> tuple[Array, Any, Coupling, Array | bool]:
    """The kernel of a body of a case over which the surface has this velocity [m/Pa].

    With Coulomb's law it contains the traction, `opposite` to that on the block or not. Then its
    errors on a window, or None; its coupling by traction; and whether all is good.
    """
    surface, grid = case.surface, case.surface.grid
    strain = strain if softens(stack) else None
    # If the velocity is known to be 0, the kernel is real.
    at_rest = is_concrete(velocity) and not np.any(np.asarray(velocity))

    cells = (grid,) if surface.periodic else (doubled(grid), long_cell(grid))
    found = [attempted_kernel(stack, cell, velocity, strain=strain) for cell in cells]
    kernels = [kernel.real if at_rest else kernel for kernel, _ in found]
    reached = functools.reduce(operators.and_, (good for _, good in found))
    kernel, error = kernels[0], None
    if not surface.periodic:
        # Cells of two sizes give the kernel of a window without the images of its load.
        grounded = all(has_ground(body, grid) for body in case.bodies)
        kernel, error = without_images(kernels[0], kernels[1], grid, grounded)
    if not is_coupled(case.shear):
        return kernel, error, Coupling(), reached
    coupling, lift_error, good = _coupling(case, stack, velocity, cells, strain)
    if isinstance(case.shear, Coulomb):
        coefficient = -case.shear.coefficient if opposite else case.shear.coefficient
        # Without friction a real kernel stays real.
        if not (is_concrete(coefficient) and np.asarray(coefficient) == 0):
            kernel = _lifted(kernel, coefficient, coupling.lift[0])
            error = None if error is None else _lifted(error, coefficient, lift_error)
    return kernel, error, coupling, reached & good


def _coupling(
    case: Case,
    stack: Stack,
    velocity: Any,
    cells: Sequence[Grid],
    strain: tuple[Array, Array] | None,
) -> tuple[Coupling, Waves | None, Bool[Array, ""]]:
    """Returns the coupling of a body of a `Case`, errors of M_ze, and whether it is good.

    `velocity` is the surface's over the body; `cells` are the cell of a periodic surface, or two
    for a non-periodic one, which has errors.
    """
    if len(cells) == 2 and not isinstance(case.shear, Coulomb):
        raise ValueError(
            "`shear` is not supported: on a non-periodic surface only `Coulomb` can be coupled. "
            "Pass `coupled=False`, or put the body into a periodic cell."
        )
    direction, velocity = direction_and_speed(case.velocity)[0], as_float(velocity)
    found = [tangential_kernels(stack, cell, velocity, direction, strain) for cell in cells]
    ((lift,), ((along,),), good), error = found[0], None
    if len(cells) == 2:
        ((far_lift,), ((far_along,),), far_good), window = found[1], case.surface.grid
        lift, error = without_images(lift, far_lift, window, False)
        along, _ = without_images(along, far_along, window, False)
        good = good & far_good
    return Coupling((lift,), ((along,),), isinstance(case.shear, Coulomb)), error, good


@compiled
def _lifted(part: Array, coefficient: Array, lift: Any) -> Array:
    """M_zz + f M_ze."""
    return part + coefficient.astype(part.real.dtype) * lift
