"""Measurements at several temperatures as data of a fit: the JAX side of `shifted_series`."""

from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..core.display import shown
from ..rheology.shift import GAS_CONSTANT, WLF, AbstractShift, Arrhenius, TabulatedShift
from .model import objective, series_of
from .observations import Observations, Unknowns
from .shifted_series import LN10, Law, SharedSeries

LawKind = Literal["wlf", "arrhenius"]


@shown()
class Isotherms(eqx.Module):
    """What was measured at several temperatures, with what is expected of the shifts.

    **Fields:**

    - `observations`: all points, as measured.
    - `group`: number of the isotherm of each point, shape `(points,)`.
    - `temperatures`: [K], shape `(isotherms,)`, increasing.
    - `penalty`: weights of the squares of departures and of ln b in the objective [1].
    - `reference`: the isotherm that is not shifted. Static.
    - `law`: the shift law. Static.
    - `departs`, `lifts`: whether there are departures, and vertical shifts. Static.
    """

    observations: Observations
    group: Int[Array, " points"]
    temperatures: Float[Array, " isotherms"]
    penalty: Float[Array, " 2"]
    reference: int = eqx.field(static=True)
    law: LawKind = eqx.field(static=True)
    departs: bool = eqx.field(static=True)
    lifts: bool = eqx.field(static=True)

    @property
    def num_shift_unknowns(self) -> int:
        """How many unknowns are not those of the series."""
        others = len(self.temperatures) - 1
        return (2 if self.law == "wlf" else 1) + others * (self.departs + self.lifts)


def law_of(unknowns: Unknowns, data: Isotherms) -> AbstractShift:
    """Returns the shift law about the reference temperature, without departures."""
    first = len(unknowns) - data.num_shift_unknowns
    reference = data.temperatures[data.reference]
    if data.law == "wlf":
        slope, margin = jnp.exp(unknowns[first : first + 2])
        c2 = reference - data.temperatures[0] + margin
        return WLF(c1=slope * c2, c2=c2, reference=reference)
    energy = GAS_CONSTANT * jnp.exp(unknowns[first])
    return Arrhenius(activation_energy=energy, reference=reference)


def shift_of(unknowns: Unknowns, data: Isotherms) -> AbstractShift:
    """Returns the shifts as found: the law if they are held to it, else their table."""
    if not (data.departs or data.lifts):
        return law_of(unknowns, data)
    across = log_vertical_of(unknowns, data)
    return TabulatedShift(
        temperatures=data.temperatures,
        log10_factors=log_shift_of(unknowns, data) / LN10,
        reference=data.temperatures[data.reference],
        # Of a compliance it is the reciprocal that moduli grow by.
        vertical_factors=jnp.exp(-across if data.observations.kind == "creep" else across)
        if data.lifts
        else None,
    )


@eqx.filter_jit
def log_vertical_of(unknowns: Unknowns, data: Isotherms) -> Float[Array, " isotherms"]:
    """Returns ln b of every isotherm."""
    if not data.lifts:
        return jnp.zeros_like(data.temperatures)
    return _with_zero(unknowns[1 - len(data.temperatures) :], data)


@eqx.filter_jit
def log_shift_of(unknowns: Unknowns, data: Isotherms) -> Float[Array, " isotherms"]:
    """Returns ln a of every isotherm."""
    by_law = jax.vmap(law_of(unknowns, data).log_factor)(data.temperatures)
    if not data.departs:
        return by_law
    first = len(unknowns) - (len(data.temperatures) - 1) * (1 + data.lifts)
    departures = unknowns[first : first + len(data.temperatures) - 1]
    return by_law + _with_zero(departures, data)


@eqx.filter_jit
def at_reference(unknowns: Unknowns, data: Isotherms) -> Observations:
    """Returns all measurements as if made at the reference temperature."""
    observed = data.observations
    along = jnp.exp(log_shift_of(unknowns, data))[data.group]
    across = jnp.exp(log_vertical_of(unknowns, data))[data.group]
    x = observed.x * along if observed.kind == "frequency" else observed.x / along
    values = jnp.where(observed.weights > 0, observed.values / across, 1)
    return eqx.tree_at(lambda o: (o.x, o.values), observed, (x, values))


def shared_objective(unknowns: Unknowns, data: Isotherms) -> Float[Array, ""]:
    """Returns the cost of `SharedSeries`, for derivatives."""
    count = len(unknowns) - data.num_shift_unknowns
    cost = objective(unknowns[:count], at_reference(unknowns, data))
    others = len(data.temperatures) - 1
    tail = unknowns[len(unknowns) - others * (data.departs + data.lifts) :]
    weights = data.penalty[np.array([data.departs, data.lifts])]
    return cost + jnp.sum(weights[:, None] * tail.reshape(-1, others) ** 2) / 2


def shared_series_of(data: Isotherms) -> SharedSeries:
    """Returns the least-squares problem of the isotherms, in NumPy."""
    series = series_of(data.observations)
    temperatures, penalty = np.asarray(data.temperatures), np.asarray(data.penalty)
    return SharedSeries(
        series=series,
        group=np.append(np.asarray(data.group), np.full(series.held, -1)),
        reference=data.reference,
        law=Law(data.law, temperatures, temperatures[data.reference]),
        stiffness=(
            float(penalty[0]) if data.departs else np.inf,
            float(penalty[1]) if data.lifts else np.inf,
        ),
    )


def _with_zero(values, data):
    """`values` of all isotherms but the reference, whose entry is zero."""
    before, after = values[: data.reference], values[data.reference :]
    return jnp.concatenate([before, jnp.zeros(1), after])
