"""Graded layers by the differential equation of the compliance, integrated by diffrax.

With κ = ν/(1 - ν), c in units of 2/(E_ref q), ζ = q z upwards, R = 2 E_r/E_ref and

    B1 = E_ref (1 + ν)/E,   B2 = E_ref (1 + ν)(1 - 2ν)/(2 E (1 - ν)),

    c11' = B1 - 2 c12 - R c11²         c12' = κ c11 - c22 - R c11 c12
    c22' = B2 + 2 κ c12 - R c12²       (det c)' = B1 c22 + B2 c11 - R c11 det c
    c_T' = B1 - c_T²/B1

(no derivative of a modulus appears; ν may vary). For waves whose c is large at the start, such as
on a free base or a smooth interface, the inverse of c is integrated. Upwards the effect of the
start decays as e^-2ζ. The integration starts where the wave has decayed
(`column.visible`), so the equation is not stiff.
"""

from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array

from ..blocks.profile import moduli_at
from ..blocks.shapes import breaks_of
from ..blocks.tolerance import AbstractGradedSolver, as_tolerance, rounding
from ..core.derivative import still
from .column import Face, face_in
from .layering import add_layered, build_mesh
from .slab import Compliance, in_units
from .upwards import Below

_MAX_STEPS = 4096


class Numbers(NamedTuple):
    """The numbers that are integrated: a symmetric matrix with its determinant, and antiplane."""

    plane: Compliance
    antiplane: Any = None


class Riccati(AbstractGradedSolver):
    """The differential equation of the compliance, integrated by diffrax.

    The tolerance of a step is `rtol`/30; a second integration with a tolerance ten times larger
    estimates the error. At an equal error it is slower than `Layering`. The two methods share only
    a rough solution for the sizes. Fields at a depth are by `Layering` for any solver.

    **Fields:**

    - `solver`: a diffrax solver; by default `Dopri8()`.
    - `rtol`: relative tolerance; by default 1e-9, in float32 1e-4. Static.
    """

    solver: Any = None
    rtol: float | None = eqx.field(static=True, default=None, converter=as_tolerance)

    def solve(self, climb, measure, stack, q, omega, rtol):
        # The solver has a tolerance for a step; errors of steps add up.
        step = rtol / 30
        values = climb(partial(self._add, step=step))
        # Without the derivatives of an integration that has none.
        fixed = lambda part, face, rule: self._add(*still((part, face)), rule, 10 * step)  # noqa: E731
        rough = jax.lax.stop_gradient(climb(fixed))
        differences = [a - b for a, b in zip(values, rough, strict=True)]
        error = jax.lax.stop_gradient(measure(differences, values))
        # The step is added because both may happen to take the same steps.
        return values, error + rounding(q) + step

    def _add(self, part, face, rule, step):
        """The other face of a graded layer."""
        import diffrax  # costs a quarter of a second that other scenes need not pay

        x = part.x
        mesh = build_mesh(part.profile, x, part.omega, num_cells=4)
        rough, _ = add_layered(part, face, mesh, rule)
        rough = jax.lax.stop_gradient(jax.tree.map(lambda leaf: leaf[-1], rough))
        reduced, e = part.moduli(jnp.ones_like(x))
        reference = jax.lax.stop_gradient(jnp.abs(reduced))
        # A wave takes what is not large at its start.
        softer = face.state.c.det * (reference / face.reduced) ** 2
        inverse = jnp.where(jnp.abs(softer) > jnp.abs(face.state.n), 1.0, 0.0).astype(x.dtype)
        scale = _numbers(rough, reference, inverse)
        entry = _numbers(rule.half_space(*part.moduli(1 - part.seen)), reference, inverse)
        start = _numbers(face, reference, inverse)
        start = jax.tree.map(lambda a, b: jnp.where(part.seen < 1, a, b), entry, start)
        sizes, stiffness = _sizes(scale), reference * part.unit
        waves = x, part.omega, part.seen, stiffness, start, sizes, inverse
        shape = jnp.broadcast_shapes(*(leaf.shape for leaf in jax.tree.leaves((waves, e))))
        waves = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, shape).ravel(), waves)

        def solve(adjoint, given):
            profile, waves = given
            return jax.vmap(lambda wave: self._solve_one(profile, wave, step, adjoint))(waves)

        # By `DirectAdjoint`, which has both modes, gradients are off by 2e-6.
        forward = partial(solve, diffrax.ForwardMode())
        backward = partial(solve, diffrax.RecursiveCheckpointAdjoint())
        top = _in_both_modes(forward, backward, (part.profile, waves))
        top = jax.tree.map(lambda leaf: leaf.reshape(shape), top)
        reference, inverse = (jnp.broadcast_to(part, shape) for part in (reference, inverse))
        return _face_of(top, reference, inverse, e)

    def _solve_one(self, profile, wave, step, adjoint):
        """The numbers of one wave at the end; NaN where the steps did not suffice.

        A wave has x = q d, ω, the fraction of the layer that is seen, E_ref [Pa], the numbers at
        the start and their sizes, and 1 if they are inverse.
        """
        import diffrax

        x, omega, seen, reference, start, size, inverse = wave
        leaves, treedef = jax.tree.flatten(start)
        size, is_complex = jnp.stack(jax.tree.leaves(size)), any(map(jnp.iscomplexobj, leaves))

        def split(numbers):
            y = jnp.stack(jax.tree.leaves(numbers)) / size
            return jnp.stack([y.real, y.imag]) if is_complex else y.real

        def join(y):
            y = (jax.lax.complex(y[0], y[1]) if is_complex else y) * size
            return jax.tree.unflatten(treedef, list(y))

        def slope(place, y, _):
            s = 1 - seen * (1 - place)
            found = _rates(join(y), *moduli_at(profile, s, omega), reference, inverse)
            return split(found) * (x * seen)

        controller = diffrax.PIDController(rtol=step, atol=1e-4 * step)
        breaks = breaks_of(profile)
        # A step across a kink would lose the order of the method.
        if len(breaks):
            places = jax.lax.stop_gradient(1 - (1 - breaks) / seen)
            controller = diffrax.ClipStepSizeController(controller, jump_ts=places)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(slope),  # pyright: ignore[reportArgumentType]
            self.solver or diffrax.Dopri8(),
            t0=0.0,
            t1=1.0,
            dt0=None,
            y0=split(start),
            stepsize_controller=controller,
            adjoint=adjoint,
            max_steps=_MAX_STEPS,
            throw=False,
        )
        assert solution.ys is not None
        ended = solution.result == diffrax.RESULTS.successful
        return join(jnp.where(ended, solution.ys[-1], jnp.nan))


