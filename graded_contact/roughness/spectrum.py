"""Spectra of roughness.

A spectrum C(q) is two-sided and isotropic, <h²> = ∫ d²q C(q) over the whole plane for a surface,
<h²> = ∫ dq C(q) over the whole line for a profile; `ndim` is 2 or 1.

The shape of the spectrum is that of B. N. J. Persson, J. Phys.: Condens. Matter 18 (2006) 7789,
doi:10.1088/0953-8984/18/32/009; Nayak's parameter is that of P. R. Nayak, J. Lubr. Technol. 93
(1971) 398, doi:10.1115/1.3451608, for an isotropic surface.
"""

import functools
from collections.abc import Sequence
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ..core.checks import as_scalar, check_positive, check_type, check_values, is_concrete
from ..core.display import shown

UNITS = {"rms_height": "[m]", "rms_slope": "[1]"}


@shown()
class SelfAffine(eqx.Module):
    """An isotropic self-affine spectrum with a roll-off.

    C is constant for q_low <= q <= q_roll, falls as q^(-2(1+H)) for q_roll < q <= q_high
    (q^(-1-2H) for a profile), and is zero outside. With a smooth roll-off it is
    [1 + (q/q_roll)²]^-(1+H) from q_low to q_high instead (-(1/2+H) for a profile).

    Derivatives of a random surface with respect to `q_low` and `q_high` see the normalisation, not
    the modes that a moving edge admits: where a mode lies on an edge they are those of the side on
    which it stays, `q_low` downwards and `q_high` upwards. By `q_roll` they are one-sided where a
    mode lies on the sharp kink (`q_roll` upwards); for a design take `roll_off="smooth"`.

    **Fields:**

    - `amplitude`: the prescribed root mean square, height [m] or slope [1].
    - `hurst`: Hurst exponent H [1], 0 < H <= 1.
    - `q_low`, `q_roll`, `q_high`: wavenumbers [rad/m], in increasing order.
    - `prescribed`: which of `"rms_height"` and `"rms_slope"` was given. Static.
    - `roll_off`: `"sharp"` or `"smooth"`. Static.
    """

    amplitude: Float[Array, ""]
    hurst: Float[Array, ""]
    q_low: Float[Array, ""]
    q_roll: Float[Array, ""]
    q_high: Float[Array, ""]
    prescribed: Literal["rms_height", "rms_slope"] = eqx.field(static=True)
    roll_off: Literal["sharp", "smooth"] = eqx.field(static=True)

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
    ):
        """Prescribes either `rms_height` [m] or `rms_slope` [1] (of the gradient's length)."""
        check_type("roll_off", roll_off, "sharp", "smooth")
        self.roll_off = roll_off
        self.prescribed, self.amplitude = one_of_height_and_slope(rms_height, rms_slope)
        self.hurst = as_scalar(hurst, "hurst")
        self.q_low, self.q_roll = as_scalar(q_low, "q_low"), as_scalar(q_roll, "q_roll")
        self.q_high = as_scalar(q_high, "q_high")
        check_values(
            "hurst", self.hurst, "it must be greater than 0 and at most 1", above=0, at_most=1
        )
        check_positive("q_low", self.q_low, "[rad/m]")
        _check_order("q_roll", self.q_roll, "q_low", self.q_low)
        _check_order("q_high", self.q_high, "q_roll", self.q_roll)
        if (
            is_concrete(self.q_low)
            and is_concrete(self.q_high)
            and not (float(self.q_low) < float(self.q_high))
        ):
            raise ValueError(
                f"`q_high={float(self.q_high):g}` is refused: it must exceed "
                f"`q_low={float(self.q_low):g}`, the band is empty."
            )
        if all(map(is_concrete, jax.tree.leaves(self))):
            check_square(self.prescribed, self.amplitude, _squares(self))

    @property
    def rms_height(self) -> Float[Array, ""]:
        """Root mean square height of the surface [m]."""
        return rms_height_of(self, 2)

    @property
    def rms_slope(self) -> Float[Array, ""]:
        """Root mean square length of the gradient of the surface [1]."""
        return jnp.sqrt(self.moment(2))

    @property
    def rms_curvature(self) -> Float[Array, ""]:
        """Root mean square of the mean curvature ∇²h/2 [1/m]."""
        return jnp.sqrt(self.moment(4)) / 2

    @property
    def nayak_parameter(self) -> Float[Array, ""]:
        """Nayak's bandwidth parameter α = (3/2) m0 m4/m2² [1], 3/2 for a narrow band."""
        m0, m2, m4 = (_relative_moment(self, order, 2) for order in (0, 2, 4))
        return 1.5 * m0 / m2 * (m4 / m2)

    def density(self, q: Float[Array, "*q"], ndim: int = 2) -> Float[Array, "*q"]:
        """Returns C(q) at the wavenumbers `q` [rad/m]: [m⁴], or [m³] of a profile (`ndim=1`)."""
        relative = relative_density(self, q / self.q_roll, ndim)
        return (rms_height_of(self, ndim) / self.q_roll ** (ndim / 2)) ** 2 * relative

    def moment(self, order: int | float, ndim: int = 2) -> Float[Array, ""]:
        """Returns ∫ d²q q^order C(q) [m^(2 - order)], for a profile (`ndim=1`) ∫ dq |q|^order C(q).

        To rounding for every real order: order 0 is the square of the rms height, order 2 that of
        the rms slope.
        """
        ratio = _relative_moment(self, order, ndim) / _relative_moment(self, 0, ndim)
        return (rms_height_of(self, ndim) * self.q_roll ** (order / 2)) ** 2 * ratio


