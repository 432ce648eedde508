"""Contact of a rough rigid surface with a solid, at a mean pressure or at a mean gap.

The displacement of each mode is w = M σ: M is the kernel, and w and the heights h are positive into
the solid. Find the pressure σ and the gap u = w - h + ū that obey the law of contact: for a hard
wall σ >= 0, u >= 0, σ u = 0. Either the mean of σ is prescribed and the mean gap ū follows, or ū is
prescribed and the mean of σ follows.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ScalarLike

from ..core.checks import Numbers, as_float, as_numbers, check_tolerance, in_precision, is_concrete
from ..core.compilation import compiled, compiled_loop, one_by_one
from ..core.derivative import derivative_apart, still
from ..core.memory import CONTACT, check_memory
from ..fields.devices import num_devices, required
from .adjoint import attach_gradient
from .estimates import assess, contact_state, penalty_at
from .inputs import as_start, check_gap, check_heights, check_kernel, loading_of
from .law import AbstractLaw, HardWall, Windowed, depth_of_flow, never_overlaps
from .operators.operator import nonzero
from .operators.window import Window, operator_of, with_ground
from .solution import RESULTS, ContactSolution, if_known
from .solver.abstract_solver import AbstractContactSolver, Inputs, SolverOutput, participation
from .solver.nested_solve import DouglasRachford

# Default tolerances of the pressure. docs/performance.md has the errors of friction they leave.
# 5e-5 takes 0.77 of the FFT pairs of 1e-6 (156 contacts).
# In float32 rounding hid errors of 7e-5 (a periodic cell) and 2.4e-4 (a window) on 128² points.
RTOL, SINGLE_RTOL = 5e-5, 5e-4
# Slope of an attraction over the stiffness of the shortest wave, up to which all computed
# equilibria were stable: see `law.py`.
_RESOLVED = 0.3
# Tolerance of the linear solves of derivatives: its ratio to the tolerance of the pressure, and a
# limit. True errors were 0.01 to 0.5 of it, with 0.58 of the pairs of the solve at 1e-3 and 0.83 at
# 5e-5 (medians of 15 contacts).
_OF_PRESSURE, _LOOSEST_DERIVATIVE = 20, 1e-3
_WORTHLESS = 0.1  # error of gaps over the rms height


def solve_contact(
    kernel: Numbers,
    heights: Numbers,
    pressure: ScalarLike | None = None,
    *,
    mean_gap: ScalarLike | None = None,
    approach: ScalarLike | None = None,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    solver: AbstractContactSolver = DouglasRachford(),  # noqa: B008
    rtol: float | None = None,
    derivative_rtol: float | None = None,
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
    - `mean_gap`: mean of the gap u [m], measured from the mean of the heights; at a hard wall 0 or
      more. In full contact it is 0 at every pressure, and the least one is found. With a
      `hardness` the depth of the flow counts as a negative gap; or
    - `approach`: on a window, how far the body moved into the block after its first touch [m],
      relative to the block far away. In one dimension only slabs on a rigid base have one.
    - `law`: of contact.
    - `solver`: algorithm and its limits: see `DouglasRachford`, or `AbstractContactSolver` to write
      a custom one.
    - `rtol`: requested relative error of the pressure [1]; None means 5e-5, or 5e-4 in float32.
    - `derivative_rtol`: requested relative error of a derivative of the pressure [1]; None means
      twenty times `rtol`, at most 1e-3.
    - `start`: a pressure field [Pa] to start from, such as a neighbouring solution; a missing load
      is spread evenly. A start whose load or speed differs by more than 1.5 times gives no
      speed-up. With a law that attracts, it chooses among several solutions: along a
      path of gaps pass the last one.
    - `solution`: of an earlier call with the same arguments. Nothing is solved then: the same
      contact is returned, with derivatives. On a window its pressure is a `start`.
    - `throw`: whether to raise if the solver fails, the kernel is not finite, or the linear solve
      of a derivative fails. With False, check `.result`: the fields are returned as they are, with
      their derivatives; a derivative is NaN if its linear solve failed. A `jit` with `throw=False`
      calls no Python, so that JAX can store its program on disk.

    **Returns:** the fields, their errors and how the solve ended, see `ContactSolution`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if the solve fails.
    """
    heights = as_float(heights, "heights")
    check_heights(heights)
    operator = operator_of(as_numbers(kernel, "kernel"), heights.shape)
    on_window = isinstance(operator, Window)
    cell = tuple((2 if on_window else 1) * n for n in heights.shape)
    check_memory(
        "heights", "a contact", CONTACT, cell, heights.dtype.itemsize, num_devices(heights)
    )
    check_kernel(operator.kernel, heights.shape, on_window, throw)
    # Not by JAX: a loop would trace it.
    known = approach is not None and is_concrete(operator.kernel)
    ground = not known or bool(np.asarray(operator.kernel).flat[0] != 0)
    load = check_gap(on_window, ground, pressure, mean_gap=mean_gap, approach=approach)
    loading = loading_of(law, heights, None, **load)
    start = as_start(start, heights, law)
    inputs = Inputs(operator, heights, law, loading)
    return contact_of(inputs, solver, rtol, derivative_rtol, start, solution, throw)


