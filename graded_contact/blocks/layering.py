"""Graded layers as homogeneous layers with the moduli at their middle heights, extrapolated.

On a mesh adapted to the profile and to each wavenumber every cell is cut n-fold. The error is even
in 1/n within every cell of any mesh, so that extrapolation in 1/n²
(Richardson, Phil. Trans. R. Soc. A 226 (1927) 299, doi:10.1098/rsta.1927.0008) over n = 1, 2, 3, 4,
6, 8 gives order 12. The layers themselves are exact (`slab`), passive, and need no derivative of
the profile.

"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..core.checks import Numbers, as_float, check_type, check_types, check_whole
from ..materials.material import AbstractMaterial
from .column import Face, Rule, cast_like, stable_shape
from .grading import AbstractGradedSolver, as_tolerance, rounding
from .mesh import Mesh, build_mesh, cells_of, coarsened, position, span, visible
from .profile import moduli_at
from .slab import plane_strain
from .stack import GradedLayer, Layer, Stack

# Layers per cell of the mesh. Longer rows gain order but lose digits to their weights.
_REFINEMENT = (1, 2, 3, 4, 6, 8)
_SUBLAYERS = {
    "level": np.repeat(np.arange(len(_REFINEMENT)), _REFINEMENT),
    "middle": np.concatenate([(np.arange(n) + 0.5) / n for n in _REFINEMENT]),
    "width": np.concatenate([np.full(n, 1 / n) for n in _REFINEMENT]),
    "first": np.concatenate([np.arange(n) == 0 for n in _REFINEMENT]),
}
_LAST = np.cumsum(_REFINEMENT) - 1  # the last sublayer of each refinement
# How much finer the mesh of a second attempt is.
_SPLIT = 5


class Layering(AbstractGradedSolver):
    """Homogeneous layers at middle heights, extrapolated.

    If the error estimate exceeds the tolerance anywhere, everything is done again on a mesh of
    five times as many cells.

    **Fields:**

    - `num_cells`: cells of the mesh of each graded layer, 24 layers of work each; by default
      chosen for the tolerance. Static.
    - `retry`: whether to try the finer mesh. Static.
    - `rtol`: relative tolerance; by default 1e-9, in float32 1e-4. Static.
    """

    num_cells: int | None = eqx.field(static=True, default=None)
    retry: bool = eqx.field(static=True, default=True)
    rtol: float | None = eqx.field(static=True, default=None, converter=as_tolerance)

    def __check_init__(self):
        if self.num_cells is not None:
            check_whole("num_cells", self.num_cells, 1)
        check_type("retry", self.retry, bool)

    def solve(self, climb, measure, stack, q, omega, rtol):
        num_cells = self.num_cells
        if num_cells is None:
            # The error goes as the number of cells to the power -12, estimates as -11.
            num_cells = int(np.ceil(12 * (1e-9 / rtol) ** (1 / 11)))
        split = _SPLIT if self.retry else 1
        meshes = {
            i: build_mesh(layer.profile, q * layer.thickness, omega, num_cells, split)
            for i, layer in enumerate(stack.layers)
            if isinstance(layer, GradedLayer)
        }

        def extrapolated(meshes):
            def add(i, face, rule, unit, height):
                return add_layered(stack.layers[i], face, q, omega, meshes[i], rule, unit, height)

            return _extrapolated(climb(add), measure, rounding(q))

        found = extrapolated({i: coarsened(mesh, split) for i, mesh in meshes.items()})
        if not self.retry:
            return found
        # A derivative recomputes the finer one rather than store it.
        finer = jax.checkpoint(extrapolated)
        values, error = jax.lax.cond(jnp.all(found[1] <= rtol), lambda _: found, finer, meshes)
        return values, error


def _extrapolated(levels, measure, floor):
    def combine(first, last):
        weights = np.asarray(_weights(_REFINEMENT[first:last]))
        return [_weighted(weights, part[first:][: len(weights)]) for part in levels]

    def without(first, last):
        differences = [a - b for a, b in zip(values, combine(first, last), strict=True)]
        return measure(differences, values)

    values = combine(0, len(_REFINEMENT))
    # Without the coarsest refinement it falls short of the error on the reference cases, up to
    # fifty times where a cell is deep, and without the finest it exceeds it as much; three times
    # their geometric mean does neither.
    error = 3 * jnp.sqrt(without(1, len(_REFINEMENT))) * jnp.sqrt(without(0, -1))
    return tuple(values), jax.lax.stop_gradient(error) + floor


def _weighted(weights, part):
    weights = jnp.asarray(weights, part.real.dtype).reshape(-1, *(1,) * (part.ndim - 1))
    return jnp.sum(weights * part, axis=0)


def _weights(levels):
    """Weights that extrapolate a function even in 1/n from n = `levels` to infinity."""
    squares = np.asarray(levels, float) ** 2
    return [float(np.prod([a / (a - b) for b in squares if b != a])) for a in squares]


def add_layered(
    layer: GradedLayer,
    face: Face,
    q: Array,
    omega: Array,
    mesh: Mesh,
    rule: Rule,
    unit: Array,
    height: Array | None = None,
) -> Face:
    """Returns the other face of a graded layer for every refinement, along a new first axis.

    `face` may have that axis already. With a `height` only the part below is passed, above if the
    rule goes downwards.
    """
    x = q * layer.thickness
    index, weight = position(mesh, x)
    seen = visible(jax.lax.stop_gradient(x))
    if height is not None:  # what lies below a cut is seen from there
        seen = jnp.minimum(1, seen + 1 - jax.lax.stop_gradient(height))

    def at(s):
        modulus, poisson = moduli_at(layer.profile, s, omega)
        return plane_strain(modulus, poisson, unit)

    def add_cell(faces, cell):
        low, high = (
            cell[end][index] * (1 - weight) + cell[end][index + 1] * weight
            for end in ("low", "high")
        )
        length, deep = span(seen, cell["bottom"], cell["top"])
        if height is not None:  # as a fraction of what is seen of the piece
            place = 1 - (1 - deep - height) / jnp.where(length > 0, length, 1)
            clip = jnp.maximum if rule.down else jnp.minimum
            low, high = clip(low, place), clip(high, place)

        def add_sublayer(state, sublayer):
            first = jax.tree.map(lambda part: part[sublayer["level"]], faces)
            state = jax.tree.map(lambda a, b: jnp.where(sublayer["first"], a, b), first, state)
            s = 1 - deep - length * (1 - low - (high - low) * sublayer["middle"])
            depth = x * (length * (high - low) * sublayer["width"])
            state = cast_like(rule.add(state, depth, *at(s)), state)
            return state, state

        replaced = jax.tree.map(lambda part: part[0], faces)
        _, found = jax.lax.scan(
            jax.checkpoint(add_sublayer), replaced, _sublayers(x.dtype, rule.down)
        )
        return jax.tree.map(lambda part: part[_LAST], found), None

    start = face
    if rule.half_space is not None:
        entry = rule.half_space(*at(1 - seen))
        start = jax.tree.map(lambda a, b: jnp.where(seen < 1, a, b), entry, face)
    like = stable_shape(lambda state: rule.add(state, x, *at(seen)), start)
    rank = max(q.ndim, omega.ndim)
    shapes = [part.shape[max(0, part.ndim - rank) :] for part in jax.tree.leaves(like)]
    shape = (len(_REFINEMENT), *jnp.broadcast_shapes(q.shape, omega.shape, *shapes))
    faces = jax.tree.map(lambda a, b: jnp.broadcast_to(a, shape).astype(b.dtype), start, like)
    # The first axis of cells is what is scanned; a derivative keeps one state for each of them.
    return jax.lax.scan(jax.checkpoint(add_cell), faces, cells_of(mesh), reverse=rule.down)[0]


def _sublayers(dtype, down):
    """Counted in the direction in which they are passed."""
    found = {
        name: jnp.asarray(values, dtype if values.dtype.kind == "f" else None)
        for name, values in _SUBLAYERS.items()
    }
    return {**found, "middle": 1 - found["middle"]} if down else found


class _AtHeight(AbstractMaterial):
    """The material of a graded layer at one height."""

    profile: Any
    height: Float[Array, ""]

    def modulus(self, omega: Numbers) -> Inexact[Array, "*w"]:
        omega = as_float(omega, "omega")
        return jnp.broadcast_to(self.profile(self.height, omega)[0], omega.shape)

    def poisson_ratio(self, omega: Numbers) -> Inexact[Array, "..."]:
        return jnp.asarray(self.profile(self.height, as_float(omega, "omega"))[1])

    def at(self, temperature: ScalarLike) -> "_AtHeight":
        return _AtHeight(self.profile.at(temperature), self.height)


@check_types
def sliced(stack: Stack, num_slices: int) -> Stack:
    """Returns the stack with every graded layer cut into equal layers of its middle moduli.

    For export, or as a check: its error is even in 1/n for n slices, so that with values f(n)
    (4 f(2n) - f(n))/3 is two orders better. Nothing here needs it.

    **Arguments:**

    - `stack`: with graded layers.
    - `num_slices`: of each graded layer.

    **Returns:** a stack of homogeneous layers.

    **Raises:** `ValueError` if `num_slices` is less than 1.
    """
    check_whole("num_slices", num_slices, 1)
    layers = []
    for layer in stack.layers:
        if isinstance(layer, Layer):
            layers.append(layer)
            continue
        heights = 1 - (jnp.arange(num_slices) + 0.5) / num_slices
        layers += [
            Layer(_AtHeight(layer.profile, s), layer.thickness / num_slices) for s in heights
        ]
    return Stack(layers=layers, base=stack.base)
