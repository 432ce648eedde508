"""Moduli through a graded layer: profile(s, omega) -> (E, ν), s from 0 (bottom) to 1 (top).

A profile is a module called with heights s [1] (0 at the layer's bottom, 1 at its top) and
angular frequencies ω [rad/s] that broadcast against each other; it returns Young's modulus
E [Pa] and Poisson's ratio [1], entry by entry, each of a shape that broadcasts to theirs. Where
a derivative of it jumps, it (or a shape in it) may have an attribute `breaks` (heights strictly
between 0 and 1): the layer is then cut there, and convergence is as fast as without. E and ν
themselves must be continuous; a jump is a boundary between two layers. Fields may be networks
(`equinox.nn`): functions inside a profile are fixed, arrays have derivatives.

The ready profiles vary with height through a shape φ(s). The paper's two (Scaraggi & Comingio,
App. B) are `Blend` with `Linear()` and with `Sinusoidal()`.

Sources: Z. Hashin, S. Shtrikman, J. Mech. Phys. Solids 11 (1963) 127,
doi:10.1016/0022-5096(63)90060-7, for the mixture, extended to viscoelastic phases by the
correspondence principle.
"""

import abc
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..core.checks import check_positive, check_type, check_values, is_concrete, scalar
from ..core.display import shown
from ..materials.coverage import coverage
from ..materials.material import AbstractMaterial, material_called
from .shapes import FROM_0_TO_1, AbstractShape, Linear, shape_called
from .stack import moduli_of

SAMPLES = 64  # intervals of height in which a profile is looked at


@shown(units=False)
class AbstractProfile(eqx.Module):
    """Young's modulus and Poisson's ratio as functions of height and frequency."""

    @abc.abstractmethod
    def __call__(
        self, s: Float[Array, "..."], omega: Inexact[Array, "..."]
    ) -> tuple[Inexact[Array, "..."], Inexact[Array, "..."]]:
        """Returns E [Pa] and ν [1] at heights `s` [1] and frequencies `omega` [rad/s]."""

    def at(self, temperature: ScalarLike) -> "AbstractProfile":
        """Returns the profile with its materials at another temperature [K]."""

        is_material = lambda node: isinstance(node, AbstractMaterial)  # noqa: E731
        moved = lambda node: node.at(temperature) if is_material(node) else node  # noqa: E731
        return jax.tree.map(moved, self, is_leaf=is_material)


class Blend(AbstractProfile):
    """One material passing into another: E from E_bottom(ω) and E_top(ω), by φ(s).

    If `mixing` is "linear", E = (1 - φ) E_bottom + φ E_top and ν = (1 - φ) ν_bottom + φ ν_top, also
    beyond φ = 1: the paper's E = E₀ (1 + s + sin 2πs) is `Blend(Elastic(E0), Elastic(2*E0),
    Sinusoidal())`. If it is "logarithmic", E = E_bottom^(1-φ) E_top^φ, which is positive for any φ
    is, and ν is as above for a shape that never leaves [0, 1] (`Linear`, `Exponential`, `PowerLaw`,
    `ErrorFunction`); for any other it is the average with weights (1 - φ)² and φ², which stays
    between the two.

    **Fields:**

    - `bottom`: the material at φ = 0.
    - `top`: the material at φ = 1.
    - `shape`: φ(s).
    - `mixing`: "linear" or "logarithmic". Static.
    """

    bottom: AbstractMaterial = eqx.field(converter=material_called("bottom"))
    top: AbstractMaterial = eqx.field(converter=material_called("top"))
    shape: AbstractShape = eqx.field(converter=shape_called("shape"), default=Linear())
    mixing: Literal["linear", "logarithmic"] = eqx.field(static=True, default="linear")

    def __check_init__(self):
        check_type("mixing", self.mixing, "linear", "logarithmic")

    def __call__(self, s, omega):
        phi = self.shape(s)
        (bottom, low), (top, high) = moduli_of(self.bottom, omega), moduli_of(self.top, omega)
        if self.mixing == "linear":
            return bottom + phi * (top - bottom), low + phi * (high - low)
        # The complex logarithm stays on its branch: both moduli have positive real parts.
        modulus = bottom * jnp.exp(phi * jnp.log(top / bottom))
        if not isinstance(self.shape, FROM_0_TO_1):
            # Extrapolated, ν might exceed 1/2; cut off, it would have a kink.
            phi = phi**2 / (phi**2 + (1 - phi) ** 2)
        return modulus, low + phi * (high - low)


