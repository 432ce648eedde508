"""The solid under a periodic motion and load, as an operator in space and time.

The surface has moved by s(t). In the frame of the block the pressure is p(X - s(t), t), which
multiplies each mode by a phase. With

    U = F_t exp(-i q·s(t)) F_x

the displacement in the frame of the surface is M σ = U* K U σ, K being M_zz(|q|, ω) of the block.
U is orthogonal up to a factor, and the resolvent (I + ρM)⁻¹ costs one transform in space and time,
and its inverse. So every periodic motion and load is one contact problem, without steps in time: a
solve gives the pressure at all times at once, also if the solid creeps slowly. The mean is
prescribed at every time.

A field has the shape `(nt, nx)` or `(nt, nx, ny)`; times are equally spaced over one period.
Spectra are half along the last axis of space, and whole in time.

On Nyquist lines of space a shift of a real field is not defined. There the kernel is a real number:
the average of Re K over the frequencies of this wave under the motion. Under steady sliding
`stack_kernel` has the same rule.
"""

import math
from collections.abc import Sequence
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact

from ...fields.grid import Grid, mode_numbers, resample_spectrum, to_field, to_spectrum, wavevector
from .operator import AbstractOperator, first_mode, long_wave_of, nonzero

# The share of a wave from which on a frequency counts at the edges of contact. What a motion or a
# load excites for a moment has a small share; rounding, and what a solver leaves, a smaller one.
# With 1e-6 the areas of rough contacts that shrink are 0.5 % larger.
_EXCITED = 1e-8


class SpaceTime(AbstractOperator):
    """The solid under a surface that moves periodically.

    **Fields:**

    - `kernel`: K [m/Pa], shape `(nt, *half)`; see `in_motion`.
    - `phases`: exp(-i q s) for each axis of space, each broadcastable to the kernel.
    """

    kernel: Inexact[Array, "nt *half"]
    phases: tuple[Complex[Array, "nt ..."], ...]
    of_distance: ClassVar[bool] = False

    def to_waves(self, field):
        # From the frame of the surface, which moves, to the frame of the block.
        waves = jax.vmap(to_spectrum)(field)
        for phase in self.phases:
            waves = waves * phase
        return jnp.fft.fft(waves, axis=0)

    def to_field(self, waves, shape):
        waves = jnp.fft.ifft(waves, axis=0)
        for phase in self.phases:
            waves = waves * jnp.conj(phase)
        return jax.vmap(lambda one: to_field(one, shape[1:]))(waves)

    def carried(self, field: Float[Array, "*shape"]) -> Float[Array, "nt *shape"]:
        """Returns a field that rests on the block, in the frame of the surface at each time."""
        waves = to_spectrum(field)
        for phase in self.phases:
            waves = waves * jnp.conj(phase)
        return jax.vmap(lambda one: to_field(one, field.shape))(waves)

    def mean(self, field):
        return jnp.mean(field, axis=tuple(range(1, field.ndim)), keepdims=True)

    def coarser(self, shape, new_shape):
        # Some of the times: interpolated phases would not be of modulus 1.
        times = np.arange(new_shape[0]) * shape[0] // new_shape[0]
        numbers = mode_numbers(new_shape[1:])
        phases = tuple(
            jnp.take(phase[times], k.ravel() % n, axis + 1)
            for axis, (phase, k, n) in enumerate(zip(self.phases, numbers, shape[1:], strict=True))
        )
        kernel = resample_spectrum(self.compliance, shape, new_shape)
        return SpaceTime(_even_on_nyquist(kernel, phases, new_shape), phases)

    def bending_energy(self, field):
        return self.mean(field * self.filtered(self.inverse, field))

    def at_each_time(self, formula, *fields):
        return jax.vmap(formula)(*fields)

    def at_edges(self, load):
        # The softest and the stiffest frequency that the motion and the load excite, by |M|.
        load = load / jnp.sqrt(nonzero(jnp.mean(load**2)))
        shares = frequency_shares([*self.phases, load.reshape(-1, *[1] * (self.kernel.ndim - 1))])
        size = jnp.log(jnp.abs(jnp.where(self.is_mean, 1, self.kernel)))
        mean = jnp.sum(shares * size, axis=0)
        beyond = shares / (shares + _EXCITED) * (size - mean)
        return jnp.exp(mean + jnp.stack([jnp.max(beyond, axis=0), jnp.min(beyond, axis=0)]))

    @property
    def is_mean(self):
        return jnp.broadcast_to(first_mode(self.kernel.shape[1:]), self.kernel.shape)

    @property
    def long_wave(self):
        # The softest, of the slowest times: with the median of all it takes 2 to 4 times the pairs.
        return jnp.max(jax.vmap(long_wave_of)(self.kernel))


def in_motion(
    kernel: Inexact[Array, "nt *half"], displacement: Float[Array, "nt ndim"], grid: Grid
) -> SpaceTime:
    """Returns the operator of a block whose surface moves.

    **Arguments:**

    - `kernel`: M_zz(|q|, ω) [m/Pa] at the frequencies of the period and the wavevectors of `grid`.
    - `displacement`: s [m] of the surface over the block at each time, along each axis.
    - `grid`: of the surface.
    """
    phases = tuple(
        jnp.exp(-1j * q * displacement[:, axis].reshape(-1, *[1] * grid.ndim))
        for axis, q in enumerate(wavevector(grid))
    )
    return SpaceTime(_even_on_nyquist(kernel, phases, (len(kernel), *grid.shape)), phases)


def at_rest(kernel: Inexact[Array, "nt *half"]) -> SpaceTime:
    """Returns the operator of a solid that rests under the surface, in the frame of the surface.

    `kernel` as in `in_motion`.
    """
    return SpaceTime(_even_on_nyquist(kernel, (), kernel.shape[:1]), ())


def frequency_shares(factors: Sequence[Inexact[Array, "nt ..."]]) -> Float[Array, "nt ..."]:
    """Returns how the phases of a motion, and a load, spread each wave over the frequencies.

    The sum of the shares is the mean square of the factors, 1 for phases.
    """
    product = math.prod(factors[1:], start=factors[0])
    return jnp.abs(jnp.fft.fft(product, axis=0) / len(product)) ** 2


def _even_on_nyquist(kernel, phases, shape: tuple[int, ...]):
    """The kernel by the rules on Nyquist lines of time and space."""
    num_times = shape[0]
    if num_times % 2 == 0:
        kernel = kernel.at[num_times // 2].set(kernel[num_times // 2].real)
    for axis, n in enumerate(shape[1:]):
        if n % 2:
            continue
        line = (slice(None),) * (axis + 1) + (slice(n // 2, n // 2 + 1),)
        others = [phase for i, phase in enumerate(phases) if i != axis]
        both = (phases[axis][line], jnp.conj(phases[axis][line]))
        share = sum(frequency_shares([nyquist, *others]) for nyquist in both) / 2
        even = jnp.sum(share * kernel[line].real, axis=0, keepdims=True)
        kernel = kernel.at[line].set(even.astype(kernel.dtype))
    return kernel