def one_of_height_and_slope(rms_height: Any, rms_slope: Any) -> tuple[Any, Float[Array, ""]]:
    """Returns the name and the value of the one that was given; refuses both or none."""
    if (rms_height is None) == (rms_slope is None):
        raise ValueError(
            "Exactly one of `rms_height` and `rms_slope` is needed, got "
            f"`rms_height={rms_height}` and `rms_slope={rms_slope}`."
        )
    name = "rms_slope" if rms_height is None else "rms_height"
    value = as_scalar(rms_slope if rms_height is None else rms_height, name)
    check_positive(name, value, UNITS[name])
    return name, value


def check_square(name: str, value: Array, logarithms: Sequence[float] = (0.0,)) -> None:
    """Refuses an amplitude whose square, times what has these logarithms, is beyond its dtype."""
    if not is_concrete(value):
        return
    kind = jnp.finfo(value.dtype)
    ends = np.log(float(kind.tiny)) - min(logarithms), np.log(float(kind.max)) - max(logarithms)
    least, most = np.exp(np.array(ends) / 2)
    allowed = (
        f"it must be from {least:.2g} to {most:.2g} {UNITS[name]}, otherwise its square or the "
        f"density of its spectrum leaves the range of {value.dtype}"
    )
    check_values(name, value, allowed, at_least=least, at_most=most)


def _squares(spectrum: SelfAffine) -> list[float]:
    """Logarithms of the squares of rms height and slope and of C on the plateau, of amplitude 1."""
    known = jax.tree.map(lambda leaf: np.asarray(leaf, float), spectrum)
    height, slope = (np.log(_relative_moment(known, order, 2, np)) for order in (0, 2))
    units = 2 * np.log(known.q_roll)
    found = [height, slope + units, -units]
    return [each - found[spectrum.prescribed == "rms_slope"] for each in found]


def _check_order(name: str, value: Array, lower_name: str, lower: Array) -> None:
    check_positive(name, value, "[rad/m]")
    if is_concrete(lower) and is_concrete(value) and float(value) < float(lower):
        raise ValueError(
            f"`{name}={float(value):g}` is refused: it must be at least "
            f"`{lower_name}={float(lower):g}` [rad/m]."
        )


def _power_integral(exponent: Any, length: Any, lib: Any) -> Any:
    """∫_0^length exp(exponent y) dy, smooth where the exponent passes through zero."""
    t = exponent * length
    small = lib.abs(t) < 0.5
    safe = lib.where(small, 1, t)
    near = lib.where(small, t, 0)
    series = lib.ones_like(near)
    for n in range(16, 1, -1):
        series = 1 + near / n * series
    return length * lib.where(small, series, lib.expm1(safe) / safe)


def _relative_moment(spectrum: SelfAffine, order: float, ndim: int, lib: Any = jnp) -> Any:
    """The moment of the spectrum in units of q_roll whose plateau is 1, by JAX or by NumPy."""
    if ndim not in (1, 2):
        raise ValueError(f"`ndim={ndim}` is refused: it must be 1 or 2.")
    unit = 2 * np.pi if ndim == 2 else 2
    if spectrum.roll_off == "smooth":
        node, weight = _nodes()
        low, high = (lib.log(q / spectrum.q_roll) for q in (spectrum.q_low, spectrum.q_high))
        y = (low + high) / 2 + (high - low) / 2 * lib.asarray(node, low.dtype)
        # In logarithms: q^order alone may leave the range of float32.
        exponent = (order + ndim) * y - (ndim / 2 + spectrum.hurst) * lib.logaddexp(0.0, 2 * y)
        return unit * (high - low) / 2 * lib.sum(lib.asarray(weight, y.dtype) * lib.exp(exponent))
    falls = -lib.asarray(order + ndim, spectrum.q_low.dtype), order - 2 * spectrum.hurst
    lengths = (spectrum.q_roll / spectrum.q_low, spectrum.q_high / spectrum.q_roll)
    plateau, tail = (
        _power_integral(exponent, lib.log(length), lib)
        for exponent, length in zip(falls, lengths, strict=True)
    )
    return unit * (plateau + tail)


@functools.cache
def _nodes() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights by Gauss, enough for moments to rounding over fifteen decades of q."""
    return np.polynomial.legendre.leggauss(256)


def relative_density(spectrum: SelfAffine, x: Array, ndim: int) -> Array:
    """Returns C at x = q/q_roll in units of q_roll, of <h²> = 1; the edges are in the band."""
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


@shown()
class CutoffCurve(eqx.Module):
    """Friction and contact area up to each cut-off.

    Which waves count depends on the function: `cumulative_friction` adds up the waves of one
    contact, `area_against_cutoff` and `mean_field_friction` leave out those of the surface.

    **Fields:**

    - `cutoff`: wavenumbers q [rad/m], increasing, shape `(cutoffs,)`.
    - `friction`: force opposing the motion over the load [1], shape `(cutoffs,)`.
    - `contact_area`: fraction of the nominal area in contact [1], shape `(cutoffs,)`; None where
      there is one contact.
    - `contact_area_smooth`: that with sub-pixel edges [1], shape `(cutoffs,)`; None without a grid.
    """

    cutoff: Float[Array, " cutoffs"]
    friction: Float[Array, " cutoffs"]
    contact_area: Float[Array, " cutoffs"] | None = None
    contact_area_smooth: Float[Array, " cutoffs"] | None = None
