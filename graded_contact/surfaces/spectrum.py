"""Spectra of roughness.

A spectrum C(q) is two-sided, <h²> = ∫ d²q C(q) over the whole plane for a surface, <h²> = ∫ dq
C(q) over the whole line for a profile; `ndim` is 2 or 1. It is isotropic unless it has an
`anisotropy`, Peklenik's number γ: the correlation length along the lay over that across the lay
(J. Peklenik, Proc. Inst. Mech. Eng. 182 (1967) 108, doi:10.1243/PIME_CONF_1967_182_309_02). Then
C depends on the stretched wavenumber k² = q_across² + γ² q_along² in place of q², while the ends
of the band remain circles: they belong to the cell and to the resolution.

The spectrum has the shape of B. N. J. Persson, J. Phys.: Condens. Matter 18 (2006) 7789,
doi:10.1088/0953-8984/18/32/025.
"""

import functools
from typing import Any, Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ..core.checks import Numbers, as_float, check_type, check_values, is_concrete, positive, scalar
from ..core.display import shown


@shown(units=False)
class SelfAffine(eqx.Module):
    """A self-affine spectrum with a roll-off, isotropic or with a lay.

    C is constant for q_low <= q <= q_roll, falls as q^(-2(1+H)) for q_roll < q <= q_high
    (q^(-1-2H) for a profile), and is zero outside. With a smooth roll-off it is
    [1 + (q/q_roll)²]^-(1+H) from q_low to q_high instead (-(1/2+H) for a profile).

    With `anisotropy` γ, which needs the smooth roll-off, it is [1 + (k/q_roll)²]^-(1+H), k being
    q across the lay and γ q along the lay. The limit γ → ∞ is a ridged surface whose profile has
    the spectrum of the same numbers without anisotropy (`ndim=1`, a 1-D grid), exactly.

    Derivatives of a random surface with respect to `q_low` and `q_high` see the normalisation, not
    the modes that a moving edge admits: where a mode lies on an edge they belong to the side on
    which it stays, `q_low` downwards and `q_high` upwards. By `q_roll` they are one-sided where a
    mode lies on the sharp kink (`q_roll` upwards); for a design take `roll_off="smooth"`.

    **Fields:**

    - `amplitude`: the prescribed root mean square, height [m] or slope [1].
    - `hurst`: Hurst exponent H [1], 0 < H <= 1.
    - `q_low`, `q_roll`, `q_high`: wavenumbers [rad/m], in increasing order.
    - `prescribed`: which of `"rms_height"` and `"rms_slope"` was given. Static.
    - `roll_off`: `"sharp"` or `"smooth"`. Static.
    - `anisotropy`: Peklenik's number γ [1], at least 1, or None for an isotropic spectrum.
    - `angle`: of the lay, the direction of long correlation, from the x axis [rad], or None.
    """

    amplitude: Float[Array, ""]
    hurst: Float[Array, ""]
    q_low: Float[Array, ""]
    q_roll: Float[Array, ""]
    q_high: Float[Array, ""]
    prescribed: Literal["rms_height", "rms_slope"] = eqx.field(static=True)
    roll_off: Literal["sharp", "smooth"] = eqx.field(static=True)
    anisotropy: Float[Array, ""] | None
    angle: Float[Array, ""] | None

    def __init__(
        self,
        *,
        rms_height: ScalarLike | None = None,
        rms_slope: ScalarLike | None = None,
        hurst: ScalarLike,
        q_low: ScalarLike,
        q_roll: ScalarLike,
        q_high: ScalarLike,
        roll_off: Literal["sharp", "smooth"] = "sharp",
        anisotropy: ScalarLike | None = None,
        angle: ScalarLike | None = None,
    ):
        """Prescribes either `rms_height` [m] or `rms_slope` [1] (of the gradient's length)."""
        check_type("roll_off", roll_off, "sharp", "smooth")
        self.anisotropy, self.angle = _lay(anisotropy, angle, roll_off)
        self.roll_off = roll_off
        self.prescribed, self.amplitude = one_of_height_and_slope(rms_height, rms_slope)
        allowed = "it must be greater than 0 and at most 1"
        self.hurst = scalar("hurst", allowed, above=0, at_most=1)(hurst)
        for name, value in (("q_low", q_low), ("q_roll", q_roll), ("q_high", q_high)):
            setattr(self, name, positive(name, "[rad/m]")(value))
        for name, lower in (("q_roll", "q_low"), ("q_high", "q_roll")):
            if is_concrete(least := getattr(self, lower)):
                allowed = f"it must be at least `{lower}={float(least):g}` [rad/m]"
                check_values(name, getattr(self, name), allowed, at_least=float(least))
        if is_concrete(self.q_low):  # one of the two steps must be wide
            allowed = f"it must exceed `q_low={float(self.q_low):g}` [rad/m]"
            check_values("q_high", self.q_high, allowed, above=float(self.q_low))

    @property
    def rms_height(self) -> Float[Array, ""]:
        """Root mean square height of the surface [m]."""
        return rms_height_of(self, 2)

    @property
    def rms_slope(self) -> Float[Array, ""]:
        """Root mean square length of the gradient of the surface [1]."""
        return jnp.sqrt(self.moment(2))

    def density(
        self, q: Float[Array, "*q"], ndim: int = 2, direction: Numbers | None = None
    ) -> Float[Array, "*q"]:
        """Returns C(q) at the wavenumbers `q` [rad/m]: [m⁴], or [m³] of a profile (`ndim=1`).

        At the `direction` [rad] of the wavevector from the x axis; None: the mean over directions.
        """
        relative = relative_density(self, q / self.q_roll, ndim)
        if self.angle is not None and direction is not None:
            offset = as_float(direction, "direction") - self.angle - np.pi / 2
            relative *= narrowing(self, q / self.q_roll, offset)
        elif self.angle is not None:
            fraction, _, weight = (jnp.asarray(a, q.dtype) for a in between_ends(NUM_DIRECTIONS))
            relative *= narrowing(self, q[..., None] / self.q_roll, np.pi / 2 * fraction) @ weight
        return (rms_height_of(self, ndim) / self.q_roll ** (ndim / 2)) ** 2 * relative

    def moment(self, order: int | float, ndim: int = 2) -> Float[Array, ""]:
        """Returns ∫ d²q q^order C(q) [m^(2 - order)], for a profile (`ndim=1`) ∫ dq |q|^order C(q).

        To rounding for every real order: order 0 is the square of the rms height, order 2 of
        the rms slope.
        """
        ratio = _relative_moment(self, order, ndim) / _relative_moment(self, 0, ndim)
        return (rms_height_of(self, ndim) * self.q_roll ** (order / 2)) ** 2 * ratio


