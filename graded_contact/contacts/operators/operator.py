"""The solid as an operator from pressures to displacements.

An operator M is diagonal in some waves: M = U* K U with the kernel K, one number for each wave. U
is orthogonal up to a factor, so that the resolvent is diagonal too, (I + ρM)⁻¹ = U* (1 + ρK)⁻¹ U:
one transform and its inverse. A solver needs M, the resolvent and the mean. The mean of the
pressure or of the gap is prescribed, so the operator leaves the mean of a displacement open. The
splitting converges because the real part of K is positive.

Under steady sliding U is the Fourier transform in the frame of the surface (`Steady`). Under any
other periodic motion it is one in space and time (`space_time.py`), and the mean is prescribed at
every time. The defaults of `AbstractOperator` are for steady sliding; another operator is a
subclass with a kernel and what differs.

An operator also knows its fields: the cell that they fill, around a window (`window.py`) more than
the surface, and which of their axes is time. So an observable of a contact is one formula for all.
"""

from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Inexact, Int, Shaped

from ...fields.grid import Grid, Waves, multiplicity, resample_spectrum, to_field, to_spectrum

Field = Float[Array, "*shape"]  # on the surface, or on the cell of a window
Scalar = Float[Array, ""]
# Largest -ρ Re M of a wave: 36 of 36 windows converged at 0.05, 23 without a limit.
_NEGATIVE = 0.05