def contact_of(inputs: Inputs, solver, rtol, derivative_rtol, start, solution, throw: bool):
    """Returns the contact of checked inputs; see `solve_contact` for the arguments."""
    if not isinstance(inputs.operator, Window):
        return _contact_on_cell(inputs, solver, rtol, derivative_rtol, start, solution, throw)
    whole, start = _on_whole(inputs, start if solution is None else solution.pressure)
    found = _contact_on_cell(whole, solver, rtol, derivative_rtol, start, None, throw)
    return _on_part(found, inputs)


def _on_whole(inputs: Inputs, start: Array | None) -> tuple[Inputs, Array | None]:
    """Returns the inputs of the contact on the cell of a window, and its start.

    The gap of the loading belongs to the undeformed block.
    """
    operator, heights, law, loading = inputs
    if loading.gap is None:  # the mean over the cell, of which the window is a part
        loading = loading._replace(pressure=loading.pressure / 2**heights.ndim)
    else:
        operator = with_ground(operator, heights.shape)
    inputs = Inputs(operator, operator.on_cell(heights, "symmetric"), Windowed(law), loading)
    return inputs, None if start is None else operator.on_cell(start)


@compiled
def _on_part(found: ContactSolution, inputs: Inputs) -> ContactSolution:
    """Returns the contact on a window, and its means there, from the contact on the cell."""
    fields = found.pressure, found.gap, found.displacement, found.correction
    pressure, gap, moved, correction = map(inputs.operator.on_surface, fields)
    opened = gap - depth_of_flow(inputs.law, pressure, gap)
    moved = moved - jnp.mean(moved)  # of zero mean on the window
    return dataclasses.replace(
        found, pressure=pressure, gap=gap, displacement=moved, correction=correction,
        mean_pressure=jnp.mean(pressure), mean_gap=jnp.mean(opened),
    )  # fmt: skip


def _contact_on_cell(inputs: Inputs, solver, rtol, derivative_rtol, start, solution, throw: bool):
    # In one precision: what ends a solve counts the digits of the fields.
    kernel = inputs.operator.kernel
    dtype = jnp.result_type(inputs.heights, jnp.finfo(kernel.dtype).dtype)
    inputs, start = in_precision((inputs, start), dtype)
    rtol = default_rtol(dtype) if rtol is None else rtol
    check_tolerance("rtol", rtol, inputs.heights)
    if derivative_rtol is None:
        derivative_rtol = min(_OF_PRESSURE * rtol, max(rtol, _LOOSEST_DERIVATIVE))
    check_tolerance("derivative_rtol", derivative_rtol, inputs.heights)
    # Compiled separately: under a derivative the search is compiled already.
    fixed, start, solution = still((inputs, start, solution))
    # As numbers of NumPy: of Python's, JAX would compile a program.
    tolerance, close = (jnp.asarray(dtype.type(value)) for value in (rtol, derivative_rtol))
    concrete = all(map(is_concrete, jax.tree.leaves((fixed, start))))
    if solution is not None:
        found = _output_of(fixed, solution)
    elif concrete and num_devices(fixed.heights) == 1 and isinstance(solver, DouglasRachford):
        found = solver.solve(*fixed, rtol=tolerance, start=start)  # in a few programs
    else:
        found = _find_contact(fixed, solver, tolerance, start)
    how = solver.finds_unstable, throw
    result, good = _solution(inputs, *how, found, tolerance, close)
    if throw:
        return required(result, good, result.result.error_if)
    return _unless_failed(result)


