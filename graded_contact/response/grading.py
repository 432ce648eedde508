"""The recursion through a stack with graded layers, and the interface of their solvers.

The recursion carries the state of a face through the layers. A `Rule` defines the state and how it
passes a homogeneous slab: the rule of M_zz is below, that of the full compliance in `matrix`, that
of what lies above a depth in `interior`. A state passes a graded layer by an
`AbstractGradedSolver`. There are two, `Layering` and `Riccati`. Both estimate the error of their
result; an error above the tolerance is raised.
"""

import abc
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Inexact

from ..core.checks import Numbers, as_float, check_together, check_tolerance, check_values
from ..rheology.measured import check_frequencies
from .profile import check_profile, moduli_at
from .recursion import cast_like, largest, stable_shape
from .slab import (
    Compliance,
    factors,
    free,
    half_space,
    in_units,
    plane_strain,
    reciprocal,
    rigid,
    stack_on,
    times,
)
from .stack import Free, GradedLayer, HalfSpace, Rigid, Stack


class Cut(NamedTuple):
    """A height s in a graded layer, which separates two parts of it."""

    height: Float[Array, "..."]
    upper: bool


class Rule(NamedTuple):
    """The state that a recursion passes from face to face.

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
    """Returns a column of layers with these moduli, (E, ν) [Pa, 1]; None for graded ones.

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
    - `cuts`: where each graded layer is cut.
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
    like = stable_shape(lambda face: step(face, first), face)
    steps = jax.lax.scan(
        lambda face, layer: (cast_like(step(face, layer), like), None),
        cast_like(face, like),
        tuple(run),
        reverse=not down,
    )
    return steps[0]


def _stacked(values: Sequence[Any], like: Array) -> Array:
    """Stacks per-layer values of unlike shapes and dtypes, each filled up to the rank of `like`."""
    stacked = jnp.stack(jnp.broadcast_arrays(*map(jnp.asarray, values)))
    missing = (1,) * (like.ndim + 1 - stacked.ndim)
    return stacked.reshape(len(values), *missing, *stacked.shape[1:])


# Rounding: what no refinement removes, and the tightest tolerance worth trying.
_FLOOR, _REFUSED_BELOW = 100.0, 400.0
_NOT_REACHED = (
    "The tolerance was not reached in a graded layer: its profile varies too sharply. Put "
    "boundaries between layers at its jumps and list its kinks in `breaks`, pass a larger "
    "`rtol`, or read `graded_compliance(..., throw=False).error`."
)


class AbstractGradedSolver(eqx.Module):
    """A way to pass the graded layers of a stack.

    **Fields:**

    - `rtol`: relative tolerance; by default 1e-9, in float32 1e-4. Static.
    """

    rtol: eqx.AbstractVar[float | None]

    @abc.abstractmethod
    def solve(
        self,
        climb: Callable[[AddGraded], tuple[Array, ...]],
        measure: Callable[[Sequence[Array], Sequence[Array]], Float[Array, "*w"]],
        stack: Stack,
        q: Float[Array, "..."],
        omega: Float[Array, "..."],
        rtol: float,
    ) -> tuple[tuple[Array, ...], Float[Array, "*w"]]:
        """Returns the values that `climb` finds, and their estimated error.

        **Arguments:**

        - `climb`: a recursion through the stack, given what adds a graded layer to it. It may find
          values with more axes in front.
        - `measure`: the error [1] that `differences` of these `values` are.
        - `stack`, `q`, `omega`: what it climbs through; wavenumbers [rad/m] and frequencies [rad/s]
          of equal rank.
        - `rtol`: the target error.
        """


def check_profiles(stack: Stack, omega: Float[Array, "..."]) -> None:
    """Raises `ValueError` for frequencies that a table refuses, or a profile that is not usable.

    Of a profile it names the layer and the height.
    """
    check_frequencies(stack, omega)
    for i, layer in enumerate(stack.layers):
        if isinstance(layer, GradedLayer):
            check_profile(f"layers[{i}].profile", layer.profile, omega)


def as_waves(stack: Stack, **arrays: Numbers) -> tuple[Array, ...]:
    """Returns components of wavevectors [rad/m] and, the last, `omega` [rad/s], of equal rank.

    So a modulus is computed once for each entry of `omega`. Refuses what is not finite, does not
    broadcast, or is outside of what the materials and profiles of the stack allow.
    """
    waves = {name: as_float(value, name) for name, value in arrays.items()}
    for name, value in waves.items():
        check_values(name, value, "wavenumbers and frequencies must be finite")
    check_together(**waves)
    check_profiles(stack, waves["omega"])
    rank = max(value.ndim for value in waves.values())
    return tuple(x.reshape((1,) * (rank - x.ndim) + x.shape) for x in waves.values())


