"""Design: positive, bounded parameters that make an objective least, by its gradients.

Every parameter is searched on the logarithm between its bounds, by SciPy's sequential quadratic
programming (D. Kraft, DFVLR-FB 88-28, 1988), from several starts: the first is the one given, the
others are spread evenly (Halton's sequence, randomly shifted). Constraints c(parameters) >= 0 hold
in what is returned, by a margin of 1e-8: write them relative, such as 1 - total/limit.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float
from scipy.optimize import minimize
from scipy.stats import qmc

from .._checks import as_float, check_values, check_whole, door
from .evaluations import MARGIN, Evaluation, Evaluations

Objective = Callable[[Any], Float[Array, ""]]
Constraints = Callable[[Any], Float[Array, "..."]]

FIRST_STEP = 0.1  # longest, of the way between the bounds


class Run(NamedTuple):
    """One start: parameters and value it came to, values by step, evaluations, and why it ended."""

    parameters: list[float]
    value: float
    history: list[float]
    num_evaluations: int
    feasible: bool
    converged: bool
    message: str


@dataclasses.dataclass(frozen=True, eq=False)
class Design:
    """The best design found, and the evidence.

    **Fields:**

    - `parameters`: as `lower` and `upper` were given.
    - `value`: of the objective.
    - `elasticities`: d ln|value|/d ln(parameter), shaped as `parameters`: what matters most.
    - `margins`: of the constraints, all positive; empty without constraints.
    - `runs`: what every start came to. The number of them near `value` tells how sure it is.
    """

    parameters: Any
    value: float
    elasticities: Any
    margins: Float[np.ndarray, " constraints"]
    runs: tuple[Run, ...]

    @property
    def converged(self) -> bool:
        """Whether the best run met the tolerance."""
        return min((r for r in self.runs if r.feasible), key=lambda r: r.value).converged

    @property
    def num_evaluations(self) -> int:
        """Evaluations of objective and gradient in all runs."""
        return sum(run.num_evaluations for run in self.runs)

    def report(self) -> str:
        """Returns parameters with their elasticities, and the runs, as text."""
        names, values = _named(self.parameters)
        _, slopes = _named(self.elasticities)
        width = max(map(len, names))
        lines = [f"value {self.value:.6g}; {'' if self.converged else 'NOT '}converged", ""]
        lines.append(f"{'parameter':{width}s} {'value':>12s} {'elasticity':>11s}")
        for name, value, slope in zip(names, values, slopes, strict=True):
            lines.append(f"{name:{width}s} {value:12.5g} {slope:11.3g}")
        lines += ["", f"{'start':>5s} {'value':>12s} {'evaluations':>11s}"]
        for i, run in enumerate(self.runs):
            note = "" if run.converged and run.feasible else f"  {run.message}"
            lines.append(f"{i:5d} {run.value:12.5g} {run.num_evaluations:11d}{note}")
        return "\n".join(lines)


@door
def minimise(
    objective: Objective,
    lower: Any,
    upper: Any,
    start: Any = None,
    *,
    constraints: Constraints | None = None,
    num_starts: int = 8,
    seed: int = 0,
    tolerance: float = 1e-9,
    max_steps: int = 200,
    store: str | Path | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Design:
    """Returns the parameters between `lower` and `upper` that make `objective` least.

    **Arguments:**

    - `objective`: parameters -> a number, differentiable by JAX; it is jitted.
    - `lower`, `upper`: bounds, positive numbers in any nesting of dicts, lists and arrays. Where
      they are equal the parameter is held.
    - `start`: where to start first, in the same nesting; by default the middle on the logarithm.
    - `constraints`: parameters -> numbers that must not be negative.
    - `num_starts`, `seed`: how many starts, and what spreads them.
    - `tolerance`: change of the objective over its size at which a run ends.
    - `max_steps`: of a run.
    - `store`: a file that keeps every evaluation at once: a call that was cut off, called again,
      repeats its steps from there and goes on. Other bounds, starts and tolerances may share it.
    - `progress`: called with the number of the start and the value after each evaluation; what it
      raises ends the search.

    **Raises:** `ValueError` for bounds that are refused, for an objective or constraint that is
    not finite (naming the parameters), if no start satisfies the constraints, and for a `store`
    whose values are not those of `objective` and `constraints`: where the search starts, where it
    ends and at its first entry they are computed again.
    """
    check_whole("num_starts", num_starts, 1)
    check_whole("seed", seed, 0)
    check_whole("max_steps", max_steps, 1)
    check_values("tolerance", tolerance, "it lies between 0 and 1", above=0, at_most=1)
    low, high, unravel = _bounds(lower, upper)
    starts = _starts(low, high, start, lower, num_starts, seed)
    kept = Evaluations(store, _named(lower)[0])
    problem = _Problem(objective, constraints, low, high, unravel, kept)
    if kept.first is not None:
        problem.evaluate(kept.first, proven=True)
    # A start may be where the objective is all but zero.
    size = np.median([abs(problem.evaluate(x, proven=True).value) for x in starts])
    runs = []
    for i, x in enumerate(starts):
        if progress is not None:
            problem.tell = partial(progress, i)
        runs.append(problem.run(x, size, tolerance, max_steps))
        problem.evaluate(np.array(runs[-1].parameters), proven=True)
    feasible = [run for run in runs if run.feasible]
    if not feasible:
        least = max(problem.evaluate(np.array(run.parameters)).limits.min() for run in runs)
        raise ValueError(
            f"No start of {len(runs)} satisfies `constraints`; the best of them falls short by "
            f"{-least:.3g}. Widen the bounds or the constraints, or raise `num_starts`."
        )
    best = min(feasible, key=lambda run: run.value)
    x = np.array(best.parameters)
    value, margins, slope, _ = problem.evaluate(x)
    return Design(
        parameters=unravel(jnp.asarray(x)),
        value=value,
        elasticities=unravel(jnp.asarray(x * slope / value if value else x * np.inf)),
        margins=margins,
        runs=tuple(runs),
    )


@door
def rounded(
    objective: Objective, design: Design, choices: dict[str, Sequence[float]], **arguments: Any
) -> Design:
    """Returns a design with some parameters from what can be made, the others found again.

    **Arguments:**

    - `objective`: as in `minimise`, with what that was given as `arguments`, `lower` and `upper`
      included.
    - `design`: to begin from; its parameters must be a dict.
    - `choices`: the values that a parameter can have, by its key; the nearest on the logarithm is
      taken.
    """
    bounds = {end: dict(arguments.pop(end)) for end in ("lower", "upper")}
    start = dict(design.parameters)
    for key, values in choices.items():
        if key not in start:
            raise ValueError(f"`choices` names {key!r}, which is none of {list(start)}.")
        values = np.asarray(values, float)
        inside = (values >= np.max(bounds["lower"][key])) & (values <= np.min(bounds["upper"][key]))
        if not np.any(inside):
            raise ValueError(f"`choices[{key!r}]` has no value between the bounds.")
        logs = np.log(values[inside])
        wanted = np.log(np.asarray(start[key]))
        nearest = np.abs(wanted[..., None] - logs).argmin(axis=-1)
        start[key] = bounds["lower"][key] = bounds["upper"][key] = values[inside][nearest]
    arguments.setdefault("num_starts", 1)
    return minimise(objective, bounds["lower"], bounds["upper"], start, **arguments)


@door
def pareto_front(
    objectives: Callable[[Any], Float[Array, "2"]],
    lower: Any,
    upper: Any,
    *,
    num_points: int = 7,
    constraints: Constraints | None = None,
    store: str | Path | None = None,
    **arguments: Any,
) -> list[tuple[Design, Float[np.ndarray, "2"]]]:
    """Returns designs between which one of two objectives improves only if the other worsens.

    Between the two single optima, the first objective is minimised under ceilings of the second
    that are equally spaced. Designs that another beats in both are left out.

    **Arguments:**

    - `objectives`: parameters -> two numbers, both to be small.
    - `num_points`: ceilings, the two ends included.
    - `store`: as in `minimise`, a file for each point: of "front.jsonl" they are
      "front-first.jsonl", "front-second.jsonl" for the ends, "front-2of7.jsonl" and so on.
    - others: as in `minimise`.

    **Returns:** pairs of a design and its two objectives, the first objective increasing.
    """
    if num_points < 2:
        raise ValueError(f"`num_points={num_points}` must be at least 2.")

    def best(point, i, start=None, limit=None):
        def all_constraints(p):
            parts = [] if constraints is None else [jnp.ravel(constraints(p))]
            if limit is not None:
                parts.append(jnp.atleast_1d((limit - objectives(p)[1]) / spread))
            return jnp.concatenate(parts)

        some = all_constraints if constraints is not None or limit is not None else None
        # Every point is a problem of its own.
        own = None if store is None else Path(store).with_stem(f"{Path(store).stem}-{point}")
        found = minimise(
            lambda p: objectives(p)[i], lower, upper, start, constraints=some, store=own,
            **arguments,
        )  # fmt: skip
        return found, np.asarray(objectives(found.parameters))

    ends = [best("first", 0), best("second", 1)]
    high, low = ends[0][1][1], ends[1][1][1]
    spread = abs(high - low) or 1.0
    found, previous = [ends[0]], ends[0][0]
    for k, limit in enumerate(np.linspace(high, low, num_points)[1:-1], start=2):
        found.append(best(f"{k}of{num_points}", 0, previous.parameters, limit))
        previous = found[-1][0]
    found.append(ends[1])
    values = np.array([v for _, v in found])
    beaten = [bool(np.any(np.all(values < v, axis=1))) for v in values]
    front = [pair for pair, out in zip(found, beaten, strict=True) if not out]
    return sorted(front, key=lambda pair: float(pair[1][0]))


@door
def scatter(
    objective: Objective, parameters: Any, spread: Any, *, num_samples: int = 64, seed: int = 0
) -> Float[Array, " samples"]:
    """Returns the objective of designs that scatter as manufacture does.

    **Arguments:**

    - `parameters`: of the design.
    - `spread`: standard deviation of ln(parameter) [1]: one number, or as `parameters`.
    - `num_samples`, `seed`: how many draws, and what draws them.
    """
    check_whole("num_samples", num_samples, 1)
    check_whole("seed", seed, 0)
    flat, unravel = ravel_pytree(
        jax.tree.map(functools.partial(as_float, name="parameters"), parameters)
    )
    width, _ = ravel_pytree(jax.tree.map(functools.partial(as_float, name="spread"), spread))
    width = jnp.broadcast_to(width, flat.shape) if width.shape == (1,) else width
    if width.shape != flat.shape or not bool(jnp.all(jnp.isfinite(width) & (width >= 0))):
        raise ValueError("`spread` must be a number or as `parameters`, zero or positive.")
    draws = jax.random.normal(jax.random.key(seed), (num_samples, flat.size))
    return jax.jit(lambda all_: jax.lax.map(lambda x: objective(unravel(x)), all_))(
        flat * jnp.exp(width * draws)
    )


class _Problem:
    """Objective and constraints on the unit cube, each point evaluated once."""

    def __init__(self, objective, constraints, low, high, unravel, kept):
        self.low, self.high, self.unravel, self.kept = low, high, unravel, kept
        self.span = np.log(high / low)
        self.tell: Callable[[float], None] = lambda _: None
        self.constrained = constraints is not None

        def limits(x):
            if constraints is None:
                return jnp.zeros(0)
            return jnp.ravel(jnp.asarray(constraints(unravel(x))))

        self.limits = jax.jit(lambda x: (limits(x), jax.jacrev(limits)(x)))
        self.objective = jax.jit(jax.value_and_grad(lambda x: objective(unravel(x))))

    def parameters(self, u):
        if np.array_equal(u, self.origin):
            return self.start  # whose logarithm is rounded
        return self.low * np.exp(self.span * np.clip(u, 0, 1))

    def evaluate(self, x, proven=False):
        """Objective and constraints at parameters; `proven`, even if a file has them already."""
        kept = self.kept.get(x, proven)
        if kept is not None:
            return kept
        value, slope = self.objective(x)
        limits, slopes = self.limits(x)
        for name, array in (("objective", value), ("constraints", limits)):
            if not np.all(np.isfinite(array)):
                raise ValueError(f"`{name}` is {np.asarray(array)} at {_text(self.unravel(x))}.")
        if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(slopes))):
            raise ValueError(f"A derivative is not finite at {_text(self.unravel(x))}.")
        found = Evaluation(float(value), *map(np.asarray, (limits, slope, slopes)))
        self.kept.add(x, found)
        return found

    def at(self, u):
        """The same on the cube, remembered."""
        if self.last is None or not np.array_equal(self.last[0], u):
            x = self.parameters(u)
            value, limits, slope, slopes = self.evaluate(x)
            self.count += 1
            self.tell(value)
            scale = self.span * x
            self.last = (np.array(u), value, limits, slope * scale, slopes * scale)
        return self.last

    def run(self, start, size, tolerance, max_steps):
        u = np.log(start / self.low) / np.where(self.span > 0, self.span, 1)
        self.count, self.last, self.start, self.origin = 0, None, start, u
        # The first step goes along the gradient, as far as that is large: not through the cube.
        steepness = np.linalg.norm(self.at(u)[3])
        scale = 1 / max(size, steepness / FIRST_STEP, np.finfo(float).tiny)
        history = [self.at(u)[1]]
        best = (np.inf, u)

        def seen(u):
            nonlocal best
            _, value, limits, *_ = self.at(u)
            if np.all(limits >= 0) and value < best[0]:
                best = (value, np.array(u))

        def after_step(u):
            history.append(self.at(u)[1])
            seen(u)

        seen(u)
        limits = {
            "type": "ineq",
            "fun": lambda u: self.at(u)[2] - MARGIN,
            "jac": lambda u: self.at(u)[4],
        }
        found = minimize(
            lambda u: self.at(u)[1] * scale,
            u,
            jac=lambda u: self.at(u)[3] * scale,
            method="SLSQP",
            bounds=[(0.0, 1.0 if s > 0 else 0.0) for s in self.span],
            constraints=[limits] if self.constrained else [],
            options={"ftol": tolerance * size * scale, "maxiter": max_steps},
            callback=after_step,
        )
        seen(np.clip(found.x, 0, 1))
        feasible = bool(np.isfinite(best[0]))
        value, u = best if feasible else (self.at(found.x)[1], found.x)
        return Run(
            parameters=self.parameters(u).tolist(),
            value=float(value),
            history=history,
            num_evaluations=self.count,
            feasible=feasible,
            converged=bool(found.success) and feasible,
            message=str(found.message),
        )


def _bounds(lower, upper):
    """Flat bounds, checked, and what gives flat values their nesting."""
    if jax.tree.structure(lower) != jax.tree.structure(upper):
        raise ValueError("`lower` and `upper` must have the same nesting.")
    names, low = _named(lower)
    names_high, high = _named(upper)
    if names != names_high:
        raise ValueError("`lower` and `upper` must have arrays of the same shapes.")
    if len(low) == 0:
        raise ValueError("`lower` holds no parameter.")
    for name, a, b in zip(names, low, high, strict=True):
        if not (np.isfinite(a) and np.isfinite(b) and 0 < a <= b):
            raise ValueError(
                f"Bounds of {name} are {a:g} and {b:g}; they must be positive, and the lower one "
                "not above the upper."
            )
    _, unravel = ravel_pytree(jax.tree.map(lambda leaf: jnp.asarray(leaf, float), lower))
    return low, high, unravel


def _starts(low, high, start, like, num_starts, seed):
    if num_starts < 1:
        raise ValueError(f"`num_starts={num_starts}` must be at least 1.")
    if start is None:
        first = np.sqrt(low * high)
    else:
        if jax.tree.structure(start) != jax.tree.structure(like):
            raise ValueError("`start` must have the nesting of `lower`.")
        names, first = _named(start)
        if first.shape != low.shape:
            raise ValueError("`start` must have arrays of the same shapes as `lower`.")
        for name, x, a, b in zip(names, first, low, high, strict=True):
            if not a * (1 - 1e-9) <= x <= b * (1 + 1e-9):
                raise ValueError(f"`start` has {name} = {x:g}, not between {a:g} and {b:g}.")
        first = np.clip(first, low, high)
    shift = np.random.default_rng(seed).random(len(low))
    spread = (qmc.Halton(len(low), scramble=False).random(num_starts)[1:] + shift) % 1
    return [first, *(low * (high / low) ** u for u in spread)]


def _named(tree):
    """Names and values of all numbers in a nesting."""
    names, values = [], []
    for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
        array = np.asarray(leaf, float)
        where = jax.tree_util.keystr(path, simple=True, separator=".") or "parameter"
        for index in np.ndindex(array.shape):
            names.append(where + "".join(f"[{i}]" for i in index))
            values.append(float(array[index]))
    return names, np.array(values)


def _text(parameters):
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(*_named(parameters), strict=True))
