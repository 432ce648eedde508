"""A rough rigid surface in any periodic motion on a layered viscoelastic block.

The surface h(x - s(t)) is pressed on the block while it moves by s(t): back and forth, with starts
and stops, under a load that varies. One contact problem in space and time gives the periodic state
at once (`contacts/operators/space_time.py`), without steps in time.

Per cycle and area, friction does the work ∮ τ·v dt, with the traction τ = -⟨σ ∇w⟩ that opposes the
motion, and the load does the work ∮ ⟨σ ∂w/∂t⟩ dt, at a fixed point of the surface. The block turns
their sum to heat: T Σ -ω Im M |σ_qω|². Shear in the contact acts along the motion at each time; the
traction is coupled as in `isothermal.py`.
"""

import jax.numpy as jnp
from jaxtyping import Array

from ...blocks.stack import Stack
from ...contacts.inputs import loading_of
from ...contacts.operators.space_time import SpaceTime, at_rest, in_motion
from ...core.checks import within
from ...core.compilation import compiled
from ...core.derivative import derivative_apart
from ...core.memory import CYCLE, CYCLE_COUNTERFACE, check_memory
from ...fields.grid import Grid
from ...kernels.periodic import periodic_kernel
from ...kernels.tangential import periodic_tangential_kernels
from ...response.grading import graded_tolerance
from ...surfaces.surface import check_periodic
from ..bodies import Counterface, Coupling, middle_of
from ..case import Case, facts_of
from ..motion.motion import components
from ..problem import CycleProblem
from ..shear import is_coupled, shear_stress


def cycle_problem(case: Case) -> tuple[CycleProblem, Array]:
    """Returns the problem of a case with a period, and whether its kernel is good."""
    surface, law = case.surface, case.law
    check_periodic(surface)
    grid, num_times = surface.grid, len(case.displacement)
    heights = jnp.broadcast_to(surface.heights, (num_times, *grid.shape))
    fields = CYCLE if case.counterface is None else CYCLE + CYCLE_COUNTERFACE
    check_memory("displacement", "a cycle", fields, heights.shape, heights.dtype.itemsize)
    # Refuses what is no load.
    loading_of(law, heights, num_times, pressure=case.pressure, mean_gap=case.mean_gap)
    kernel, coupling, reached = _response(case, case.stack)
    counterface = None
    if case.counterface is not None:
        with within("`counterface`:"):
            other, traction, good = _response(case, case.counterface)
        reached = reached & good
        lags = jnp.iscomplexobj(other)
        counterface = Counterface(at_rest(other), middle_of(other), traction, lags)
    sheared = shear_stress(case.shear, jnp.zeros((), heights.dtype), case.temperature)
    own = None if case.block_surface is None else case.block_surface.heights
    problem = CycleProblem(
        operator=_operator(kernel, counterface, case.displacement, grid),
        heights=surface.heights, grid=grid, law=law, displacement=case.displacement,
        period=case.period, shear=sheared, coupling=coupling, counterface=counterface,
        block_heights=own, prescribed=case.prescribed, facts=facts_of(case),
    )  # fmt: skip
    return problem, reached


def _response(case: Case, stack: Stack) -> tuple[Array, Coupling, Array]:
    """The kernel of a body, its coupling by traction, and whether they are good."""
    grid, num_times, period = case.surface.grid, len(case.displacement), case.period
    kernel, error = periodic_kernel(stack, grid, num_times, period)
    reached = error <= graded_tolerance(stack, grid.size)
    if not is_coupled(case.shear):
        return kernel, Coupling(), reached
    axes = components(case.displacement).shape[1]
    lift, along, good = periodic_tangential_kernels(stack, grid, num_times, period, axes)
    return kernel, Coupling(lift, along), reached & good


@derivative_apart
@compiled
def _operator(kernel, counterface: Counterface | None, displacement, grid: Grid) -> SpaceTime:
    moved = components(displacement)
    # A motion along x alone stays in place on the other axis.
    missing = grid.ndim - moved.shape[1]
    block = in_motion(kernel, jnp.pad(moved, [(0, 0), (0, missing)]), grid)
    return block if counterface is None else counterface.beside(block)
