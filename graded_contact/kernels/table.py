"""A function of the wavevector on the quadrant of a grid, interpolated from few wavevectors.

The compliance of a graded or long stack is expensive, but smooth: for sliding along x, log(q M_zz)
is analytic in log q_x and log q_y (Re M_zz > 0 keeps the logarithm on its branch), and polynomials
through Chebyshev nodes converge geometrically (L. N. Trefethen, Approximation Theory and
Approximation Practice, SIAM 2013, ch. 8). With the nodes' values in a matrix L, those of the whole
grid are A_x L A_yᵀ: two matrix products. The lines q_x = 0 and q_y = 0 are one more node in each
direction.

The number of nodes follows from the Chebyshev coefficients along a few lines. The error is
measured at wavevectors of the grid that are not nodes.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, Int, Real

from ..core.display import shown

# The function, of mode numbers k_x and k_y [1] that broadcast; also between integers.
OfModes = Callable[[Float[Array, "..."], Float[Array, "..."]], Inexact[Array, "..."]]

_TILE = 28  # nodes along a side of the squares that are evaluated together
_MOST = 8 * _TILE  # nodes in each direction, the one at zero included
_PROBED = _MOST // 2  # wavevectors on a line where coefficients are read
_LINES = (-0.9, 0.1, 0.95)  # such lines, from the lowest (-1) to the highest (1)
_SAFETY = 3.0  # largest error over the largest of the sample


@shown("num_nodes", "num_evaluations", "error")
class KernelTable(eqx.Module):
    """The values at the nodes, and their error.

    **Fields:**

    - `values`: at the nodes; the first in each direction is at zero, unused ones hold zero.
    - `num_nodes`: nodes besides the first, along x and y.
    - `num_evaluations`: how often the function was computed.
    - `error`: estimated largest error of the interpolated function.
    - `highest`: mode numbers up to which it reaches, along x and y. Static.
    """

    values: Inexact[Array, "most most"]
    num_nodes: Int[Array, "2"]
    num_evaluations: Int[Array, ""]
    error: Float[Array, ""]
    highest: tuple[int, int] = eqx.field(static=True)

    def along_y(self, ky: Int[Array | np.ndarray, " ny"]) -> Inexact[Array, "most ny"]:
        """Returns the function at the nodes along x and the mode numbers `ky`."""
        return _times(_matrix(ky, self.num_nodes[1], self.highest[1]), self.values.T).T

    def along_x(
        self, kx: Real[Array | np.ndarray, " nx"], columns: Inexact[Array, "most ny"]
    ) -> Inexact[Array, "nx ny"]:
        """Returns the function at the mode numbers `kx`, given what `along_y` returned."""
        return _times(_matrix(kx, self.num_nodes[0], self.highest[0]), columns)


def tabulate(
    function: OfModes, probe: OfModes, highest: tuple[int, int], tolerance: float, dtype: np.dtype
) -> KernelTable:
    """Returns a table for the mode numbers 0 ... `highest` in each direction.

    The number of nodes follows from `tolerance`, by values of `probe`: the function, or a cheaper
    version of it. `error` shows whether the tolerance was reached.
    """
    counts = _counts(probe, highest, tolerance / 10, dtype)
    nodes = [_nodes(n, top) for n, top in zip(counts, highest, strict=True)]
    sample = [_sample(top, start) for top, start in zip(highest, (0.0, 0.5), strict=True)]
    num_tiles = _MOST // _TILE
    corners = np.indices((num_tiles, num_tiles)).reshape(2, -1)
    used = jnp.all(_TILE * corners <= counts[:, None], axis=0)
    # The sample is evaluated as one more square.
    kx, ky = (
        jnp.concatenate([k.reshape(num_tiles, _TILE)[corner], unseen[None]]).astype(dtype)
        for k, corner, unseen in zip(nodes, corners, sample, strict=True)
    )
    nothing = jnp.zeros((_TILE, _TILE), jax.eval_shape(function, kx[0], ky[0]).dtype)

    @jax.checkpoint
    def evaluate(tile):
        kx, ky, used = tile
        return jax.lax.cond(used, lambda: function(kx[:, None], ky[None, :]), lambda: nothing)

    found = jax.lax.map(evaluate, (kx, ky, jnp.append(used, True)))
    values = jnp.swapaxes(found[:-1].reshape(num_tiles, num_tiles, _TILE, _TILE), 1, 2)
    table = KernelTable(
        values=values.reshape(_MOST, _MOST),
        num_nodes=counts,
        num_evaluations=2 * len(_LINES) * _PROBED + _TILE**2 * (jnp.sum(used) + 1),
        error=jnp.zeros((), dtype),
        highest=highest,
    )
    missed = jnp.abs(table.along_x(sample[0], table.along_y(sample[1])) - found[-1])
    error = jax.lax.stop_gradient(_SAFETY * jnp.max(missed))
    return eqx.tree_at(lambda t: t.error, table, error)


def _times(matrix, values):
    """A real matrix times a complex one, as two real products: half the work of a complex one."""
    if not jnp.iscomplexobj(values):
        return matrix.astype(values.dtype) @ values
    parts = (matrix.astype(part.dtype) @ part for part in (values.real, values.imag))
    return jax.lax.complex(*parts)


def _counts(probe, highest, tolerance, dtype):
    """Nodes needed along x and y, by the coefficients that fall off along some lines."""
    num = _PROBED
    fine = np.cos(np.pi * (np.arange(num) + 0.5) / num)
    to_coefficients = 2 / num * np.cos(np.outer(np.arange(num), np.arccos(fine)))
    (kx, ky), (line_x, line_y) = (
        [_mode_number(np.asarray(s), top) for top in highest] for s in (fine, _LINES)
    )
    lines = [np.broadcast_arrays(kx, line_y[:, None]), np.broadcast_arrays(line_x[:, None], ky)]
    kx, ky = (jnp.asarray(np.stack(k).ravel(), dtype) for k in zip(*lines, strict=True))
    found = jax.lax.stop_gradient(probe(kx, ky)).reshape(2, len(_LINES), num)
    size = jnp.abs(found @ jnp.asarray(to_coefficients.T, dtype))
    # What is cut off with the coefficients from here on; NaN counts as too much.
    rest = jnp.cumsum(size[..., ::-1], axis=-1)[..., ::-1]
    # The dearest line decides.
    needed = jnp.max(jnp.sum(~(rest <= tolerance), axis=-1), axis=1)
    return jnp.where(needed < num, jnp.maximum(needed, 4), _MOST - 1)


def _mode_number(position, highest):
    """The mode number at a position: -1 is the lowest, 1; 1 the highest."""
    return highest ** ((1 + position) / 2)


def _nodes(count, highest):
    """Mode numbers of the nodes: zero, then Chebyshev's; those past `count` repeat the last."""
    index = jnp.minimum(jnp.arange(_MOST - 1), count - 1)
    return jnp.append(0.0, _mode_number(jnp.cos(np.pi * (index + 0.5) / count), highest))


def _matrix(k, count, highest):
    """Takes values at the nodes to those at the mode numbers k: the barycentric formula."""
    index = jnp.arange(_MOST - 1)
    angle = np.pi * (index + 0.5) / count
    weight = jnp.where(index < count, (1 - 2 * (index % 2)) * jnp.sin(angle), 0)
    position = 2 * jnp.log(jnp.maximum(k, 1)) / np.log(highest) - 1
    distance = position[:, None] - jnp.cos(angle)
    hit = (distance == 0) & (index < count)
    # At a node the formula is 0/0: the row is that of the identity.
    share = weight / jnp.where(distance == 0, 1, distance)
    share = jnp.where(jnp.any(hit, axis=1, keepdims=True), hit, share)
    share = share / jnp.sum(share, axis=1, keepdims=True)
    zero = (k == 0)[:, None]
    return jnp.concatenate([zero, jnp.where(zero, 0, share)], axis=1)


def _sample(highest, start):
    """Mode numbers spread between the lowest and the highest, and zero."""
    position = (np.arange(_TILE - 1) + (start + np.arange(_TILE - 1) * 0.618) % 1) / (_TILE - 1)
    return jnp.asarray(np.append(0, np.rint(_mode_number(2 * position - 1, highest)).astype(int)))
