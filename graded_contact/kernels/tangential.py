"""The response of a stack to tangential traction in the direction of sliding, on a half spectrum.

A traction T along the unit vector e moves the surface by M_ze T along z and by M_ee T along e. The
pressure moves it along e by M_ez = -M_ze. With c11, c12 and c_T of `compliance` and a = q·e/|q|

    M_ze = i c12 a,      M_ee = c11 a² + c_T (1 - a²).

M_ze is odd in q: on Nyquist lines both are 0. The parts are evaluated at every wave, also for
graded layers on large grids.
"""

from functools import partial

import jax.numpy as jnp
from jaxtyping import Array, Bool

from ..blocks.stack import Stack, check_at_rest, is_graded
from ..core.compilation import compiled_loop
from ..core.derivative import derivative_apart
from ..fields.grid import Grid, Waves, nyquist_lines, wavenumber, wavevector, zero_mode
from ..response.compliance import compliance_parts
from ..response.grading import check_profiles, graded_tolerance
from .periodic import of_period, period_frequencies
from .steady import of_waves

Kernels = tuple[tuple[Waves, ...], tuple[tuple[Waves, ...], ...], Bool[Array, ""]]


def tangential_kernels(
    stack: Stack, grid: Grid, velocity: Array, direction: Array, strain=None
) -> Kernels:
    """Returns M_ze and M_ee [m/Pa] on the half spectrum of a grid, and whether they are good.

    **Arguments:**

    - `stack`, `grid`, `velocity`, `strain`: as in `stack_kernel`, checked.
    - `direction`: e, of one component (along x) or two.
    """
    rtol = graded_tolerance(stack, grid.size)
    parts = _steady_parts(stack, grid, velocity, rtol, strain)
    return *_along(parts, grid, direction), _good(stack, parts)


def periodic_tangential_kernels(
    stack: Stack, grid: Grid, num_times: int, period: Array, axes: int
) -> Kernels:
    """Returns M_zi and M_ij [m/Pa] along the first `axes`, and whether they are good.

    Arguments and shapes as in `periodic_kernel`.
    """
    rtol = graded_tolerance(stack, grid.size)
    check_at_rest(stack)
    check_profiles(stack, period_frequencies(num_times, period))
    parts = _periodic_parts(stack, grid, num_times, period, rtol)
    units = jnp.eye(axes, dtype=grid.size.dtype)
    return *_along(parts, grid, units), _good(stack, parts)


def _good(stack: Stack, parts) -> Array:
    if not is_graded(stack):
        return jnp.asarray(True)
    return jnp.all(jnp.stack([jnp.all(jnp.isfinite(part)) for part in parts]))


def _response(rtol, block, q, omega):
    (c11, c12, _, c_t), error = compliance_parts(block, q, omega, rtol, throw=False)
    shape = jnp.broadcast_shapes(q.shape, omega.shape)
    good = error <= rtol
    return [jnp.broadcast_to(jnp.where(good, part, jnp.nan), shape) for part in (c11, c12, c_t)]


@derivative_apart
@compiled_loop
def _steady_parts(stack, grid, velocity, rtol, strain):
    return of_waves(partial(_response, rtol), stack, grid, velocity, strain)


@derivative_apart
@compiled_loop
def _periodic_parts(stack, grid, num_times: int, period, rtol):
    response = partial(_response, rtol, stack)
    parts = of_period(response, grid, num_times, period)
    if num_times % 2 == 0:  # the highest frequency has no sign
        parts = [part.at[num_times // 2].set(part[num_times // 2].real) for part in parts]
    return parts


@compiled_loop
def _along(parts, grid: Grid, directions: Array):
    """M_zi and M_ij along unit vectors, the rows of an array; or along one."""
    directions, (c11, c12, c_t) = jnp.atleast_2d(directions), parts
    q = wavenumber(grid)
    unit = [component / jnp.where(q == 0, 1, q) for component in wavevector(grid)]
    parallel = [sum(e * n for e, n in zip(row, unit, strict=False)) for row in directions]
    kept = ~(nyquist_lines(grid.shape) | zero_mode(grid.shape))
    lift = tuple(jnp.where(kept, 1j * c12 * a, 0) for a in parallel)
    cosines = directions @ directions.T
    along = tuple(
        tuple(
            jnp.where(kept, (c11 - c_t) * a * b + c_t * cosines[i, j], 0)
            for j, b in enumerate(parallel)
        )
        for i, a in enumerate(parallel)
    )
    return lift, along