class AbstractOperator(eqx.Module):
    """M, the displacement under a pressure, diagonal in waves.

    **Fields:**

    - `kernel`: M of each wave [m/Pa], on half of the last axis. Its entry for the mean is ignored.
    - `of_distance`: whether M depends on the distance of two points only, so that its matrix
      between few points can be gathered. Static.
    """

    kernel: eqx.AbstractVar[Waves]
    of_distance: ClassVar[bool] = True

    def to_waves(self, field: Field) -> Waves:
        """Returns U f, unnormalised as `to_spectrum` is."""
        return to_spectrum(field)

    def to_field(self, waves: Waves, shape: tuple[int, ...]) -> Field:
        """Returns the field of these waves, the inverse of `to_waves`."""
        return to_field(waves, shape)

    def mean(self, field: Field) -> Float[Array, "..."]:
        """Returns the mean that M leaves open, broadcastable to the field."""
        return jnp.mean(field)

    def coarser(self, shape: tuple[int, ...], new_shape: tuple[int, ...]) -> "AbstractOperator":
        """Returns the operator on a coarser grid of the same cell, for a start."""
        return self.with_kernel(resample_spectrum(self.compliance, shape, new_shape))

    @property
    def is_mean(self) -> Bool[Array, "*half"]:
        """Where the waves have the mean that M leaves open, as a mask."""
        return first_mode(self.kernel.shape)

    @property
    def long_wave(self) -> Scalar:
        """|M| of the long waves, see `long_wave_of`."""
        return long_wave_of(self.kernel)

    @property
    def least(self) -> Scalar:
        """The smallest |M| of all waves."""
        return jnp.min(jnp.where(self.is_mean, jnp.inf, jnp.abs(self.kernel)))

    @property
    def compliance(self) -> Waves:
        """The kernel, 0 for the mean."""
        return jnp.where(self.is_mean, 0, self.kernel)

    @property
    def inverse(self) -> Waves:
        """1/M, 0 for the mean."""
        return jnp.where(self.is_mean, 0, 1 / jnp.where(self.is_mean, 1, self.kernel))

    def scaled(self, factor: Scalar | float) -> "AbstractOperator":
        """Returns the operator times a factor."""
        return self.with_kernel(factor * self.kernel)

    def with_kernel(self, kernel: Waves) -> "AbstractOperator":
        """Returns the operator with another kernel in the same waves."""
        return eqx.tree_at(lambda operator: operator.kernel, self, kernel)

    def filtered(self, factors: Waves, field: Field) -> Field:
        """Returns a field whose waves were multiplied by `factors`."""
        return self.to_field(factors * self.to_waves(field), field.shape)

    def displace(self, pressure: Field) -> Field:
        """Returns M σ without its mean."""
        return self.filtered(self.compliance, pressure)

    def bending_energy(self, field: Field) -> Float[Array, "..."]:
        """Returns the mean energy ⟨f M⁻¹ f⟩ of a displacement, of each mean that is prescribed."""
        # By one transform instead of two: only the real part of 1/M stores energy.
        waves = self.to_waves(field)
        weight = multiplicity(field.shape) / np.prod(field.shape) ** 2
        weight = jnp.asarray(weight, waves.real.dtype)
        return jnp.sum(jnp.abs(waves) ** 2 * weight * jnp.real(self.inverse))

    # What solvers need.

    def penalty_for(self, participation: Scalar, steepest_rise: Scalar | float) -> Scalar:
        """Returns ρ = 1.8 s^0.4/√(|M| of the long waves × least |M|) [Pa/m].

        It balances the softest modes, which carry the displacement, against the stiffest, which
        carry the edges of the contact; s is ⟨|σ|⟩²/⟨σ²⟩. Factor and power are within 10 % of the
        fewest FFT pairs of viscoelastic contacts. For a law that attracts, at least twice its
        steepest rise, so that its proximal map is single-valued. Where Re M is negative for some
        waves, at most `_NEGATIVE` over the largest of them: out of contact a step magnifies their
        errors by (1 - ρM)/(1 + ρM) less the relaxation.
        """
        long, least = self.long_wave, self.least
        # Not the root of the product, which underflows in float32.
        penalty = 1.8 * participation**0.4 / jnp.sqrt(long) / jnp.sqrt(least)
        negative = jnp.max(jnp.where(self.is_mean, 0, -jnp.real(self.kernel)))
        most = jnp.where(negative > 0, _NEGATIVE / jnp.where(negative > 0, negative, 1), jnp.inf)
        penalty = jnp.minimum(penalty, most)
        # The penalty decides the path to the solution, not the solution.
        return jax.lax.stop_gradient(jnp.maximum(penalty, 2 * steepest_rise))

    def pressure_unit(self, heights: Field, pressure: Array | None, gap: Array | None) -> Scalar:
        """Returns a typical pressure: the prescribed one plus what flattens the longest waves.

        `heights` are of zero mean.
        """
        load, opened = (0 if a is None else jnp.max(jnp.abs(a)) for a in (pressure, gap))
        unit = (root_mean_square(heights) + opened) / self.long_wave + load
        return jnp.where(unit > 0, unit, 1)

    def to_mean(self, pressure, mean, bounds):
        """Scales a pressure to a mean within its bounds; without an upper one by a factor.

        Points without a pressure get none.
        """
        low, high = bounds
        room = (pressure - low) * (1 - (pressure - low) / (high - low)) * (pressure != 0)
        total, free = self.mean(pressure), self.mean(room)
        # If all points are at a bound, those above the lower bound exceed theirs, or all points do.
        above = jnp.where(total > low, pressure - low, 1)
        room = jnp.where(free > 0, room, above)
        return pressure + room * ((mean - total) / nonzero(self.mean(room)))

    # The fields of a contact.

    def cell(self, grid: Grid) -> Grid:
        """Returns the cell of the kernel; `grid` belongs to the surface."""
        return grid

    def on_cell(self, field: Shaped[Array, "..."], mode: str = "constant") -> Shaped[Array, "..."]:
        """Returns a field of the surface on the cell; `mode` as in `numpy.pad`."""
        return field

    def on_surface(self, field: Shaped[Array, "..."]) -> Shaped[Array, "..."]:
        """Returns the part of a field on the cell that lies on the surface."""
        return field

    def at_each_time(self, formula: Callable[..., Array], *fields: Array) -> Array:
        """Returns the formula of fields over space, at each time if they have times."""
        return formula(*fields)

    def at_edges(self, load: Float[Array, "..."]) -> Inexact[Array, "frequencies *half"]:
        """Returns M over space at the frequencies that edges of contact may have.

        See `edge_stiffness`; `load` is the mean pressure at each time.
        """
        return self.kernel[None]

    def traction(self, pressure: Field, profile: Field, q) -> Float[Array, "..."]:
        """Returns -⟨σ ∂f/∂x⟩ [Pa] at each time; `q` is each wave's number along x [rad/m]."""
        return self.at_each_time(lambda p, f: jnp.sum(work_of_waves(p, f, q)), pressure, profile)

    def dissipation(self, pressure: Field, omega: Float[Array, "..."]) -> Float[Array, "*half"]:
        """Returns the power lost per area [W/m²] in each wave and its conjugate.

        `omega` is the frequency of each wave [rad/s].
        """
        amplitude = self.to_waves(pressure) / pressure.size
        power = (amplitude.real**2 + amplitude.imag**2) * -omega * jnp.imag(self.compliance)
        return power * multiplicity(pressure.shape)


def work_of_waves(pressure: Field, profile: Field, q: Float[Array, "..."]) -> Float[Array, "*half"]:
    """Returns the part of -⟨σ ∂f/∂x⟩ [Pa] of each wave and its conjugate, `q` along x [rad/m]."""
    # The real part of -conj(σ) i q f.
    found = q * (jnp.conj(to_spectrum(pressure)) * to_spectrum(profile)).imag
    return found * multiplicity(pressure.shape) / pressure.size**2