class Mixture(AbstractProfile):
    """Isolated grains of one material in another, with a volume fraction that varies with height.

    The Hashin-Shtrikman estimate with the matrix as the reference phase (for spheres, that of
    Mori and Tanaka), with moduli replaced by complex moduli: with K, G the bulk and shear
    moduli, ⟨·⟩ the volume average, and m for the matrix,

        1/(K + z) = ⟨1/(K_i + z)⟩,  z = 4 G_m/3,
        1/(G + h) = ⟨1/(G_i + h)⟩,  h = G_m (9 K_m + 8 G_m)/(6 (K_m + 2 G_m)).

    For a stiff filler it is the lower bound: interacting and percolating grains are stiffer.

    **Fields:**

    - `matrix`: the continuous material.
    - `filler`: the material of the grains.
    - `fraction`: the shape whose values are the filler's volume fraction [1], from 0 to 1.
    """

    matrix: AbstractMaterial = eqx.field(converter=material_called("matrix"))
    filler: AbstractMaterial = eqx.field(converter=material_called("filler"))
    fraction: AbstractShape = eqx.field(converter=shape_called("fraction"))

    def __check_init__(self):
        fraction = self.fraction(jnp.linspace(0.0, 1.0, SAMPLES + 1))
        allowed = "a volume fraction lies between 0 and 1"
        check_values("fraction", fraction, allowed, at_least=-1e-9, at_most=1 + 1e-9)

    def __call__(self, s, omega):
        fraction = self.fraction(s)
        pairs = (moduli_of(material, omega) for material in (self.matrix, self.filler))
        # In units of the matrix's shear modulus, and with 1/K: then ν = 1/2 is no exception.
        (unit, bulk_m), (shear, bulk_f) = (
            (modulus / (2 * (1 + poisson)), 3 * (1 - 2 * poisson) / modulus)
            for modulus, poisson in pairs
        )
        shear, bulk_m, bulk_f = shear / unit, bulk_m * unit, bulk_f * unit
        z, h = 4 / 3, (9 + 8 * bulk_m) / (6 * (1 + 2 * bulk_m))

        def mean(matrix, filler):
            return matrix + fraction * (filler - matrix)

        bulk = mean(bulk_m / (1 + z * bulk_m), bulk_f / (1 + z * bulk_f)) / mean(
            1 / (1 + z * bulk_m), 1 / (1 + z * bulk_f)
        )
        shear = 1 / mean(1 / (1 + h), 1 / (shear + h)) - h
        product = shear * bulk
        return unit * 9 * shear / (3 + product), (3 - 2 * product) / (2 * (3 + product))