@shown()
class CutoffCurve(eqx.Module):
    """Friction and contact area up to each cut-off.

    Which waves count depends on the function: `cumulative_friction` adds up the waves of one
    contact, `mean_field_friction` leaves out shorter waves of the surface.

    **Fields:**

    - `cutoff`: wavenumbers q [rad/m], increasing, shape `(cutoffs,)`.
    - `friction`: force opposing the motion over the load [1], shape `(cutoffs,)`.
    - `contact_area`: fraction of the nominal area in contact [1], shape `(cutoffs,)`; None where
      there is one contact.
    """

    cutoff: Float[Array, " cutoffs"]
    friction: Float[Array, " cutoffs"]
    contact_area: Float[Array, " cutoffs"] | None = None


def _lay(anisotropy: Any, angle: Any, roll_off: str) -> tuple[Any, Any]:
    """Peklenik's number and the angle of the lay, both or none."""
    if anisotropy is None:
        if angle is not None:
            raise ValueError(f"`angle={angle}` is refused without an `anisotropy`.")
        return None, None
    if roll_off != "smooth":
        given = f"`anisotropy={anisotropy}`"
        raise ValueError(f'{given} is refused with the sharp roll-off: pass `roll_off="smooth"`.')
    words = "Peklenik's number is from 1 to 10,000; `angle` is of the long direction"
    anisotropy = scalar("anisotropy", words, at_least=1, at_most=1e4)(anisotropy)
    return anisotropy, scalar("angle")(0.0 if angle is None else angle)


def one_of_height_and_slope(rms_height: Any, rms_slope: Any) -> tuple[Any, Float[Array, ""]]:
    """Returns the name and the value of the one that was given; refuses both or none."""
    if (rms_height is None) == (rms_slope is None):
        given = f"`rms_height={rms_height}` and `rms_slope={rms_slope}`"
        raise ValueError(f"Exactly one of `rms_height` and `rms_slope` is needed, not {given}.")
    name = "rms_slope" if rms_height is None else "rms_height"
    given, unit = (rms_slope, "[1]") if rms_height is None else (rms_height, "[m]")
    return name, positive(name, unit)(given)


def power_integral(exponent: Array, length: Array) -> Array:
    """Returns ∫_0^length exp(exponent y) dy, smooth where the exponent passes through zero."""
    # The quotient loses its digits near zero, where a series takes its place. Both get harmless
    # arguments where the other counts, so that no derivative is NaN.
    t = exponent * length
    small = jnp.abs(t) < 0.5
    safe = jnp.where(small, 1, t)
    near = jnp.where(small, t, 0)
    series = jnp.ones_like(near)
    for n in range(16, 1, -1):
        series = 1 + near / n * series
    return length * jnp.where(small, series, jnp.expm1(safe) / safe)


