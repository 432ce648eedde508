"""The iteration on one grid that finds contacts and their derivatives.

Douglas-Rachford splitting, with Anderson's acceleration. One real field z = σ + ρ u carries
pressure σ and gap u at once. One step costs one FFT pair:

    x  = (I + ρM)⁻¹ (z + ρh)      in Fourier space; the mean of x is set to the load,
                                  or that of the gap (z - x)/ρ to the wanted gap
    y  = proximal map of the law at v = 2x - z
    z⁺ = z + 2α (y - x)

x obeys the solid and what is prescribed, y obeys the law of contact, and at the fixed point they
agree; until then their gaps differ by (y - x)/ρ, so that one residual measures pressure, load and
gap. The step is a contraction for every kernel with Re M > 0, symmetric or not, and every law
whose pressure falls with the gap: this is what sliding viscoelastic solids need and conjugate
gradients cannot give.

P. L. Lions & B. Mercier, SIAM J. Numer. Anal. 16 (1979) 964, doi:10.1137/0716071.

Lengths are in units of that of pressure over ρ. Large grids find their first digits in single
precision, a draft, which moves half as many bytes, and on them nothing is stored that follows from
the kernel mode by mode.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..fields.grid import multiplicity, to_field, to_spectrum
from .anderson import History, accelerate, sums
from .solver import contact_stiffness, first_mode, in_precision, participation_of

DRAFTED_FROM = 2**18  # points of a grid worth a draft, by `bench_contact.py overhead`
CYCLE = 2  # steps between accelerations


class Solid(eqx.Module):
    """The map z -> (I + ρM)⁻¹z, of the mean to nothing or to itself.

    **Fields:**

    - `kernel`: M on the half spectrum, of any mean.
    - `penalty`: ρ.
    - `free_mean`: whether the mean stays. Static.
    """

    kernel: Inexact[Array, "*half"]
    penalty: Float[Array, ""]
    free_mean: bool = eqx.field(static=True)

    def __call__(self, z):
        return self.under(to_spectrum(z), z.shape)

    def under(self, spectrum, shape):
        """The map of the z of a spectrum."""
        kernel = self.compliance
        filter = 1 / (1 + kernel)
        if jnp.iscomplexobj(kernel):  # XLA's own division of complex numbers guards each of them
            real, imag = 1 + kernel.real, kernel.imag
            scale = 1 / (real**2 + imag**2)
            filter = jax.lax.complex(real * scale, -imag * scale)
        filter = jnp.where(first_mode(kernel.shape), 1 if self.free_mean else 0, filter)
        return to_field(filter * spectrum, shape)

    @property
    def compliance(self) -> Inexact[Array, "*half"]:
        """ρM, 0 for the mean."""
        return jnp.where(first_mode(self.kernel.shape), 0, self.penalty * self.kernel)

    @property
    def stiffness(self) -> Float[Array, "*half"]:
        """1/ρ Re M, 0 for the mean."""
        mean, real = first_mode(self.kernel.shape), jnp.real(self.compliance)
        return jnp.where(mean, 0, 1 / jnp.where(mean, 1, real))


class Splitting(eqx.Module):
    """What is iterated: the solid against the law.

    **Fields:**

    - `solid`: the map of z.
    - `shift`: what is added to it: that of ρh, and the mean of x, or if that is free of x - z.
    - `proximal`: that of the law, a pytree.
    - `share`: of points under load [1], or None for the participation of the pressure as it is.
    """

    solid: Solid
    shift: Float[Array, "..."]
    proximal: Callable
    share: Float[Array, ""] | None = None


def iterate(
    splitting: Splitting,
    z: Float[Array, "*shape"],
    *,
    rtol: Float[Array, ""],
    relaxation: float,
    memory: int,
    max_steps: Array | int,
    draft: bool = False,
    watch: Callable | None = None,
) -> History:
    """Returns the last state: z, the estimated relative error, whether it was `going_on`.

    It ends where rounding hides the residual; a `draft` when rounding alone would cause the error.
    `watch` is called with the number of each cycle and its y.
    """
    eps = jnp.finfo(z.dtype).eps
    sharpness = jnp.sqrt(jnp.sum(weight_of_modes(z) * splitting.solid.stiffness**2))
    rounding = 4 * eps * jnp.stack([jnp.ones_like(sharpness), sharpness])

    def step(splitting, z):
        spectrum = to_spectrum(z)
        x = splitting.shift + splitting.solid.under(spectrum, z.shape)
        y = splitting.proximal(2 * x - z)
        return z + (2 * relaxation) * (y - x), spectrum, x, y

    def cycle(z, cycles):
        between, before, *_ = step(_afresh(splitting, cycles), z)
        image, after, x, y = step(_afresh(splitting, cycles + 1), between)
        stiffness = _afresh(splitting, cycles + 2).solid.stiffness
        # The spectrum of y - x comes for nothing: steps move z by 2α (y - x).
        defect, stiff = powers((after - before) / (2 * relaxation), stiffness, z)
        size, scale, total, squared = sums(x * x, z * z, jnp.abs(y), y * y)
        unit = jnp.where(size > 0, size, 1)
        share = splitting.share
        v = 2 * x - between
        s = jnp.abs(jax.jvp(splitting.proximal, (v,), (jnp.ones_like(v),))[1])
        if share is None:
            # Saturated points carry a load, but hold nothing.
            share = jnp.maximum(jnp.mean(s), 1 / y.size)
            share = jnp.minimum(share, participation_of(total, squared, y.size))
        error = _error(jnp.sqrt(defect / unit), jnp.sqrt(stiff / unit), share)
        if splitting.solid.free_mean:
            # With the mean gap exact, an error of the gaps is one of the mean pressure.
            rigid = contact_stiffness(splitting.solid.compliance, y - v, s)
            shift = (after - before)[(0,) * z.ndim].real / (2 * relaxation * z.size)
            by_shift = rigid * jnp.abs(shift) * jnp.sqrt(z.size / unit)
            error = jnp.where(jnp.isfinite(rigid), error + by_shift, jnp.inf)
        # Pressures below the rounding of the gaps cannot be told from zero.
        lost = defect <= (8 * eps) ** 2 * scale
        if draft:
            least, least_stiff = rounding * jnp.sqrt(scale / unit)
            lost |= error <= _error(least, least_stiff, share)
        return image, error, lost, y

    def running(state):
        return state.going_on & (state.cycles * CYCLE < max_steps)

    def body(state):
        image, error, lost, y = cycle(state.z, state.cycles)
        if watch is not None:
            watch(state.cycles, y)
        # Steps never raise the residual of a law without attraction, acceleration may: the
        # last image has at most the residual that ended the loop.
        return accelerate(state, image, error, (error > rtol) & ~lost)

    return jax.lax.while_loop(running, body, History.empty(z, memory + 1))


def draft(
    splitting: Splitting, z: Float[Array, "*shape"], *, rtol: Float[Array, ""], **settings
) -> tuple[Float[Array, "*shape"], Array]:
    """Returns z to about `rtol` or to single precision, and the number of steps.

    As it is, and none, on a grid not worth it. `settings` are those of `iterate`.
    """
    if z.size < DRAFTED_FROM or z.dtype != jnp.float64:
        return z, jnp.asarray(0)
    single, begin, rtol = in_precision((splitting, z, rtol), jnp.float32)
    last = iterate(single, begin, rtol=rtol, draft=True, **settings)
    # A start that is as good already keeps its digits.
    z = jnp.where(last.cycles > 1, last.z.astype(z.dtype), z)
    return z, last.cycles * CYCLE


def _afresh(splitting: Splitting, cycles: Array) -> Splitting:
    """The same: on a large grid not stored before the loop, but computed from what is."""
    solid = splitting.solid
    if solid.kernel.size < DRAFTED_FROM // 2:
        return splitting
    one = jnp.where(cycles >= 0, 1, 0).astype(solid.penalty.dtype)  # which compilers cannot know
    solid = Solid(solid.kernel, one * solid.penalty, solid.free_mean)
    return dataclasses.replace(splitting, solid=solid)


def check_relaxation(relaxation: float) -> None:
    """Raises `ValueError` unless this is an α between 0 and 1."""
    if not isinstance(relaxation, float) or not 0 < relaxation < 1:
        raise ValueError(f"`relaxation={relaxation}` must be a number between 0 and 1.")


def weight_of_modes(field: Float[Array, "*shape"]) -> Float[Array, "#half"]:
    """Returns what a squared mode of the half spectrum adds to a field's sum of squares."""
    return jnp.asarray(multiplicity(field.shape) / field.size, field.dtype)


def powers(spectrum, stiffness, field):
    """Sums of squares of a field of this half spectrum, and of `stiffness` times it."""
    power = (spectrum.real**2 + spectrum.imag**2) * weight_of_modes(field)
    return sums(power, power * stiffness**2)


def _error(residual, stiff, share):
    """Estimated relative error of the pressure.

    With r = y - x, `residual` is ‖r‖/‖x‖ and `stiff` ‖(Re M)⁻¹r/ρ‖/‖x‖. On the set of contact P
    the pressure y is off by (PρMP)⁻¹P r - r; (PMP)⁻¹ is at most PM⁻¹P for a symmetric kernel, and
    where losses turn it, at most what Re M alone would leave. The factor and the power of the
    loaded share s were found by measurement on elastic and
    viscoelastic, layered and homogeneous bodies from a thousandth in contact to full contact; see
    `bench_contact.py random`.
    """
    return share**-0.45 * (residual + stiff)
