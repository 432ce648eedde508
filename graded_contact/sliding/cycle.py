"""A rough rigid surface in any periodic motion on a layered viscoelastic block.

The surface h(x - s(t)) is pressed on the block while it moves by s(t): back and forth, with starts
and stops, under a load that varies. One contact problem in space and time gives the periodic state
at once (`contacts/space_time.py`), without steps in time.

Per cycle and area, friction does the work ∮ τ·v dt, with the traction τ = -⟨σ ∇w⟩ that opposes the
motion, and the load does the work ∮ ⟨σ ∂w/∂t⟩ dt, at a fixed point of the surface. The block turns
their sum to heat: T Σ -ω Im M |σ_qω|². Shear in the contact acts along the motion at each time; the
coupling of its traction is that of `isothermal.py`.
"""

import equinox as eqx
import jax.numpy as jnp

from ..blocks.grading import graded_tolerance
from ..blocks.periodic_kernel import periodic_kernel
from ..blocks.tangential_kernel import periodic_tangential_kernels
from ..contacts.inputs import loading_of
from ..contacts.law import check_one_law
from ..contacts.solution import RESULTS
from ..contacts.space_time import SpaceTime, in_motion
from ..core.checks import check_squares
from ..core.derivative import derivative_apart
from ..core.memory import CYCLE, check_memory
from ..fields.devices import required
from ..fields.grid import Grid
from ..materials.coverage import coverage
from ..surfaces.surface import check_periodic
from .case import Case
from .facts import facts_of
from .motion import components
from .numerics import Numerics
from .problem import Coupling, CycleProblem, Posed
from .shear import is_coupled, shear_stress, unless_negative


def cycle_problem(case: Case, how: Numerics) -> Posed:
    """Returns the problem of a case with a displacement over time, and its load."""
    stack, surface, law, period = case.stack, case.rough, case.law, case.period
    check_periodic(surface)
    check_one_law(law)
    grid, num_times = surface.grid, len(case.displacement)
    check_squares("heights", surface.heights, "m")
    heights = jnp.broadcast_to(surface.heights, (num_times, *grid.shape))
    check_memory("displacement", "a cycle", CYCLE, heights.shape, heights.dtype.itemsize)
    load = dict(pressure=case.pressure, mean_gap=case.mean_gap)
    loading_of(law, heights, num_times, **load)  # refuses what is no load
    kernel, error = periodic_kernel(stack, grid, num_times, period)
    reached = error <= graded_tolerance(stack, None, grid.size)
    sheared = shear_stress(case.shear, jnp.zeros((), heights.dtype), case.temperature)
    coupling = None
    if is_coupled(case.shear):
        lift, along, good = periodic_tangential_kernels(
            stack, grid, num_times, period, components(case.displacement).shape[1]
        )
        coupling, reached = Coupling(lift, along), reached & good
    # Under `jit` only the program itself can raise.
    if how.throw:
        kernel = required(kernel, reached, RESULTS.inaccurate_kernel.error_if)
    problem = CycleProblem(
        operator=_operator(unless_negative(kernel, sheared), case.displacement, grid),
        heights=surface.heights, grid=grid, law=law, displacement=case.displacement, period=period,
        shear=sheared, coupling=coupling, measured_range=coverage(stack),
        prescribed=case.prescribed, facts=facts_of(case),
    )  # fmt: skip
    return Posed(problem, load, True if how.throw else reached)


@derivative_apart
@eqx.filter_jit
def _operator(kernel, displacement, grid: Grid) -> SpaceTime:
    moved = components(displacement)
    # A motion along x alone stays in place on the other axis.
    missing = grid.ndim - moved.shape[1]
    return in_motion(kernel, jnp.pad(moved, [(0, 0), (0, missing)]), grid)
