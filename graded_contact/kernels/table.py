"""A function of the wavevector on the quadrant of a grid, interpolated from few wavevectors.

The compliance of a graded or long stack is expensive, but smooth: for sliding along x, log(q M_zz)
is analytic in log q_x and log q_y (Re M_zz > 0 keeps the logarithm on its branch), and polynomials
through Chebyshev nodes converge geometrically (L. N. Trefethen, Approximation Theory and
Approximation Practice, SIAM 2013, ch. 8). With the values at the nodes in a matrix L, the values on
the whole grid are A_x L A_yᵀ: two matrix products. The lines q_x = 0 and q_y = 0 are one more node
in each direction. The error is measured at wavevectors of the grid that are not nodes.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, Int, Real

from ..blocks.stack import Stack
from ..blocks.tolerance import REFUSED_BELOW
from ..response.compliance import compliance_or_nan

# The function, of mode numbers k_x and k_y [1] that broadcast; also between integers.
OfModes = Callable[[Float[Array, "..."], Float[Array, "..."]], Inexact[Array, "..."]]

# Nodes in each direction, the one at zero included, for mode numbers up to 1024, and for higher
# ones: 30 and 300 layers then have an error of 3e-10 at 2048² and at 8192².
NODES, MORE_NODES, _FEW_NUMBERS = 64, 80, 1024
_SAMPLES = 32  # wavevectors in each direction at which the error is measured
_ROWS = 16  # of wavevectors that are evaluated together
_SAFETY = 3.0  # largest error over the largest of the sample


class KernelTable(eqx.Module):
    """The values at the nodes, and their error.

    **Fields:**

    - `values`: at the nodes; the first in each direction is at zero.
    - `error`: estimated largest error of the interpolated function.
    - `highest`: mode numbers up to which it reaches, along x and y. Static.
    """

    values: Inexact[Array, "nodes nodes"]
    error: Float[Array, ""]
    highest: tuple[int, int] = eqx.field(static=True)

    def along_y(self, ky: Int[Array | np.ndarray, " ny"]) -> Inexact[Array, "nodes ny"]:
        """Returns the function at the nodes along x and the mode numbers `ky`."""
        return _times(_matrix(ky, self.highest[1], len(self.values)), self.values.T).T

    def along_x(
        self, kx: Real[Array | np.ndarray, " nx"], columns: Inexact[Array, "nodes ny"]
    ) -> Inexact[Array, "nx ny"]:
        """Returns the function at the mode numbers `kx`, given what `along_y` returned."""
        return _times(_matrix(kx, self.highest[0], len(self.values)), columns)


def tabulate(function: OfModes, highest: tuple[int, int], dtype: np.dtype) -> KernelTable:
    """Returns a table for the mode numbers 0 ... `highest` in each direction."""

    def at(kx, ky):
        # A few rows fit the cache; a derivative computes them again.
        rows = jax.checkpoint(lambda k: function(k[:, None], ky[None, :]))
        return jax.lax.map(rows, kx.reshape(-1, _ROWS)).reshape(len(kx), len(ky))

    count = (NODES if max(highest) <= _FEW_NUMBERS else MORE_NODES) - 1
    angle = np.pi * (np.arange(count) + 0.5) / count
    nodes = [jnp.append(0.0, _mode_number(np.cos(angle), top)).astype(dtype) for top in highest]
    sample = [_sample(top, start) for top, start in zip(highest, (0.0, 0.5), strict=True)]
    table = KernelTable(at(*nodes), jnp.zeros((), dtype), highest)
    exact = at(*(k.astype(dtype) for k in sample))
    missed = jnp.abs(table.along_x(sample[0], table.along_y(sample[1])) - exact)
    error = jax.lax.stop_gradient(_SAFETY * jnp.max(missed))
    return eqx.tree_at(lambda t: t.error, table, error)


def log_compliance(stack: Stack, q: Array, omega: Array, rtol: float) -> Array:
    """Returns log(q M_zz) for a table with the tolerance `rtol`."""
    # The nodes are solved more closely than they are interpolated.
    closer = max(rtol / 4, REFUSED_BELOW * float(jnp.finfo(q.dtype).eps))
    return jnp.log(compliance_or_nan(stack, q, omega, closer) * q)


def _times(matrix, values):
    """A real matrix times a complex one, as two real products: half the work of a complex one."""
    if not jnp.iscomplexobj(values):
        return matrix.astype(values.dtype) @ values
    parts = (matrix.astype(part.dtype) @ part for part in (values.real, values.imag))
    return jax.lax.complex(*parts)


def _mode_number(position, highest):
    """The mode number at a position: -1 is the lowest, 1; 1 the highest."""
    return highest ** ((1 + position) / 2)


def barycentric(place: Array, count: int) -> Array:
    """Returns the weights of values at Chebyshev's nodes in those at places in [-1, 1]."""
    angle = np.pi * (np.arange(count) + 0.5) / count
    weight = (1 - 2 * (np.arange(count) % 2)) * np.sin(angle)
    distance = place[:, None] - jnp.cos(angle).astype(place.dtype)
    # At a node the formula is 0/0: the row is a row of the identity.
    share = weight / jnp.where(distance == 0, 1, distance)
    share = jnp.where(jnp.any(distance == 0, axis=1, keepdims=True), distance == 0, share)
    return share / jnp.sum(share, axis=1, keepdims=True)


def _matrix(k, highest, nodes):
    """Takes values at the nodes to those at the mode numbers k."""
    share = barycentric(2 * jnp.log(jnp.maximum(k, 1)) / np.log(highest) - 1, nodes - 1)
    zero = (k == 0)[:, None]
    return jnp.concatenate([zero, jnp.where(zero, 0, share)], axis=1)


def _sample(highest, start):
    """Mode numbers spread between the lowest and the highest, and zero."""
    n = _SAMPLES - 1
    position = (np.arange(n) + (start + np.arange(n) * 0.618) % 1) / n
    return jnp.asarray(np.append(0, np.rint(_mode_number(2 * position - 1, highest)).astype(int)))
