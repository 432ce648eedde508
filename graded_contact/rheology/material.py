"""Linear viscoelastic materials: complex Young's modulus E(ω) and Poisson's ratio.

Fields go as exp(iωt), so E = E' + iE'' with loss modulus E'' >= 0 for ω > 0 and
E(-ω) = conj E(ω). Temperatures are in kelvin.

Sources: the generalised Maxwell solid and its creep form, N. W. Tschoegl, The Phenomenological
Theory of Linear Viscoelastic Behavior, Springer (1989), doi:10.1007/978-3-642-73602-5; the creep
form is also the paper's (Scaraggi & Comingio, eq. prony, with its misprinted index corrected).
The shift of Williams, Landel & Ferry, J. Am. Chem. Soc. 77 (1955) 3701, doi:10.1021/ja01619a008.
"""

import abc
from collections.abc import Callable
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Complex, Float, Inexact

from .._checks import Numbers, as_float, check_poisson, check_positive, check_values, is_concrete

GAS_CONSTANT = 8.31446261815324  # J/(mol K), exact in the SI of 2019


class AbstractShift(eqx.Module):
    """A law of time-temperature superposition: τ(T) = a_T(T) τ(reference)."""

    @abc.abstractmethod
    def factor(self, temperature: Numbers) -> Float[Array, ""]:
        """Returns a_T [1] at `temperature` [K]; it is 1 at the reference temperature."""

    @abc.abstractmethod
    def rebased(self, temperature: Numbers) -> "AbstractShift":
        """Returns the same law written about another reference temperature [K]."""


class WLF(AbstractShift):
    """The Williams-Landel-Ferry shift, log10 a_T = -c1 (T - T_ref)/(c2 + T - T_ref).

    **Fields:**

    - `c1`: first constant [1].
    - `c2`: second constant [K].
    - `reference`: temperature T_ref [K] at which the material's times were given.
    """

    c1: Float[Array, ""] = eqx.field(converter=as_float)
    c2: Float[Array, ""] = eqx.field(converter=as_float)
    reference: Float[Array, ""] = eqx.field(converter=as_float)

    def __check_init__(self):
        check_positive("c1", self.c1, "[1]")
        check_positive("c2", self.c2, "[K]")
        check_positive("reference", self.reference, "[K]")

    def factor(self, temperature: Numbers) -> Float[Array, ""]:
        temperature = self._checked(temperature)
        step = temperature - self.reference
        return 10 ** (-self.c1 * step / (self.c2 + step))

    def rebased(self, temperature: Numbers) -> "WLF":
        temperature = self._checked(temperature)
        c2 = self.c2 + temperature - self.reference
        return WLF(c1=self.c1 * self.c2 / c2, c2=c2, reference=temperature)

    def _checked(self, temperature: Numbers) -> Float[Array, ""]:
        temperature = as_float(temperature)
        if is_concrete(temperature) and is_concrete(self.c2) and is_concrete(self.reference):
            vogel = float(self.reference - self.c2)
            check_values(
                "temperature",
                temperature,
                f"temperatures are in kelvin and this WLF law holds only above {vogel:.2f} K",
                above=max(vogel, 0.0),
            )
        return temperature


class Arrhenius(AbstractShift):
    """The Arrhenius shift, ln a_T = (Q/R)(1/T - 1/T_ref).

    **Fields:**

    - `activation_energy`: Q [J/mol].
    - `reference`: temperature T_ref [K] at which the material's times were given.
    """

    activation_energy: Float[Array, ""] = eqx.field(converter=as_float)
    reference: Float[Array, ""] = eqx.field(converter=as_float)

    def __check_init__(self):
        check_positive("activation_energy", self.activation_energy, "[J/mol]")
        check_positive("reference", self.reference, "[K]")

    def factor(self, temperature: Numbers) -> Float[Array, ""]:
        temperature = as_float(temperature)
        check_positive("temperature", temperature, "[K]")
        return jnp.exp(
            self.activation_energy / GAS_CONSTANT * (1 / temperature - 1 / self.reference)
        )

    def rebased(self, temperature: Numbers) -> "Arrhenius":
        temperature = as_float(temperature)
        check_positive("temperature", temperature, "[K]")
        return Arrhenius(activation_energy=self.activation_energy, reference=temperature)