def default_rtol(dtype: Any) -> float:
    """Returns the tolerance of the pressure in a precision."""
    return SINGLE_RTOL if jnp.finfo(dtype).bits == 32 else RTOL


@compiled_loop
@one_by_one
def _find_contact(inputs: Inputs, solver: AbstractContactSolver, rtol, start):
    inputs = _known_to_have_a_solution(inputs)
    operator = inputs.operator
    if not isinstance(solver, DouglasRachford):  # which accepts any mean, and saves a copy
        inputs = inputs._replace(operator=operator.with_kernel(operator.compliance))
    return solver.solve(*inputs, rtol=rtol, start=start)


def _known_to_have_a_solution(inputs: Inputs) -> Inputs:
    """NaN in place of a load or a kernel that input would have refused if it had been known.

    A solver would look for a solution up to its last step.
    """
    law, load, operator = inputs.law, inputs.loading.pressure, inputs.operator
    if load is not None:
        low, high = law.bounds
        load = jnp.where((load > low) & (load < high), load, jnp.nan)
    pulls = jnp.sum(jnp.where(operator.is_mean, 0, jnp.real(operator.kernel))) <= 0
    operator = operator.with_kernel(operator.kernel * jnp.where(pulls, jnp.nan, 1))
    return inputs._replace(operator=operator, loading=inputs.loading._replace(pressure=load))


@compiled
def _output_of(inputs: Inputs, solution: ContactSolution) -> SolverOutput:
    """The output of a solver for a known solution, with the gap of the law."""
    law, pressure, gap = inputs.law, solution.pressure, solution.gap
    if isinstance(law, HardWall):
        low, high = law.bounds
        closed = jnp.where(pressure > low, jnp.minimum(gap, 0), jnp.maximum(gap, 0))
        gap = jnp.where((pressure > low) & (pressure < high), 0, closed)
    else:  # the gap of the law's point nearest to pressure and gap
        penalty = inputs.operator.penalty_for(participation(pressure), law.steepest_rise)
        v = pressure - penalty * gap
        gap = (law.in_units(1.0, 1 / penalty).proximal(v) - v) / penalty
    return SolverOutput(
        pressure=pressure, gap=gap,
        displacement=solution.displacement, error=solution.error / law.softness,
        ended=jnp.asarray(True), num_steps=jnp.asarray(0),
        num_fft_pairs=jnp.zeros((), pressure.dtype),
    )  # fmt: skip


@derivative_apart
@compiled
def _solution(
    inputs: Inputs, finds_unstable: bool, throw: bool, found: SolverOutput, rtol, close
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
    state = attach_gradient(inputs, state, found.gap, penalty, close, throw)
    pressure, displacement, mean_gap = state
    if never_overlaps(inputs.law):  # in full contact the error of 0 may be negative
        mean_gap = mean_gap + jax.lax.stop_gradient(jnp.maximum(-mean_gap, 0))
    heights = inputs.heights - jnp.mean(inputs.heights)
    gap = displacement - heights + mean_gap
    flown = depth_of_flow(inputs.law, pressure, gap)
    # Errors have no derivative: a norm's may be 0/0.
    gap_error = gap_error / nonzero(jnp.std(jax.lax.stop_gradient(heights)))
    result = _how_it_ended(inputs, finds_unstable, found, reached, gap_error)
    solution = ContactSolution(
        pressure=pressure, displacement=displacement, gap=gap,
        mean_pressure=jnp.mean(pressure), mean_gap=mean_gap - operator.mean(flown),
        correction=correction, error=error, gap_error=gap_error,
        num_steps=found.num_steps, num_fft_pairs=found.num_fft_pairs, result=result,
    )  # fmt: skip
    return solution, result == RESULTS.successful


@compiled
def _unless_failed(solution: ContactSolution) -> ContactSolution:
    """NaN in place of all numbers of a failed solve.

    A program of its own: the one of the derivative would compute again how the solve ended.
    """
    return if_known(solution.result, solution)


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
    operator = inputs.operator
    negative = jnp.any((jnp.real(operator.kernel) <= 0) & ~operator.is_mean)
    result = RESULTS.where((reached & finite) | ~negative, result, RESULTS.not_positive)
    if pressure is not None:
        # On input the value is unknown if the pressure is traced.
        low, high = law.bounds
        possible = jnp.all((pressure > low) & (pressure < high))
        result = RESULTS.where(possible, result, RESULTS.bad_pressure)
    return result
