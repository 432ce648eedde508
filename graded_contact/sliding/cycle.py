"""A rough rigid surface in any periodic motion on a layered viscoelastic block.

The surface h(x - s(t)) is pressed on the block while it moves by s(t): back and forth, with starts
and stops, under a load that varies. One contact problem in space and time gives the periodic state
at once (`contacts/space_time.py`), without steps in time.

Per cycle and area, friction does the work ∮ τ·v dt, with the traction τ = -⟨σ ∇w⟩ that opposes the
motion, and the load does the work ∮ ⟨σ ∂w/∂t⟩ dt, at a fixed point of the surface. The block turns
their sum to heat: T Σ -ω Im M |σ_qω|². Shear in the contact acts along the motion at each time; the
coupling of its traction is that of `coupling.py`.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from ..blocks.grading import graded_tolerance
from ..blocks.periodic_kernel import periodic_kernel
from ..blocks.tangential_kernel import periodic_tangential_kernels
from ..contacts.abstract_solver import Inputs
from ..contacts.law import check_one_law
from ..contacts.solution import RESULTS, ContactSolution, ended
from ..contacts.solve import as_start, contact_of, loading_of
from ..contacts.space_time import SpaceTime, in_motion
from ..core.checks import Numbers, check_squares
from ..core.derivative import derivative_apart
from ..core.memory import CYCLE, check_memory
from ..fields.devices import required
from ..fields.grid import Grid
from ..materials.coverage import coverage
from ..surfaces.surface import check_periodic
from .coupling import Coupling, lagged
from .motion import components
from .numerics import Numerics
from .result import CyclicSliding
from .shear import is_coupled, shear_stress, unless_negative


def solve_cycle(
    case: Any,
    numerics: Numerics,
    start: Numbers | None = None,
    solution: ContactSolution | None = None,
) -> CyclicSliding:
    """Returns the periodic state of a `Case` with a displacement over time, without its heat.

    See `slide_cycle`; with a `solution` as `Case.solve`.
    """
    stack, surface, law, period = case.stack, case.surface, case.law, case.period
    check_periodic(surface)
    check_one_law(law)
    grid, num_times = surface.grid, len(case.displacement)
    check_squares("heights", surface.heights, "m")
    heights = jnp.broadcast_to(surface.heights, (num_times, *grid.shape))
    check_memory("displacement", "a cycle", CYCLE, heights.shape, heights.dtype.itemsize)
    loading_of(law, heights, num_times, **_load(case))  # refuses what is no load
    begin = as_start(start, heights, law)
    kernel, error = periodic_kernel(stack, grid, num_times, period, numerics.graded_solver)
    reached = error <= graded_tolerance(numerics.graded_solver, None, grid.size)
    sheared = shear_stress(case.shear, jnp.zeros((), heights.dtype), case.temperature)
    coupling = None
    if is_coupled(case.shear):
        lift, along, good = periodic_tangential_kernels(
            stack, grid, num_times, period, components(case.displacement).shape[1],
            numerics.graded_solver,
        )  # fmt: skip
        coupling, reached = Coupling(lift, along), reached & good
    # Under `jit` only the program itself can raise.
    if numerics.throw:
        kernel = required(kernel, reached, RESULTS.inaccurate_kernel.error_if)
    operator = _operator(unless_negative(kernel, sheared), case.displacement, grid)

    def result(given, contact):
        case, operator, sheared, coupling = given
        return CyclicSliding(
            contact=contact, operator=operator, heights=case.surface.heights, grid=grid,
            law=case.law, displacement=case.displacement, period=case.period, shear=sheared,
            coupling=coupling, measured_range=coverage(stack), prescribed=case.prescribed,
        )  # fmt: skip

    def solve(given, shift, start, solution):
        """The contact of the heights less a shift."""
        case, operator = given[:2]
        heights = jnp.broadcast_to(case.surface.heights, (num_times, *grid.shape))
        loading = loading_of(case.law, heights, num_times, **_load(case))
        heights = heights if shift is None else heights - shift
        contact = contact_of(
            Inputs(operator, heights, case.law, loading),
            numerics.solver, numerics.adjoint, numerics.rtol, start, solution, numerics.throw,
        )  # fmt: skip
        return result(given, contact)

    given = case, operator, sheared, coupling
    if coupling is None:
        found = solve(given, None, begin, solution)
    else:
        none = jnp.zeros_like(heights)
        found = lagged(solve, result, given, numerics, begin, solution, none)
    if not numerics.throw:
        contact = ended(found.contact, reached, RESULTS.inaccurate_kernel)
        found = dataclasses.replace(found, contact=contact)
    return found


def _load(case: Any) -> dict[str, Any]:
    return {"pressure": case.pressure, "mean_gap": case.mean_gap}


@derivative_apart
@eqx.filter_jit
def _operator(kernel, displacement, grid: Grid) -> SpaceTime:
    moved = components(displacement)
    # A motion along x alone stays in place on the other axis.
    missing = grid.ndim - moved.shape[1]
    return in_motion(kernel, jnp.pad(moved, [(0, 0), (0, missing)]), grid)
