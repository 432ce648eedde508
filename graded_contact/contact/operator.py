"""The solid as an operator from pressures to displacements.

Under steady sliding the operator is diagonal in Fourier space, w = M σ mode by mode. A solver needs
three things of it: M σ, (I + ρM)⁻¹ z, and what happens to the mean. The mean of the pressure or
that of the gap is prescribed, so the operator leaves the mean of a displacement open. Its real part
is positive, which is what makes the splitting converge.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Inexact

from ..fields.grid import multiplicity, to_field, to_spectrum


class Solid(eqx.Module):
    """The solid with the penalty ρ of a solver: ρM, and (I + ρM)⁻¹ from z = σ + ρu to σ.

    **Fields:**

    - `kernel`: M on the half spectrum, of any mean.
    - `penalty`: ρ.
    - `free_mean`: whether (I + ρM)⁻¹ keeps the mean; else it removes the mean. Static.
    """

    kernel: Inexact[Array, "*half"]
    penalty: Float[Array, ""]
    free_mean: bool = eqx.field(static=True)

    @property
    def compliance(self) -> Inexact[Array, "*half"]:
        """ρM, 0 for the mean."""
        return jnp.where(first_mode(self.kernel.shape), 0, self.penalty * self.kernel)

    @property
    def stiffness(self) -> Float[Array, "*half"]:
        """1/ρ Re M, 0 for the mean."""
        mean, real = first_mode(self.kernel.shape), jnp.real(self.compliance)
        return jnp.where(mean, 0, 1 / jnp.where(mean, 1, real))

    def displace(self, pressure: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """Returns ρM σ, of zero mean."""
        return to_field(self.compliance * to_spectrum(pressure), pressure.shape)

    def resolve(self, z: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """Returns (I + ρM)⁻¹ z."""
        return self.resolve_spectrum(to_spectrum(z), z.shape)

    def resolve_spectrum(self, spectrum, shape: tuple[int, ...]) -> Float[Array, "*shape"]:
        """Returns (I + ρM)⁻¹ z for the spectrum of z."""
        kernel = self.compliance
        filter = 1 / (1 + kernel)
        if jnp.iscomplexobj(kernel):  # XLA's own division of complex numbers guards each of them
            real, imag = 1 + kernel.real, kernel.imag
            scale = 1 / (real**2 + imag**2)
            filter = jax.lax.complex(real * scale, -imag * scale)
        filter = jnp.where(first_mode(kernel.shape), 1 if self.free_mean else 0, filter)
        return to_field(filter * spectrum, shape)


def displace(
    kernel: Inexact[Array, "*half"], field: Float[Array, "*shape"]
) -> Float[Array, "*shape"]:
    """Returns M σ without its mean."""
    spectrum = (kernel * to_spectrum(field)).at[(0,) * field.ndim].set(0)
    return to_field(spectrum, field.shape)


def first_mode(shape: tuple[int, ...]) -> Bool[Array, "*half"]:
    """Returns where a half spectrum of this shape has its mean, as a mask.

    A mask sets that entry in the same pass over memory; an index would need another one.
    """
    numbers = [jax.lax.broadcasted_iota(jnp.int32, shape, axis) for axis in range(len(shape))]
    return sum(numbers[1:], numbers[0]) == 0


def third_mode(kernel: Inexact[Array, "*half"]) -> Inexact[Array, ""]:
    """Returns the kernel of the long waves: at three times the lowest wavenumber along x.

    Along y if the grid has only one row.
    """
    if kernel.ndim == 2 and len(kernel) == 1:
        kernel = kernel[0]
    return kernel[(3,) + (0,) * (kernel.ndim - 1)]


def least_compliance(kernel: Inexact[Array, "*half"]) -> Float[Array, ""]:
    """Returns the smallest |M| of all waves."""
    return jnp.min(jnp.where(first_mode(kernel.shape), jnp.inf, jnp.abs(kernel)))


def bending_energy(kernel: Inexact[Array, "*half"], field: Float[Array, "*shape"]) -> Array:
    """Returns the mean energy ⟨f M⁻¹ f⟩ of a displacement, for a kernel that is 0 at q = 0."""
    weight = jnp.asarray(multiplicity(field.shape) / field.size**2, field.dtype)
    power = jnp.abs(to_spectrum(field)) ** 2 * weight
    # Only the real part of 1/M stores energy.
    present = jnp.abs(kernel) > 0
    return jnp.sum(jnp.where(present, power * jnp.real(1 / jnp.where(present, kernel, 1)), 0))


def contact_stiffness(
    kernel: Inexact[Array, "*half"], gap: Float[Array, "*shape"], s: Float[Array, "*shape"]
) -> Float[Array, ""]:
    """Returns an upper bound of dp/dū, the change of the mean pressure with the mean gap.

    The stiffness is the least energy of all fields χ of mean 1: ⟨χ M⁻¹ χ⟩ in the solid, and
    s/(1 - s) χ² in a law of slope s. Two fields are tried, the gap and a constant. At a hard wall
    the bound is infinite in full contact.

    **Arguments:**

    - `kernel`: ρM on the half spectrum, 0 at q = 0.
    - `gap`: of the law, in units of pressure over ρ.
    - `s`: slope of the law's proximal map there.
    """
    field = jnp.abs(gap)
    springs = jnp.where(s < 1, s / jnp.where(s < 1, 1 - s, 1), jnp.inf)
    bent = bending_energy(kernel, field) + jnp.mean(jnp.where(s < 1, springs, 0) * field**2)
    squared = jnp.mean(field) ** 2
    by_gap = jnp.where(squared > 0, bent / nonzero(squared), jnp.inf)
    return jnp.minimum(by_gap, jnp.mean(springs))


def nonzero(number: Array) -> Array:
    """Returns a number to divide by: 1 in place of 0."""
    return jnp.where(number != 0, number, 1)


def root_mean_square(field: Float[Array, "..."]) -> Float[Array, ""]:
    """Returns √⟨f²⟩."""
    return jnp.sqrt(jnp.mean(field**2))
