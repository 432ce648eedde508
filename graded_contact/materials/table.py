"""A measured modulus as a material, without fitting."""

from typing import Any, Literal, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact, ScalarLike

from ..core.checks import (
    Numbers,
    as_float,
    as_numbers,
    as_scalar,
    check_increasing,
    check_poisson,
    check_positive,
    check_rows,
    check_type,
    is_concrete,
)
from ..core.spline import monotone_cubic
from .coverage import is_unknown
from .material import AbstractMaterial
from .shift import AbstractShift, as_temperature, require_shift, stretched

T = TypeVar("T")
U = TypeVar("U")
_REMEDY = "Use a table that covers it, or `extrapolate='plateau'`."
_OUTSIDE = f"A frequency lies outside the table of moduli. {_REMEDY}"


class Tabulated(AbstractMaterial):
    """A measured modulus without a fit, by monotone interpolation of its logarithms.

    E' and E'' are interpolated by Fritsch-Carlson cubics in log ω. At rest (ω = 0 exactly) the
    modulus is the first E'. Other frequencies outside the table, by more than 1e-4 of its ends,
    raise an error, unless `extrapolate="plateau"`. Outside, E' stays at its end value, and E''
    falls off as ω below the table and as 1/ω above it, as for a single relaxation far from its
    peak.

    **Fields:**

    - `omega`: angular frequencies [rad/s], shape `(points,)`, positive and increasing.
    - `storage`: E' [Pa], shape `(points,)`, positive.
    - `loss`: E'' [Pa], shape `(points,)`, positive.
    - `poisson`: Poisson's ratio ν [1].
    - `shift`: law of time-temperature superposition, or None.
    - `extrapolate`: `"refuse"` or `"plateau"`. Static.
    """

    omega: Float[Array, " points"]
    storage: Float[Array, " points"]
    loss: Float[Array, " points"]
    poisson: Float[Array, ""]
    shift: AbstractShift | None
    extrapolate: Literal["refuse", "plateau"] = eqx.field(static=True)

    def __init__(
        self,
        omega: Numbers,
        modulus: Numbers,
        poisson: ScalarLike = 0.5,
        *,
        shift: AbstractShift | None = None,
        extrapolate: Literal["refuse", "plateau"] = "refuse",
    ):
        self.omega, modulus = as_float(omega, "omega"), as_numbers(modulus, "modulus")
        # Two real rows, so that derivatives and paths need no complex numbers.
        self.storage, self.loss = modulus.real, modulus.imag
        self.poisson = as_scalar(poisson, "poisson")
        self.shift, self.extrapolate = shift, extrapolate
        check_rows(2, omega=self.omega, modulus=modulus)
        check_positive("omega", self.omega, "[rad/s]")
        check_positive("modulus.real", self.storage, "[Pa]")
        check_positive("modulus.imag", self.loss, "[Pa] (the loss modulus)")
        check_poisson("poisson", self.poisson)
        check_increasing("omega", self.omega)
        check_type("extrapolate", extrapolate, "refuse", "plateau")
        check_type("shift", shift, AbstractShift, type(None))

    def modulus(self, omega: Numbers) -> Complex[Array, "*w"]:
        omega = as_numbers(omega, "omega")
        self.check(omega)
        first, last = self.omega[0], self.omega[-1]
        size = jnp.abs(omega)
        if self.extrapolate == "refuse":
            size = eqx.error_if(size, is_unknown(omega, (first, last)), _OUTSIDE)
        below, above = size < first, size > last
        # Clipped before the logarithm: at rest it would be -inf, with a NaN derivative.
        inside = jnp.log(jnp.where(below, first, jnp.where(above, last, size)))
        nodes = jnp.log(self.omega)
        storage, loss = (
            jnp.exp(monotone_cubic(nodes, jnp.log(part), inside))
            for part in (self.storage, self.loss)
        )
        # Odd in ω; at rest its slope is that of the first point.
        beyond = jnp.sign(omega) * last / jnp.where(above, size, last)
        decay = jnp.where(below, omega / first, beyond)
        return jax.lax.complex(storage, loss * decay)

    def coverage(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Returns the ends of the table [rad/s]."""
        return jax.lax.stop_gradient((self.omega[0], self.omega[-1]))

    def check(self, omega: Inexact[Array | np.ndarray, "..."]) -> None:
        """Raises `ValueError` for frequencies [rad/s] outside a table that refuses them.

        A table has no modulus at complex frequencies.
        """
        if jnp.iscomplexobj(omega):
            raise ValueError(
                "A table of moduli (`Tabulated`) is refused: a transient motion needs moduli at "
                "complex frequencies, where a table has none. Fit it: `fit_prony(omega, modulus)`."
            )
        if self.extrapolate != "refuse" or not (is_concrete(omega) and is_concrete(self.omega)):
            return
        # In NumPy: inside `jit` even what is known would be traced.
        size, (low, high) = np.abs(np.asarray(omega)), np.asarray(self.omega)[[0, -1]]
        if np.any(is_unknown(size, (low, high))):
            least, most = np.min(size[size > 0]), np.max(size)
            raise ValueError(
                f"`omega` from {least:.5g} to {most:.5g} rad/s is refused: the table of moduli "
                f"covers {low:.5g} to {high:.5g} rad/s. {_REMEDY}"
            )

    def poisson_ratio(self, omega: Numbers) -> Float[Array, ""]:
        return self.poisson

    def at(self, temperature: ScalarLike) -> "Tabulated":
        shift, temperature = require_shift(self.shift), as_temperature(temperature)
        # As far as the first frequency can go: no two of them may become one.
        first = stretched(self.omega[:1], -shift.log_factor(temperature))
        lift = jnp.exp(shift.log_vertical(temperature))
        omega = self.omega / self.omega[0] * first
        # Not by the constructor: squares of frequencies far away may overflow.
        return eqx.tree_at(
            lambda m: (m.omega, m.storage, m.loss, m.shift),
            self,
            (omega, self.storage * lift, self.loss * lift, shift.rebased(temperature)),
        )


def continued(tree: T) -> T:
    """Returns a tree whose tables of moduli continue beyond their ends, see `extrapolate`."""

    def plateau(node: Any) -> Any:
        if not isinstance(node, Tabulated):
            return node
        found = object.__new__(Tabulated)  # the constructor would check the numbers once more
        for name, value in {**vars(node), "extrapolate": "plateau"}.items():
            object.__setattr__(found, name, value)
        return found

    return jax.tree.map(plateau, tree, is_leaf=lambda node: isinstance(node, Tabulated))


def refuse_beyond(tree: Any, share: Float[Array, "..."], most: float, value: U) -> U:
    """Returns `value`; raises for a share of friction above `most` beyond a table that refuses it.

    **Arguments:**

    - `tree`: with tables.
    - `share`: of the friction from frequencies that its materials do not cover [1].
    """
    tables = jax.tree.leaves(tree, is_leaf=lambda node: isinstance(node, Tabulated))
    if not any(getattr(table, "extrapolate", "") == "refuse" for table in tables):
        return value
    reason = f"comes from frequencies outside the table of moduli. {_REMEDY}"
    if is_concrete(share) and np.any(np.asarray(share) > most):
        raise ValueError(f"{float(np.max(share)):.0%} of the friction {reason}")
    return eqx.error_if(value, share > most, f"More than {most:.0%} of the friction {reason}")
