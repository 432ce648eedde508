"""Spectra of isotropic surfaces from a table, such as measured ones."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ..core.checks import Numbers, as_float, check_ascending, positive
from ..core.display import shown
from .spectrum import SelfAffine, power_integral

ROUNDED = 1e-5  # relative: a point this near to an end is the end
_CORRECTIONS = 3  # of C from a line: more blow up noise, fewer miss a roll-off


@shown("q_low", "q_high", "rms_height", "rms_slope", "history", "warnings", units=False)
class SpectrumTable(eqx.Module):
    """The spectrum C(q) of an isotropic surface: a power of q between neighbours, 0 outside.

    <h²> = ∫ d²q C(q) over the whole plane, as for `SelfAffine`.

    **Fields:**

    - `q`: wavenumbers [rad/m], increasing, shape `(points,)`.
    - `values`: C at these [m⁴], shape `(points,)`.
    - `history`: where the spectrum comes from, one sentence each. Static.
    - `warnings`: sentences on what makes it doubtful, for surfaces drawn from it. Static.
    """

    q: Float[Array, " points"] = eqx.field(converter=positive("q", "[rad/m]", as_float))
    values: Float[Array, " points"] = eqx.field(converter=positive("values", "[m⁴]", as_float))
    history: tuple[str, ...] = eqx.field(static=True, default=())
    warnings: tuple[str, ...] = eqx.field(static=True, default=())
    angle = None  # without a lay

    def __check_init__(self):
        check_ascending(2, q=self.q, values=self.values)

    @classmethod
    def from_line(cls, q: Numbers, line: Numbers, **said: tuple[str, ...]) -> "SpectrumTable":
        """Returns the spectrum of an isotropic surface from the spectrum of lines on it.

        Such is the spectrum of several scans that SurfaceTopography's containers join, over 2π.

        **Arguments:**

        - `q`: wavenumbers [rad/m], increasing, shape `(points,)`.
        - `line`: C of a line [m³], two-sided: <h²> is its integral over positive and negative q.
        - `said`: `history` and `warnings`.
        """
        line = positive("line", "[m³]", as_float)(line)
        return cls(q, _isotropic(np.asarray(q, float), np.asarray(line)), **said)

    @property
    def q_low(self) -> Float[Array, ""]:
        """Lowest wavenumber [rad/m]."""
        return self.q[0]

    @property
    def q_high(self) -> Float[Array, ""]:
        """Highest wavenumber [rad/m]."""
        return self.q[-1]

    @property
    def rms_height(self) -> Float[Array, ""]:
        """Root mean square height of the surface [m]."""
        return jnp.sqrt(self.moment(0))

    @property
    def rms_slope(self) -> Float[Array, ""]:
        """Root mean square length of the gradient of the surface [1]."""
        return jnp.sqrt(self.moment(2))

    def density(self, q: Float[Array, "*q"]) -> Float[Array, "*q"]:
        """Returns C(q) at wavenumbers [rad/m]: [m⁴]; both ends count."""
        slack = 8 * float(jnp.finfo(q.dtype).eps)
        inside = (q >= self.q[0] * (1 - slack)) & (q <= self.q[-1] * (1 + slack))
        logarithm = jnp.log(jnp.where(inside, q, self.q[0]))
        between = jnp.interp(logarithm, jnp.log(self.q), jnp.log(self.values))
        return jnp.where(inside, jnp.exp(between), 0)

    def moment(self, order: int | float) -> Float[Array, ""]:
        """Returns ∫ d²q q^order C(q) [m^(2 - order)], to rounding."""
        x, y = jnp.log(self.q), jnp.log(self.values)
        power = order + 2
        pieces = power_integral(jnp.diff(y) / jnp.diff(x) + power, jnp.diff(x))
        # In logarithms: q^power alone may leave the range of float32.
        return 2 * np.pi * jnp.sum(jnp.exp(y + power * x)[:-1] * pieces)

    def between(self, q_low: ScalarLike, q_high: ScalarLike) -> "SpectrumTable":
        """Returns the part of the spectrum between two wavenumbers [rad/m], as far as it is known.

        A random surface takes the part from 2π/L to the Nyquist wavenumber of its grid.
        """
        known = np.asarray(self.q)
        first, last = np.clip(np.asarray([q_low, q_high]), known[0], known[-1])
        inner = known[(known > first * (1 + ROUNDED)) & (known < last * (1 - ROUNDED))]
        q = jnp.asarray([first, *inner, last], self.q.dtype)
        return SpectrumTable(q, self.density(q), self.history, self.warnings)


def _isotropic(q: np.ndarray, line: np.ndarray) -> np.ndarray:
    """C of an isotropic surface [m⁴] from the spectrum of a line on it [m³].

    By corrections of C with the ratio of the line's spectrum to the one that C implies, smoothed
    over neighbours: short ripples in q are noise of a single line. Where C falls as a power law the
    error is 2 %. Below a roll-off, lines tell little: C may be 1.6 times too large there.
    """
    u = np.linspace(0, 12, 600)  # k = q cosh u
    weight = np.cosh(u) * (u[1] - u[0])
    weight[0] /= 2
    x, target = np.log(q), np.log(line)
    log_k = x[:, None] + np.log(np.cosh(u))
    far = x >= x[-1] - np.log(10) / 2
    near = np.array([1, 2, 3, 2, 1])
    share = np.convolve(np.ones(len(x)), near, "same")
    found = target - x - np.log(np.pi)
    for _ in range(_CORRECTIONS):
        # Waves beyond the last one follow a power law, from 1/q² to q⁻⁶.
        slope = np.clip(np.polyfit(x[far], found[far], 1)[0], -6, -2) if np.sum(far) > 1 else -4
        density = np.exp(np.interp(log_k, x, found) + slope * np.maximum(log_k - x[-1], 0))
        ratio = target - x - np.log(2 * density @ weight)
        found = found + np.convolve(ratio, near, "same") / share
    return np.exp(found)


Spectrum = SelfAffine | SpectrumTable
