"""Design: positive, bounded parameters that minimise an objective, by its gradients.

Every parameter is searched on the logarithm between its bounds, by SciPy's sequential quadratic
programming (D. Kraft, DFVLR-FB 88-28, 1988), from several starts: the first is the one given, the
others are spread evenly (Halton's sequence, randomly shifted). Constraints c(parameters) >= 0 hold
in what is returned, by a margin of 1e-8: write them relative, such as 1 - total/limit.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from ..core.checks import check_tolerance, check_whole
from ..core.display import shown
from .evaluations import Box, Evaluation, Evaluations, Flat, box_of, first_in, numbers_in
from .progress_line import shown_on_a_line
from .store import Store, open_store

Objective = Callable[[Any], Float[Array, ""] | tuple[Float[Array, ""], Any]]
Constraints = Callable[[Any], Any]

MARGIN = 1e-8  # of the constraints
ACTIVE = 1e-3  # margin of a constraint, or relative distance to a bound, that counts as none
FIRST_STEP = 0.1  # largest first step over the distance of the bounds


@shown()
class Tried(NamedTuple):
    """The evaluations of a search, one entry each.

    **Fields:**

    - `values`: of the objective, shape `(evaluations,)`.
    - `parameters`: shape `(evaluations, parameters)`.
    - `margins`: of the constraints, shape `(evaluations, constraints)`.
    """

    values: Float[np.ndarray, " evaluations"]
    parameters: Float[np.ndarray, "evaluations parameters"]
    margins: Float[np.ndarray, "evaluations constraints"]


@shown()
class Descent(eqx.Module):
    """One start of a search.

    **Fields:**

    - `parameters`: its result.
    - `value`: of the objective there.
    - `history`: how it came there.
    - `num_evaluations`: of objective and gradient.
    - `feasible`: whether it satisfies the constraints.
    - `converged`: whether it met the tolerance.
    - `message`: why it ended.
    """

    parameters: list[float]
    value: float
    history: Tried
    num_evaluations: int
    feasible: bool
    converged: bool
    message: str


@shown(
    "value", "error", "converged", "message", "parameters", "elasticities", "active", "margins",
    "multipliers", "num_evaluations",
)  # fmt: skip
class Design(eqx.Module):
    """The best design found, and all runs.

    **Fields:**

    - `parameters`: as `lower` and `upper` were given.
    - `value`: of the objective.
    - `elasticities`: d ln|value|/d ln(parameter) [1], shaped as `parameters`: what matters most.
    - `margins`: of the constraints, all positive; empty without constraints.
    - `constraints`: names of the constraints.
    - `active`: which bounds and constraints hold the design where it is, a sentence each.
    - `runs`: the result of every start. Many of them near `value` mean a reliable minimum.
    - `error`: standard error of the value where it is a mean over draws, see `minimise_expected`.
    - `multipliers`: by how much the value would fall by an allowance of 1 in each constraint;
      of `minimise_expected`, else empty.
    """

    parameters: Any
    value: float
    elasticities: Any
    margins: Float[np.ndarray, " constraints"]
    runs: tuple[Descent, ...]
    constraints: tuple[str, ...] = ()
    active: tuple[str, ...] = ()
    error: float = 0.0
    multipliers: Float[np.ndarray, " multipliers"] = eqx.field(default_factory=lambda: np.zeros(0))

    @property
    def best(self) -> Descent:
        """The best run."""
        return min((run for run in self.runs if run.feasible), key=lambda run: run.value)

    @property
    def converged(self) -> bool:
        """Whether the best run met the tolerance."""
        return self.best.converged

    @property
    def message(self) -> str:
        """Why the best run ended."""
        return self.best.message

    @property
    def num_evaluations(self) -> int:
        """Evaluations of objective and gradient in all runs."""
        return sum(run.num_evaluations for run in self.runs)

    def report(self) -> str:
        """Returns parameters with their elasticities, what is active, and the runs, as text."""
        names, values = numbers_in(self.parameters)
        _, slopes = numbers_in(self.elasticities)
        width = max(map(len, names))
        error = f" ± {self.error:.2g}" if self.error else ""
        lines = [f"value {self.value:.6g}{error}; {'' if self.converged else 'NOT '}converged", ""]
        lines.append(f"{'parameter':{width}s} {'value':>12s} {'elasticity':>11s}")
        for name, value, slope in zip(names, values, slopes, strict=True):
            lines.append(f"{name:{width}s} {value:12.5g} {slope:11.3g}")
        lines += ["", *(self.active or ["no bound and no constraint is active"])]
        lines += ["", f"{'start':>5s} {'value':>12s} {'evaluations':>11s}"]
        for i, run in enumerate(self.runs):
            note = "" if run.converged and run.feasible else f"  {run.message}"
            lines.append(f"{i:5d} {run.value:12.5g} {run.num_evaluations:11d}{note}")
        return "\n".join(lines)


def minimise(
    objective: Objective,
    lower: Any,
    upper: Any,
    start: Any = None,
    *,
    constraints: Constraints | None = None,
    num_starts: int = 8,
    seed: int = 0,
    rtol: float = 1e-9,
    max_steps: int = 200,
    store: str | Path | Store | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Design:
    """Returns the parameters between `lower` and `upper` that minimise `objective`.

    **Arguments:**

    - `objective`: parameters -> a number, differentiable by JAX; it is jitted. Or parameters -> a
      pair of this number and constraints, if one solve gives both.
    - `lower`, `upper`: bounds, positive numbers in any nesting of dicts, lists and arrays. Where
      they are equal the parameter is fixed.
    - `start`: where to start first, in the same nesting; by default the middle on the logarithm.
    - `constraints`: parameters -> numbers that must not be negative, in any nesting. The keys of a
      dict are their names: `{"area of at most 0.1": 1 - area / 0.1}`.
    - `num_starts`, `seed`: number of starts, and the seed of their positions.
    - `rtol`: change of the objective over its size at which a run ends.
    - `max_steps`: of a run.
    - `store`: a folder, which is made, or a `Store`. Each evaluation is on the disk at once: the
      same call after a kill repeats its steps from there. Other searches may share the folder.
    - `progress`: called with the number of the start and the value after each evaluation; what it
      raises ends the search. By default a line in the terminal or notebook shows both.

    **Returns:** the best parameters, which bounds and constraints are active there, and the result
    of every start.

    **Raises:** `ValueError` for bounds that are refused, for an objective or constraint that is
    not finite (naming the parameters), and if no start satisfies the constraints; of a `store`,
    `BlockingIOError` if another process writes to it, and `OSError` if it cannot be written.
    """
    from scipy.stats import qmc  # takes 0.4 s to import

    check_whole("num_starts", num_starts, 1)
    check_whole("seed", seed, 0)
    check_whole("max_steps", max_steps, 1)
    check_tolerance("rtol", rtol, np.zeros(()))
    box = box_of(lower, upper)
    first = first_in(box, start)
    # A shift modulo 1 keeps the points evenly spread, for every seed.
    shift = np.random.default_rng(seed).random(len(first))
    spread = (qmc.Halton(len(first), scramble=False).random(num_starts)[1:] + shift) % 1
    starts = [first, *(box.low * (box.high / box.low) ** u for u in spread)]
    with open_store(store) as points, shown_on_a_line(progress, "start", num_starts) as say:
        problem = Evaluations(objective, constraints, box, points)
        # The median: a start may be where the objective is all but zero.
        size = np.median([abs(problem.at(x).value) for x in starts])
        runs = [
            descend(problem.at, box, x, size, rtol, max_steps, partial(say, i))
            for i, x in enumerate(starts)
        ]
    feasible = [run for run in runs if run.feasible]
    if not feasible:
        ends = [problem.at(np.array(run.parameters)).limits for run in runs]
        limits = max(ends, key=np.min)
        raise NothingAllowed(
            f"No start of {len(runs)} satisfies `constraints`: the best of them misses "
            f"{problem.names[np.argmin(limits)]!r} by {-np.min(limits):.3g}. Widen the bounds or "
            "the constraints, or search from more starts."
        )
    best = min(feasible, key=lambda run: run.value)
    x = np.array(best.parameters)
    value, margins, slope, _ = problem.at(x)
    return designed(problem, x, value, slope, margins=margins, runs=tuple(runs))


class NothingAllowed(ValueError):
    """No start of a search satisfies its constraints."""


def designed(
    problem: Evaluations, x: Flat, value: float, slope: Flat, margins: Float[np.ndarray, " limits"],
    **others: Any,
) -> Design:  # fmt: skip
    """Returns the design at flat parameters, with the derivative of its value there."""
    box = problem.box
    slopes = x * slope / value if value else x * np.inf  # d ln|value|/d ln x
    parameters, elasticities = (box.unravel(jnp.asarray(flat)) for flat in (x, slopes))
    active = [
        f"{name} is at its {end} bound"
        for end, bound in (("lower", box.low), ("upper", box.high))
        for name, u, at_end, low, high in zip(box.names, x, bound, box.low, box.high, strict=True)
        if low < high and abs(np.log(u / at_end)) <= ACTIVE * min(1, np.log(high / low))
    ]
    pairs = zip(problem.names, margins, strict=True)
    active += [f"{name} is active" for name, margin in pairs if margin <= ACTIVE]
    return Design(
        parameters=parameters, value=value, elasticities=elasticities, margins=margins,
        constraints=problem.names, active=tuple(active), **others,
    )  # fmt: skip


def descend(
    evaluate: Callable[[Flat], Evaluation], box: Box, start: Flat, size: float, rtol: float,
    max_steps: int, report: Callable[[float], None] = lambda _: None,
) -> Descent:  # fmt: skip
    """Returns one run of sequential quadratic programming, on the unit cube of the logarithms.

    **Arguments:**

    - `evaluate`: parameters -> objective and constraints.
    - `box`, `start`: bounds, and where to begin.
    - `size`: of the objective; a run ends when it changes by less than `rtol` of that, or after
      `max_steps`.
    - `report`: called with each value.
    """
    span = np.log(box.high / box.low)
    origin = np.log(start / box.low) / np.where(span > 0, span, 1)
    tried: dict[bytes, tuple] = {}

    def at(u):
        """Parameters, value, limits and their slopes on the cube, remembered."""
        if u.tobytes() not in tried:
            # At the origin `start` itself, because its logarithm is rounded.
            x = start if np.array_equal(u, origin) else box.low * np.exp(span * np.clip(u, 0, 1))
            value, limits, slope, slopes = evaluate(x)
            report(value)
            tried[u.tobytes()] = x, value, limits, slope * span * x, slopes * span * x
        return tried[u.tobytes()]

    # The first step goes along the gradient, as far as that is large: not through the cube.
    steepness = np.linalg.norm(at(origin)[3])
    scale = 1 / max(size, steepness / FIRST_STEP, np.finfo(float).tiny)
    # With a margin, because SLSQP meets active constraints to about its tolerance only.
    margins = {"type": "ineq", "fun": lambda u: at(u)[2] - MARGIN, "jac": lambda u: at(u)[4]}
    found = scipy.optimize.minimize(
        lambda u: at(u)[1] * scale,
        origin,
        jac=lambda u: at(u)[3] * scale,
        method="SLSQP",
        bounds=[(0.0, 1.0 if s > 0 else 0.0) for s in span],
        constraints=[margins] if at(origin)[2].size else [],
        # SLSQP compares changes of the scaled objective with `ftol` itself.
        options={"ftol": rtol * size * scale, "maxiter": max_steps},
    )
    last = at(np.clip(found.x, 0, 1))
    # SLSQP may end just outside a constraint: only points that satisfy all are taken.
    allowed = [one for one in tried.values() if np.all(one[2] >= 0)]
    x, value, *_ = min(allowed, key=lambda one: one[1]) if allowed else last
    path = [(value, x, limits) for x, value, limits, *_ in tried.values()]
    return Descent(
        parameters=x.tolist(), value=value, num_evaluations=len(tried),
        history=Tried(*map(np.array, zip(*path, strict=True))), feasible=bool(allowed),
        converged=bool(found.success and allowed), message=str(found.message),
    )  # fmt: skip
