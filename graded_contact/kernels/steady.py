"""The surface compliance of a stack on the whole half spectrum of a grid, for steady sliding.

A surface moving with velocity v excites the wavevector q at ω = -q·v. To save work:

- Moduli are computed once per row of equal q_x: for sliding along x, ω depends on the row only.
- The geometry uses real arithmetic if Poisson's ratio is real.
- Rows of -q_x follow by conjugation.
- Rows are computed in blocks that fit the cache, so temporaries do not grow with the grid;
  derivatives recompute a block instead of storing it.
- Graded and long stacks are interpolated from a table of few wavevectors if that is less work
  (`table`).
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Inexact

from ..blocks.stack import Stack, is_graded
from ..core.checks import Numbers, is_concrete
from ..core.compilation import compiled_loop
from ..core.derivative import derivative_apart
from ..fields.devices import required, spread, whole_along
from ..fields.frequency import sliding_frequency
from ..fields.grid import Grid, both_signs, even_on_nyquist, nyquist_lines, zero_mode
from ..materials.softening import at_strain
from ..response.compliance import compliance_or_nan
from ..response.grading import NOT_REACHED, checked_velocity, graded_tolerance
from .table import log_compliance, tabulate

_BLOCK_ROWS = 16
_FEW_ROWS = 33  # of 64 points: without blocks a first gradient takes a sixth fewer calls in Python
# With so few layers, or points of the grid, direct evaluation is faster than a table.
_FEW_LAYERS, _FEW_POINTS = 6, 192**2


def stack_kernel(stack: Stack, grid: Grid, velocity: Numbers = 0.0) -> Inexact[Array, "*half"]:
    """Returns M_zz [m/Pa] of a stack on the half spectrum of a grid, for steady sliding.

    Up to six homogeneous layers are evaluated at every wavevector, to rounding. Longer stacks
    and graded layers are interpolated from a table on grids of some size if the velocity is
    along x. A table that misses the tolerance of the stack is replaced by direct evaluation.

    **Arguments:**

    - `stack`: the block.
    - `grid`: the periodic cell.
    - `velocity`: of the rough surface over the block [m/s]: a number (along x) or `(vx, vy)`.

    **Returns:** the kernel, shape of the half spectrum. The q = 0 entry is 0 (the mean
    displacement is part of the mean gap). Nyquist lines have the real part of the mean over both
    signs of that component of q: then the operator is real, and so is its inverse. The kernel is
    real if every material is elastic.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if graded layers do not
    reach their tolerance.
    """
    kernel, reached = attempted_kernel(stack, grid, velocity)
    return required(kernel, reached, partial(eqx.error_if, msg=NOT_REACHED))


def attempted_kernel(
    stack: Stack, grid: Grid, velocity, strain=None
) -> tuple[Inexact[Array, "*half"], Bool[Array, ""] | bool]:
    """Returns the kernel, and whether it reached its tolerance; does not raise.

    NaN where the tolerance of a graded layer was missed.

    **Arguments:**

    - `stack`, `grid`, `velocity`: as in `stack_kernel`.
    - `strain`: wavenumbers [rad/m], ascending, and amplitudes ε [1] at them, for a block with
      `materials.StrainSoftening`: each wave has the modulus at its ε, linear in between.
    """
    velocity = checked_velocity(stack, grid, velocity)
    rtol = graded_tolerance(stack, grid.size)
    oblique = velocity.ndim > 0

    def direct():
        kernel = _direct_kernel(stack, grid, velocity, rtol, strain)
        return kernel, jnp.all(jnp.isfinite(kernel)) if is_graded(stack) else jnp.asarray(True)

    if strain is None and not oblique and grid.ndim == 2 and is_dear(stack, math.prod(grid.shape)):
        kernel, error = _interpolated_kernel(stack, grid, velocity, rtol)
        # NaN comes from a node that could not be solved; nor could its neighbours be.
        table, missed = (kernel, error <= rtol), error > rtol
        if not is_concrete(missed):
            return jax.lax.cond(missed, direct, lambda: table)
        if not missed:
            return table
    return direct()


def is_dear(stack: Stack, num_points: int) -> bool:
    """Returns whether a table is less work than the response of a stack at so many points."""
    many = is_graded(stack) or len(stack.layers) > _FEW_LAYERS
    return bool(many and num_points > _FEW_POINTS)


@derivative_apart
@compiled_loop
def _direct_kernel(stack, grid, velocity, rtol, strain):
    def response(block, q, omega):
        return [compliance_or_nan(block, q, omega, rtol)]

    return of_waves(response, stack, grid, velocity, strain)[0]


def of_waves(
    response: Callable[..., list[Array]], stack: Stack, grid: Grid, velocity: Array, strain: Any
) -> list[Inexact[Array, "*half"]]:
    """Returns the parts of a response on the half spectrum of a grid, each by its rules.

    `response(block, q, omega)` returns its parts at these waves, functions of |q| and ω.
    """

    def rows(qx, qy):
        # Side by side, as one wider row.
        return jnp.concatenate(_responses(response, stack, qx, qy, velocity, strain), axis=-1)

    if grid.ndim == 1:
        # The first wave in place of the mean, which `_rules` sets: a liquid has no modulus at rest.
        qx = _wavenumbers(grid, 0, np.maximum(np.arange(grid.shape[0] // 2 + 1), 1))
        found = rows(qx, jnp.zeros_like(qx))
        return [_rules(part, grid) for part in jnp.split(found, len(found) // len(qx))]
    kx, ky = both_signs(grid.shape)
    qy = _wavenumbers(grid, 1, ky)
    rows_at = lambda index: rows(_wavenumbers(grid, 0, jnp.asarray(kx)[index]), qy)  # noqa: E731
    oblique = velocity.ndim > 0
    found = _in_blocks(rows_at, len(kx)) if oblique else _mirrored(rows_at, grid)
    parts = jnp.split(found, found.shape[1] // qy.shape[1], axis=1)
    if oblique:
        parts = [even_on_nyquist(part, grid.shape) for part in parts]
    return [_rules(part, grid) for part in parts]


@derivative_apart
@compiled_loop
def _interpolated_kernel(stack, grid, velocity, rtol):
    """The kernel by its table, and the error of that."""
    lowest = 2 * np.pi / grid.size

    def logarithm(kx, ky):
        qx, qy = kx * lowest[0], ky * lowest[1]
        q, omega = _magnitude(qx, qy), sliding_frequency(qx, qy, velocity)
        return log_compliance(stack, q, omega, rtol)

    highest = (grid.shape[0] // 2, grid.shape[1] // 2)
    table = tabulate(logarithm, highest, grid.size.dtype)
    numbers = np.arange(grid.shape[1] // 2 + 1)
    qy, columns = _wavenumbers(grid, 1, numbers), table.along_y(numbers)

    def rows(index):
        qx = _wavenumbers(grid, 0, index)
        return jnp.exp(table.along_x(index, columns)) / _magnitude(qx[:, None], qy[None, :])

    return _rules(_mirrored(rows, grid), grid), table.error


def _mirrored(rows_of, grid):
    """The kernel of sliding along x: rows of ±q_x are conjugates of each other."""
    num_rows = grid.shape[0] // 2 + 1
    kernel = _in_blocks(rows_of, num_rows)
    # The row of the Nyquist number, if any, is its own mirror image.
    others = kernel[1 : grid.shape[0] - num_rows + 1][::-1]
    return jnp.concatenate([kernel, jnp.conj(others)])


def _in_blocks(rows_of, num_rows):
    """All rows of the kernel, computed a block at a time."""
    # On several devices each takes its columns of every block.
    block = lambda index: whole_along(rows_of(index), 0)  # noqa: E731
    if num_rows <= _FEW_ROWS:
        return block(np.arange(num_rows))
    num_blocks = -(-num_rows // _BLOCK_ROWS)
    rows = np.arange(num_blocks * _BLOCK_ROWS).reshape(num_blocks, _BLOCK_ROWS)
    # The last block repeats its last row instead of running over the grid.
    kernel = jax.lax.map(jax.checkpoint(block), np.minimum(rows, num_rows - 1))
    return kernel.reshape(-1, kernel.shape[-1])[:num_rows]


def _wavenumbers(grid, axis, number):
    """Components of q along an axis."""
    return (2 * np.pi / grid.size[axis]) * number.astype(grid.size.dtype)


def _magnitude(qx, qy):
    """|q| of broadcast components; q = 0 takes a wavenumber at which everything is finite."""
    squared = qx**2 + qy**2
    return jnp.sqrt(jnp.where(squared == 0, 1, squared))


def _responses(response, stack, qx, qy, velocity, strain):
    q = _magnitude(qx, qy)
    # For sliding along x the frequency keeps the shape of qx: one modulus per row.
    omega = sliding_frequency(qx, qy, velocity)
    if strain is None:
        return response(stack, q, omega)

    # With strain each wave sees another block.
    def at(q, omega):
        block = at_strain(stack, jnp.interp(q, *strain))
        return jnp.concatenate(response(block, q[None], omega[None]))

    return jnp.moveaxis(jnp.vectorize(at, signature="(),()->(n)")(q, omega), -1, 0)


def _rules(kernel, grid):
    """A kernel by the rules of the half spectrum, spread over the devices."""
    # The mean displacement belongs to the mean gap.
    kernel = jnp.where(zero_mode(grid.shape), 0, kernel)
    if jnp.iscomplexobj(kernel):
        imag = jnp.where(nyquist_lines(grid.shape), 0, kernel.imag)
        kernel = jax.lax.complex(kernel.real, imag)
    return kernel if grid.ndim == 1 else spread(kernel, grid.size)
