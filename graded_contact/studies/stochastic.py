"""Design with a random objective: parameters that minimise its mean.

    def objective(parameters, key):           # friction on a new surface
        surface = random_surface(spectrum, grid, key)
        return slide(with_values(stack, parameters), surface, ...).friction

A design for a few given surfaces is good on these surfaces only; here every step draws a new one.
Steps are those of an optimiser of optax (by default Adam: D. P. Kingma, J. Ba, arXiv:1412.6980) on
the logarithms of the parameters, projected on the bounds. Constraints enter by an augmented
Lagrangian whose multipliers move with every step (R. T. Rockafellar, SIAM J. Control 12 (1974) 268,
doi:10.1137/0312021). The result is the mean of the later iterates, which reduces noise (B. T.
Polyak, A. B. Juditsky, SIAM J. Control Optim. 30 (1992) 838, doi:10.1137/0330046), moved to the
nearest point that satisfies the constraints. New draws, which no step has used, then give its value
and errors.

A contact on a new surface has no useful `start`: the pressure under another surface costs more than
no start (`bench_design.py unseen`).
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray

from ..core.checks import check_values, check_whole
from .evaluations import Evaluation, Evaluations, Flat, box_of, first_in
from .progress_line import shown_on_a_line
from .search import MARGIN, Descent, Design, Tried, descend, designed
from .store import Store, open_store

LEARNING_RATE = 0.1  # of the logarithms at first; it falls to zero as a cosine
STIFFNESS = 10.0  # of the penalty: a constraint missed by a tenth weighs as much as the objective
RISE = 0.1  # share of a multiplier's full step in each draw
CLOSEST = 1e-16  # change of half the squared distance to the allowed point, at which it ends
MOST_STEPS = 100  # to the allowed point
SURE = 2.0  # standard errors by which a mean constraint may be missed

RandomObjective = Callable[[Any, PRNGKeyArray], Float[Array, ""]]
RandomConstraints = Callable[[Any, PRNGKeyArray], Float[Array, "..."]]


def minimise_expected(
    objective: RandomObjective,
    lower: Any,
    upper: Any,
    start: Any = None,
    *,
    constraints: RandomConstraints | None = None,
    optimiser: optax.GradientTransformation | None = None,
    num_steps: int = 200,
    num_checks: int = 16,
    seed: int = 0,
    rtol: float = 0.01,
    store: str | Path | Store | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Design:
    """Returns the parameters between `lower` and `upper` that minimise the mean of `objective`.

    **Arguments:**

    - `objective`: parameters and a key of JAX -> a number, differentiable by JAX; it is jitted.
      Draw all random numbers with the key, which is a new one in each step.
    - `lower`, `upper`, `start`: as in `minimise`; there is one start.
    - `constraints`: parameters and the key -> numbers whose means must not be negative, in any
      nesting, see `minimise`.
    - `optimiser`: any of optax, for the logarithms of the parameters; by default `optax.adam` with
      a rate that falls from 0.1 to 0.
    - `num_steps`: number of steps, a draw each; the result is the mean of the latter half.
    - `num_checks`: number of new draws that evaluate the result, at least 2.
    - `seed`: of all draws: the same seed gives the same design.
    - `rtol`: change and standard error of the value, over the objective's size, up to which
      the result counts as converged.
    - `store`: as in `minimise`.
    - `progress`: called with the number and the value of each draw; what it raises ends the run.
      By default a line in the terminal or notebook shows both.

    **Returns:** the design; its value, margins and elasticities are means over the new draws,
    `error` is the standard error of the value, `multipliers` are those of the
    constraints. There is one run, whose message says what is missing if it did not converge.

    **Raises:** `ValueError` as `minimise` does, and if the result misses a constraint.
    """
    check_whole("num_steps", num_steps, 4)
    check_whole("num_checks", num_checks, 2)
    check_whole("seed", seed, 0)
    check_values("rtol", rtol, "it lies between 0 and 1", above=0, at_most=1)
    box = box_of(lower, upper)
    first = first_in(box, start)
    with open_store(store) as points, shown_on_a_line(progress, "step", num_steps) as say:
        problem = Evaluations(objective, constraints, box, points, jax.random.key(seed))
        path = _steps_down(problem, first, optimiser, num_steps, say)
        # One set of draws to move the mean by, another to judge where that led.
        last = num_steps + num_checks
        mean = np.clip(np.exp(np.mean(path.points, axis=0)), box.low, box.high)
        x = _nearest_allowed(problem, mean, range(last, last + num_checks))
        return _judged(problem, x, path, range(num_steps, last), rtol)


class _Path(NamedTuple):
    """What all steps tried; logarithms of the parameters and multipliers of their latter half."""

    tried: list[tuple[float, Flat, Flat]]
    points: list[Flat]
    multipliers: list[Flat]


def _steps_down(problem, first, optimiser, num_steps, say) -> _Path:
    """The steps of the optimiser down the augmented Lagrangian of limits >= 0."""
    if optimiser is None:
        optimiser = optax.adam(optax.cosine_decay_schedule(LEARNING_RATE, num_steps))
    low, high = np.log(problem.box.low), np.log(problem.box.high)

    @jax.jit
    def step(u, state, gradient):
        updates, state = optimiser.update(gradient, state, u)
        return optax.projections.projection_box(optax.apply_updates(u, updates), low, high), state

    u, path, multipliers, squares = jnp.log(first), _Path([], [], []), 0.0, 0.0
    state = optimiser.init(u)
    for k in range(num_steps):
        x = np.clip(np.exp(u), problem.box.low, problem.box.high)
        value, limits, slope, slopes = problem.at(x, k)
        say(k, value)
        slope, slopes = x * slope, x * slopes
        # The stiffness follows from the sizes of all gradients so far: units do not matter.
        squares = squares + np.array([slope @ slope, *np.sum(slopes**2, axis=1)])
        own, *theirs = np.maximum(squares, np.finfo(float).tiny)
        stiffness = STIFFNESS * np.sqrt(own / np.array(theirs))
        # A constraint that holds with room to spare pulls with neither multiplier nor penalty.
        pull = np.maximum(multipliers - stiffness * limits, 0)
        multipliers = np.maximum(multipliers - RISE * stiffness * limits, 0)
        path.tried.append((value, np.asarray(x), limits))
        if 2 * k >= num_steps:  # the first half still moves from the start
            path.points.append(np.asarray(u))
            path.multipliers.append(pull)
        u, state = step(u, state, slope - pull @ slopes)
    return path


def _nearest_allowed(problem: Evaluations, x: Flat, draws: range) -> Flat:
    """The point nearest to `x` at which the mean constraints hold; their noise may remain."""

    def distance(at: Flat) -> Evaluation:
        limits, slopes = (
            np.mean(parts, axis=0)
            for parts in zip(*(problem.constraints(at, draw) for draw in draws), strict=True)
        )
        off = np.log(at / x)
        return Evaluation(float(off @ off) / 2, limits, off / at, slopes)

    if np.all(distance(x).limits >= MARGIN):
        return x
    return np.array(descend(distance, problem.box, x, 1.0, CLOSEST, MOST_STEPS).parameters)


def _judged(problem: Evaluations, x: Flat, path: _Path, draws: range, rtol: float) -> Design:
    """The design at `x`, by draws that no step has seen."""
    checks = [problem.at(x, draw) for draw in draws]
    values, limits, slopes = map(np.array, list(zip(*checks, strict=True))[:3])
    # The standard error of a mean.
    noise, noise_of_limits = (
        np.std(samples, axis=0, ddof=1) / np.sqrt(len(draws)) for samples in (values, limits)
    )
    margins, slope, value = limits.mean(axis=0), slopes.mean(axis=0), float(values.mean())
    if np.any(margins < -SURE * noise_of_limits - MARGIN):
        raise ValueError(
            f"The mean of `constraints` is {margins} at the end of {len(path.tried)} steps. Widen "
            "the bounds or the constraints, or raise `num_steps`."
        )
    # The mean size of the draws: a value near 0 must not make every error large.
    size, half = np.mean([abs(value) for value, *_ in path.tried]), len(path.points) // 2
    earlier, later = (np.mean(part, axis=0) for part in (path.points[:half], path.points[half:]))
    # The change of the value, to first order, between the third and the last quarter.
    drift, message = abs(x * slope @ (later - earlier)), ""
    if drift > rtol * size:
        message = f"the last steps still changed the value by {drift:.2g}: raise `num_steps`"
    elif noise > rtol * size:
        message = f"the value is known to ± {noise:.2g} only: raise `num_checks`"
    run = Descent(
        parameters=x.tolist(), value=value, num_evaluations=len(path.tried) + len(draws),
        history=Tried(*map(np.array, zip(*path.tried, strict=True))), feasible=True,
        converged=not message, message=message,
    )  # fmt: skip
    multipliers = np.mean(path.multipliers, axis=0)
    return designed(
        problem, x, value, slope, margins=margins, runs=(run,), error=float(noise),
        multipliers=multipliers,
    )  # fmt: skip
