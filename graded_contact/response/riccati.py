"""A graded layer by the differential equation of its compliance, integrated upwards.

With κ = ν/(1 - ν), c in units of 2/(E_ref q), ζ = q z upwards, R = 2 E_r/E_ref and

    B1 = E_ref (1 + ν)/E,   B2 = E_ref (1 + ν)(1 - 2ν)/(2 E (1 - ν)),

    c11' = B1 - 2 c12 - R c11²         c12' = κ c11 - c22 - R c11 c12
    c22' = B2 + 2 κ c12 - R c12²       (det c)' = B1 c22 + B2 c11 - R c11 det c

(no derivative of a modulus appears; ν may vary). On a free base c is infinite, and its inverse
is integrated. Upwards the equation forgets its start as e^-2ζ; downwards it would blow up. Started
where the wave ends (`mesh.WINDOW`), it is not stiff.

This is the independent check of `grading.Layering`, at four to seven times its cost.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from .mesh import WINDOW, visible
from .profile import moduli_at
from .shape import breaks_of
from .slab import Compliance, half_space

_MAX_STEPS = 4096


def integrate(
    profile: Any,
    x: Float[Array, " n"],
    omega: Float[Array, " n"],
    below: Compliance,
    reference: Float[Array, " n"],
    scale: Compliance,
    *,
    inverse: bool,
    rtol: float,
    solver: Any = None,
    forward: bool = False,
) -> Compliance:
    """Returns the compliance of the upper face of a graded layer, in units of 2/(E_ref q).

    **Arguments:**

    - `profile`, `x`, `omega`: of the layer, x = q d [1], and ω [rad/s], shape `(n,)`.
    - `below`: compliance of what it lies on in the same units; its inverse, with the inverse
      determinant, if `inverse`. Zero for a rigid base, and for a free one if `inverse`.
    - `reference`: E_ref [Pa], shape `(n,)`.
    - `scale`: a rough result, from which absolute tolerances are taken.
    - `rtol`: tolerance of a step. `solver`: a diffrax solver; by default Dopri8.
    - `forward`: whether it can be differentiated in forward mode rather than in reverse.

    **Returns:** the compliance; NaN where the steps did not suffice.
    """
    import diffrax  # costs a quarter of a second that other scenes need not pay

    solver = diffrax.Dopri8() if solver is None else solver
    # `DirectAdjoint` has both modes, but in reverse it was off by 2e-4 on a batch of eight.
    adjoint = diffrax.ForwardMode() if forward else diffrax.RecursiveCheckpointAdjoint()
    is_complex = any(jnp.iscomplexobj(part) for part in jax.tree.leaves((below, scale)))

    def split(y):
        return jnp.stack([y.real, y.imag]) if is_complex else y

    def join(y):
        return jax.lax.complex(y[0], y[1]) if is_complex else y

    def solve(x, omega, below, reference, scale):
        seen = visible(jax.lax.stop_gradient(x))
        rough = jax.lax.stop_gradient(invert(scale) if inverse else scale)
        size = jnp.stack([jnp.abs(part) for part in rough])

        def slope(height, y, _):
            c = join(y) * size
            modulus, poisson = moduli_at(profile, 1 - seen * (1 - height), omega)
            rates = _rates_inverse if inverse else _rates
            values = jnp.stack(rates(*c, *_coefficients(modulus, poisson, reference)))
            if not is_complex:
                values = values.real
            return split(values * (x * seen) / size)

        modulus, poisson = moduli_at(profile, 1 - seen, omega)
        local = half_space(1 - 2 * poisson)
        ratio = reference * (1 - poisson**2) / modulus
        local = Compliance(
            ratio * local.c11, ratio * local.c12, ratio * local.c22, ratio**2 * local.det
        )
        local = invert(local) if inverse else local
        start = jnp.stack([jnp.where(x > WINDOW, a, b) for a, b in zip(local, below, strict=True)])
        controller = diffrax.PIDController(rtol=rtol, atol=1e-4 * rtol)
        breaks = breaks_of(profile)
        if len(breaks):
            heights = jax.lax.stop_gradient(1 - (1 - breaks) / seen)
            controller = diffrax.ClipStepSizeController(controller, jump_ts=heights)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(slope),  # pyright: ignore[reportArgumentType]
            solver,
            t0=0.0,
            t1=1.0,
            dt0=None,
            y0=split(start / size),
            stepsize_controller=controller,
            adjoint=adjoint,
            max_steps=_MAX_STEPS,
            throw=False,
        )
        assert solution.ys is not None
        ended = solution.result == diffrax.RESULTS.successful
        top = Compliance(*(join(jnp.where(ended, solution.ys[-1], jnp.nan)) * size))
        return invert(top) if inverse else top

    return jax.vmap(solve)(x, omega, below, reference, scale)


def invert(c: Compliance) -> Compliance:
    """Returns the inverse of a symmetric 2×2 matrix that carries its determinant."""
    return Compliance(c.c22 / c.det, -c.c12 / c.det, c.c11 / c.det, 1 / c.det)


def _coefficients(modulus, poisson, reference) -> tuple[Inexact[Array, ""], ...]:
    soft = reference * (1 + poisson) / modulus
    kappa = poisson / (1 - poisson)
    stiff = 2 * modulus / (reference * (1 - poisson**2))
    return kappa, soft, soft * (1 - 2 * poisson) / (2 * (1 - poisson)), stiff


def _rates(c11, c12, c22, det, kappa, b1, b2, r):
    return (
        b1 - 2 * c12 - r * c11 * c11,
        kappa * c11 - c22 - r * c11 * c12,
        b2 + 2 * kappa * c12 - r * c12 * c12,
        b1 * c22 + b2 * c11 - r * c11 * det,
    )


def _rates_inverse(z11, z12, z22, det, kappa, b1, b2, r):
    return (
        r - 2 * kappa * z12 - b1 * z11 * z11 - b2 * z12 * z12,
        z11 - kappa * z22 - b1 * z11 * z12 - b2 * z12 * z22,
        2 * z12 - b1 * z12 * z12 - b2 * z22 * z22,
        r * z22 - (b1 * z11 + b2 * z22) * det,
    )
