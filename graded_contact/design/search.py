"""Design: positive, bounded parameters that minimise an objective, by its gradients.

Every parameter is searched on the logarithm between its bounds, by SciPy's sequential quadratic
programming (D. Kraft, DFVLR-FB 88-28, 1988), from several starts: the first is the one given, the
others are spread evenly (Halton's sequence, shifted). Constraints c(parameters) >= 0 hold in the
result, by a margin of 1e-8: write them relative, such as 1 - total/limit.
"""

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..core.checks import check_tolerance, check_whole
from ..core.compilation import jit
from ..core.display import shown
from ..studies.points import patiently

MARGIN = 1e-8  # of the constraints: SLSQP meets them to about its tolerance only
FIRST_STEP = 0.1  # largest first step over the distance of the bounds
Flat = Float[np.ndarray, " parameters"]


@shown()
class Descent(NamedTuple):
    """One start of a search, and its evaluations in their order.

    **Fields:**

    - `values`: of the objective, shape `(evaluations,)`.
    - `parameters`: shape `(evaluations, parameters)`.
    - `margins`: of the constraints, shape `(evaluations, constraints)`.
    - `converged`: whether it met the tolerance.
    - `message`: why it ended.
    """

    values: Float[np.ndarray, " evaluations"]
    parameters: Float[np.ndarray, "evaluations parameters"]
    margins: Float[np.ndarray, "evaluations constraints"]
    converged: bool
    message: str

    @property
    def value(self) -> float:
        """The least value that the constraints allow; infinite if there is none."""
        return float(np.min(self._allowed))

    @property
    def best(self) -> int:
        """The number of its evaluation."""
        return int(np.argmin(self._allowed))

    @property
    def _allowed(self) -> np.ndarray:
        return np.where(np.all(self.margins >= 0, axis=1), self.values, np.inf)


@shown("value", "converged", "message", "parameters", "elasticities", "constraints")
class Design(eqx.Module):
    """The best design found.

    **Fields:**

    - `parameters`: as `lower` and `upper` were given.
    - `value`: of the objective.
    - `elasticities`: d ln|value|/d ln(parameter) [1], as `parameters`.
    - `constraints`: their values, as the function gives them; near 0 where one is active.
    - `best`: the best run.
    - `runs`: from every start. Many of them near `value` mean a reliable minimum.
    """

    parameters: Any
    value: float
    elasticities: Any
    constraints: Any
    best: Descent
    runs: tuple[Descent, ...]

    @property
    def converged(self) -> bool:
        """Whether the best run met the tolerance."""
        return self.best.converged

    @property
    def message(self) -> str:
        """Why the best run ended."""
        return self.best.message


class Box(NamedTuple):
    """Flat bounds, and the function that restores the nesting of flat values."""

    low: Flat
    high: Flat
    unravel: Callable[[Any], Any]


def box_of(lower: Any, upper: Any) -> Box:
    """Returns bounds, checked: of the same nesting, positive, and in this order."""
    if jax.tree.structure(lower) != jax.tree.structure(upper):
        raise ValueError("`upper` must have the same nesting as `lower`.")
    low, unravel = ravel_pytree(jax.tree.map(lambda leaf: jnp.asarray(leaf, float), lower))
    high = ravel_pytree(jax.tree.map(lambda leaf: jnp.asarray(leaf, float), upper))[0]
    if not (low.size and low.shape == high.shape and np.all((low > 0) & (low <= high))):
        raise ValueError("`lower` and `upper` must be positive, and `lower` at most `upper`.")
    return Box(np.asarray(low), np.asarray(high), unravel)


