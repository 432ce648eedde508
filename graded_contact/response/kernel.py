"""The surface compliance of a stack on the whole half spectrum of a grid, for steady sliding.

A surface moving with velocity v excites the wavevector q at ω = -q·v. What is computed, and how
often: moduli once per row of equal q_x (sliding along x makes ω depend on the row alone), the
geometry in real arithmetic where Poisson's ratio is real, rows of -q_x by conjugation. Rows are
taken in blocks that fit the cache, so that temporaries do not grow with the grid; derivatives
recompute a block instead of storing it.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Inexact

from .._checks import Numbers, as_float, check_values
from ..grid import Grid, nyquist_lines
from ..rheology.tabulated import Tabulated
from .compliance import surface_compliance_unchecked
from .grading import check_profiles
from .stack import Stack, materials_of

_BLOCK_ROWS = 32


def stack_kernel(stack: Stack, grid: Grid, velocity: Numbers = 0.0) -> Inexact[Array, "*half"]:
    """Returns M_zz [m/Pa] of a stack on the half spectrum of a grid, for steady sliding.

    **Arguments:**

    - `stack`: the block.
    - `grid`: the periodic cell.
    - `velocity`: of the rough surface over the block [m/s]: a number (along x) or `(vx, vy)`.

    **Returns:** the kernel, shape of the half spectrum. The q = 0 entry is 0 (the mean
    displacement belongs to the mean gap) and Nyquist lines hold the real part, the even one.
    It is real when every material is elastic.
    """
    velocity = as_float(velocity)
    if velocity.shape not in ((), (2,)) or (velocity.shape == (2,) and grid.ndim == 1):
        raise ValueError(
            f"`velocity` has shape {velocity.shape}; a number (along x) or, on a grid in two "
            "dimensions, two components are needed."
        )
    check_values("velocity", velocity, "a velocity [m/s] must be finite")
    along = velocity if velocity.ndim == 0 else jnp.sqrt(jnp.sum(velocity**2))
    lowest, highest = _wavenumbers(grid, 0, np.array([1, grid.shape[0] // 2]))
    omega = along * jnp.stack([jnp.zeros_like(lowest), lowest, highest])
    check_profiles(stack, omega)
    for material in materials_of(stack):
        if isinstance(material, Tabulated):
            material.modulus(omega)  # refuses what its table does not cover
    return _stack_kernel(stack, grid, velocity)


@jax.jit
def _stack_kernel(stack, grid, velocity):
    if grid.ndim == 1:
        qx = _wavenumbers(grid, 0, np.arange(grid.shape[0] // 2 + 1))
        return _rules(_compliance(stack, qx, jnp.zeros_like(qx), velocity), grid.shape)
    # Sliding along x: rows of ±q_x are conjugates of each other.
    mirrored = velocity.shape == ()
    num_rows = grid.shape[0] // 2 + 1 if mirrored else grid.shape[0]
    qy = _wavenumbers(grid, 1, np.arange(grid.shape[1] // 2 + 1))

    @jax.checkpoint
    def block(rows):
        qx = _wavenumbers(grid, 0, rows)
        return _compliance(stack, qx[:, None], qy[None, :], velocity)

    if num_rows <= 2 * _BLOCK_ROWS:
        kernel = block(np.arange(num_rows))
    else:
        num_blocks = -(-num_rows // _BLOCK_ROWS)
        rows = np.arange(num_blocks * _BLOCK_ROWS).reshape(num_blocks, _BLOCK_ROWS)
        # The last block repeats its last row instead of running over the grid.
        kernel = jax.lax.map(block, np.minimum(rows, num_rows - 1))
        kernel = kernel.reshape(-1, kernel.shape[-1])[:num_rows]
    if mirrored:
        others = kernel[1 : grid.shape[0] - num_rows + 1][::-1]
        kernel = jnp.concatenate([kernel, jnp.conj(others)])
    return _rules(kernel, grid.shape)


def _wavenumbers(grid, axis, index):
    """Components of q along an axis at positions of the full spectrum; Nyquist is positive."""
    n = grid.shape[axis]
    k = jnp.where(index <= n // 2, index, index - n)
    return (2 * np.pi / grid.size[axis]) * k.astype(grid.size.dtype)


def _compliance(stack, qx, qy, velocity):
    """M_zz of broadcast components; q = 0 takes a wavenumber at which everything is finite."""
    squared = qx**2 + qy**2
    q = jnp.sqrt(jnp.where(squared == 0, 1, squared))
    # For sliding along x the frequency keeps the shape of qx: one modulus per row.
    omega = -qx * velocity if velocity.ndim == 0 else -(qx * velocity[0] + qy * velocity[1])
    return surface_compliance_unchecked(stack, q, omega)


def _rules(kernel, shape):
    """The rules of the half spectrum at q = 0 and on Nyquist lines."""
    zero = np.zeros(kernel.shape, bool)
    zero[(0,) * kernel.ndim] = True
    kernel = jnp.where(zero, 0, kernel)
    if jnp.iscomplexobj(kernel):
        imag = jnp.where(nyquist_lines(shape), 0, kernel.imag)
        kernel = jax.lax.complex(kernel.real, imag)
    return kernel