class AbstractMaterial(eqx.Module):
    """An isotropic linear viscoelastic solid."""

    @abc.abstractmethod
    def modulus(self, omega: Numbers) -> Inexact[Array, "*w"]:
        """Returns Young's modulus E(ω) [Pa] at the angular frequencies `omega` [rad/s]."""

    @abc.abstractmethod
    def poisson_ratio(self, omega: Numbers) -> Inexact[Array, "..."]:
        """Returns Poisson's ratio [1], of shape `()` when it does not depend on frequency."""

    @abc.abstractmethod
    def at(self, temperature: Numbers) -> "AbstractMaterial":
        """Returns the material at another temperature [K]."""


class Elastic(AbstractMaterial):
    """A linear elastic solid.

    **Fields:**

    - `young`: Young's modulus E [Pa] (the constructor's `modulus`).
    - `poisson`: Poisson's ratio ν [1], -1 < ν <= 1/2.
    """

    young: Float[Array, ""]
    poisson: Float[Array, ""]

    def __init__(self, modulus: Numbers, poisson: Numbers = 0.5):
        self.young = as_float(modulus)
        self.poisson = as_float(poisson)
        check_positive("modulus", self.young, "[Pa]")
        check_poisson("poisson", self.poisson)

    def modulus(self, omega: Numbers) -> Float[Array, "*w"]:
        omega = as_float(omega)
        dtype = jnp.result_type(self.young, omega)
        return jnp.broadcast_to(self.young.astype(dtype), omega.shape)

    def poisson_ratio(self, omega: Numbers) -> Float[Array, ""]:
        return self.poisson

    def at(self, temperature: Numbers) -> "Elastic":
        check_positive("temperature", as_float(temperature), "[K]")
        return self


