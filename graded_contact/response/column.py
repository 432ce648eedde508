"""The recursion that carries the state of a face through the layers of a stack.

What a state is, and how it passes a homogeneous slab, says a `Rule`: that of M_zz stands in
`grading`, that of the full compliance in `matrix`, that of what lies above a depth in `interior`.
How it passes a graded layer says a solver (`grading.AbstractGradedSolver`).
"""

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from .profile import moduli_at
from .recursion import largest
from .slab import Compliance, plane_strain
from .stack import Free, GradedLayer, HalfSpace, Rigid, Stack


class Cut(NamedTuple):
    """A height s in a graded layer, and which part of the layer is meant."""

    height: Float[Array, "..."]
    upper: bool


class Rule(NamedTuple):
    """What a recursion carries from face to face.

    - `add(face, x, reduced, e, lowest)`: the state of a slab's other face, of x = q d, E_r in the
      unit of the column and e = 1 - 2ν. If there is nothing below, `face` is None, or `lowest` a
      mask of where.
    - `half_space(reduced, e)`: the state of its face; None if the recursion goes downwards.
    - `numbers(face, reference, inverse)`: a state as the `Carried` that `Riccati` integrates, in
      units of E_ref = `reference`, and `face(numbers, reference, inverse, e)` back. If `inverse`,
      compliances are inverse ones.
    """

    add: Callable[..., Any]
    half_space: Callable[..., Any] | None
    numbers: Callable[..., "Carried"]
    face: Callable[..., Any]


class Carried(NamedTuple):
    """A symmetric matrix with its determinant, in plane; antiplane; and a traction (t, s, T)."""

    plane: Compliance
    antiplane: Any = None
    traction: Any = None


# Adds to a face the graded layer of this number, by a rule and the unit of moduli, or a part of it.
AddGraded = Callable[[int, Any, Rule, Array, Cut | None], Any]


class Run(NamedTuple):
    """Homogeneous layers in a row, surface first: E_r in the unit of the column, and e = 1 - 2ν."""

    thickness: Float[Array, "layers *#w"]
    reduced: Inexact[Array, "layers *#w"]
    e: Inexact[Array, "layers *#w"]


class Column(NamedTuple):
    """A stack at given wavenumbers and frequencies.

    `runs`: from the surface downwards, homogeneous layers in a row, and numbers of graded layers.
    `base`: E_r and e of a half space, or the base itself. `unit`: of moduli [Pa].
    """

    runs: tuple[Run | int, ...]
    base: Any
    unit: Float[Array, ""]
    q: Float[Array, "..."]


def column_of(stack: Stack, q: Float[Array, "..."], omega: Float[Array, "..."]) -> Column:
    """Returns the column of a stack."""
    moduli, ends = [], []
    for layer in stack.layers:
        if isinstance(layer, GradedLayer):
            moduli.append(None)
            ends += [moduli_at(layer.profile, end + 0 * q, omega)[0] for end in (0, 1)]
        else:
            moduli.append((layer.material.modulus(omega), layer.material.poisson_ratio(omega)))
    base = stack.base
    if isinstance(base, HalfSpace):
        base = (base.material.modulus(omega), base.material.poisson_ratio(omega))
    return column([layer.thickness for layer in stack.layers], moduli, base, q, ends)


def column(thickness, moduli, base, q, others=()) -> Column:
    """Returns a column of layers with these moduli, (E, ν) [Pa, 1]; None stands for graded ones.

    `others` are moduli [Pa] that occur besides.
    """
    known = [*filter(None, moduli), *(() if isinstance(base, Rigid | Free) else (base,))]
    unit = largest([*others, *(jnp.asarray(modulus) for modulus, _ in known)])

    def reduced(pair):
        modulus, poisson = map(jnp.asarray, pair)
        return plane_strain(modulus / unit, poisson)

    runs = []
    for graded, members in groupby(range(len(moduli)), lambda i: moduli[i] is None):
        members = list(members)
        if graded:
            runs += members
        else:
            parts = zip(*(reduced(moduli[i]) for i in members), strict=True)
            sizes = [thickness[i] for i in members]
            runs.append(Run(*(_stacked(values, q) for values in (sizes, *parts))))
    base = base if isinstance(base, Rigid | Free) else reduced(base)
    return Column(tuple(runs), base, unit, q)


def climb_through(
    column: Column,
    face: Any,
    rule: Rule,
    add_graded: AddGraded | None,
    *,
    parts: Sequence[Array] | None = None,
    cuts: dict[int, Cut] | None = None,
) -> Any:
    """Returns the state at the other end of a column from that at one end.

    **Arguments:**

    - `face`: at the base, or for a `rule` that goes downwards at the surface.
    - `parts`: what is there of the thickness of each homogeneous layer [m].
    - `cuts`: likewise where a graded layer is cut.
    """
    down = rule.half_space is None
    start = 0
    numbered = []
    for run in column.runs:
        numbered.append((start, run))
        start += 1 if isinstance(run, int) else len(run.reduced)
    for first, run in numbered if down else reversed(numbered):
        if isinstance(run, int):
            assert add_graded is not None
            cut = None if cuts is None else cuts[run]
            face = add_graded(run, face, rule, column.unit, cut)
            continue
        if parts is not None:
            run = run._replace(
                thickness=_stacked(parts[first : first + len(run.reduced)], column.q)
            )
        face = _through(run, column.q, face, rule, down)
    return face


def _through(run, q, face, rule, down):
    if face is None:
        *run, (d, reduced, e) = (part[:-1] for part in run), (part[-1] for part in run)
        run = Run(*run[0])
        face = rule.add(None, q * d, reduced, e)
    if len(run.reduced) == 0:
        return face

    def step(face, layer):
        d, reduced, e = layer
        return rule.add(face, q * d, reduced, e)

    # The carry keeps one shape and dtype from the first step on.
    first = jax.tree.map(lambda part: part[0], tuple(run))
    like = settled_shape(lambda face: step(face, first), face)
    steps = jax.lax.scan(
        lambda face, layer: (kept(step(face, layer), like), None),
        kept(face, like),
        tuple(run),
        reverse=not down,
    )
    return steps[0]


def settled_shape(step: Callable[[Any], Any], face: Any) -> Any:
    """Returns shapes and dtypes that no further `step` changes."""
    for _ in range(2):
        after = jax.eval_shape(step, face)
        face = jax.tree.map(
            lambda a, b: jax.ShapeDtypeStruct(
                jnp.broadcast_shapes(a.shape, b.shape), jnp.result_type(a, b)
            ),
            face,
            after,
        )
    return face


def kept(new: Any, old: Any) -> Any:
    """Returns `new` with the shapes and dtypes of `old`, as the carry of a scan must have."""
    return jax.tree.map(lambda n, o: jnp.broadcast_to(n, o.shape).astype(o.dtype), new, old)


def _stacked(values: Sequence[Any], like: Array) -> Array:
    """Stacks per-layer values of unlike shapes and dtypes, each filled up to the rank of `like`."""
    stacked = jnp.stack(jnp.broadcast_arrays(*map(jnp.asarray, values)))
    missing = (1,) * (like.ndim + 1 - stacked.ndim)
    return stacked.reshape(len(values), *missing, *stacked.shape[1:])
