"""A rough rigid surface in any periodic motion on a layered viscoelastic block.

The surface h(x - s(t)) is pressed on the block while it moves by s(t): back and forth, with starts
and stops, under a load that varies. One contact problem in space and time gives the periodic state
at once (`contact/space_time.py`), without steps in time.

Per cycle and area, friction does the work ∮ τ·v dt, with the traction τ = -⟨σ ∇w⟩ that opposes the
motion, and the load does the work ∮ ⟨σ ∂w/∂t⟩ dt, at a fixed point of the surface. The block turns
their sum to heat: T Σ -ω Im M |σ_qω|².
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import ScalarLike

from ..contact.adjoint import Inputs, LinearSolver, LinearSplitting
from ..contact.law import AbstractLaw, HardWall, check_law
from ..contact.nested_solve import DouglasRachford
from ..contact.problem import RTOL, contact_of, loading_of
from ..contact.solution import RESULTS
from ..contact.space_time import SpaceTime, in_motion
from ..core.checks import (
    Numbers,
    as_float,
    as_scalar,
    check_positive,
    check_squares,
    check_types,
    check_values,
    short,
)
from ..core.derivative import derivative_apart
from ..core.memory import check_memory, cycle_memory
from ..fields.devices import required
from ..fields.grid import Grid
from ..response.grading import AbstractGradedSolver, graded_tolerance
from ..response.layering import Layering
from ..response.periodic import periodic_kernel
from ..response.stack import Stack
from ..rheology.measured import coverage
from ..roughness.surface import Surface, check_periodic
from .motion import components
from .sliding import CyclicSliding

_FEWEST = 4  # times in a period


@check_types
def slide_cycle(
    stack: Stack,
    surface: Surface,
    *,
    displacement: Numbers,
    period: ScalarLike,
    pressure: Numbers | None = None,
    mean_gap: Numbers | None = None,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    solver: DouglasRachford = DouglasRachford(),  # noqa: B008
    adjoint: LinearSolver = LinearSplitting(),  # noqa: B008
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008
    rtol: float = RTOL,
    start: Numbers | None = None,
    throw: bool = True,
) -> CyclicSliding:
    """Returns friction, contact area and fields of a surface in periodic motion on a block.

    The periodic state, which a repeated motion approaches. Differentiable in every leaf of `stack`,
    `surface` and `law`, in the motion and in the prescribed load or gap; works under `jit` and
    `vmap`.

    **Arguments:**

    - `stack`: the block, see `Stack`. `stack.at(temperature)` is the block at another temperature.
    - `surface`: the rough surface; heights count into the block.
    - `displacement`: s [m] of the surface at equally spaced times of a period, shape `(nt,)` (along
      x) or `(nt, 2)`, nt at least 4; see `sinusoidal`, `start_stop`, `steady`, `recorded`. Over a
      period the surface may advance by whole cells; their number follows from the last step, which
      must be like its neighbours.
    - `period`: T [s].
    - `pressure`: mean pressure σ0 [Pa], a number or one at each time; or
    - `mean_gap`: mean of the gap [m], a number or one at each time, counted from the mean of the
      heights.
    - `law`, `solver`, `adjoint`, `rtol`, `start`, `throw`: as in `solve_contact`; the law has no
      history.
    - `graded_solver`: as in `slide`.

    **Returns:** friction and areas over time, works, errors and the contact, see `CyclicSliding`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if kernel or solve fail.
    """
    displacement, period = _motion(stack, surface, displacement, period)
    check_periodic(surface)
    check_law(law)
    grid, num_times = surface.grid, len(displacement)
    check_squares("heights", surface.heights, "m")
    heights = jnp.broadcast_to(surface.heights, (num_times, *grid.shape))
    check_memory(
        "displacement",
        heights.shape,
        lambda shape: cycle_memory(shape, heights.dtype.itemsize, solver.history_length),
        "a cycle",
    )
    loading = loading_of(pressure, mean_gap, law, heights, num_times)
    kernel, error = periodic_kernel(stack, grid, num_times, period, graded_solver)
    reached = error <= graded_tolerance(graded_solver, None, grid.size)
    if throw:
        kernel = required(kernel, reached, lambda x, bad: eqx.error_if(x, bad, _NOT_REACHED))
    operator = _operator(kernel, displacement, grid)
    inputs = Inputs(operator, heights, law, loading)
    contact = contact_of(inputs, solver, adjoint, rtol, start, None, throw)
    if not throw:
        result = RESULTS.where(reached, contact.result, RESULTS.inaccurate_kernel)
        contact = eqx.tree_at(lambda c: c.result, contact, result)
    return CyclicSliding(
        contact=contact,
        operator=operator,
        heights=surface.heights,
        grid=grid,
        law=law,
        displacement=displacement,
        period=period,
        measured_range=coverage(stack),
    )


_NOT_REACHED = (
    "The tolerance was not reached in the kernel of a graded layer: its profile varies too "
    "sharply. Put boundaries between layers at its jumps and list its kinks in `breaks`, or pass a "
    "`graded_solver` with a larger `rtol`."
)


def _motion(stack, surface, displacement, period):
    """The checked displacement and period."""
    if not isinstance(stack, Stack):
        raise ValueError(f"`stack={short(stack)}` must be a `Stack(layers=..., base=...)`.")
    if not isinstance(surface, Surface):
        raise ValueError(f"`surface={short(surface)}` must be a `Surface(heights, grid)`.")
    displacement, period = as_float(displacement, "displacement"), as_scalar(period, "period")
    components = displacement.shape[1:]
    few = displacement.ndim == 0 or len(displacement) < _FEWEST
    if few or components not in ((), (2,)) or len(components) >= surface.grid.ndim:
        raise ValueError(
            f"`displacement` has shape {displacement.shape}; `(nt,)` or, on a grid in two "
            f"dimensions, `(nt, 2)` is needed, with nt of at least {_FEWEST} times."
        )
    check_values("displacement", displacement, "a displacement [m] must be finite")
    check_positive("period", period, "[s]")
    return displacement, period


@derivative_apart
@eqx.filter_jit
def _operator(kernel, displacement, grid: Grid) -> SpaceTime:
    moved = components(displacement)
    missing = grid.ndim - moved.shape[1]
    return in_motion(kernel, jnp.pad(moved, [(0, 0), (0, missing)]), grid)