def _numbers(face: Face, reference: Array, inverse: Array) -> Numbers:
    """The numbers of a face in units of E_ref, of its inverse compliance where `inverse`."""
    n, (c11, c12, c22, det), n_t, c_t = face.state
    stiff, stiff_t = reference / face.reduced, reference / face.shear
    either = partial(jnp.where, inverse > 0)
    n, c = either(det, n), (either(c22, c11), either(-c12, c12), either(c11, c22), either(n, det))
    plane = in_units(Compliance(*(part / n for part in c)), either(1 / stiff, stiff))
    if n_t is None:
        return Numbers(plane)
    return Numbers(plane, either(c_t, n_t) ** -1 * either(n_t / stiff_t, c_t * stiff_t))


def _face_of(numbers: Numbers, reference: Array, inverse: Array, e: Array) -> Face:
    """The face of such numbers, in units of a material of E_ref."""
    (c11, c12, c22, det), antiplane = numbers
    one, shear = jnp.ones_like(det), (1 + e) / 2  # 2 μ over E_r
    either = partial(jnp.where, inverse > 0)
    n = either(det, one)
    c = Compliance(either(c22, c11), either(-c12, c12), either(c11, c22), either(one, det))
    if antiplane is None:
        return face_in(Below(n, c), reference, e)
    n_t, c_t = either(antiplane / shear, one), either(one, antiplane * shear)
    return face_in(Below(n, c, n_t, c_t), reference, e)


def _rates(numbers, modulus, poisson, reference, inverse):
    """Returns the rates of change per unit of ζ, of the compliance or its inverse."""
    (c11, c12, c22, det), antiplane = numbers
    kappa, b1 = poisson / (1 - poisson), reference * (1 + poisson) / modulus
    b2 = b1 * (1 - 2 * poisson) / (2 * (1 - poisson))
    r = 2 * modulus / (reference * (1 - poisson**2))
    stiffness = (
        r - 2 * kappa * c12 - b1 * c11 * c11 - b2 * c12 * c12,
        c11 - kappa * c22 - b1 * c11 * c12 - b2 * c12 * c22,
        2 * c12 - b1 * c12 * c12 - b2 * c22 * c22,
        r * c22 - (b1 * c11 + b2 * c22) * det,
    )
    compliance = (
        b1 - 2 * c12 - r * c11 * c11,
        kappa * c11 - c22 - r * c11 * c12,
        b2 + 2 * kappa * c12 - r * c12 * c12,
        b1 * c22 + b2 * c11 - r * c11 * det,
    )
    either = partial(jnp.where, inverse > 0)
    if antiplane is not None:
        soft = either(1 / b1, b1)
        antiplane = soft - antiplane * antiplane / soft
    return Numbers(Compliance(*map(either, stiffness, compliance)), antiplane)


def _in_both_modes(forward, backward, given):
    """Returns `backward(given)`, with derivatives by either in the mode that it has.

    The map of tangents is linear; JAX transposes it as the solution of a linear
    system: (b, 0) -> (0, L b), transposed (0, c) -> (Lᵀ c, 0).
    """
    given, rest = eqx.partition(given, eqx.is_inexact_array)

    @jax.custom_jvp
    def value(given):
        return backward(eqx.combine(given, rest))

    @value.defjvp
    def _(primals, tangents):
        (given,), (change,) = primals, tangents
        found = value(given)
        none = jax.tree.map(jnp.zeros_like, (given, found))
        # In one array: JAX wants all of it to depend on what is differentiated.
        flat, unravel = ravel_pytree((change, none[1]))

        def tangent(_, flat):
            run = lambda given: forward(eqx.combine(given, rest))  # noqa: E731
            return ravel_pytree((none[0], jax.jvp(run, (given,), unravel(flat)[:1])[1]))[0]

        def cotangent(_, flat):
            run = lambda given: backward(eqx.combine(given, rest))  # noqa: E731
            return ravel_pytree((*jax.vjp(run, given)[1](unravel(flat)[1]), none[1]))[0]

        solved = jax.lax.custom_linear_solve(lambda x: x, flat, tangent, cotangent)
        return found, unravel(solved)[1]

    return value(given)


def _sizes(rough):
    """The scales of tolerances: sizes of a rough result, never 0."""

    def plane(c):
        mean = jnp.sqrt(jnp.abs(c.c11)) * jnp.sqrt(jnp.abs(c.c22))
        return Compliance(*map(jnp.abs, c))._replace(c12=jnp.abs(c.c12) + 1e-6 * mean)

    size = Numbers(plane(rough.plane), *jax.tree.map(jnp.abs, rough[1:]))
    size = jax.tree.map(lambda z: jnp.where(z > 0, z, 1), size)
    return jax.lax.stop_gradient(size)
