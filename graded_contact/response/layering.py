"""Graded layers as homogeneous layers with the moduli at their middle heights, extrapolated.

On a mesh adapted to the profile and to each wavenumber every cell is cut n-fold. The error is even
in 1/n within every cell of any mesh, so that extrapolation in 1/n²
(Richardson, Phil. Trans. R. Soc. A 226 (1927) 299, doi:10.1098/rsta.1927.0008) over n = 1, 2, 3, 4,
6, 8 gives order 12. The layers themselves are exact (`slab`), passive, and need no derivative of
the profile.

The mesh has few cells where the profile hardly changes, and few at depth. A surface wave of
wavenumber q hardly depends on the block below a few 1/q. Therefore the recursion through a thick
layer starts at a depth that the wave can still see (`column.visible`), with the half space that has
the moduli there. Above, the density of cells follows the changes of ln E and ν and the decay
lengths of the wave, and decreases with depth. Beside a steep step the cells grow from its width in
proportion to their distance: no tail of it hides in the last sublayer of a wide cell. What may hide
there, a jump, is looked for (`_missed`) and counts in the estimated error.

Cells are needed for every q at once: the mesh is made for a few q, and the heights of its nodes, as
fractions of the visible depth, are interpolated in log q. The result does not depend on the mesh,
so the mesh needs no derivative.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.profile import moduli_at
from ..blocks.shapes import breaks_of
from ..blocks.stack import GradedLayer
from ..blocks.tolerance import AbstractGradedSolver, as_tolerance, rounding
from ..core.checks import check_whole
from .column import Face, GradedPart, Rule, cast_like, stable_shape, visible

# Layers per cell of the mesh. Longer rows gain order but lose digits to their weights.
_REFINEMENT = (1, 2, 3, 4, 6, 8)
# Of every sublayer, one refinement after the other.
_LEVEL = np.repeat(np.arange(len(_REFINEMENT)), _REFINEMENT)
_MIDDLE = np.concatenate([(np.arange(n) + 0.5) / n for n in _REFINEMENT])
_WIDTH = np.concatenate([np.full(n, 1 / n) for n in _REFINEMENT])
_IS_FIRST = np.concatenate([np.arange(n) == 0 for n in _REFINEMENT])
_LAST = np.cumsum(_REFINEMENT) - 1  # the last sublayer of each refinement
# Just within the ends of a cell, where no sublayer has its middle.
_ENDS, _FINEST = (1e-6, 1 - 1e-6), _MIDDLE[-_REFINEMENT[-1] :]
# How much finer the mesh of a second attempt is.
_SPLIT = 5
# The mesh is made for so many wavenumbers and frequencies, from the profile at so many heights.
_WAVENUMBERS, _FREQUENCIES, _POINTS, _REFINEMENTS = 48, 12, 128, 8
# How fast cells grow beside a steep step: less makes them wider, more leaves few of them in it.
_GROWTH = 1.0
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


class Layering(AbstractGradedSolver):
    """Homogeneous layers at middle heights, extrapolated.

    **Fields:**

    - `num_cells`: cells of the mesh of each graded layer, 24 layers of work each. By default as
      many as the tolerance needs mostly, and five times as many if the error exceeds it. Static.
    - `rtol`: relative tolerance; by default 1e-9, in float32 1e-4. Static.
    """

    num_cells: int | None = eqx.field(static=True, default=None)
    rtol: float | None = eqx.field(static=True, default=None, converter=as_tolerance)

    def __check_init__(self):
        if self.num_cells is not None:
            check_whole("num_cells", self.num_cells, 1)

    def solve(self, climb, measure, stack, q, omega, rtol):
        num_cells = self.num_cells
        if num_cells is None:
            # The error goes as the number of cells to the power -12, estimates as -11.
            num_cells = int(np.ceil(12 * (1e-9 / rtol) ** (1 / 11)))
        meshes = {
            i: build_mesh(layer.profile, q * layer.thickness, omega, num_cells, _SPLIT)
            for i, layer in enumerate(stack.layers)
            if isinstance(layer, GradedLayer)
        }

        def extrapolated(meshes):
            hidden = []

            def add(part, face, rule):
                face, unseen = add_layered(part, face, meshes[part.number], rule)
                hidden.append(unseen)
                return face

            values, error = _extrapolated(climb(add), measure, rounding(q))
            return values, error + jax.lax.stop_gradient(sum(hidden))

        coarse = {i: mesh._replace(nodes=mesh.nodes[:, ::_SPLIT]) for i, mesh in meshes.items()}
        found = extrapolated(coarse)
        if self.num_cells is not None:
            return found
        # A derivative recomputes the finer one rather than store it.
        finer = jax.checkpoint(extrapolated)
        values, error = jax.lax.cond(jnp.all(found[1] <= rtol), lambda _: found, finer, meshes)
        return values, error


def _extrapolated(levels, measure, floor):
    def combine(first, last):
        squares = np.square(_REFINEMENT[first:last], dtype=float)
        # What extrapolates a function even in 1/n from these n to infinity.
        weights = [float(np.prod([a / (a - b) for b in squares if b != a])) for a in squares]
        return [sum(w * part[first + i] for i, w in enumerate(weights)) for part in levels]

    def without(first, last):
        differences = [a - b for a, b in zip(values, combine(first, last), strict=True)]
        return measure(differences, values)

    values = combine(0, len(_REFINEMENT))
    # Without the coarsest refinement it falls short of the error on the reference cases, up to
    # fifty times where a cell is deep, and without the finest it exceeds it as much; three times
    # their geometric mean does neither. Both are multiples of one divided difference. Where that
    # changes sign, a tenth of the difference of a shorter row is larger: of 1,152 waves of steep
    # profiles 10 % have a larger error, of up to 7.5 times this.
    error = 3 * jnp.sqrt(without(1, len(_REFINEMENT))) * jnp.sqrt(without(0, -1))
    error = jnp.maximum(error, without(1, -1) / 10)
    return tuple(values), jax.lax.stop_gradient(error) + floor


def add_layered(part: GradedPart, face: Face, mesh: Mesh, rule: Rule) -> tuple[Face, Array]:
    """Returns the other face of a graded layer for every refinement, along a new first axis.

    `face` may have that axis already. Also returns the relative error of steps that no refinement
    sees, as they lie between the end of a cell and the middle of its outermost sublayer.
    """
    x, seen, height = part.x, part.seen, part.height
    index, weight = _position(mesh, x)
    # Sublayers are counted in the direction in which they are passed.
    middle = 1 - _MIDDLE if rule.down else _MIDDLE
    sublayers = (_LEVEL, _IS_FIRST, *(jnp.asarray(a, x.dtype) for a in (middle, _WIDTH)))

    def add_cell(carry, cell):
        faces, unseen = carry
        *ends, bottom, top = cell
        low, high = (end[index] * (1 - weight) + end[index + 1] * weight for end in ends)
        length, deep = span(seen, bottom, top)
        if height is not None:  # as a fraction of what is seen of the piece
            cut = 1 - (1 - deep - height) / jnp.where(length > 0, length, 1)
            clip = jnp.maximum if rule.down else jnp.minimum
            low, high = clip(low, cut), clip(high, cut)

        def add_sublayer(state, sublayer):
            level, is_first, middle, width = sublayer
            # All refinements of a cell in one scan: each starts from its own face.
            first = jax.tree.map(lambda leaf: leaf[level], faces)
            state = jax.tree.map(lambda a, b: jnp.where(is_first, a, b), first, state)
            depth, moduli = x * (length * (high - low) * width), part.moduli(place(middle))
            state = cast_like(rule.add(state, depth, *moduli), state)
            return state, state

        def place(middle):
            return 1 - deep - length * (1 - low - (high - low) * middle)

        replaced = jax.tree.map(lambda leaf: leaf[0], faces)
        _, found = jax.lax.scan(jax.checkpoint(add_sublayer), replaced, sublayers)
        # The outermost half of a sublayer is hidden. Its effect is at most as in `column`.
        above = 2 * x * (deep + length * (1 - high))
        effect = x * length * (high - low) / 4 * (1 + above) ** 2 * jnp.exp(-above)
        unseen = unseen + effect * _missed(part, place)
        return (jax.tree.map(lambda leaf: leaf[_LAST], found), unseen), None

    # A wave that does not see the bottom starts from a half space inside the layer.
    start = face
    if rule.half_space is not None:
        entry = rule.half_space(*part.moduli(1 - seen))
        start = jax.tree.map(lambda a, b: jnp.where(seen < 1, a, b), entry, face)
    like = stable_shape(lambda state: rule.add(state, x, *part.moduli(seen)), start)
    rank = max(x.ndim, part.omega.ndim)
    shapes = [leaf.shape[max(0, leaf.ndim - rank) :] for leaf in jax.tree.leaves(like)]
    shape = (len(_REFINEMENT), *jnp.broadcast_shapes(x.shape, part.omega.shape, *shapes))
    faces = jax.tree.map(lambda a, b: jnp.broadcast_to(a, shape).astype(b.dtype), start, like)
    pieces, count = mesh.nodes.shape[0], mesh.nodes.shape[1] - 1
    ends = (end.reshape(pieces * count, -1) for end in (mesh.nodes[:, :-1], mesh.nodes[:, 1:]))
    cells = *ends, jnp.repeat(mesh.edges[:-1], count), jnp.repeat(mesh.edges[1:], count)
    # A derivative keeps one state for each cell.
    start = faces, jnp.zeros(shape[1:], x.dtype)
    return jax.lax.scan(jax.checkpoint(add_cell), start, cells, reverse=rule.down)[0]


def _missed(part: GradedPart, place: Callable[[Array], Array]) -> Array:
    """Returns by how much ln E and 4ν at the ends of a cell leave the polynomial of its inside."""

    def numbers(middles):
        middles = jnp.asarray(middles, part.x.dtype)
        reduced, e = jax.vmap(lambda middle: part.moduli(place(middle)))(middles)
        return jnp.log(reduced), 2 * e

    missed = 0.0
    for inside, ends in zip(numbers(_FINEST), numbers(_ENDS), strict=True):
        # Beside a step all polynomials are wrong, in a smooth profile the one of four values is.
        wrong, rough = (
            jnp.max(jnp.abs(ends - jnp.tensordot(_to_ends(count, inside.dtype), inside, 1)), axis=0)
            for count in (8, 4)
        )
        missed += jnp.maximum(2 * wrong - rough, 0)
    return jnp.asarray(missed)


def _to_ends(count: int, dtype: Any) -> Array:
    """Returns weights of the values at `_FINEST` in the polynomials of the outermost `count`."""
    rows = np.zeros((2, len(_FINEST)))
    for row, end, near in zip(rows, _ENDS, (slice(count), slice(-count, None)), strict=True):
        nodes = _FINEST[near]
        row[near] = [np.prod([(end - b) / (a - b) for b in nodes if b != a]) for a in nodes]
    return jnp.asarray(rows, dtype)


def span(seen: Array, bottom: Array, top: Array) -> tuple[Array, Array]:
    """Returns height of the visible part of a piece, and the depth of its top, both over d."""
    deep = 1 - top
    return jnp.clip(seen, deep, 1 - bottom) - deep, deep


def build_mesh(profile: Any, x: Array, omega: Array, num_cells: int, split: int = 1) -> Mesh:
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
            # Nodes move until every interval has the same mass.
            mass = _mass(profile, x, 1 - deep - length * (1 - fractions), omega)
            total = jnp.concatenate([jnp.zeros(1, x.dtype), jnp.cumsum(mass)])
            fractions = jnp.interp(even * total[-1], total, fractions)
            return fractions.at[0].set(0).at[-1].set(1)

        fractions = jax.lax.fori_loop(0, _REFINEMENTS, refine, even)
        return jnp.interp(jnp.linspace(0, 1, num_nodes, dtype=x.dtype), even, fractions)

    over_x = jax.vmap(nodes, (0, None, None), out_axes=1)
    table = jax.vmap(over_x, (None, 0, 0))(jnp.exp(log_x), edges[:-1], edges[1:])
    return Mesh(log_x, edges, table)


def _position(mesh, x):
    """The place of log x among the tabulated wavenumbers: index and weight."""
    log_x = jnp.log(jnp.maximum(jax.lax.stop_gradient(x), _SMALLEST))
    first, last, steps = mesh.log_x[0], mesh.log_x[-1], len(mesh.log_x) - 1
    wide = last > first
    place = jnp.where(wide, (log_x - first) / jnp.where(wide, last - first, 1), 0) * steps
    index = jnp.clip(place.astype(int), 0, steps - 1)
    return index, jnp.clip(place - index, 0, 1)


def _mass(profile, x, s, omega):
    """The weight of each interval of heights: changes of ln E and ν, decay lengths, a little."""
    modulus, poisson = moduli_at(profile, s[:, None], omega)
    modulus, poisson = (jnp.broadcast_to(a, (s.size, omega.size)) for a in (modulus, poisson))
    step, tiny = jnp.diff(s), jnp.finfo(s.dtype).tiny
    change = jnp.abs(jnp.log(modulus[1:] / modulus[:-1])) + 4 * jnp.abs(jnp.diff(poisson, axis=0))
    change = jnp.max(change, axis=1)
    middle = (s[1:] + s[:-1]) / 2
    depth = 1 - middle
    # A change of ln E over a length l weighs at a distance r as over l + r.
    length = step / jnp.maximum(change, tiny)
    near = jnp.min(length + _GROWTH * jnp.abs(middle[:, None] - middle), axis=1)
    # What a wave does not see has no thickness.
    change = step / jnp.maximum(near, tiny)
    # Decay rates and weights measured on the reference cases; they only shape the mesh.
    seen = jnp.exp(-0.2 * x * depth)
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