class Steady(AbstractOperator):
    """Steady sliding: waves in the frame of the surface; see `stack_kernel` for the kernel."""

    kernel: Waves


class Solid(eqx.Module):
    """The solid with the penalty ρ of a solver: ρM, and (I + ρM)⁻¹ from z = σ + ρu to σ.

    **Fields:**

    - `operator`: M.
    - `penalty`: ρ.
    - `free_mean`: whether (I + ρM)⁻¹ keeps the mean; else it removes the mean. Static.
    """

    operator: AbstractOperator
    penalty: Scalar
    free_mean: bool = eqx.field(static=True)

    @property
    def scaled(self) -> AbstractOperator:
        """ρM."""
        return self.operator.scaled(self.penalty)

    @property
    def stiffness(self) -> Float[Array, "*half"]:
        """1/ρ Re M, 0 for the mean."""
        mean, real = self.operator.is_mean, jnp.real(self.scaled.compliance)
        return jnp.where(mean, 0, 1 / jnp.where(mean, 1, real))

    def resolve(self, z: Field) -> Field:
        """Returns (I + ρM)⁻¹ z."""
        return self.operator.filtered(self.filter, z)

    @property
    def filter(self) -> Waves:
        """(I + ρM)⁻¹ of each wave."""
        kernel = self.scaled.compliance
        filter = 1 / (1 + kernel)
        if jnp.iscomplexobj(kernel):  # XLA's own division of complex numbers guards each of them
            real, imag = 1 + kernel.real, kernel.imag
            scale = 1 / (real**2 + imag**2)
            filter = jax.lax.complex(real * scale, -imag * scale)
        return jnp.where(self.operator.is_mean, 1 if self.free_mean else 0, filter)


def first_mode(shape: tuple[int, ...]) -> Bool[Array, "*half"]:
    """Returns where a half spectrum of this shape has its mean, as a mask.

    A mask sets that entry in the same pass over memory; an index would need another one.
    """
    first, *others = positions(shape)
    return sum(others, first) == 0


def positions(shape: tuple[int, ...]) -> list[Int[Array, "*shape"]]:
    """Returns the index of each entry along each axis, which XLA does not store."""
    return [jax.lax.broadcasted_iota(jnp.int32, shape, axis) for axis in range(len(shape))]


def long_wave_of(kernel: Waves) -> Scalar:
    """Returns |M| of the long waves: at three times the lowest wavenumber along the longer period.

    The kernel tells which period is longer: that along y, if three periods along y hardly stiffen a
    wave of one period along x. In a square along x, where losses stiffen a block that slides.
    """
    size = jnp.abs(kernel)
    if len(kernel) == 1 or kernel.ndim == 1:
        return size.ravel()[3]
    y_is_longer = size[1, 3] > size[1, 0] / 2
    return jnp.where(y_is_longer, size[0, 3], size[3, 0])


def stiffness_bound(operator: AbstractOperator, gap: Field, s: Field) -> Float[Array, "..."]:
    """Returns an upper bound of dp/dū, the change of the mean pressure with the mean gap.

    The stiffness is the least energy of all fields χ of mean 1: ⟨χ M⁻¹ χ⟩ in the solid, and
    s/(1 - s) χ² in a law of slope s. Two fields are tried, the gap and a constant. At a hard wall
    the bound is infinite in full contact. In space and time there is one stiffness for each time.

    **Arguments:**

    - `operator`: ρM.
    - `gap`: of the law, in units of pressure over ρ.
    - `s`: slope of the law's proximal map there.
    """
    mean = operator.mean(jnp.abs(gap))
    field = jnp.abs(gap) / nonzero(mean)
    springs = jnp.where(s < 1, s / jnp.where(s < 1, 1 - s, 1), jnp.inf)
    bent = operator.bending_energy(field)
    bent = jnp.maximum(jnp.abs(bent), jnp.mean(bent))
    bent = bent + operator.mean(jnp.where(s < 1, springs, 0) * field**2)
    return jnp.minimum(jnp.where(mean > 0, bent, jnp.inf), operator.mean(springs))


def nonzero(number: Array) -> Array:
    """Returns a number to divide by: 1 in place of 0."""
    return jnp.where(number != 0, number, 1)


def root_mean_square(field: Float[Array, "..."]) -> Scalar:
    """Returns √⟨f²⟩."""
    return jnp.sqrt(jnp.mean(field**2))
