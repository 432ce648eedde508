"""A stack at given wavenumbers and frequencies, and the recursion through its layers.

The recursion carries the state of a face from layer to layer: upwards what lies below it
(`upwards`), downwards what lies above it (`downwards`). A `Rule` defines the state and how it
passes a homogeneous slab. A state passes a graded layer by a solver (`layering`, `riccati`).
"""

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..blocks.profile import moduli_at
from ..blocks.stack import GradedLayer, HalfSpace, Stack, materials_of, moduli_of_all
from .slab import plane_strain


class Face(NamedTuple):
    """The state of a face, in units of its E_r and 2 μ, which are relative to a unit [Pa]."""

    state: Any
    reduced: Inexact[Array, "..."]
    shear: Inexact[Array, "..."]


def face_in(state: Any, reduced: Array, e: Array) -> Face:
    """Returns the face of a state in units of a material, by its E_r and e = 1 - 2ν."""
    return Face(state, reduced, reduced * (1 + e) / 2)


class Rule(NamedTuple):
    """One direction of the recursion: how the state changes across a slab.

    - `add(face, x, reduced, e)`: the state of a slab's other face, of x = q d, E_r in the unit of
      the column and e = 1 - 2ν.
    - `half_space(reduced, e)`: the state of its face; None if the recursion goes downwards.
    """

    add: Callable[..., Face]
    half_space: Callable[..., Face] | None

    @property
    def down(self) -> bool:
        return self.half_space is None


# The effect of what lies deeper than x = q × depth is less than 2 (1 + 2x)² e^-2x.
_WINDOW = 22.0