def _relative_moment(spectrum: SelfAffine, order: int | float, ndim: int) -> Array:
    """The moment of the spectrum in units of q_roll whose plateau is 1."""
    if ndim not in (1, 2):
        raise ValueError(f"`ndim={ndim}` is refused: it must be 1 or 2.")
    if ndim == 1 and spectrum.anisotropy is not None:
        remedy = "Across an endless lay, take the spectrum without `anisotropy`"
        raise ValueError(f"`anisotropy` is refused for a profile, which has no lay. {remedy}.")
    unit = 2 * np.pi if ndim == 2 else 2
    if spectrum.roll_off == "smooth":
        node, weight = _legendre_nodes()
        low, high = (jnp.log(q / spectrum.q_roll) for q in (spectrum.q_low, spectrum.q_high))
        y = (low + high) / 2 + (high - low) / 2 * jnp.asarray(node, low.dtype)
        # In logarithms: q^order alone may leave the range of float32.
        power = -(ndim / 2 + spectrum.hurst)
        exponent = (order + ndim) * y + power * jnp.logaddexp(0.0, 2 * y)
        if spectrum.anisotropy is not None:
            fraction, _, share = between_ends(NUM_DIRECTIONS)
            offset = np.pi / 2 * fraction
            share = jnp.asarray(share, y.dtype)
            stretch = jnp.log(across_lay(spectrum.anisotropy, jnp.asarray(offset, y.dtype)))
            narrow = jnp.logaddexp(0.0, 2 * (y[:, None] + stretch))
            narrow = narrow - jnp.logaddexp(0.0, 2 * y)[:, None]
            exponent = exponent + jnp.log(jnp.exp(power * narrow) @ share)
        return unit * (high - low) / 2 * jnp.sum(jnp.asarray(weight, y.dtype) * jnp.exp(exponent))
    falls = -jnp.asarray(order + ndim, spectrum.q_low.dtype), order - 2 * spectrum.hurst
    lengths = (spectrum.q_roll / spectrum.q_low, spectrum.q_high / spectrum.q_roll)
    pairs = zip(falls, lengths, strict=True)
    below, above = (power_integral(power, jnp.log(length)) for power, length in pairs)
    return unit * (below + above)


@functools.cache
def _legendre_nodes() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights by Gauss, enough for moments to rounding over fifteen decades of q."""
    return np.polynomial.legendre.leggauss(256)


@functools.cache
def between_ends(num_intervals: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes x in [0, 1], 1 - x, and weights that sum to 1, which are dense at both ends.

    The trapezoidal rule in t, x = 1/(1 + exp(-π sinh t)) (H. Takahasi, M. Mori, Publ. RIMS 9 (1974)
    721, doi:10.2977/prims/1195192451): what varies with the logarithm of the distance from an end
    is resolved. Every second node is one of half as many intervals.
    """
    t = np.linspace(-1, 1, num_intervals + 1) * np.arcsinh(_LAST / np.pi)
    x, rest = (1 / (1 + np.exp(sign * np.pi * np.sinh(t))) for sign in (-1, 1))
    weight = x * rest * np.cosh(t) * np.pi * (t[1] - t[0])
    # The last nodes represent what is beyond them.
    weight[[0, -1]] += (1 - np.sum(weight)) / 2
    return x, rest, weight


_LAST = 16.0  # logarithm of the distance of the last node from its end
NUM_DIRECTIONS = 128  # of moments and of the mean over directions, good to rounding


def across_lay(anisotropy: Array, offset: Array) -> Array:
    """Returns k/q [1] at angles [rad] from the direction across the lay."""
    return jnp.sqrt(jnp.cos(offset) ** 2 + (anisotropy * jnp.sin(offset)) ** 2)


def narrowing(spectrum: SelfAffine, x: Array, offset: Array) -> Array:
    """Returns C at x = q/q_roll and angles from the direction across the lay, over C across [1]."""
    assert spectrum.anisotropy is not None
    narrow = jnp.log1p((x * across_lay(spectrum.anisotropy, offset)) ** 2) - jnp.log1p(x**2)
    return jnp.exp(-(1 + spectrum.hurst) * narrow)


def relative_density(spectrum: SelfAffine, x: Array, ndim: int) -> Array:
    """Returns C across the lay at x = q/q_roll in units of q_roll, of <h²> = 1.

    The edges are in the band.
    """
    slack = 8 * float(jnp.finfo(x.dtype).eps)
    inside = (x >= spectrum.q_low / spectrum.q_roll * (1 - slack)) & (
        x <= spectrum.q_high / spectrum.q_roll * (1 + slack)
    )
    if spectrum.roll_off == "smooth":
        tail = (1 + jnp.where(inside, x, 1) ** 2) ** -(ndim / 2 + spectrum.hurst)
    else:
        # A mode on the kink is on the plateau whatever its rounding, and so is its derivative.
        falling = inside & (x > 1 + slack)
        tail = jnp.where(falling, x, 1) ** -(ndim + 2 * spectrum.hurst)
    return jnp.where(inside, tail, 0) / _relative_moment(spectrum, 0, ndim)


def rms_height_of(spectrum: SelfAffine, ndim: int) -> Array:
    """Returns the root mean square height [m] of a surface or a profile (`ndim`)."""
    if spectrum.prescribed == "rms_height":
        return spectrum.amplitude
    ratio = _relative_moment(spectrum, 0, ndim) / _relative_moment(spectrum, 2, ndim)
    return spectrum.amplitude / spectrum.q_roll * jnp.sqrt(ratio)
