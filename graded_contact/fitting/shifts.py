"""The shifts of isotherms, as unknowns.

An isotherm g measures b_g m(x a_g) at frequencies x (or times x/a_g). Its shift is a law plus a
departure, ln a_g = L_g(p) + e_g. The unknowns are (p, e, ln b): of the law, and departures
and vertical shifts of all isotherms but the reference. Departures and ln b may be expected to be
small; those squares are then part of the cost.

The unknowns p of WLF are the logarithms of its slope c1/c2 [1/K] at the reference and of the
distance [K] of the coldest isotherm from the Vogel temperature; for Arrhenius it is ln Q/R [K].
"""

from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..core.display import shown
from ..materials.shift import GAS_CONSTANT, WLF, AbstractShift, Arrhenius

LN10 = float(np.log(10))
LawKind = Literal["wlf", "arrhenius", "table"]  # a table is searched about a WLF law
# Limits of exp(p), far beyond any material, and values of a usual polymer.
_WLF, _ARRHENIUS = [(1e-4, 10), (1, 1e4)], [(1e2, 1e6)]
LAW_LIMITS = {"wlf": _WLF, "table": _WLF, "arrhenius": _ARRHENIUS}
LAW_TYPICAL = {"wlf": [0.1, 60.0], "table": [0.1, 60.0], "arrhenius": [1e4]}


@shown()
class Isotherms(eqx.Module):
    """The temperatures of measurements, and what is expected of the shifts.

    **Fields:**

    - `group`: number of the isotherm of each point, shape `(points,)`.
    - `temperatures`: [K], shape `(isotherms,)`, increasing.
    - `penalty`: weights of the squares of departures and of ln b in the objective [1].
    - `reference`: the isotherm that is not shifted. Static.
    - `law`: the shift law. Static.
    - `stds`: expected deviations of ln a from the law, and of ln b; 0 if there are none. Static.
    """

    group: Int[Array, " points"]
    temperatures: Float[Array, " isotherms"]
    penalty: Float[Array, " 2"]
    reference: int = eqx.field(static=True)
    law: LawKind = eqx.field(static=True)
    stds: tuple[float, float] = eqx.field(static=True)

    @property
    def counts(self) -> list[int]:
        """The numbers of unknowns of the law, of departures, and of vertical shifts."""
        others = len(self.temperatures) - 1
        return [len(LAW_LIMITS[self.law]), *(others * (std > 0) for std in self.stds)]

    @property
    def others(self) -> np.ndarray:
        """Which isotherm each unknown shift belongs to: all but the reference."""
        return np.delete(np.eye(len(self.temperatures)), self.reference, axis=0)

    def law_of(self, p: Any) -> AbstractShift:
        """Returns the law with the unknowns `p`, about the reference temperature."""
        base = self.temperatures[self.reference]
        if self.law == "arrhenius":
            return Arrhenius(activation_energy=GAS_CONSTANT * jnp.exp(p[0]), reference=base)
        slope, distance = jnp.exp(p)
        c2 = base - self.temperatures[0] + distance
        return WLF(c1=slope * c2, c2=c2, reference=base)

    def weights(self, xp: Any) -> Any:
        """Returns the weight of the square of each unknown in the cost."""
        return xp.repeat(xp.append(0.0, xp.asarray(self.penalty)), np.array(self.counts))

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns the limits of the unknowns."""
        lower, upper = np.log(LAW_LIMITS[self.law]).T
        free = np.full(sum(self.counts[1:]), np.inf)
        return np.append(lower, -free), np.append(upper, free)


# Functions, because a method of a Module costs more than a search in NumPy has to spare.


def split_shifts(isotherms: Isotherms, unknowns: Any) -> tuple[Any, Any, Any]:
    """Returns `(p, e, ln b)`: the last of the unknowns, by what they belong to."""
    first, second, third = len(unknowns) - np.cumsum(isotherms.counts[::-1])[::-1]
    return unknowns[first:second], unknowns[second:third], unknowns[third:]


def law_shifts(isotherms: Isotherms, p: Any) -> Any:
    """Returns ln a of each isotherm by the law."""
    return _by_law(isotherms, p)[0]


def _by_law(isotherms: Isotherms, p: Any) -> tuple[Any, Any]:
    """ln a of each isotherm by the law, and its derivatives by `p`.

    In closed form, because a search in NumPy asks for them at each step.
    """
    xp = jnp if isinstance(p, jax.Array) else np
    temperatures = xp.asarray(isotherms.temperatures)
    base, factor = temperatures[isotherms.reference], xp.exp(p)
    if isotherms.law == "arrhenius":
        value = factor[0] * (1 / temperatures - 1 / base)
        return value, value[None]
    above, c2 = temperatures - base, base - temperatures[0] + factor[1]
    value = -LN10 * factor[0] * c2 * above / (c2 + above)
    by_distance = -LN10 * factor[0] * factor[1] * (above / (c2 + above)) ** 2
    return value, xp.stack([value, by_distance])


def log_shifts(isotherms: Isotherms, unknowns: Any) -> tuple[Any, Any]:
    """Returns ln a and ln b of every isotherm."""
    p, departures, lifts = split_shifts(isotherms, unknowns)
    along = law_shifts(isotherms, p) + departures @ isotherms.others[: len(departures)]
    return along, lifts @ isotherms.others[: len(lifts)]


def shift_slopes(isotherms: Isotherms, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the derivatives of ln a by (p, e), and of ln b by itself.

    The isotherms are the last axis.
    """
    p, departures, lifts = split_shifts(isotherms, unknowns)
    _, first = _by_law(isotherms, p)
    along = np.concatenate([first, isotherms.others[: len(departures)]])
    return along, isotherms.others[: len(lifts)]