def visible(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Returns the fraction of a layer of x = q d [1] that a wave can see."""
    return jnp.minimum(1, _WINDOW / jnp.where(x > 0, x, 1))


class GradedPart(NamedTuple):
    """A graded layer at given wavenumbers and frequencies, or its part at one side of a cut.

    Its number in the stack, its profile, x = q d, ω, the unit of moduli [Pa], and the height s of
    the cut, if any. The part lies below the cut, above it if the rule goes downwards.
    """

    number: int
    profile: Any
    x: Float[Array, "..."]
    omega: Inexact[Array, "..."]
    unit: Float[Array, ""]
    height: Float[Array, "..."] | None = None

    def moduli(self, s: Array) -> tuple[Array, Array]:
        """E_r in the unit and e = 1 - 2ν at heights s."""
        return plane_strain(*moduli_at(self.profile, s, self.omega), self.unit)

    @property
    def seen(self) -> Array:
        """The fraction of the layer that a wave can see from its top, or from the cut."""
        # What lies deeper has no effect, so where it is cut has no derivative.
        seen = visible(jax.lax.stop_gradient(self.x))
        if self.height is None:
            return seen
        return jnp.minimum(1, seen + 1 - jax.lax.stop_gradient(self.height))


# Returns the face at the other side of a part of a graded layer.
AddGraded = Callable[[GradedPart, Face, Rule], Face]


class Run(NamedTuple):
    """Homogeneous layers in a row, surface first, and which of the stack they are.

    Thickness [m], E_r in the unit of the column, and e = 1 - 2ν.
    """

    members: slice
    thickness: Float[Array, "layers *#w"]
    reduced: Inexact[Array, "layers *#w"]
    e: Inexact[Array, "layers *#w"]


class Column(NamedTuple):
    """A stack at given wavenumbers and frequencies.

    `runs`: from the surface downwards, homogeneous layers in a row, and graded layers.
    `base`: E_r and e of a half space, or the base itself. `unit`: of moduli [Pa].
    """

    runs: tuple[Run | GradedPart, ...]
    base: Any
    unit: Float[Array, ""]
    q: Float[Array, "..."]


def column_of(stack: Stack, q: Float[Array, "..."], omega: Inexact[Array, "..."]) -> Column:
    """Returns the column of a stack."""
    graded = [layer for layer in stack.layers if isinstance(layer, GradedLayer)]
    modulus, poisson = moduli_of_all(materials_of(stack), omega)
    # Its ends are enough for a unit, which need not be the largest of all.
    ends = [moduli_at(g.profile, end + 0 * q, omega)[0] for g in graded for end in (0, 1)]
    # In one unit: products of moduli in pascals leave the range of float32.
    unit = unit_of_moduli([*ends, modulus])
    reduced, e = plane_strain(modulus / unit, poisson)
    thickness = in_rows([layer.thickness for layer in stack.layers], q)
    runs, first, known = [], 0, 0  # numbers of layers, and of homogeneous ones, so far
    for is_graded, layers in groupby(stack.layers, lambda layer: isinstance(layer, GradedLayer)):
        count = len([*layers])
        if is_graded:
            for i in range(first, first + count):
                layer: Any = stack.layers[i]
                runs.append(GradedPart(i, layer.profile, q * layer.thickness, omega, unit))
        else:
            members, rows = slice(first, first + count), slice(known, known + count)
            runs.append(Run(members, thickness[members], reduced[rows], e[rows]))
            known += count
        first += count
    base = (reduced[-1], e[-1]) if isinstance(stack.base, HalfSpace) else stack.base
    return Column(tuple(runs), base, unit, q)


def in_rows(numbers: Any, like: Array) -> Array:
    """Returns numbers on a first axis, followed by as many axes as `like` has.

    Without these the first axis would broadcast against waves.
    """
    return jnp.array(numbers, like.dtype).reshape(-1, *[1] * like.ndim)


def unit_of_moduli(moduli: Sequence[Array]) -> Array:
    """Returns the largest modulus, a unit without derivative.

    In units of it derivatives in float32 neither overflow nor underflow.
    """
    sizes = [jnp.max(jnp.abs(modulus)) for modulus in moduli if modulus.size]
    return jax.lax.stop_gradient(jnp.max(jnp.array(sizes)))


def climb_through(
    column: Column, face: Face, rule: Rule, add_graded: AddGraded | None, parts=None, heights=None
) -> Face:
    """Returns the state at the other end of a column from that at one end.

    **Arguments:**

    - `face`: at the base, or for a `rule` that goes downwards at the surface.
    - `parts`: what is there of the thickness of each layer [m], on a first axis; None for all.
    - `heights`: s at which each graded layer is cut, by its number; None for no cut.
    """

    def add_layer(face, layer):
        d, reduced, e = layer
        return rule.add(face, column.q * d, reduced, e)

    for run in column.runs if rule.down else reversed(column.runs):
        if isinstance(run, GradedPart):
            assert add_graded is not None
            cut = None if heights is None else heights[run.number]
            face = add_graded(run._replace(height=cut), face, rule)
            continue
        thickness = run.thickness if parts is None else parts[run.members]
        layers = (thickness, run.reduced, run.e)
        face = scan_layers(add_layer, face, layers, reverse=not rule.down)
    return face


def scan_layers(step, face: Any, layers: tuple[Any, ...], *, reverse: bool) -> Any:
    """Returns `face` after the steps through `layers`, arrays with the layers on a first axis.

    The carry of a scan keeps its shapes and dtypes: it begins with the ones that it ends with.
    """
    like = stable_shape(lambda face: step(face, jax.tree.map(lambda part: part[0], layers)), face)
    # A derivative computes a step again: to store and load its numbers takes longer.
    add = jax.checkpoint(lambda *given: (cast_like(step(*given), like), None), prevent_cse=False)
    return jax.lax.scan(add, cast_like(face, like), layers, reverse=reverse)[0]


def stable_shape(step: Callable[[Any], Any], face: Any) -> Any:
    """Returns shapes and dtypes that no further `step` changes."""

    def common(a, b):
        shape = jnp.broadcast_shapes(a.shape, b.shape)
        return jax.ShapeDtypeStruct(shape, jnp.result_type(a, b))

    # The first step may widen what the second one gets.
    for _ in range(2):
        face = jax.tree.map(common, face, jax.eval_shape(step, face))
    return face


def cast_like(new: Any, old: Any) -> Any:
    """Returns `new` with the shapes and dtypes of `old`."""
    return jax.tree.map(lambda n, o: jnp.broadcast_to(n, o.shape).astype(o.dtype), new, old)
