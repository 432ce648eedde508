"""Contact of a rough rigid surface with a solid, at a mean pressure or at a mean gap.

The displacement of each mode is w = M σ: M is the kernel, and w and the heights h are positive into
the solid. Find the pressure σ and the gap u = w - h + ū that obey the law of contact: for a hard
wall σ >= 0, u >= 0, σ u = 0. Either the mean of σ is prescribed and the mean gap ū follows, or ū is
prescribed and the mean of σ follows.
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ScalarLike

from ..core.checks import (
    Numbers,
    as_float,
    as_numbers,
    check_positive,
    check_shape,
    check_squares,
    check_tolerance,
    check_types,
    check_values,
    is_concrete,
)
from ..core.compilation import jit, one_by_one
from ..core.derivative import derivative_apart, largest, still
from ..core.memory import CONTACT, check_memory
from ..fields.devices import num_devices, required
from ..fields.grid import half_shape
from .abstract_solver import (
    AbstractContactSolver,
    Inputs,
    Loading,
    SolverOutput,
    in_precision,
    participation,
    penalty_for,
    softness,
)
from .adjoint import LinearSolver, LinearSplitting, attach_gradient, check_converged, explain_lost
from .estimates import assess, contact_state, penalty_at
from .law import AbstractLaw, HardWall, check_one_law, check_pressure
from .nested_solve import DouglasRachford
from .operator import Field, first_mode
from .solution import RESULTS, ContactSolution, if_known
from .window import Window, on_part, on_whole, operator_of

# Default tolerances of the pressure. docs/howto/precision.md has the errors of friction they leave.
# 5e-5 takes 0.77 of the FFT pairs of 1e-6 (156 contacts, `bench_contact.py observables`).
# In float32 rounding hid errors of 7e-5 (a periodic cell) and 2.4e-4 (a window) on 128² points.
RTOL, SINGLE_RTOL = 5e-5, 5e-4
# Slope of an attraction over the stiffness of the shortest wave, up to which all computed
# equilibria were stable: see `adhesion.py`.
_RESOLVED = 0.3
# Tolerance of the linear solves of derivatives: its ratio to the tolerance of the pressure, and a
# limit. True errors were 0.01 to 0.5 of it, with 0.58 of the pairs of the solve at 1e-3 and 0.83 at
# 5e-5 (medians of 15 contacts, `bench_contact.py linear`).
_OF_PRESSURE, _LOOSEST_DERIVATIVE = 20, 1e-3
_WORTHLESS = 0.1  # error of gaps over the rms height
LEAST_GAP = 1e-12  # mean gaps over the rms height below this are rounding


@check_types
def solve_contact(
    kernel: Numbers,
    heights: Numbers,
    pressure: ScalarLike | None = None,
    *,
    mean_gap: ScalarLike | None = None,
    approach: ScalarLike | None = None,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    solver: AbstractContactSolver = DouglasRachford(),  # noqa: B008
    adjoint: LinearSolver = LinearSplitting(),  # noqa: B008
    rtol: float | None = None,
    start: Numbers | None = None,
    solution: ContactSolution | None = None,
    throw: bool = True,
) -> ContactSolution:
    """Returns the contact of a rough surface with a solid at a mean pressure or a mean gap.

    On a window, at a mean pressure or an approach.

    Differentiable in `kernel`, `heights`, `law` and what is prescribed (forward and reverse, one
    linear solve; see `contacts/adjoint.py` for where the derivative is one-sided), and works under
    `jit` and `vmap`. On a CPU a batch under `vmap` is solved one by one, as under `jax.lax.map`;
    elsewhere it runs until its slowest member has converged.

    **Arguments:**

    - `kernel`: M(q) [m/Pa] on the half spectrum of the heights, real or complex, Re M > 0; the
      q = 0 entry is ignored. See `stack_kernel`. With the kernel of a window, which has twice as
      many points along each axis (`window_kernel`), no pressure acts around the heights.
    - `heights`: h [m], positive into the solid, shape `(nx, ny)` or `(nx,)`; the mean is ignored.
      The more precise of `heights` and `kernel` decides in which dtype all is computed.
    - `pressure`: mean pressure σ0 [Pa], within the bounds of the law; or
    - `mean_gap`: mean of the gap u [m], measured from the mean of the heights; above 0 at a hard
      wall, because in full contact it is 0 at every pressure; or
    - `approach`: on a window, how far the body moved into the block after its first touch [m],
      relative to the block far away. In one dimension only slabs on a rigid base have one.
    - `law`: of contact.
    - `solver`: algorithm and its limits: see `DouglasRachford`, or `AbstractContactSolver` to write
      a custom one.
    - `adjoint`: solver of the linear systems of derivatives, and its tolerance: see
      `LinearSplitting`.
    - `rtol`: requested relative error of the pressure [1]; None means 5e-5, or 5e-4 in float32.
    - `start`: a pressure field [Pa] to start from, such as a neighbouring solution; a missing load
      is spread evenly. A start whose load or speed differs by more than 1.5 times gives no
      speed-up. With a law that attracts, it chooses among several solutions; see `follow_contact`.
    - `solution`: of an earlier call with the same arguments. Nothing is solved then: the same
      contact is returned, with derivatives.
    - `throw`: whether to raise if the solver fails, the kernel is not finite, or the linear solve
      of a derivative fails. With False, check `.result`: the fields are returned as they are, with
      their derivatives; a derivative is NaN if its linear solve failed. A `jit` with `throw=False`
      calls no Python, so that JAX can store its program on disk.

    **Returns:** the fields, their errors and how the solve ended, see `ContactSolution`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if the solve fails.
    """
    heights = as_float(heights, "heights")
    _check_heights(heights)
    operator = operator_of(as_numbers(kernel, "kernel"), heights.shape)
    on_window = isinstance(operator, Window)
    cell = tuple((2 if on_window else 1) * n for n in heights.shape)
    check_memory(
        "heights", "a contact", CONTACT, cell, heights.dtype.itemsize, num_devices(heights)
    )
    _check_kernel(operator.kernel, heights.shape, on_window, throw)
    check_one_law(law)
    gaps = {"mean_gap": mean_gap, "approach": approach}
    own, other = ("approach", "mean_gap") if on_window else ("mean_gap", "approach")
    if gaps[other] is not None:
        only = "in a periodic cell" if on_window else "on a window (see `Surface.periodic`)"
        raise ValueError(
            f"`{other}={gaps[other]}` is refused: only a body {only} has one. Prescribe `{own}`."
        )
    loading = loading_of(law, heights, None, pressure=pressure, **{own: gaps[own]})
    known = approach is not None and is_concrete(operator.kernel)
    if known and np.asarray(operator.kernel).flat[0] == 0:  # not by JAX: a loop would trace it
        raise ValueError(
            f"`approach={approach}` is refused: the displacement of this block has no limit far "
            "away, as of all blocks in one dimension but slabs on a `Rigid()` base. Prescribe "
            "`pressure`."
        )
    start = as_start(start, heights, law)
    inputs = Inputs(operator, heights, law, loading)
    if on_window:
        inputs, start, solution = on_whole(inputs, start, solution)
    found = contact_of(inputs, solver, adjoint, rtol, start, solution, throw)
    return on_part(found, operator) if on_window else found


def contact_of(inputs: Inputs, solver, adjoint, rtol, start, solution, throw: bool):
    """Returns the contact of checked inputs; see `solve_contact` for the arguments."""
    # In one precision: what ends a solve counts the digits of the fields.
    kernel = inputs.operator.kernel
    dtype = jnp.result_type(inputs.heights, jnp.finfo(kernel.dtype).dtype)
    inputs, start = in_precision((inputs, start), dtype)
    rtol = default_rtol(dtype) if rtol is None else rtol
    check_tolerance("rtol", rtol, inputs.heights)
    # Compiled separately: under a derivative the search is compiled already.
    fixed, start, solution = still((inputs, start, solution))
    tolerance = jnp.asarray(rtol, dtype)
    concrete = all(map(is_concrete, jax.tree.leaves((fixed, start))))
    if solution is not None:
        found = _output_of(fixed, solution)
    elif concrete and num_devices(fixed.heights) == 1 and isinstance(solver, DouglasRachford):
        found = solver.solve(*fixed, rtol=tolerance, start=start)  # in a few programs
    else:
        found = _find_contact(fixed, solver, tolerance, start)
    close = jnp.asarray(min(_OF_PRESSURE * rtol, max(rtol, _LOOSEST_DERIVATIVE)), dtype)
    solution_of = _solution_or_fail if throw else _solution_or_nan
    result, good = solution_of(inputs, solver.finds_unstable, found, adjoint, tolerance, close)
    return required(result, good, result.result.error_if) if throw else result


def default_rtol(dtype: Any) -> float:
    """Returns the tolerance of the pressure in a precision."""
    return SINGLE_RTOL if jnp.finfo(dtype).bits == 32 else RTOL


def _check_heights(heights) -> None:
    if heights.ndim not in (1, 2) or heights.size < 2:
        raise ValueError(
            f"`heights` has shape {heights.shape}; one or two axes, and two points at least, are "
            "needed."
        )
    if heights.dtype not in (jnp.float32, jnp.float64):
        raise ValueError(f"`heights` has dtype {heights.dtype}; float32 or float64 is needed.")
    check_values("heights", heights, "heights [m] must be finite")
    check_squares("heights", heights, "m")


def _check_kernel(kernel, shape: tuple[int, ...], on_window: bool, throw: bool) -> None:
    remedy = ""
    if on_window:
        remedy = (
            ". A stiff coat, or a plate on a `Free()` base, spreads the load over the window: put "
            "the body into a periodic cell several windows wide, with lower heights around it"
        )
    else:
        check_shape("kernel", kernel, half_shape(shape))
    if is_concrete(kernel):
        real, imag = _compliances(kernel, throw)
        check_positive("kernel.real", real, f"[m/Pa] for every q but 0{remedy}", squares=False)
        check_values("kernel.imag", imag, "it must be finite")


@functools.partial(jax.jit, static_argnames="throw")
def _compliances(kernel, throw: bool):
    """Real and imaginary part of the kernel, 1 and 0 where it is ignored."""
    ignored = first_mode(kernel.shape)
    if not throw:
        ignored = ignored | ~jnp.isfinite(kernel)  # `.result` reports them
    checked = jnp.where(ignored, 1, kernel)
    return checked.real, checked.imag


def as_start(start: Numbers | None, heights: Array, law: AbstractLaw) -> Array | None:
    """Returns a checked pressure to start from, if there is one."""
    if start is None:
        return None
    start = as_float(start, "start")
    check_shape("start", start, heights.shape)
    low = law.bounds[0]
    if is_concrete(low):
        # A solution's own pressures may be an ulp below after a change of units.
        allowed = f"pressures [Pa] must be at least {float(low):g}"
        check_values("start", start, allowed, at_least=float(low) * (1 + 1e-5))
    return start


def loading_of(
    law: AbstractLaw, heights: Field, num_times: int | None = None, **given: Numbers | None
) -> Loading:
    """Returns the loading: one number, or one for each of `num_times`, the heights' first axis.

    `given` are the `pressure` and the `mean_gap` or `approach`; one of the two is None.
    """
    named = [(name, value) for name, value in given.items() if value is not None]
    if len(named) != 1:
        both = " and ".join(f"`{name}={value}`" for name, value in given.items())
        raise ValueError(f"{both}: give exactly one of the two.")
    [(name, value)] = named
    value = spread = as_float(value, name)
    if num_times is None or value.ndim:
        check_shape(name, value, () if num_times is None else (num_times,))
    if num_times is not None:  # an array that broadcasts to the heights
        spread = jnp.broadcast_to(value, num_times).reshape(-1, *[1] * (heights.ndim - 1))
    if name == "pressure":
        parted = "; where the surfaces part, prescribe `mean_gap`" if num_times else ""
        check_pressure(value, law, parted)
        return Loading(spread, None)
    check_values(name, value, f"the {name.replace('_', ' ')} [m] must be finite")
    if name == "approach":
        return Loading(None, _undeformed_gap(value, law, heights))
    if isinstance(law, HardWall) and is_concrete(heights) and is_concrete(value):
        least = LEAST_GAP * float(jnp.std(heights))
        for gap in np.ravel(value):
            if abs(gap) <= least or (law.hardness is None and gap < 0):
                raise ValueError(
                    f"`mean_gap={gap:g}` is refused: at a hard wall it must be above {least:.2g} m "
                    f"(or, with a `hardness`, below -{least:.2g} m), since in full contact it is 0 "
                    "at every pressure: prescribe `pressure`."
                )
    return Loading(None, spread)


def _undeformed_gap(approach, law: AbstractLaw, heights):
    """The mean gap on a window if the block did not deform."""
    if isinstance(law, HardWall):  # at the first touch, nothing touches; else rounding decides
        least = LEAST_GAP * jnp.maximum(jnp.std(heights), jnp.finfo(heights.dtype).tiny ** 0.5)
        at_touch = jnp.abs(approach) <= least
        approach = approach + jax.lax.stop_gradient(jnp.where(at_touch, -least - approach, 0))
    return largest(heights) - jnp.mean(heights) - approach


@jit
@one_by_one
def _find_contact(inputs: Inputs, solver: AbstractContactSolver, rtol, start):
    operator = inputs.operator
    if not isinstance(solver, DouglasRachford):  # which accepts any mean, and saves a copy
        inputs = inputs._replace(operator=operator.with_kernel(operator.compliance))
    return solver.solve(*inputs, rtol=rtol, start=start)


@jit
def _output_of(inputs: Inputs, solution: ContactSolution) -> SolverOutput:
    """What a solver would return for a solution: the gap is that of the law."""
    law, pressure, gap = inputs.law, solution.pressure, solution.gap
    if isinstance(law, HardWall):
        low, high = law.bounds
        closed = jnp.where(pressure > low, jnp.minimum(gap, 0), jnp.maximum(gap, 0))
        gap = jnp.where((pressure > low) & (pressure < high), 0, closed)
    else:  # the gap of the law's point nearest to pressure and gap
        penalty = penalty_for(inputs.operator, participation(pressure), law)
        v = pressure - penalty * gap
        gap = (law.in_units(1.0, 1 / penalty).proximal(v) - v) / penalty
    return SolverOutput(
        pressure=pressure, gap=gap, mismatch=solution.correction,
        displacement=solution.displacement, error=solution.error / softness(law),
        ended=jnp.asarray(True), num_steps=jnp.asarray(0),
        num_fft_pairs=jnp.zeros((), pressure.dtype),
    )  # fmt: skip


@jit
def _solution(
    inputs: Inputs, finds_unstable: bool, found: SolverOutput, adjoint: LinearSolver, rtol, close
) -> tuple[ContactSolution, Array]:
    """The solution with its derivative, to a tolerance `close`, and whether it is one."""
    operator = inputs.operator
    inputs = inputs._replace(operator=operator.with_kernel(operator.compliance))
    found = jax.lax.stop_gradient(found)
    correction, error, gap_error = jax.lax.stop_gradient(assess(inputs, found))
    # Where rounding ended the solve, its own error counts noise out of contact, too. Under an
    # attraction the error is larger than the solver's, near a jump without limit.
    closer = found.ended & (not inputs.law.attracts)
    reached = (jnp.where(closer, error, found.error) <= rtol) & ~jnp.isnan(error)
    state = jax.lax.stop_gradient(contact_state(inputs, found))
    penalty = penalty_at(inputs, found)
    state = attach_gradient(inputs, state, found.gap, penalty, adjoint, close)
    pressure, displacement, mean_gap = state
    heights = inputs.heights - jnp.mean(inputs.heights)
    gap = displacement - heights + mean_gap
    # Errors have no derivative: that of a norm or of a maximum may be 0/0.
    known, opened = jax.lax.stop_gradient((pressure, gap))
    rms, mean = jnp.std(jax.lax.stop_gradient(heights)), jnp.mean(jnp.abs(known))
    unit, load = jnp.where(rms > 0, rms, 1), jnp.where(mean > 0, mean, 1)
    gap_error = gap_error / unit
    result = _how_it_ended(inputs, finds_unstable, found, reached, gap_error)
    solution = ContactSolution(
        pressure=pressure, displacement=displacement, gap=gap,
        mean_pressure=jnp.mean(pressure), mean_gap=mean_gap,
        correction=correction, error=error, gap_error=gap_error,
        load_error=jnp.abs(jnp.mean(found.mismatch)) / load,
        complementarity_error=jnp.mean(jnp.abs(known * (opened - found.gap))) / (load * unit),
        penetration=jnp.max(jnp.maximum(jnp.minimum(found.gap, 0) - opened, 0)) / unit,
        num_steps=found.num_steps, num_fft_pairs=found.num_fft_pairs, result=result,
    )  # fmt: skip
    return if_known(result, solution), result == RESULTS.successful


_solution_or_fail = derivative_apart(_solution, check_converged, explain_lost)
_solution_or_nan = derivative_apart(_solution)


def _how_it_ended(inputs: Inputs, finds_unstable, found: SolverOutput, reached, gap_error):
    law, (pressure, gap) = inputs.law, inputs.loading
    # From the mildest to the gravest end, each in place of those before it.
    worthless = (gap_error > _WORTHLESS) & (jnp.std(inputs.heights) > 0)
    result = RESULTS.where(worthless, RESULTS.gap_unresolved, RESULTS.successful)
    if law.attracts and finds_unstable:
        steep = law.steepest_rise * inputs.operator.least > _RESOLVED
        result = RESULTS.where(steep, RESULTS.unresolved, result)
    missed = RESULTS.where(found.ended, RESULTS.rounding, RESULTS.max_steps_reached)
    result = RESULTS.where(reached, result, missed)
    # Near full contact at a given gap the bound of the error may still be infinite.
    finite = ~jnp.isnan(found.error) & jnp.all(jnp.isfinite(found.pressure))
    finite = finite & (True if gap is None else jnp.all(jnp.isfinite(gap)))
    result = RESULTS.where(finite, result, RESULTS.not_finite)
    if pressure is not None:
        # On input the value is unknown if the pressure is traced.
        low, high = law.bounds
        possible = jnp.all((pressure > low) & (pressure < high))
        result = RESULTS.where(possible, result, RESULTS.bad_pressure)
    return result
