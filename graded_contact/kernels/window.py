"""The surface compliance of a stack on a window: a piece of its surface, all around free of load.

The displacement of a window of length L under a pressure on the same window needs Green's function
G only for distances up to L along each axis. So a cell of twice the length does (Hockney's method):
its periodic kernel has G and its images, which belong to the loads 2L, 4L, ... away,

    K = M on the cell 2L  -  F[images],      images(x) = Σ_{m≠0} G(x + 2Lm),  |x| <= L.

Images are smoother than G: the nearest load is at least L away. They are computed on a cell many
windows long with few points to the window, and interpolated by a cubic spline. Two errors remain:
the long cell has images of its own (estimated by a cell half as long), and it has few points
(estimated by half as many). The second one matters where a block relaxes
slowly: the track that a load leaves behind is not smooth across the motion.

The entry at q = 0 holds the mean of G so that G vanishes far away. This gives the approach of an
indenter. What a cell of length S lacks of G is a/S + b/S²: a of the half space, b of the layers;
cells half and a quarter as long give both. The estimated error is the term of b and, where the base
does not relax within the cell, the difference of the relaxed 1/Re(1/M) and Re M at its longest
waves. Along a line only slabs on a rigid base have this entry; else it is 0.

R. W. Hockney, Methods Comput. Phys. 9 (1970) 135; S. Liu, Q. Wang & G. Liu, Wear 243 (2000) 101,
doi:10.1016/S0043-1648(00)00427-0.
"""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Inexact

from ..blocks.stack import HalfSpace, Rigid, Stack
from ..core.checks import Numbers
from ..core.compilation import compiled_loop
from ..core.derivative import derivative_apart
from ..fields.grid import Grid, resample_spectrum, to_field, to_spectrum, zero_mode
from .steady import stack_kernel

# Windows along an axis of the long cell, by the number of axes, and points to a window there.
_WINDOWS = {1: 1024, 2: 32}
_POINTS = 32


def window_kernel(stack: Stack, grid: Grid, velocity: Numbers = 0.0) -> Inexact[Array, "*half"]:
    """Returns M_zz [m/Pa] of a stack for pressures on a window, with no load around it.

    **Arguments:**

    - `stack`: the block.
    - `grid`: the points of the window.
    - `velocity`: of the window over the block [m/s]: a number (along x) or `(vx, vy)`.

    **Returns:** the kernel on the half spectrum of a cell of twice as many points along each axis,
    for `solve_contact` with heights on the window.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if a graded layer misses its
    tolerance.
    """
    near, far = (stack_kernel(stack, cell, velocity) for cell in (doubled(grid), long_cell(grid)))
    return without_images(near, far, grid, has_ground(stack, grid))[0]


def has_ground(stack: Stack, grid: Grid) -> bool:
    """Returns whether a load on a window moves the block far away by nothing."""
    return isinstance(stack.base, Rigid | HalfSpace if grid.ndim == 2 else Rigid)


def doubled(grid: Grid) -> Grid:
    """Returns the cell of twice the length, with twice as many points along each axis."""
    return Grid(tuple(2 * n for n in grid.shape), 2 * grid.size)


def long_cell(grid: Grid) -> Grid:
    """Returns the cell many windows long, with few points to the window."""
    windows = _WINDOWS[grid.ndim]
    return Grid((windows * _POINTS,) * grid.ndim, windows * grid.size)


@derivative_apart
@compiled_loop
def without_images(near: Array, far: Array, grid: Grid, ground: bool) -> tuple[Array, Array]:
    """Returns the kernel of a window and its two estimated errors [m/Pa], see above.

    `near` and `far` are the kernels of the cells `doubled` and `long_cell` of its grid. With
    `ground` the block far away does not move.
    """
    windows, points = _WINDOWS[grid.ndim], _POINTS
    shape = (windows * points,) * grid.ndim
    fewer = resample_spectrum(far, shape, tuple(n // 2 for n in shape))
    images, own, more = (
        _images(far, grid, points, length) for length in (2, windows // 2, windows // 4)
    )
    mean = zero_mode(tuple(2 * n for n in grid.shape))
    longest = far[tuple(np.eye(grid.ndim, dtype=int))]
    late = jnp.sum(longest.imag**2 / longest.real) * 8 * (2 / windows) ** grid.ndim
    of_mean = jnp.abs(more - 3 * own) / 3 + late
    errors = [
        jnp.where(mean, of_mean if ground else 0, own),
        images - _images(fewer, grid, points // 2, 2),
    ]
    kernel = near - images - jnp.where(mean, 2 * own - more / 3, 0)
    return kernel if ground else jnp.where(mean, 0, kernel), jnp.stack(errors)


def _images(far, grid: Grid, points: int, length: int):
    """The part of a kernel by loads `length` windows away, and multiples of it.

    `far` is a kernel of the long cell with so many points to a window.
    """
    size = _WINDOWS[grid.ndim] * points
    # One point of the long cell loads as much as so many of the window.
    share = math.prod(points / n for n in grid.shape)
    # 1 for long waves and 0 for the shortest, without a step.
    along = np.exp(-36 * np.abs(2 * np.fft.fftfreq(size)) ** 8)
    damping = along[: size // 2 + 1] if grid.ndim == 1 else np.outer(along, along[: size // 2 + 1])
    damping = jnp.asarray(damping, far.real.dtype)
    green = to_field(far * damping * share + 0j, (size,) * grid.ndim)
    blocks = green.reshape((size // (length * points), length * points) * grid.ndim)
    folded = jnp.sum(blocks, axis=tuple(range(0, 2 * grid.ndim, 2)))
    reach = np.arange(-points, points + 1)  # the distances -L ... L, on either cell
    near, whole = (np.ix_(*(reach % n,) * grid.ndim) for n in (length * points, size))
    images = folded[near] - green[whole]
    for axis, n in enumerate(grid.shape):
        weights = jnp.asarray(_spline(points, n), images.dtype)
        images = jnp.moveaxis(jnp.tensordot(weights, images, (1, axis)), 0, axis)
    spectrum = to_spectrum(images)
    return spectrum if jnp.iscomplexobj(far) else spectrum.real


def _spline(points: int, n: int) -> np.ndarray:
    """Weights of the values at -L ... L in those at the differences of 2n points, 0 first.

    The difference n is -L and L at once.
    """
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(np.linspace(-1, 1, 2 * points + 1), np.eye(2 * points + 1))
    weights = spline(np.fft.fftfreq(2 * n) * 2)
    weights[n] = (spline(-1.0) + spline(1.0)) / 2
    return weights
