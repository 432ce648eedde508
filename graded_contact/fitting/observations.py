"""Measured moduli or compliances prepared for a fit."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import Numbers, as_float, check_positive, check_values, is_concrete
from ..core.display import shown
from .series import Kind

REPRESENTABLE = 1e100  # beyond this, or below its reciprocal, squares and ratios overflow

Unknowns = Float[Array, " unknowns"]


@shown()
class Observations(eqx.Module):
    """What was measured, with what is known beforehand.

    **Fields:**

    - `x`: angular frequencies [rad/s] or times [s], shape `(points,)`.
    - `values`: storage and loss modulus [Pa], or one channel of moduli [Pa] or compliances
      [1/Pa]; shape `(channels, points)`; 1 where nothing was measured.
    - `weights`: of the squared log residuals [1], shape `(channels, points)`.
    - `equilibrium`, `glassy`: E_eq and E_inf [Pa] where they are known.
    - `times`: given relaxation or retardation times [s], or None to find them.
    - `huber`: log residual from which on a point counts linearly, or None.
    - `kind`, `flows`: the measurement; whether a compliance is that of a liquid. Static.
    """

    x: Float[Array, " points"]
    values: Float[Array, "channels points"]
    weights: Float[Array, "channels points"]
    equilibrium: Float[Array, ""] | None
    glassy: Float[Array, ""] | None
    times: Float[Array, " times"] | None
    huber: Float[Array, ""] | None
    kind: Kind = eqx.field(static=True)
    flows: bool = eqx.field(static=True)

    @property
    def num_extras(self) -> int:
        """How many unknowns belong to no branch."""
        known = self.glassy if self.kind == "creep" else self.equilibrium
        return int(known is None) + int(self.flows)

    def num_unknowns(self, terms: int) -> int:
        """Returns the length of θ of a series of `terms` branches."""
        return terms * (2 if self.times is None else 1) + self.num_extras


def observe(
    kind: Kind,
    x: Numbers,
    channels: dict[str, tuple[Any, Numbers]],
    *,
    equilibrium: Numbers | None,
    glassy: Numbers | None,
    times: Numbers | None,
    huber: Numbers | None,
) -> Observations:
    """Returns the observations, checked.

    `channels` holds `(values, weight)` by the name of the argument that the values came in; those
    that are NaN count as not measured.
    """
    x_name, unit = ("omega", "[rad/s]") if kind == "frequency" else ("time", "[s]")
    x = as_float(x, x_name)
    if x.dtype != jnp.float64:
        raise ValueError(
            f"`{x_name}` is {x.dtype}: series over many decades are fitted in double precision. "
            "Call `jax.config.update('jax_enable_x64', True)` before creating arrays."
        )
    if x.ndim != 1 or not len(x):
        raise ValueError(f"`{x_name}` has shape {x.shape}; one axis of at least 1 is needed.")
    if kind == "frequency":
        check_positive(x_name, x, unit)
    else:
        check_values(x_name, x, f"it must be zero or a positive number {unit}", at_least=0)
    # Of a number as it was given: inside `jit` a converted one is not known.
    flows = (
        kind == "creep"
        and equilibrium is not None
        and is_concrete(equilibrium)
        and not np.any(np.asarray(equilibrium))
    )
    known = {"equilibrium": equilibrium, "glassy": glassy, "times": times, "huber": huber}
    known = {name: None if v is None else as_float(v, name) for name, v in known.items()}
    if known["equilibrium"] is not None:
        check_values(
            "equilibrium", known["equilibrium"], "zero or a positive number [Pa]", at_least=0
        )
    for name, allowed in (("glassy", "[Pa]"), ("times", "[s]"), ("huber", "[1]")):
        if (value := known[name]) is not None:
            check_positive(name, value, allowed)
    pairs = [_channel(name, *channel, x) for name, channel in channels.items()]
    data = Observations(
        x=x,
        values=jnp.stack([values for values, _ in pairs]),
        weights=jnp.stack([weights for _, weights in pairs]),
        kind=kind,
        flows=flows,
        **known,
    )
    if concrete(data):
        _check_content(data, x_name, list(channels))
    return data


def concrete(data: Observations) -> bool:
    """Returns whether all numbers of the observations are known now."""
    return all(is_concrete(leaf) for leaf in jax.tree.leaves(data))


def _channel(name, values, weight, x):
    values, weight = as_float(values, name), as_float(weight, f"weight of {name}")
    if values.shape != x.shape:
        raise ValueError(f"`{name}` has shape {values.shape}; the shape must be {x.shape}.")
    if weight.shape not in ((), x.shape):
        raise ValueError(
            f"The weight of `{name}` has shape {weight.shape}; the shape must be () or {x.shape}."
        )
    check_values(f"weight of {name}", weight, "it must be zero or positive", at_least=0)
    present = ~jnp.isnan(values)
    weights = jnp.where(present, jnp.broadcast_to(weight, x.shape), 0)
    check_values(
        name,
        jnp.where(weights > 0, values, 1),
        "its logarithm is fitted, so it must be positive; NaN, or a weight of 0, leaves it out",
        above=0,
    )
    return jnp.where(weights > 0, values, 1), weights


def _check_content(data, x_name, names):
    counts = np.sum(np.asarray(data.weights) > 0, axis=1)
    if np.sum(counts) < 2:
        raise ValueError(
            f"`{names[0].split('.')[0]}` holds {np.sum(counts)} measured value(s) of a weight "
            "above 0; at least 2 are needed."
        )
    if data.kind == "frequency" and counts[0] == 0 and data.equilibrium is None:
        raise ValueError(
            "`equilibrium=None` cannot be fitted to a loss modulus alone, which says nothing "
            "about it. Give it, or 0 for a liquid."
        )
    if data.kind != "frequency" and not np.any(np.asarray(data.x) > 0):
        raise ValueError(f"`{x_name}` holds no time after 0.")
    x = np.asarray(data.x)
    for name, measured in ((x_name, x[x > 0]), (names[0], np.asarray(data.values))):
        check_values(
            name,
            measured,
            f"a measured value lies between {1 / REPRESENTABLE:g} and {REPRESENTABLE:g}",
            at_least=1 / REPRESENTABLE,
            at_most=REPRESENTABLE,
        )
    glassy, equilibrium = data.glassy, data.equilibrium
    if glassy is not None and equilibrium is not None and float(glassy) <= float(equilibrium):
        raise ValueError(
            f"`glassy={float(glassy):g}` must exceed `equilibrium={float(equilibrium):g}`."
        )
    if data.times is not None and len(np.unique(np.asarray(data.times))) < data.times.size:
        raise ValueError("`times` holds a value twice.")
