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
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ..contact.adjoint import Inputs, LinearSolver, LinearSplitting
from ..contact.law import AbstractLaw, HardWall, check_law
from ..contact.nested_solve import DouglasRachford
from ..contact.problem import RTOL, contact_of, loading_of
from ..contact.solution import RESULTS, ContactSolution
from ..contact.space_time import SpaceTime, in_motion
from ..core.checks import (
    Numbers,
    as_float,
    as_scalar,
    check_positive,
    check_squares,
    check_tolerance,
    check_types,
    check_values,
    short,
)
from ..core.derivative import derivative_apart
from ..core.display import shown
from ..core.memory import check_memory, cycle_memory
from ..core.warnings import LIMIT, SLIDING_RULES, Rule, caveats_of
from ..fields.devices import required
from ..fields.grid import Grid
from ..response.grading import AbstractGradedSolver, graded_tolerance
from ..response.layering import Layering
from ..response.periodic import periodic_kernel
from ..response.stack import Stack
from ..rheology.measured import coverage
from ..roughness.surface import Surface, check_periodic
from .cycle_numbers import MeanAndPeak, components, cycle_numbers

_FEWEST = 4  # times in a period


@shown(
    "mean_friction", "mean_friction_error", "peak_friction", "peak_friction_error", "work",
    "load_work", "dissipated_power", "phase", "friction", "contact_area", "mean_gap", "load",
    "time_in_contact", "energy_imbalance", "slope_in_contact", "largest_step", "contact", "caveats",
)  # fmt: skip
class CyclicSliding(eqx.Module):
    """Friction, contact area and fields over a cycle.

    Arrays over time have the shape `(nt,)`; those along the motion `(nt, 2)` if the displacement
    has two components. Errors and `energy_imbalance` have no derivative.

    **Observables:** over time

    - `friction`: traction over load [1], positive where it opposes a motion along +x; NaN where
      a mean gap leaves no contact. Over `displacement` it draws the hysteresis loop.
    - `traction`: τ [Pa], the shear stress on the whole area.
    - `load`: mean pressure [Pa].
    - `mean_gap`: mean of the gap [m].
    - `contact_area`, `contact_area_corrected`, `contact_area_smooth`: as those of `Sliding` [1].
    - `geometric_friction`: friction from the surface's slope [1]. Its difference from `friction` is
      the error of the grid.

    and of the whole cycle

    - `work`: of friction per area [J/m²].
    - `load_work`: of the load on the block per area [J/m²]; the dissipated energy is the sum.
    - `dissipated_power`: mean power lost in the block per area [W/m²].
    - `dissipation`: its parts at the frequencies ω = 2π k/T, k = 0, 1, ..., shape `(nt//2 + 1,)`.
    - `mean_friction`: work over ∮ load |v| dt [1], 0 without motion; under steady sliding the
      friction coefficient.
    - `peak_friction`: the largest |friction| of any time [1].
    - `mean_friction_error`, `peak_friction_error`: their estimated errors from the solver [1].
    - `time_in_contact`: share of the times at which the surfaces touch [1].
    - `phase`: by which the first harmonic of the traction leads that of the displacement [rad]:
      0 for a spring, π/2 for a dashpot; 0 without motion.
    - `slope_in_contact`: rms slope of the block where it carries the load, the largest of all times
      [1].
    - `load_mismatch`: difference of `load_work` from -∮ σ0 dū, its other form, over the energy
      dissipated [1]: the error of grid and times, 0 without dissipation.
    - `energy_imbalance`: works of friction and load against dissipation, relative [1].
    - `largest_step`: largest distance that the surface moves from one time to the next, in spacings
      of the grid, along x plus along y [1].
    - `unresolved_motion`: share of the velocity at the upper half of the frequencies [1].
    - `extrapolated_friction`: share of the dissipation at frequencies at which a material was not
      measured [1].

    **Fields:**

    - `contact`: pressure, gap and convergence, see `ContactSolution`; the fields have the shape
      `(nt, *grid.shape)`. Also reached directly as `.pressure`, `.gap` [Pa, m] and `.result`.
    - `operator`: the block in space and time.
    - `heights`, `grid`, `law`: of the surface and of the contact.
    - `displacement`, `velocity`: s(t) and ds/dt of the surface [m, m/s].
    - `period`: T [s].
    """

    friction: Float[Array, "nt ..."]
    traction: Float[Array, "nt ..."]
    load: Float[Array, " nt"]
    mean_gap: Float[Array, " nt"]
    contact_area: Float[Array, " nt"]
    contact_area_corrected: Float[Array, " nt"]
    contact_area_smooth: Float[Array, " nt"]
    geometric_friction: Float[Array, "nt ..."]
    work: Float[Array, ""]
    load_work: Float[Array, ""]
    dissipated_power: Float[Array, ""]
    dissipation: Float[Array, " nw"]
    mean_friction: Float[Array, ""]
    peak_friction: Float[Array, ""]
    mean_friction_error: Float[Array, ""]
    peak_friction_error: Float[Array, ""]
    time_in_contact: Float[Array, ""]
    phase: Float[Array, ""]
    slope_in_contact: Float[Array, ""]
    energy_imbalance: Float[Array, ""]
    load_mismatch: Float[Array, ""]
    largest_step: Float[Array, ""]
    unresolved_motion: Float[Array, ""]
    extrapolated_friction: Float[Array, ""]
    contact: ContactSolution
    operator: SpaceTime
    heights: Float[Array, "..."]
    grid: Grid
    law: AbstractLaw
    displacement: Float[Array, "nt ..."]
    velocity: Float[Array, "nt ..."]
    period: Float[Array, ""]

    @property
    def times(self) -> Float[Array, " nt"]:
        """The times of all arrays over time [s]."""
        count = len(self.displacement)
        return self.period * jnp.arange(count, dtype=self.period.dtype) / count

    @property
    def caveats(self) -> tuple[str, ...]:
        """Warnings about these numbers, one sentence each; not under `jit`."""
        return tuple(caveat.sentence for caveat in caveats_of(self, RULES))

    @property
    def pressure(self) -> Float[Array, "nt *shape"]:
        return self.contact.pressure

    @property
    def gap(self) -> Float[Array, "nt *shape"]:
        return self.contact.gap

    @property
    def result(self) -> RESULTS:
        return self.contact.result


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
    rtol: float | None = None,
    friction_rtol: float | None = None,
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
    - `friction_rtol`: requested relative error of the mean and the peak friction and of the mean
      sub-pixel contact area [1]; for frictions below 1 % of the slope in contact, relative to that
      1 %. Or
    - `rtol`: requested relative error of the pressure [1]; 5e-5 if neither is given.
    - `law`, `solver`, `adjoint`, `start`, `throw`: as in `solve_contact`; the law has no history.
    - `graded_solver`: as in `slide`.

    **Returns:** friction and areas over time, works, errors and the contact, see `CyclicSliding`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if kernel or solve fail.
    """
    displacement, period = _motion(stack, surface, displacement, period)
    check_periodic(surface)
    if rtol is not None and friction_rtol is not None:
        raise ValueError(
            f"`rtol={rtol}` and `friction_rtol={friction_rtol}`: give at most one of the two."
        )
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
    target = None
    if friction_rtol is not None:
        check_tolerance("friction_rtol", friction_rtol, heights)
        tolerance = jnp.asarray(friction_rtol, heights.dtype)
        target = MeanAndPeak(operator, grid, law, displacement, period, tolerance)
    contact = contact_of(
        Inputs(operator, heights, law, loading),
        solver,
        adjoint,
        friction_rtol or rtol or RTOL,
        target,
        start,
        None,
        throw,
    )
    if not throw:
        result = RESULTS.where(reached, contact.result, RESULTS.inaccurate_kernel)
        contact = eqx.tree_at(lambda c: c.result, contact, result)
    numbers = cycle_numbers(contact, operator, surface, law, displacement, period, coverage(stack))
    return CyclicSliding(
        **numbers,
        contact=contact,
        operator=operator,
        heights=surface.heights,
        grid=grid,
        law=law,
        displacement=displacement,
        period=period,
    )


RULES = (
    *SLIDING_RULES,
    Rule(
        lambda found: found.largest_step,
        1.0 + LIMIT,
        "The surface moves by up to {worst:.2g} spacings of the grid from one time to the next: "
        "the times do not resolve how the shortest waves move. Take more times.",
    ),
    Rule(
        lambda found: found.load_mismatch,
        LIMIT,
        "The work of the load has an error of about {worst:.0%} of the dissipated energy: the load "
        "or the gap changes too fast for the number of times. If it jumps, let it change over "
        "several times; otherwise take more times.",
    ),
    Rule(
        lambda found: np.all(np.asarray(found.load) == 0, axis=-1),
        0,
        "The surfaces never touch: without a load there is no friction.",
    ),
    Rule(
        lambda found: found.unresolved_motion,
        LIMIT,
        "{worst:.0%} of the velocity is at the upper half of the frequencies that the times "
        "resolve: the motion has kinks or jumps. Take more times, or a smoother motion.",
    ),
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
