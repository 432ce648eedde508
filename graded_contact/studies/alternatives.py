"""Alternatives to a design: available values, trade-offs, and manufacturing scatter."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..core.checks import as_float, check_values, check_whole
from ..core.compilation import compiled
from .search import Constraints, Design, Objective, minimise


def snap_to_values(
    objective: Objective, design: Design, choices: dict[str, Sequence[float]], **arguments: Any
) -> Design:
    """Returns a design with some parameters at available values, the others optimised again.

    **Arguments:**

    - `objective`: as in `minimise`, with what that was given as `arguments`, `lower` and `upper`
      included.
    - `design`: to begin from; its parameters must be a dict.
    - `choices`: the values that a parameter can have, by its key; the nearest on the logarithm is
      taken.

    **Returns:** the design that can be made.
    """
    bounds = {end: dict(arguments.pop(end)) for end in ("lower", "upper")}
    start = dict(design.parameters)
    for key, values in choices.items():
        if key not in start:
            raise ValueError(f"`choices` has the unknown key {key!r}; allowed: {list(start)}.")
        values = np.asarray(values, float)
        inside = (values >= np.max(bounds["lower"][key])) & (values <= np.min(bounds["upper"][key]))
        if not np.any(inside):
            raise ValueError(f"`choices[{key!r}]` has no value between the bounds.")
        logs = np.log(values[inside])
        logarithm = np.log(np.asarray(start[key]))
        # Parameters may be arrays: each entry takes its own nearest value.
        nearest = np.abs(logarithm[..., None] - logs).argmin(axis=-1)
        start[key] = bounds["lower"][key] = bounds["upper"][key] = values[inside][nearest]
    arguments.setdefault("num_starts", 1)
    return minimise(objective, bounds["lower"], bounds["upper"], start, **arguments)


def pareto_front(
    objectives: Callable[[Any], Float[Array, "2"]], lower: Any, upper: Any, *,
    num_points: int = 7, constraints: Constraints | None = None, **arguments: Any,
) -> list[tuple[Design, Float[np.ndarray, "2"]]]:  # fmt: skip
    """Returns designs between which one of two objectives improves only if the other worsens.

    Between the two single optima, the first objective is minimised under ceilings of the second
    that are equally spaced. Designs that another beats in both are left out.

    **Arguments:**

    - `objectives`: parameters -> two numbers, both to be small.
    - `num_points`: ceilings, the two ends included.
    - `lower`, `upper`, `constraints` and other `arguments`: as in `minimise`.

    **Returns:** pairs of a design and its two objectives, the first objective increasing.
    """
    if num_points < 2:
        raise ValueError(f"`num_points={num_points}` must be at least 2.")

    def best(i, start=None, limit=None):
        def all_constraints(p):
            parts = {} if constraints is None else {"given": constraints(p)}
            if limit is not None:
                parts["second objective"] = (limit - objectives(p)[1]) / spread
            return parts

        some = None if constraints is None and limit is None else all_constraints
        one = lambda p: objectives(p)[i]  # noqa: E731
        found = minimise(one, lower, upper, start, constraints=some, **arguments)
        return found, np.asarray(objectives(found.parameters))

    ends = [best(0), best(1)]
    high, low = ends[0][1][1], ends[1][1][1]
    spread = abs(high - low) or 1.0  # makes the ceiling relative, as constraints must be
    found, previous = [ends[0]], ends[0][0]
    for limit in np.linspace(high, low, num_points)[1:-1]:
        # The design under the ceiling before is a good start for the next.
        found.append(best(0, previous.parameters, limit))
        previous = found[-1][0]
    found.append(ends[1])
    values = np.array([v for _, v in found])
    # A start may end in a local minimum: another design then beats it in both objectives.
    beaten = [bool(np.any(np.all(values < v, axis=1))) for v in values]
    front = [pair for pair, out in zip(found, beaten, strict=True) if not out]
    return sorted(front, key=lambda pair: float(pair[1][0]))


def scatter(
    objective: Objective, parameters: Any, spread: Any, *, num_samples: int = 64, seed: int = 0
) -> Float[Array, " samples"]:
    """Returns the objective of designs with manufacturing scatter.

    **Arguments:**

    - `objective`: as in `minimise`.
    - `parameters`: of the design.
    - `spread`: standard deviation of ln(parameter) [1]: one number, or one for each parameter.
    - `num_samples`, `seed`: number of draws, and the seed of the draws.

    **Returns:** values of the objective, shape `(num_samples,)`.
    """
    check_whole("num_samples", num_samples, 1)
    check_whole("seed", seed, 0)
    flat, unravel = ravel_pytree(jax.tree.map(lambda p: as_float(p, "parameters"), parameters))
    width, _ = ravel_pytree(jax.tree.map(lambda width: as_float(width, "spread"), spread))
    width = jnp.broadcast_to(width, flat.shape) if width.shape == (1,) else width
    if width.shape != flat.shape:
        raise ValueError("`spread` must be one number, or have the nesting of `parameters`.")
    allowed = "a standard deviation of ln(parameter) lies between 0 and 10"
    check_values("spread", width, allowed, at_least=0, at_most=10)
    draws = jax.random.normal(jax.random.key(seed), (num_samples, flat.size))
    values = compiled(lambda every: jax.lax.map(lambda x: objective(unravel(x)), every))
    return values(flat * jnp.exp(width * draws))