class Prony(AbstractMaterial):
    """A generalised Maxwell solid, E(t) = E_eq + Σ_k E_k exp(-t/τ_k).

    **Fields:**

    - `equilibrium`: long-time modulus E_eq [Pa]; 0 for a liquid.
    - `strengths`: branch moduli E_k [Pa], shape `(branches,)`, all positive.
    - `times`: relaxation times τ_k [s], shape `(branches,)`, all positive.
    - `poisson`: Poisson's ratio ν [1], independent of frequency.
    - `shift`: law of time-temperature superposition, or None.
    """

    equilibrium: Float[Array, ""] = eqx.field(converter=as_float)
    strengths: Float[Array, " branches"] = eqx.field(converter=as_float)
    times: Float[Array, " branches"] = eqx.field(converter=as_float)
    poisson: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)
    shift: AbstractShift | None = None

    def __check_init__(self):
        check_values(
            "equilibrium", self.equilibrium, "it must be zero or a positive number [Pa]", at_least=0
        )
        _check_series("strengths", self.strengths, "[Pa]", "times", self.times)
        check_poisson("poisson", self.poisson)

    @classmethod
    def from_creep(
        cls,
        glassy: Numbers,
        compliances: Numbers,
        times: Numbers,
        poisson: Numbers = 0.5,
        shift: AbstractShift | None = None,
    ) -> "Prony":
        """Returns the material of 1/E(ω) = 1/E_inf + Σ_j H_j/(1 + iω t_j), converted exactly.

        The zeros of this compliance lie one between each two of its poles; each is bracketed
        and refined, and the branch moduli are the residues of its reciprocal.

        **Arguments:**

        - `glassy`: instantaneous modulus E_inf [Pa].
        - `compliances`: H_j [1/Pa], shape `(branches,)`, all positive.
        - `times`: retardation times t_j [s], shape `(branches,)`, positive, no two equal.
        - `poisson`, `shift`: as the fields of the class.
        """
        glassy, compliances, times = as_float(glassy), as_float(compliances), as_float(times)
        check_positive("glassy", glassy, "[Pa]")
        _check_series("compliances", compliances, "[1/Pa]", "times", times)
        _check_distinct("times", times)
        order = jnp.argsort(-times)
        rates = 1 / times[order]
        weights = glassy * compliances[order] * rates
        # J(s) = 0 at s = -λ: one root above each rate, the last below r_n + Σ a.
        roots, gaps = _increasing_roots(
            lambda root, gaps: 1 + jnp.sum(weights / gaps, axis=-1),
            rates,
            lower=rates,
            upper=jnp.append(rates[1:], rates[-1] + 2 * jnp.sum(weights)),
        )
        slope = jnp.sum(weights / gaps / gaps, axis=-1)
        return cls(
            equilibrium=glassy / (1 + glassy * jnp.sum(compliances)),
            strengths=glassy / (roots * slope),
            times=1 / roots,
            poisson=poisson,
            shift=shift,
        )

    def creep(
        self,
    ) -> tuple[Float[Array, ""], Float[Array, " branches"], Float[Array, " branches"]]:
        """Returns the creep form `(glassy [Pa], compliances [1/Pa], times [s])` of the material.

        The inverse of `from_creep`. A liquid (`equilibrium` 0) flows and has no such form.
        """
        check_positive(
            "equilibrium", self.equilibrium, "[Pa] to have a creep form (a liquid flows)"
        )
        _check_distinct("times", self.times)
        order = jnp.argsort(-self.times)
        rates, strengths = 1 / self.times[order], self.strengths[order]
        glassy = self.equilibrium + jnp.sum(strengths)
        ratios = strengths / self.equilibrium
        # E(s) = 0 at s = -r: one root below each rate, the first above r_1/(1 + Σ E_k/E_eq).
        roots, gaps = _increasing_roots(
            lambda root, gaps: jnp.sum(ratios * root[:, None] / gaps, axis=-1) - 1,
            rates,
            lower=jnp.append(rates[:1] / (1 + 2 * jnp.sum(ratios)), rates[:-1]),
            upper=rates,
        )
        slope = jnp.sum(strengths * rates / gaps / gaps, axis=-1)
        return glassy, 1 / (roots * slope), 1 / roots

    @property
    def glassy(self) -> Float[Array, ""]:
        """Instantaneous modulus E_inf = E_eq + Σ E_k [Pa]."""
        return self.equilibrium + jnp.sum(self.strengths)

    def modulus(self, omega: Numbers) -> Complex[Array, "*w"]:
        omega = as_float(omega)
        x = jnp.abs(omega[..., None] * self.times)
        # x²/(1 + x²) and x/(1 + x²), in forms that neither overflow nor cancel.
        small = x <= 1
        y = jnp.where(small, x, 1 / jnp.where(small, 1, x))
        loss = y / (1 + y * y)
        storage = jnp.where(small, y * loss, 1 / (1 + y * y))
        sign = jnp.where(omega < 0, -1, 1).astype(x.dtype)
        real = self.equilibrium + jnp.sum(self.strengths * storage, axis=-1)
        return jax.lax.complex(real, sign * jnp.sum(self.strengths * loss, axis=-1))

    def poisson_ratio(self, omega: Numbers) -> Float[Array, ""]:
        return self.poisson

    def at(self, temperature: Numbers) -> "Prony":
        shift, temperature = _require_shift(self.shift), as_float(temperature)
        return eqx.tree_at(
            lambda material: (material.times, material.shift),
            self,
            (self.times * shift.factor(temperature), shift.rebased(temperature)),
        )


