"""The iteration on one grid that solves contacts and their derivatives.

Douglas-Rachford splitting, with Anderson's acceleration. One real field z = σ + ρ u holds
pressure σ and gap u at once. One step costs one FFT pair:

    x  = (I + ρM)⁻¹ (z + ρh)      in Fourier space; the mean of x is set to the load,
                                  or of the gap (z - x)/ρ to the prescribed gap
    y  = proximal map of the law at v = 2x - z
    z⁺ = z + 2α (y - x)

x obeys the solid and what is prescribed, y obeys the law of contact, and at the fixed point both
are equal. Before that their gaps differ by (y - x)/ρ, so that one residual measures pressure, load
and gap. The step is a contraction for every kernel with Re M > 0, symmetric or not, and every law
whose pressure falls with the gap. Sliding viscoelastic solids need this, and conjugate gradients
do not have it.

P. L. Lions & B. Mercier, SIAM J. Numer. Anal. 16 (1979) 964, doi:10.1137/0716071.

The unit of length is the unit of pressure over ρ. On large grids a draft in single precision, which
moves half as many bytes, computes the first digits. There the filter is computed from the kernel at
each step and not stored.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ...core.anderson import STEPS_OF_CYCLE, Iterates, accelerate, sums
from ...core.checks import in_precision
from ...fields.grid import Waves, multiplicity
from ..operators.operator import Field, Scalar, Solid, root_mean_square, stiffness_bound
from .abstract_solver import participation_of, run_steps, slope

# Earlier iterates that the acceleration combines, each of two fields. At a given mean gap few: near
# full contact the load drifts, and with 5 some loads diverged above an area of 0.99.
_HISTORY, _HISTORY_AT_GAP = 5, 2
RELAXATION = 0.95  # α
DRAFTED_FROM = 2**18  # points of a grid worth a draft, as measured


class Moved(NamedTuple):
    """One step: z⁺, the waves of z, and the pressures x of the solid and y of the law."""

    z: Field
    waves: Waves
    x: Field
    y: Field


class Splitting(eqx.Module):
    """The iteration of the solid against the law: `init`, `step` and `done`, for `run_steps`.

    **Fields:**

    - `solid`: gives x.
    - `shift`: part of x from heights and prescribed mean; if the mean is free, of x - z.
    - `proximal`: map of the law, a pytree.
    - `rtol`: relative error of the pressure at which the iteration ends.
    - `share`: of points under load [1], or None for the participation of the current pressure.
    - `least`: residuals that rounding alone causes, at which a draft ends; else None.
    - `relaxation`: α. Static.
    """

    solid: Solid
    shift: Float[Array, "..."]
    proximal: Callable
    rtol: Scalar
    share: Scalar | None = None
    least: Float[Array, "2"] | None = None
    relaxation: float = eqx.field(default=RELAXATION, static=True)

    def init(self, start: Field) -> Iterates:
        """Returns the state of a z."""
        earlier = _HISTORY_AT_GAP if self.solid.free_mean else _HISTORY
        return Iterates.empty(start, earlier + 1)

    def done(self, state: Iterates) -> Bool[Array, ""]:
        """Returns whether the error is below `rtol`, or rounding hides the residual."""
        return ~state.running

    def step(self, state: Iterates) -> Iterates:
        """Returns the state after two steps of z and an acceleration."""
        z, cycles = state.z, state.cycles
        filter = self._recomputed(cycles).filter
        first = self._moved(z, filter)
        if self._is_large:
            filter = self._recomputed(cycles + 1).filter
        last = self._moved(first.z, filter)
        stiffness = self._recomputed(cycles + 2).stiffness
        error, lost = self.pressure_error(z, first, last, stiffness)
        # Steps never raise the residual of a law without attraction, acceleration may: the
        # last image has at most the residual that ended the loop.
        return accelerate(state, last.z, error, (error > self.rtol) & ~lost)

    def pressure_error(
        self, z: Field, first: "Moved", last: "Moved", stiffness: Waves
    ) -> tuple[Scalar, Bool[Array, ""]]:
        """Returns the estimated relative error of the pressure x, and whether rounding hides it.

        The iteration stops where the error is at most `rtol`, or hidden. `first` and `last` are two
        steps from z; each wave has its `stiffness`.
        """
        between, (image, after, x, y) = first.z, last
        # The spectrum of y - x comes for nothing: steps move z by 2α (y - x).
        moved = (after - first.waves) / (2 * self.relaxation)
        power = (moved.real**2 + moved.imag**2) * _weight_of_modes(z)
        defect, stiff = sums(power, power * stiffness**2)
        v = 2 * x - between
        s = jnp.abs(slope(self.proximal, v))
        size, scale, total, squared, fixed = sums(x * x, z * z, jnp.abs(y), y * y, s)
        unit = jnp.where(size > 0, size, 1)
        share = self.share
        if share is None:
            # Saturated points carry a load, but do not fix the gap.
            share = jnp.maximum(fixed / y.size, 1 / y.size)
            share = jnp.minimum(share, participation_of(total, squared, y.size))
        error = _error(jnp.sqrt(defect / unit), jnp.sqrt(stiff / unit), share)
        if self.solid.free_mean:
            # With the mean gap exact, an error of the gaps is one of the mean pressure.
            rigid = stiffness_bound(self.solid.scaled, y - v, s)
            shift = self.solid.operator.mean(image - between) / (2 * self.relaxation)
            error = error + root_mean_square(rigid * shift) * jnp.sqrt(z.size / unit)
            error = jnp.where(jnp.isnan(error), jnp.inf, error)
        # Pressures below the rounding of the gaps cannot be distinguished from zero.
        lost = defect <= (8 * jnp.finfo(z.dtype).eps) ** 2 * scale
        if self.least is not None:
            least, least_stiff = self.least * jnp.sqrt(scale / unit)
            lost |= error <= _error(least, least_stiff, share)
        return error, lost

    def _moved(self, z: Field, filter: Waves) -> "Moved":
        waves = self.solid.operator.to_waves(z)
        x = self.shift + self.solid.operator.to_field(filter * waves, z.shape)
        y = self.proximal(2 * x - z)
        return Moved(z + (2 * self.relaxation) * (y - x), waves, x, y)

    @property
    def _is_large(self) -> bool:
        return self.solid.operator.kernel.size >= DRAFTED_FROM // 2

    def _recomputed(self, cycles: Array) -> Solid:
        """The solid. On a large grid its filter is computed in every step."""
        solid = self.solid
        if not self._is_large:
            return solid
        # A factor that compilers do not know keeps them from storing it before the loop.
        one = jnp.where(cycles >= 0, 1, 0).astype(solid.penalty.dtype)
        return Solid(solid.operator, one * solid.penalty, solid.free_mean)


def draft(splitting: Splitting, z: Field, *, max_steps: Array | int) -> tuple[Field, Array]:
    """Returns z to about `rtol` or to single precision, and the number of steps.

    Unchanged, and none, on a grid not worth it.
    """
    if z.size < DRAFTED_FROM or z.dtype != jnp.float64:
        return z, jnp.asarray(0)
    single, begin = in_precision((splitting, z), jnp.float32)
    sharpness = jnp.sqrt(jnp.sum(_weight_of_modes(begin) * single.solid.stiffness**2))
    rounding = 4 * jnp.finfo(begin.dtype).eps * jnp.stack([jnp.ones_like(sharpness), sharpness])
    last = run_steps(dataclasses.replace(single, least=rounding), begin, max_steps)
    # A start that is as good already keeps its digits.
    return jnp.where(last.cycles > 1, last.z.astype(z.dtype), z), last.cycles * STEPS_OF_CYCLE


def _weight_of_modes(field: Field) -> Float[Array, "#half"]:
    """The weight of each squared mode of the half spectrum in a field's sum of squares."""
    return jnp.asarray(multiplicity(field.shape) / field.size, field.dtype)


def _error(residual, stiff, share):
    """Estimated relative error of the pressure.

    With r = y - x, `residual` is ‖r‖/‖x‖ and `stiff` ‖(Re M)⁻¹r/ρ‖/‖x‖. On the set of contact P
    the pressure y is off by (PρMP)⁻¹P r - r; (PMP)⁻¹ is at most PM⁻¹P for a symmetric kernel, and
    where losses turn it, at most what Re M alone would leave. The factor and the power of the
    loaded share s were found by measurement on elastic and viscoelastic, layered and homogeneous
    bodies from a thousandth in contact to full contact; see `bench_contact.py random`.
    """
    return share**-0.45 * (residual + stiff)