def graded_tolerance(graded_solver: AbstractGradedSolver, rtol: float | None, like: Array) -> float:
    """Returns the tolerance to use, refusing what the dtype of `like` cannot reach."""
    rtol = graded_solver.rtol if rtol is None else rtol
    if rtol is None:
        return 1e-9 if like.dtype == jnp.float64 else 1e-4
    check_tolerance("rtol", rtol, like, floor_factor=_REFUSED_BELOW)
    return float(rtol)


def as_tolerance(rtol: float | None) -> float | None:
    """Returns the field `rtol` of a solver, refused if no dtype can reach it."""
    if rtol is None:
        return None
    check_tolerance("rtol", rtol, np.zeros(0), floor_factor=_REFUSED_BELOW)
    return float(rtol)


def rounding(like: Array) -> float:
    """Returns the relative error that no refinement removes, for the dtype of `like`."""
    return _FLOOR * float(jnp.finfo(like.dtype).eps)


def solve_graded(
    graded_solver: AbstractGradedSolver,
    climb: Callable[[AddGraded], tuple[Array, ...]],
    measure: Callable[[Sequence[Array], Sequence[Array]], Float[Array, "*w"]],
    stack: Stack,
    q: Float[Array, "..."],
    omega: Float[Array, "..."],
    rtol: float,
    throw: bool,
) -> tuple[tuple[Array, ...], Float[Array, "*w"]]:
    """Returns the values and the error from `graded_solver`; the error may be one to raise."""
    values, error = graded_solver.solve(climb, measure, stack, q, omega, rtol)
    error = jax.lax.stop_gradient(error)
    if throw:
        # Written so that NaN fails.
        values = eqx.error_if(values, jnp.any(~(error <= rtol)), _NOT_REACHED)
    return values, error


class Face(NamedTuple):
    """In-plane compliance of a face in units of 2/(E_r q), and that E_r."""

    state: Compliance
    reduced: Inexact[Array, "..."]


def surface_climb(
    stack: Stack, q: Float[Array, "..."], omega: Float[Array, "..."]
) -> Callable[[AddGraded], tuple[Array]]:
    """Returns the recursion that finds M_zz [m/Pa]."""
    column = column_of(stack, q, omega)
    face = None
    if isinstance(column.base, Rigid):
        face = Face(rigid(q), jnp.ones_like(q))
    elif not isinstance(column.base, Free):
        face = _half_space(*column.base)

    def climb(add_graded):
        top = climb_through(column, face, _RULE, add_graded)
        return (top.state.c22 * (2 / column.unit) / (top.reduced * q),)

    return climb


def relative(differences: Sequence[Array], values: Sequence[Array]) -> Float[Array, "*w"]:
    """Returns the relative error of one value."""
    return jnp.abs(differences[0]) / jnp.abs(values[0])


def _add(
    face: Face | None, x: Array, reduced: Array, e: Array, lowest: Bool[Array, "..."] | None = None
) -> Face:
    if face is None:
        return Face(free(x, e), reduced)
    ratio = times(reciprocal(face.reduced), reduced)
    state = stack_on(face.state, factors(x, e), ratio)
    if lowest is not None:
        hanging = free(jnp.where(lowest, x, 1), e)
        state = jax.tree.map(lambda a, b: jnp.where(lowest, a, b), hanging, state)
    return Face(state, reduced)


def _half_space(reduced: Array, e: Array) -> Face:
    return Face(half_space(e), reduced)


def _numbers(face: Face, reference: Array, inverse: bool) -> Carried:
    state = in_units(face.state, reference / face.reduced)
    return Carried(invert(state) if inverse else state)


def _face(numbers: Carried, reference: Array, inverse: bool, _: Array) -> Face:
    return Face(invert(numbers.plane) if inverse else numbers.plane, reference)


_RULE = Rule(_add, _half_space, _numbers, _face)


def invert(c: Compliance) -> Compliance:
    """Returns the inverse of a symmetric 2×2 matrix that carries its determinant."""
    return Compliance(c.c22 / c.det, -c.c12 / c.det, c.c11 / c.det, 1 / c.det)
