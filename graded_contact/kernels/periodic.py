"""The surface compliance of a stack over wavenumbers and the frequencies of a periodic motion.

M_zz depends on |q| and ω, and M(q, -ω) is the conjugate of M(q, ω): so it is computed on the
quadrant of positive components of q and for ω >= 0 only. That of graded and long stacks is
interpolated from a table over log |q| and log ω (`table`).
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..blocks.stack import Stack, check_at_rest
from ..core.compilation import compiled_loop
from ..core.derivative import derivative_apart
from ..fields.grid import Grid
from ..response.compliance import compliance_or_nan
from ..response.grading import check_profiles, graded_tolerance
from .steady import is_dear
from .table import log_compliance, tabulate

_BLOCK = 16  # frequencies that are computed at once


def periodic_kernel(
    stack: Stack, grid: Grid, num_times: int, period: Array
) -> tuple[Inexact[Array, "nt *half"], Float[Array, ""]]:
    """Returns M_zz [m/Pa] at all frequencies of a period and wavevectors of a grid, and its error.

    The error is relative, an estimate; 0 where nothing is interpolated, NaN or above the tolerance
    of the stack where a graded layer missed it.

    **Arguments:**

    - `stack`: the block.
    - `grid`: the periodic cell.
    - `num_times`: number of equally spaced times in a period.
    - `period`: T [s], positive.

    **Returns:** the kernel, frequencies in the order of an FFT on the first axis, 0 at q = 0; real
    if every material is elastic. Nyquist lines are treated as in `in_motion`.
    """
    rtol = graded_tolerance(stack, grid.size)
    check_at_rest(stack)
    check_profiles(stack, period_frequencies(num_times, period))
    return _kernel(stack, grid, num_times, period, rtol)


def period_frequencies(num_times: int, period: Float[Array, ""]) -> Float[Array, " nw"]:
    """Returns the frequencies ω >= 0 of a period [rad/s]."""
    omega = 2 * np.pi / period
    return omega * jnp.arange(num_times // 2 + 1, dtype=omega.dtype)


@derivative_apart
@compiled_loop
def _kernel(stack, grid: Grid, num_times: int, period, rtol):
    """The kernel and the error of its table."""
    points = (num_times // 2 + 1) * int(np.prod([n // 2 + 1 for n in grid.shape]))
    if is_dear(stack, points):
        return _interpolated(stack, grid, num_times, period, rtol)
    response = lambda q, omega: [compliance_or_nan(stack, q, omega, rtol)]  # noqa: E731
    [found] = of_period(response, grid, num_times, period)
    return found, jnp.where(jnp.all(jnp.isfinite(found)), 0.0, jnp.nan)


def of_period(
    response: Callable[..., list[Array]], grid: Grid, num_times: int, period: Array
) -> list[Inexact[Array, "nt *half"]]:
    """Returns the parts of a response as `periodic_kernel` returns M_zz.

    `response(q, omega)` returns its parts at these waves, functions of |q| and ω.
    """
    q, has_wave = quadrant(grid)
    row = jax.checkpoint(lambda omega: response(q, omega[None]))
    found = jax.lax.map(row, period_frequencies(num_times, period), batch_size=_BLOCK)
    return [_whole(part, has_wave, num_times, grid) for part in found]


def quadrant(grid: Grid) -> tuple[Array, Array]:
    """Returns |q| of the positive components in one vector, and where it is not 0 in their shape.

    At 0 it is |q| of the lowest wave.
    """
    numbers = [np.arange(n // 2 + 1) for n in grid.shape]
    lowest = 2 * np.pi / grid.size
    mesh = jnp.meshgrid(*map(jnp.multiply, lowest, numbers), indexing="ij")
    squared = jnp.sum(jnp.stack(mesh) ** 2, axis=0)
    q = jnp.sqrt(jnp.where(squared > 0, squared, 1)).ravel()
    return jnp.where(squared.ravel() > 0, q, jnp.min(lowest)), squared > 0


def _whole(found: Array, has_wave: Array, num_times: int, grid: Grid) -> Array:
    """The response at all frequencies and waves from that at the positive ones."""
    kernel = jnp.where(has_wave, found.reshape(-1, *has_wave.shape), 0)
    if grid.ndim == 2:
        rows = kernel[:, 1 : (grid.shape[0] + 1) // 2][:, ::-1]
        kernel = jnp.concatenate([kernel, rows], axis=1)
    # M(q, -ω) is the conjugate of M(q, ω).
    others = kernel[1 : (num_times + 1) // 2][::-1]
    return jnp.concatenate([kernel, jnp.conj(others)])


def _interpolated(stack, grid: Grid, num_times: int, period, rtol):
    q, has_wave = quadrant(grid)  # the entry at q = 0 is a placeholder
    # Mode numbers of the table: along q so that both ends of the wavenumbers are its ends.
    lowest, highest = q[0], q[-1]
    top = max(len(q), 4)
    power = jnp.log(highest / lowest) / np.log(top)
    omega = 2 * np.pi / period

    def logarithm(kq, kt):
        wave = lowest * jnp.maximum(kq, 1) ** power
        return log_compliance(stack, wave, omega * kt, rtol)

    table = tabulate(logarithm, (top, num_times // 2), q.dtype)
    places = (q / lowest) ** (1 / power)
    rows = table.along_x(places, table.along_y(np.arange(num_times // 2 + 1)))
    return _whole(jnp.exp(rows.T) / q, has_wave, num_times, grid), table.error
