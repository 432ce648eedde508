"""A stack at given wavenumbers and frequencies, and the recursion through its layers.

The recursion carries the state of a face from layer to layer: upwards what lies below it (`below`),
downwards what lies above it (`depth`). A `Rule` defines the state and how it passes a homogeneous
slab. A state passes a graded layer by a solver (`grading`).
"""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..blocks.bond import Bond, Give
from ..blocks.profile import moduli_at
from ..blocks.stack import (
    GradedLayer,
    HalfSpace,
    Stack,
    by_kind,
    concatenated,
    materials_of,
    moduli_of_all,
)
from .slab import Compliance, plane_strain


class Face(NamedTuple):
    """The state of a face, in units of its E_r and 2 μ, which are relative to a unit [Pa]."""

    state: Any
    reduced: Inexact[Array, "..."]
    shear: Inexact[Array, "..."]


def face_in(state: Any, reduced: Array, e: Array) -> Face:
    """Returns the face of a state in units of a material, by its E_r and e = 1 - 2ν."""
    return Face(state, reduced, reduced * (1 + e) / 2)


class Carried(NamedTuple):
    """A symmetric matrix with its determinant, in plane; antiplane; and a traction (t, s, T)."""

    plane: Compliance
    antiplane: Any = None
    traction: Any = None


class Rule(NamedTuple):
    """How a recursion passes its state from face to face.

    - `add(face, x, reduced, e)`: the state of a slab's other face, of x = q d, E_r in the unit of
      the column and e = 1 - 2ν.
    - `join(face, give)`: the state of the other face of a bond, see `scaled`.
    - `half_space(reduced, e)`: the state of its face; None if the recursion goes downwards.
    - `numbers(face, reference, inverse)`: a state as the `Carried` that `Riccati` integrates, in
      units of E_ref = `reference`, and `face(numbers, reference, inverse, e)` back. Where
      `inverse`, compliances are inverse ones.
    """

    add: Callable[..., Face]
    join: Callable[[Face, Give], Face]
    half_space: Callable[..., Face] | None
    numbers: Callable[..., Carried]
    face: Callable[..., Face]

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

    Its number in the stack, its profile, x = q d, ω, the unit of moduli [Pa], its bond, if any, and
    the height s of the cut, if any. The part lies below the cut, above it if the rule goes
    downwards.
    """

    number: int
    profile: Any
    x: Float[Array, "..."]
    omega: Inexact[Array, "..."]
    unit: Float[Array, ""]
    bond: Give | None = None
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

    Thickness [m], E_r in the unit of the column, and e = 1 - 2ν; bonds, None if all are perfect.
    """

    members: slice
    thickness: Float[Array, "layers *#w"]
    reduced: Inexact[Array, "layers *#w"]
    e: Inexact[Array, "layers *#w"]
    bond: Give | None = None


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
                bond = _bonds([layer], omega, unit, q)
                bond = None if bond is None else Give(*(part[0] for part in bond))
                runs.append(GradedPart(i, layer.profile, q * layer.thickness, omega, unit, bond))
        else:
            members, rows = slice(first, first + count), slice(known, known + count)
            bonds = _bonds(stack.layers[members], omega, unit, q)
            runs.append(Run(members, thickness[members], reduced[rows], e[rows], bonds))
            known += count
        first += count
    base = (reduced[-1], e[-1]) if isinstance(stack.base, HalfSpace) else stack.base
    return Column(tuple(runs), base, unit, q)


def _bonds(layers, omega, unit, q) -> Give | None:
    """The bonds of layers on a first axis, their gives in units of 2/(E q), E the unit."""
    if all(layer.bond is None for layer in layers):
        return None
    bonds = [Bond() if layer.bond is None else layer.bond for layer in layers]
    rows, order = by_kind(lambda bond: bond.gives(omega), bonds)
    parts = (concatenated(part, omega.ndim)[order] for part in zip(*rows, strict=True))
    normal, normal_give, shear, shear_give = parts
    return Give(normal / unit, normal_give * q / 2, shear / unit, shear_give * q / 2)


def scaled(give: Give, reduced: Array) -> Give:
    """Returns a bond in units of 2/(E_r q), E_r in the unit of the column, by numbers near 1.

    Only ratios count: a perfect bond and a smooth interface are such numbers, too.
    """
    pairs = [(give[i], give[i + 1] * reduced) for i in (0, 2)]
    sizes = [jax.lax.stop_gradient(sum(map(jnp.abs, pair))) for pair in pairs]
    return Give(*(p / size for pair, size in zip(pairs, sizes, strict=True) for p in pair))


def _where_there(bond: Give, there: Array) -> Give:
    """A bond that is perfect except where it is `there`."""
    parts = (
        jnp.where(there, part, perfect) for part, perfect in zip(bond, (1, 0, 1, 0), strict=True)
    )
    return Give(*parts)


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
    column: Column, face: Face, rule: Rule, add_graded: AddGraded | None, parts=None, heights=None,
    bonds=None,
) -> Face:  # fmt: skip
    """Returns the state at the other end of a column from that at one end.

    **Arguments:**

    - `face`: at the base, or for a `rule` that goes downwards at the surface.
    - `parts`: what is there of the thickness of each layer [m], on a first axis; None for all.
    - `heights`: s at which each graded layer is cut, by its number; None for no cut.
    - `bonds`: whether the bond of each layer is there, on a first axis; None for all.
    """

    def add_layer(face, layer):
        d, reduced, e = layer
        return rule.add(face, column.q * d, reduced, e)

    def step(face, layer):
        return _with_bond(partial(add_layer, layer=layer[:3]), face, rule, *layer[3:])

    for run in column.runs if rule.down else reversed(column.runs):
        members = run.members if isinstance(run, Run) else run.number
        bond = run.bond
        if bond is not None and bonds is not None:
            bond = _where_there(bond, bonds[members])
        if isinstance(run, GradedPart):
            assert add_graded is not None
            cut = None if heights is None else heights[run.number]
            part = run._replace(height=cut)
            face = _with_bond(
                lambda face, part=part: add_graded(part, face, rule), face, rule, bond
            )
            continue
        thickness = run.thickness if parts is None else parts[members]
        layers = (thickness, run.reduced, run.e, *(() if bond is None else (bond,)))
        face = scan_layers(step, face, layers, reverse=not rule.down)
    return face


def _with_bond(add: Callable[[Face], Face], face: Face, rule: Rule, bond: Give | None = None):
    """The other face of a layer and of the bond at its lower side."""
    if bond is None:
        return add(face)
    return rule.join(add(face), bond) if rule.down else add(rule.join(face, bond))


def scan_layers(step, face: Any, layers: tuple[Any, ...], *, reverse: bool) -> Any:
    """Returns `face` after the steps through `layers`, arrays with the layers on a first axis.

    The carry of a scan keeps its shapes and dtypes: it has from the start those of its end.
    """
    if len(layers[0]) == 0:
        return face
    like = stable_shape(lambda face: step(face, jax.tree.map(lambda part: part[0], layers)), face)
    # A derivative computes a step again: to store and load its numbers takes longer.
    add = jax.checkpoint(lambda *given: (cast_like(step(*given), like), None), prevent_cse=False)
    return jax.lax.scan(
        add,
        cast_like(face, like),
        layers,
        reverse=reverse,
    )[0]


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
