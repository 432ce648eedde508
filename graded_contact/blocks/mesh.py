"""The cells of a graded layer: few where the profile hardly changes, and few at depth.

A surface wave of wavenumber q hardly depends on the block below a few 1/q: with x = q × depth, the
relative effect of deeper parts is less than 2 (1 + 2x)² e^-2x. The recursion through a layer
thicker than `WINDOW`/q therefore starts at that depth, with the half space that has the moduli
there. Above, the density of cells follows the changes of ln E and ν and the decay lengths of the
wave, and decreases with depth.

Cells are needed for every q at once: the mesh is made for a few q, and the heights of its nodes, as
fractions of the visible depth, are interpolated in log q. The result does not depend on the mesh,
so the mesh needs no derivative.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .profile import moduli_at
from .shapes import breaks_of

WINDOW = 22.0
_WAVENUMBERS, _FREQUENCIES, _POINTS, _REFINEMENTS = 48, 12, 128, 4
# Below it the mesh no longer depends on q d.
_SMALLEST = 1e-3


class Mesh(NamedTuple):
    """Nodes of one graded layer, from the bottom upwards.

    `log_x`: log(q d) at the tabulated q. `edges`: heights s between which the profile is smooth.
    `nodes`: fractions, from 0 to 1, of the visible part of each such piece.
    """

    log_x: Float[Array, " table"]
    edges: Float[Array, " pieces+1"]
    nodes: Float[Array, "pieces cells+1 table"]


def visible(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Returns the fraction of a layer of x = q d [1] that a wave can see."""
    return jnp.minimum(1, WINDOW / jnp.where(x > 0, x, 1))


def span(
    seen: Float[Array, "*w"], bottom: Float[Array, ""], top: Float[Array, ""]
) -> tuple[Float[Array, "*w"], Float[Array, "..."]]:
    """Returns height of the visible part of a piece, and the depth of its top, both over d."""
    deep = 1 - top
    return jnp.clip(seen, deep, 1 - bottom) - deep, deep


def build_mesh(
    profile: Any, x: Float[Array, "..."], omega: Float[Array, "..."], num_cells: int, split: int = 1
) -> Mesh:
    """Returns a `Mesh` for all x = q d [1] and ω [rad/s].

    It has about `num_cells` cells, each of them cut into `split`.
    """
    profile, x, omega = jax.lax.stop_gradient((profile, x, omega))
    breaks = breaks_of(profile).astype(x.dtype)
    edges = jnp.concatenate([jnp.zeros(1, x.dtype), breaks, jnp.ones(1, x.dtype)])
    num_nodes = split * max(2, -(-num_cells // (len(edges) - 1))) + 1
    x = jnp.maximum(x, _SMALLEST)
    num_x = min(max(x.size, 2), _WAVENUMBERS)
    log_x = jnp.linspace(jnp.log(jnp.min(x)), jnp.log(jnp.max(x)), num_x)
    omega = _representative(omega)
    even = jnp.linspace(0, 1, _POINTS + 1, dtype=x.dtype)

    def nodes(x, bottom, top):
        length, deep = span(visible(x), bottom, top)

        def refine(_, fractions):
            mass = _mass(profile, x, 1 - deep - length * (1 - fractions), omega)
            total = jnp.concatenate([jnp.zeros(1, x.dtype), jnp.cumsum(mass)])
            fractions = jnp.interp(even * total[-1], total, fractions)
            return fractions.at[0].set(0).at[-1].set(1)

        fractions = jax.lax.fori_loop(0, _REFINEMENTS, refine, even)
        return jnp.interp(jnp.linspace(0, 1, num_nodes, dtype=x.dtype), even, fractions)

    over_x = jax.vmap(nodes, (0, None, None), out_axes=1)
    table = jax.vmap(over_x, (None, 0, 0))(jnp.exp(log_x), edges[:-1], edges[1:])
    return Mesh(log_x, edges, table)


def coarsened(mesh: Mesh, split: int) -> Mesh:
    """Returns the mesh without the cuts that `split` made."""
    return mesh._replace(nodes=mesh.nodes[:, ::split])


def cells_of(mesh: Mesh) -> dict[str, Array]:
    """Returns the cells of all pieces along a first axis: the fractions at their ends, and
    the heights of the ends of their piece."""
    pieces, count = mesh.nodes.shape[0], mesh.nodes.shape[1] - 1
    return {
        "low": mesh.nodes[:, :-1].reshape(pieces * count, -1),
        "high": mesh.nodes[:, 1:].reshape(pieces * count, -1),
        "bottom": jnp.repeat(mesh.edges[:-1], count),
        "top": jnp.repeat(mesh.edges[1:], count),
    }


def position(mesh: Mesh, x: Float[Array, "*w"]):
    """Returns the place of log x among the tabulated wavenumbers: index and weight."""
    log_x = jnp.log(jnp.maximum(jax.lax.stop_gradient(x), _SMALLEST))
    first, last, steps = mesh.log_x[0], mesh.log_x[-1], len(mesh.log_x) - 1
    wide = last > first
    place = jnp.where(wide, (log_x - first) / jnp.where(wide, last - first, 1), 0) * steps
    index = jnp.clip(place.astype(int), 0, steps - 1)
    return index, jnp.clip(place - index, 0, 1)


def _mass(profile, x, s, omega):
    """What each interval of heights weighs: changes of ln E and ν, decay lengths, a little."""
    modulus, poisson = moduli_at(profile, s[:, None], omega)
    shape = (s.size, omega.size)
    modulus = jnp.broadcast_to(modulus, shape)
    poisson = jnp.broadcast_to(poisson, shape)
    step = jnp.diff(s)
    change = jnp.max(
        jnp.abs(jnp.log(modulus[1:] / modulus[:-1])) + 4 * jnp.abs(poisson[1:] - poisson[:-1]),
        axis=1,
    )
    depth = 1 - (s[1:] + s[:-1]) / 2
    # Decay rates and weights measured on the reference cases; they only shape the mesh.
    seen = jnp.exp(-0.2 * x * depth)
    tiny = jnp.finfo(s.dtype).tiny
    return (jnp.sqrt(change**2 + step**2) + 1.5 * x * step) * seen + step + tiny


def _representative(omega):
    """A few frequencies that span the given ones."""
    size = jnp.abs(omega).ravel()
    if size.size <= _FREQUENCIES:
        return size
    high = jnp.max(size)
    low = jnp.min(jnp.where(size > 0, size, jnp.where(high > 0, high, 1)))
    high = jnp.where(high > 0, high, low)
    spread = jnp.exp(jnp.linspace(jnp.log(low), jnp.log(high), _FREQUENCIES))
    spread = jnp.clip(spread, low, high)
    return jnp.where(jnp.any(size > 0), spread, 0)