def first_in(box: Box, start: Any) -> Flat:
    """Returns where a search begins: `start`, checked, or the middle on the logarithm."""
    if start is None:
        return np.sqrt(box.low * box.high)
    first = np.asarray(ravel_pytree(start)[0], float)
    # A start may come from a file, with rounded digits.
    ends = (1 - 1e-9) * box.low, (1 + 1e-9) * box.high
    if first.shape != box.low.shape or np.any((first < ends[0]) | (first > ends[1])):
        raise ValueError(f"`start={start}` must lie between `lower` and `upper`.")
    return np.clip(first, box.low, box.high)


def minimise(
    objective: Callable[[Any], Any],
    lower: Any,
    upper: Any,
    start: Any = None,
    *,
    constraints: Callable[[Any], Any] = lambda parameters: (),
    num_starts: int = 8,
    seed: int = 0,
    rtol: float = 1e-9,
    max_steps: int = 200,
    progress: bool = False,
) -> Design:
    """Returns the parameters between `lower` and `upper` that minimise `objective`.

    **Arguments:**

    - `objective`: parameters -> a number, differentiable by JAX; it is jitted. Or parameters -> a
      pair of this number and constraints, if one solve gives both.
    - `lower`, `upper`: bounds, positive numbers in any nesting of dicts, lists and arrays. Where
      they are equal the parameter is fixed.
    - `start`: where to start first, in the same nesting; by default the middle on the logarithm.
    - `constraints`: parameters -> numbers that must not be negative, in any nesting.
    - `num_starts`, `seed`: number of starts, and the seed of their positions.
    - `rtol`: change of the objective over its size at which a run ends.
    - `max_steps`: of a run.
    - `progress`: whether to show evaluations while they come.

    **Returns:** the best parameters, their elasticities, and the run from every start.

    **Raises:** `ValueError` for bounds that are refused, for an objective or constraint that is
    not finite, and if no start satisfies the constraints.
    """
    check_whole("num_starts", num_starts, 1)
    check_whole("seed", seed, 0)
    check_whole("max_steps", max_steps, 1)
    check_tolerance("rtol", rtol, jnp.zeros(()))
    from scipy.stats import qmc  # takes 0.4 s to import

    box = box_of(lower, upper)
    first = first_in(box, start)
    # A shift modulo 1 keeps the points evenly spread, for every seed.
    shift = np.random.default_rng(seed).random(len(first))
    spread = (qmc.Halton(len(first), scramble=False).random(num_starts)[1:] + shift) % 1
    starts = [first, *(box.low * (box.high / box.low) ** u for u in spread)]

    def all_of(flat: Array) -> tuple[Array, Any]:
        found = objective(box.unravel(flat))
        value, own = found if isinstance(found, tuple) else (found, ())
        limits = own, constraints(box.unravel(flat))
        return jnp.append(jnp.reshape(value, 1), ravel_pytree(limits)[0]), limits

    def work(stop: threading.Event) -> Design:
        with _status(progress) as say:
            evaluate = computed_once(all_of, stop, say)
            # The median: a start may be where the objective is all but zero.
            size = float(np.median([abs(evaluate(x).values[0]) for x in starts]))
            runs = tuple(descend(evaluate, box, x, size, rtol, max_steps) for x in starts)
        best = min(runs, key=lambda run: run.value)
        if best.value == np.inf:
            raise ValueError("No start satisfies `constraints`: widen them, or the bounds.")
        x = best.parameters[best.best]
        with np.errstate(divide="ignore", invalid="ignore"):  # of a value of 0
            elasticities = x * evaluate(x).slopes[0] / best.value
        shapes = jax.eval_shape(lambda flat: all_of(flat)[1], x)
        unravel = ravel_pytree(jax.tree.map(lambda one: jnp.zeros(one.shape), shapes))[1]
        own, others = unravel(jnp.asarray(best.margins[best.best]))
        return Design(
            parameters=box.unravel(jnp.asarray(x)),
            value=best.value,
            elasticities=box.unravel(jnp.asarray(elasticities)),
            constraints=(own, others) if jax.tree.leaves(own) else others,
            best=best,
            runs=runs,
        )

    return patiently(work)