class Aged(AbstractProfile):
    """A material whose relaxation times vary with height: E = E_material(a(s) ω).

    a = a_bottom^(1-φ) a_top^φ multiplies every relaxation time: an aged, oxidised or
    wear-modified skin has a > 1 at the top.

    **Fields:**

    - `material`: the unaged material.
    - `bottom`: a at φ = 0 [1], positive.
    - `top`: a at φ = 1 [1], positive.
    - `shape`: φ(s).
    """

    material: AbstractMaterial = eqx.field(converter=material_called("material"))
    bottom: Float[Array, ""] = eqx.field(converter=scalar("bottom"), default=1.0)
    top: Float[Array, ""] = eqx.field(converter=scalar("top"), default=1.0)
    shape: AbstractShape = eqx.field(converter=shape_called("shape"), default=Linear())

    def __check_init__(self):
        check_positive("bottom", self.bottom, "[1]")
        check_positive("top", self.top, "[1]")

    def __call__(self, s, omega):
        return moduli_of(self.material, self._factor(s) * omega)

    def coverage(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Returns the lowest and highest ω [rad/s] measured at every height."""
        known = coverage(self.material)
        if known is None:
            return jnp.zeros_like(self.top), jnp.full_like(self.top, jnp.inf)
        least, most = self._range()
        return known[0] / least, known[1] / most

    def _factor(self, s):
        return self.bottom * jnp.exp(self.shape(s) * jnp.log(self.top / self.bottom))

    def _range(self):
        # At the heights where profiles are checked.
        factors = jax.lax.stop_gradient(self._factor(jnp.linspace(0, 1, SAMPLES + 1)))
        return jnp.min(factors), jnp.max(factors)


def moduli_at(profile: Any, s: Array, omega: Array) -> tuple[Array, Array]:
    """Returns E and ν of a profile as arrays: a function may return Python numbers."""
    modulus, poisson = profile(s, omega)
    return jnp.asarray(modulus), jnp.asarray(poisson)


def check_profile(name: str, profile: Any, omega: Inexact[Array, "..."]) -> None:
    """Raises `ValueError` naming the height at which a profile is not usable, if it is known.

    Sampled at 65 heights and up to five of the frequencies: finite E of positive real part, ν
    of real part in (-1, 1/2], and no jump between samples.
    """
    if not all(is_concrete(leaf) for leaf in jax.tree.leaves((profile, omega))):
        return
    sizes = jnp.sort(jnp.abs(jnp.ravel(omega)))
    if sizes.size == 0:
        return
    # The lowest, the highest and three between.
    omega = sizes[np.linspace(0, sizes.size - 1, min(sizes.size, 5)).astype(int)]
    s = jnp.linspace(0, 1, SAMPLES + 1, dtype=omega.dtype)
    expected = (s.size, omega.size)
    try:
        shapes = [part.shape for part in jax.eval_shape(moduli_at, profile, s[:, None], omega)]
        if jnp.broadcast_shapes(*shapes, expected) != expected:
            raise ValueError(f"E of shape {shapes[0]} and ν of shape {shapes[1]}")
    except (TypeError, ValueError, AttributeError) as error:
        raise ValueError(
            f"`{name}` must return a pair (E, ν) that broadcasts to {expected} for s of shape "
            f"{(s.size, 1)} and omega of shape {omega.shape}; it gave {error}."
        ) from None
    modulus, poisson, where, jump = (np.array(part) for part in _survey(profile, s, omega))
    solid = (np.real(poisson) > -1) & (np.real(poisson) <= 0.5 + 1e-6)
    for good, value, why in (
        (
            np.real(modulus) > 0,
            modulus,
            "the modulus [Pa] must be finite, with a positive real part",
        ),
        (solid, poisson, "Poisson's ratio must be finite, greater than -1 and at most 0.5"),
    ):
        for i, j in np.argwhere(~(good & np.isfinite(value)))[:1]:
            place = f"s={float(s[i]):g}, omega={float(omega[j]):g}"
            raise ValueError(f"`{name}` at {place}: {why}, got {value[i, j]:g}.")
    if np.any(jump > 1e-2):
        place = f"s={where[np.argmax(jump)]:.6g}"
        raise ValueError(f"`{name}` jumps at {place}. Put a boundary between two layers there.")


@jax.jit
def _survey(profile, s, omega):
    """Samples of the profile, and the largest change left after halving every interval."""

    def sample(s):
        moduli = moduli_at(profile, s[..., None], omega)
        return tuple(jnp.broadcast_to(part, (*s.shape, omega.size)) for part in moduli)

    def changes(s):
        """Of each height to the next, along the first axis."""
        modulus, poisson = sample(s)
        change = jnp.abs(jnp.log(modulus[1:] / modulus[:-1])) + jnp.abs(jnp.diff(poisson, axis=0))
        return jnp.max(change, axis=-1)

    def halve(_, ends):
        low, high = ends
        middle = (low + high) / 2
        lower, upper = changes(jnp.stack([low, middle, high]))
        return jnp.where(upper > lower, middle, low), jnp.where(upper > lower, high, middle)

    # A smooth profile spreads its change over more than 2^-40 of the layer; a jump does not.
    halvings = min(40, int(-np.log2(float(jnp.finfo(s.dtype).eps))) - 8)
    ends = jax.lax.fori_loop(0, halvings, halve, (s[:-1], s[1:]))
    return *sample(s), ends[1], changes(jnp.stack(ends))[0]