class Tabulated(AbstractMaterial):
    """A measured modulus used as it stands, by monotone interpolation of its logarithms.

    E' and E'' are interpolated by Fritsch-Carlson cubics in log ω. At rest (ω = 0 exactly) the
    modulus is the first E'. Other frequencies outside the table raise an error, unless
    `extrapolate="plateau"`: then E' stays at its end value, and E'' falls off as ω below the
    table and as 1/ω above it, as for a single relaxation far from its peak.

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
        poisson: Numbers = 0.5,
        *,
        shift: AbstractShift | None = None,
        extrapolate: Literal["refuse", "plateau"] = "refuse",
    ):
        self.omega = as_float(omega)
        complex_modulus = jnp.asarray(modulus)
        self.storage = as_float(complex_modulus.real)
        self.loss = as_float(complex_modulus.imag)
        self.poisson = as_float(poisson)
        self.shift = shift
        self.extrapolate = extrapolate
        if self.omega.ndim != 1 or len(self.omega) < 2 or complex_modulus.shape != self.omega.shape:
            raise ValueError(
                f"`omega` has shape {self.omega.shape} and `modulus` {complex_modulus.shape}; "
                "two one-dimensional arrays of equal length, at least 2, are needed."
            )
        check_positive("omega", self.omega, "[rad/s]")
        check_positive("modulus.real", self.storage, "[Pa]")
        check_positive("modulus.imag", self.loss, "[Pa] (the loss modulus)")
        check_poisson("poisson", self.poisson)
        if is_concrete(self.omega):
            steps = np.diff(np.asarray(self.omega))
            if np.any(steps <= 0):
                i = int(np.argmax(steps <= 0)) + 1
                raise ValueError(
                    f"`omega[{i}]={float(self.omega[i]):g}` does not exceed the entry before it: "
                    "frequencies must be strictly increasing (sort the table first)."
                )
        if extrapolate not in ("refuse", "plateau"):
            raise ValueError(f"`extrapolate={extrapolate!r}` must be 'refuse' or 'plateau'.")

    def modulus(self, omega: Numbers) -> Complex[Array, "*w"]:
        omega = as_float(omega)
        first, last = self.omega[0], self.omega[-1]
        size = jnp.abs(omega)
        if self.extrapolate == "refuse":
            # A shifted table may miss its own ends by rounding.
            slack = 64 * jnp.finfo(self.omega.dtype).eps
            outside = (size > 0) & ((size < first * (1 - slack)) | (size > last * (1 + slack)))
            size = eqx.error_if(
                size,
                outside,
                "A frequency lies outside the table of moduli. Use a table that covers it, or "
                "`Tabulated(..., extrapolate='plateau')`.",
            )
        inside = jnp.log(jnp.clip(size, first, last))
        nodes = jnp.log(self.omega)
        storage = jnp.exp(_monotone_cubic(nodes, jnp.log(self.storage), inside))
        loss = jnp.exp(_monotone_cubic(nodes, jnp.log(self.loss), inside))
        beyond = jnp.where(size > last, size, last)
        decay = jnp.where(size < first, size / first, last / beyond)
        return jax.lax.complex(storage, jnp.sign(omega) * loss * decay)

    def poisson_ratio(self, omega: Numbers) -> Float[Array, ""]:
        return self.poisson

    def at(self, temperature: Numbers) -> "Tabulated":
        shift, temperature = _require_shift(self.shift), as_float(temperature)
        return eqx.tree_at(
            lambda material: (material.omega, material.shift),
            self,
            (self.omega / shift.factor(temperature), shift.rebased(temperature)),
        )


def _require_shift(shift: AbstractShift | None) -> AbstractShift:
    if shift is None:
        raise ValueError(
            "This material has no law of time-temperature superposition. Give it one: "
            "`shift=WLF(c1, c2, reference)` or `shift=Arrhenius(activation_energy, reference)`."
        )
    return shift


def _check_series(name: str, values: Array, unit: str, times_name: str, times: Array) -> None:
    if values.ndim != 1 or values.shape != times.shape:
        raise ValueError(
            f"`{name}` has shape {values.shape} and `{times_name}` {times.shape}; "
            "two one-dimensional arrays of equal length are needed."
        )
    check_positive(name, values, unit)
    check_positive(times_name, times, "[s]")


def _check_distinct(name: str, times: Array) -> None:
    if is_concrete(times) and len(np.unique(np.asarray(times))) < len(times):
        raise ValueError(f"`{name}` holds a value twice: merge equal times into one branch first.")


def _increasing_roots(
    value: Callable[[Float[Array, " n"], Float[Array, "n n"]], Float[Array, " n"]],
    poles: Float[Array, " n"],
    lower: Float[Array, " n"],
    upper: Float[Array, " n"],
) -> tuple[Float[Array, " n"], Float[Array, "n n"]]:
    """Returns roots λ_i between `lower` and `upper` > 0, and the gaps poles_j - λ_i.

    `value(λ, gaps)` increases along each bracket, from pole to pole. The root of a weak branch
    nearly touches its pole, so what is sought is log |λ - nearer end|: by bisection to the last
    digit, then by one Newton step that carries the derivatives.
    """
    middle = (lower + upper) / 2
    from_lower = value(middle, poles - middle[:, None]) > 0
    end, sign = jnp.where(from_lower, lower, upper), jnp.where(from_lower, 1, -1)

    def place(step):
        return end + sign * step, (poles - end[:, None]) - (sign * step)[:, None]

    def halve(_, bracket):
        near, far = bracket
        step = (near + far) / 2
        too_far = sign * value(*place(jnp.exp(step))) > 0
        return jnp.where(too_far, near, step), jnp.where(too_far, step, far)

    far = jnp.log((upper - lower) / 2)
    reach = 0.9 * float(np.log(jnp.finfo(poles.dtype).tiny))
    # 80 halvings take a bracket of 700 e-foldings below rounding.
    near, far = jax.lax.stop_gradient(jax.lax.fori_loop(0, 80, halve, (far + reach, far)))
    step = jnp.exp((near + far) / 2)
    _, slope = jax.jvp(lambda step: value(*place(step)), (step,), (jnp.ones_like(step),))
    return place(step - value(*place(step)) / jax.lax.stop_gradient(slope))


def _monotone_cubic(
    nodes: Float[Array, " n"], values: Float[Array, " n"], x: Float[Array, "*w"]
) -> Float[Array, "*w"]:
    """Returns the Fritsch-Carlson monotone cubic interpolant at `x`, as SciPy's PCHIP.

    F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, doi:10.1137/0905021.
    """
    h, secant = jnp.diff(nodes), jnp.diff(values) / jnp.diff(nodes)
    if len(values) == 2:
        slopes = jnp.broadcast_to(secant, (2,))
    else:
        left, right = secant[:-1], secant[1:]
        same = left * right > 0
        w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
        safe_left, safe_right = jnp.where(same, left, 1), jnp.where(same, right, 1)
        inner = jnp.where(same, (w1 + w2) / (w1 / safe_left + w2 / safe_right), 0)
        ends = [_end_slope(h[i], h[j], secant[i], secant[j]) for i, j in ((0, 1), (-1, -2))]
        slopes = jnp.concatenate([ends[0][None], inner, ends[1][None]])
    i = jnp.clip(jnp.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 2)
    t = (x - nodes[i]) / h[i]
    rise = values[i + 1] - values[i]
    a, b = slopes[i] * h[i], slopes[i + 1] * h[i]
    return values[i] + t * (a + t * ((3 * rise - 2 * a - b) + t * (a + b - 2 * rise)))


def _end_slope(h0, h1, secant0, secant1):
    slope = ((2 * h0 + h1) * secant0 - h0 * secant1) / (h0 + h1)
    slope = jnp.where(slope * secant0 <= 0, 0, slope)
    steep = (secant0 * secant1 < 0) & (jnp.abs(slope) > 3 * jnp.abs(secant0))
    return jnp.where(steep, 3 * secant0, slope)
