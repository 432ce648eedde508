"""A rough rigid surface sliding on a layered viscoelastic block.

The surface h(x - vt) is pressed on the block by a mean pressure and moves steadily with the
velocity v. In the frame of the surface the contact is steady, and every wavevector q of the
pressure deforms the block at the frequency ω = -q·v.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ScalarLike

from ..contact.adjoint import LinearSolver, LinearSplitting
from ..contact.law import AbstractLaw, HardWall
from ..contact.nested_solve import DouglasRachford
from ..contact.problem import LEAST_GAP, RTOL, solve_contact
from ..contact.solution import RESULTS, ContactSolution
from ..contact.solver import AbstractContactSolver
from ..contact.window import operator_of
from ..core.checks import (
    Numbers,
    as_float,
    check_types,
    check_values,
    is_concrete,
    short,
)
from ..core.compilation import compiled
from ..core.memory import check_memory, num_numbers, sliding_memory
from ..fields.devices import num_devices
from ..fields.grid import Grid, direction_and_speed
from ..response.grading import AbstractGradedSolver
from ..response.heated import AbstractHeating
from ..response.kernel import attempted_kernel, stack_kernel
from ..response.layering import Layering
from ..response.stack import Rigid, Stack, interface_depths
from ..response.window import doubled, has_ground, long_cell, without_images
from ..rheology.measured import coverage
from ..rheology.shear import ShearLaw, shear_stress
from ..rheology.softening import as_strain_per_slope
from ..roughness.statistics import slope_up_to
from ..roughness.surface import Surface, check_periodic
from .sliding import Sliding


@check_types
def slide(
    stack: Stack,
    surface: Surface,
    *,
    pressure: ScalarLike | None = None,
    mean_gap: ScalarLike | None = None,
    approach: ScalarLike | None = None,
    velocity: Numbers,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    solver: AbstractContactSolver = DouglasRachford(),  # noqa: B008
    adjoint: LinearSolver = LinearSplitting(),  # noqa: B008
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008
    rtol: float = RTOL,
    shear: ShearLaw | None = None,
    temperature: ScalarLike | None = None,
    heating: AbstractHeating | None = None,
    strain_per_slope: ScalarLike | None = None,
    start: Numbers | None = None,
    solution: ContactSolution | None = None,
    throw: bool = True,
) -> Sliding:
    """Returns friction, contact area and fields of a rough surface sliding on a block.

    Differentiable in every leaf of `stack`, `surface`, `law` and `shear`, in `pressure`, `mean_gap`
    or `approach`, in `velocity` and `temperature`: `jax.grad(lambda s: slide(s, surface,
    pressure=p, velocity=v).friction)(stack)` is a stack of derivatives. Works under `jit` and
    `vmap`, see `solve_contact`.

    **Arguments:**

    - `stack`: the block, see `Stack`. `stack.at(temperature)` is the block at another temperature.
    - `surface`: the rough surface; heights count into the block.
    - `pressure`: mean pressure σ0 [Pa]; or
    - `mean_gap`: mean of the gap [m], counted from the mean of the heights; or
    - `approach`: of a body on a window [m], see `solve_contact`.
    - `velocity`: of the surface over the block [m/s]: a number (along x) or `(vx, vy)`. Two numbers
      are one velocity, not two speeds as in a scene: for several speeds use `sweep` or
      `jax.lax.map`. At rest (0, known beforehand) the relaxed moduli act and a real kernel is used.
    - `graded_solver`: the solver of graded layers and its tolerance, `Layering()` or `Riccati()`.
    - `rtol`: requested relative error of the pressure [1]; with 5e-5 the error of friction is at
      most about 1e-4 of it.
    - `shear`: law of the shear stress in the contact, called as shear(pressure, speed,
      temperature), such as `ConstantShear` or `PeakedShear`; None for hysteresis alone. The shear
      traction does not change the pressure, which is exact for ν = 1/2 on a half space.
    - `temperature`: of the contact [K], for a law of shear that varies with it; with `heating` the
      bulk temperature, to which the block is brought, see `Stack.at`.
    - `heating`: conductivities, see `Heating`: the heat of friction then changes the temperature of
      the block under the contact; `.heated` has the temperatures. None for one temperature.
    - `strain_per_slope`: for a block with `materials.StrainSoftening`, as in `mean_field_friction`:
      each wave q has the modulus at the amplitude ε = `strain_per_slope` times the rms slope of the
      surface up to q. None: the amplitude of each material.
    - `law`, `solver`, `adjoint`, `start`, `throw`: as in `solve_contact`.
    - `solution`: `.contact` of an earlier call with the same arguments. Nothing is solved then: the
      same numbers are returned, with derivatives.

    With `throw=False`, `.result` also reports a graded layer whose kernel misses its tolerance; all
    numbers are then NaN.

    **Returns:** friction, areas, errors and the contact itself, see `Sliding`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if kernel or solve fail.
    """
    if heating is not None:
        inputs = {
            "surface": surface, "pressure": pressure, "mean_gap": mean_gap, "approach": approach,
            "velocity": velocity, "law": law, "shear": shear, "temperature": temperature,
            "start": start, "strain_per_slope": strain_per_slope,
        }  # fmt: skip
        settings = {
            "solver": solver, "adjoint": adjoint, "graded_solver": graded_solver, "rtol": rtol,
            "throw": throw,
        }  # fmt: skip
        return _settled(heating, stack, inputs, settings, solution)
    if approach is not None:
        approach = check_approach(approach, surface, law)
    kernel, velocity, reached, kernel_error = kernel_and_velocity(
        stack, surface, velocity, solver, graded_solver, throw, strain_per_slope
    )
    sheared = shear_stress(shear, direction_and_speed(velocity)[1], temperature)
    contact = solve_contact(
        kernel,
        surface.heights,
        pressure,
        mean_gap=mean_gap,
        approach=approach,
        law=law,
        solver=solver,
        adjoint=adjoint,
        rtol=rtol,
        start=start,
        solution=solution,
        throw=throw,
    )
    contact = _with_kernel_result(contact, reached)
    return Sliding(
        contact=contact,
        operator=operator_of(kernel, surface.heights.shape),
        heights=surface.heights,
        measured=surface.measured,
        grid=surface.grid,
        velocity=velocity,
        law=law,
        measured_range=_coverage(stack),
        kernel_error=kernel_error,
        shear=sheared,
        thickness=None if surface.periodic else _thickness(stack),
        ground=not surface.periodic and has_ground(stack, surface.grid),
        at_approach=approach is not None,
    )


def _settled(heating: AbstractHeating, stack, inputs, settings, solution) -> Sliding:
    """The contact at the temperatures that it causes."""
    if solution is not None:
        raise ValueError("`solution` is refused with `heating`: it contains no temperatures.")
    _check_parts(stack, inputs["surface"])
    check_periodic(inputs["surface"])
    # Temperatures are as noisy as the contact is inaccurate.
    return heating.settle(
        lambda stack, **inputs: slide(stack, **inputs, **settings),
        stack,
        inputs["surface"].grid,
        inputs,
        10 * settings["rtol"],
        settings["throw"],
    )


def _thickness(stack: Stack):
    return interface_depths(stack)[-1] if isinstance(stack.base, Rigid) else None


def check_approach(approach: Numbers, surface: Surface, law: AbstractLaw) -> Array:
    """Returns an approach; refuses one of more than a window's length: of another unit.

    It is NaN if tracing hides that. At a hard wall, one that rounding hides is refused, too.
    """
    approach, grid, heights = as_float(approach, "approach"), surface.grid, surface.heights
    if is_concrete(grid.size):
        most = float(np.max(np.asarray(grid.size)))
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
    return jnp.where(approach <= jnp.max(grid.size), approach, jnp.nan)


_coverage = compiled(coverage)


def _with_kernel_result(contact: ContactSolution, reached) -> ContactSolution:
    """The contact, its result that of the kernel if that was not reached."""
    if reached is True:
        return contact
    result = RESULTS.where(reached, contact.result, RESULTS.inaccurate_kernel)
    return dataclasses.replace(contact, result=result)


def kernel_and_velocity(
    stack, surface, velocity, solver, graded_solver, throw, strain_per_slope=None
):
    """The kernel for the surface, the velocity as an array, if the kernel is good, its error."""
    _check_parts(stack, surface)
    velocity = as_float(velocity, "velocity")
    numbers, oblique = num_numbers(stack), velocity.ndim > 0
    check_memory(
        "surface",
        surface.grid.shape,
        lambda shape: sliding_memory(
            shape, surface.heights.dtype.itemsize, numbers, oblique, solver.history_length
        ),
        "sliding",
        num_devices(surface.grid.size),
    )

    strain = None
    if strain_per_slope is not None:
        check_periodic(surface)
        ratio, (q, slope) = as_strain_per_slope(strain_per_slope, stack), slope_up_to(surface)
        strain = q, ratio * slope

    def kernel_on(cell: Grid):
        arguments = stack, cell, velocity
        if throw:
            return stack_kernel(*arguments, graded_solver=graded_solver, strain=strain), True
        return attempted_kernel(*arguments, graded_solver=graded_solver, strain=strain)

    at_rest = is_concrete(velocity) and not np.any(np.asarray(velocity))
    if surface.periodic:
        kernel, reached = kernel_on(surface.grid)
        return (kernel.real if at_rest else kernel), velocity, reached, None
    near, reached = kernel_on(doubled(surface.grid))
    far, also = kernel_on(long_cell(surface.grid))
    if at_rest:
        near, far = near.real, far.real
    kernel, error = without_images(near, far, surface.grid, has_ground(stack, surface.grid))
    return kernel, velocity, (True if throw else reached & also), error


def _check_parts(stack, surface) -> None:
    if not isinstance(stack, Stack):
        raise ValueError(f"`stack={short(stack)}` must be a `Stack(layers=..., base=...)`.")
    if not isinstance(surface, Surface):
        raise ValueError(f"`surface={short(surface)}` must be a `Surface(heights, grid)`.")