class Evaluation(NamedTuple):
    """Objective and constraints at some parameters, and their derivatives."""

    values: Float[np.ndarray, " values"]
    slopes: Float[np.ndarray, "values parameters"]


def computed_once(
    function: Callable[[Array], tuple[Array, Any]],
    stop: threading.Event,
    say: Callable[[str], None],
) -> Callable[[Flat], Evaluation]:
    """Returns objective and constraints as one function, computed once for each point."""

    @jit
    def both(flat: Array) -> tuple[Array, Array]:
        values, pull = jax.vjp(lambda x: function(x)[0], flat)
        # Not `vmap`: each row would last as long as the slowest.
        return values, jax.lax.map(lambda row: pull(row)[0], jnp.eye(len(values)))

    known: dict[bytes, Evaluation] = {}

    def evaluate(x: Flat) -> Evaluation:
        if x.tobytes() not in known:
            found = Evaluation(*map(np.asarray, both(jnp.asarray(x))))
            if not all(np.all(np.isfinite(part)) for part in found):
                raise ValueError(f"The objective, a constraint or a derivative is NaN at {x}.")
            known[x.tobytes()] = found
            lowest = min(one.values[0] for one in known.values())
            say(f"{len(known)} evaluations: {found.values[0]:.6g}, lowest {lowest:.6g}")
            if stop.is_set():
                raise KeyboardInterrupt
        return known[x.tobytes()]

    return evaluate


def descend(
    evaluate: Callable[[Flat], Evaluation],
    box: Box,
    start: Flat,
    size: float,
    rtol: float,
    max_steps: int,
) -> Descent:
    """Returns one run of sequential quadratic programming, on the unit cube of the logarithms.

    A run ends when the objective changes by less than `rtol` of its `size`.
    """
    import scipy

    span = np.log(box.high / box.low)
    origin = np.log(start / box.low) / np.where(span > 0, span, 1)
    tried: dict[bytes, tuple[Flat, Evaluation]] = {}

    def at(u: Flat) -> tuple[Flat, Evaluation]:
        if u.tobytes() not in tried:
            # At the origin `start` itself, because its logarithm is rounded.
            x = start if np.array_equal(u, origin) else box.low * np.exp(span * np.clip(u, 0, 1))
            tried[u.tobytes()] = x, evaluate(x)
        return tried[u.tobytes()]

    def slopes(u: Flat) -> np.ndarray:
        x, found = at(u)
        return found.slopes * span * x

    # The first step goes along the gradient, as far as that is large: not through the cube.
    steepness = float(np.linalg.norm(slopes(origin)[0]))
    scale = 1 / max(size, steepness / FIRST_STEP, np.finfo(float).tiny)
    limits = {
        "type": "ineq",
        "fun": lambda u: at(u)[1].values[1:] - MARGIN,
        "jac": lambda u: slopes(u)[1:],
    }
    found = scipy.optimize.minimize(
        lambda u: at(u)[1].values[0] * scale,
        origin,
        jac=lambda u: slopes(u)[0] * scale,
        method="SLSQP",
        bounds=[(0.0, 1.0 if s > 0 else 0.0) for s in span],
        constraints=[limits] if at(origin)[1].values.size > 1 else [],
        # SLSQP compares changes of the scaled objective with `ftol` itself.
        options={"ftol": rtol * size * scale, "maxiter": max_steps},
    )
    points, evaluations = zip(*tried.values(), strict=True)
    values = np.array([one.values for one in evaluations])
    return Descent(
        values=values[:, 0],
        parameters=np.array(points),
        margins=values[:, 1:],
        converged=bool(found.success),
        message=str(found.message),
    )


@contextlib.contextmanager
def _status(shown: bool) -> Iterator[Callable[[str], None]]:
    if not shown:
        yield lambda text: None
        return
    from rich.console import Console

    with Console(stderr=True).status("compiling") as status:
        yield status.update
