"""The contact of a case at one temperature of the block: the one place where contacts are solved.

    case ──> problem and load ──> contact of the heights less d ──> result
             (steady.py, cycle.py)         ^                          │
                                           └──     d(pressure)     ───┘

d is the displacement that is no part of the kernel, else 0: M_ze τ under a traction, and in a cycle
what the counterface lacks of its relaxed displacement (`bodies.py`). It lags: it uses the pressure
before. Anderson's acceleration ends the loop, and the derivative is implicit. In a cycle
the traction has the direction in which the surface moves at each time. While the surface rests
there is none: the law is for gross sliding.
"""

import dataclasses

import jax
import jax.numpy as jnp

from ...contacts.solution import RESULTS, ContactSolution, ended
from ...core.checks import Numbers, is_concrete
from ...core.compilation import compiled
from ...core.derivative import still
from ...core.fixed_point import attach_fixed_field, find_fixed_point
from ...fields.devices import required
from ...materials.coverage import coverage
from ..case import Case, Numerics
from ..formulas import lift
from ..problem import Prescribed, Problem
from ..result import CyclicSliding, Sliding, result_of
from .cycle import cycle_problem
from .steady import steady_problem

_LOOSER = 10  # tolerance of the traction over the pressure's, whose noise it has


def solve_isothermal(
    case: Case, how: Numerics, start: Numbers | None = None, solution: ContactSolution | None = None
) -> Sliding | CyclicSliding:
    """Returns the contact of a case without its heat; arguments as of `solve_contact`."""
    pose = cycle_problem if case.velocity is None else steady_problem
    problem, reached = pose(case)
    load, ranges = case.load, tuple(map(coverage, case.bodies))
    problem = dataclasses.replace(problem, measured_ranges=ranges)
    if how.throw:  # under `jit` only the program itself can raise
        operator = problem.operator
        kernel = required(operator.kernel, reached, RESULTS.inaccurate_kernel.error_if)
        problem = dataclasses.replace(problem, operator=operator.with_kernel(kernel))
    counterface = problem.counterface
    if problem.coupling.lags or (counterface is not None and counterface.lags):
        found = _lagged(problem, load, how, start, solution)
    else:
        found = result_of(problem, problem.contact(load, how, None, start, solution))
    contact = found.contact
    if not how.throw:
        contact = ended(contact, reached, RESULTS.inaccurate_kernel)
    return dataclasses.replace(found, contact=contact, bodies=case.bodies)


def _lagged(
    problem: Problem,
    load: Prescribed,
    how: Numerics,
    start: Numbers | None,
    solution: ContactSolution | None,
) -> Sliding | CyclicSliding:
    """The contact under a traction that is no part of its kernel."""
    given, none = (problem, load), jnp.zeros(problem.shape, problem.heights.dtype)

    def solve(given, shift, start, solution):
        problem, load = given
        return result_of(problem, problem.contact(load, how, shift, start, solution))

    fixed, tolerance = still(given), jnp.asarray(_LOOSER * how.rtol, none.dtype)
    pairs, settled = jnp.zeros((), none.dtype), jnp.asarray(True)
    if solution is None:

        def step(x, state):
            start, pairs = state
            found = solve(fixed, x, start, None)
            return _lift(found), (found.pressure, pairs + found.contact.num_fft_pairs)

        point = find_fixed_point(step, none, (start, pairs), tolerance)
        x, (start, pairs) = jax.lax.stop_gradient(point.x), point.state
        found, settled = solve(fixed, x, start, None), point.error <= tolerance
        pairs = pairs + found.contact.num_fft_pairs
    else:
        solution = still(solution)
        x = _lift(still(result_of(problem, solution)))
        before = dataclasses.replace(solution, displacement=solution.displacement - x)
        found = solve(fixed, x, None, before)
    # Derivatives are attached only where something is traced.
    if not all(map(is_concrete, jax.tree.leaves(given))):
        contact = still(found.contact)
        image = lambda given, x: _lift(solve(given, x, None, contact))  # noqa: E731
        x = attach_fixed_field(image, given, x)
        found = solve(given, x, None, contact)
    contact = found.contact
    if how.throw:
        contact = required(contact, settled, RESULTS.not_settled.error_if)
    contact = ended(contact, settled, RESULTS.not_settled)
    moved = contact.displacement + x
    contact = dataclasses.replace(contact, displacement=moved, num_fft_pairs=pairs)
    return dataclasses.replace(found, contact=contact)


_lift = compiled(lift)
