"""The recursion through a stack with graded layers, and the interface of their solvers.

The recursion carries the state of a face through the layers. A `Rule` defines the state and how it
passes a homogeneous slab: the rule of M_zz is in `compliance`, that of the full compliance in
`matrix`, that of the part above a depth in `depth`. A state passes a graded layer by an
`AbstractGradedSolver`. There are two, `Layering` and `Riccati`. Both estimate the error of their
result; an error above the tolerance is raised.
"""

import abc
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from types import MappingProxyType
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..core.checks import (
    Numbers,
    as_float,
    check_together,
    check_tolerance,
    check_values,
    is_concrete,
)
from ..materials.coverage import check_frequencies
from .profile import check_profile, moduli_at
from .recursion import cast_like, largest, stable_shape
from .slab import Compliance, plane_strain
from .stack import Free, GradedLayer, HalfSpace, Rigid, Stack, check_at_rest, is_graded


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

    @property
    def down(self) -> bool:
        return self.half_space is None


class Carried(NamedTuple):
    """A symmetric matrix with its determinant, in plane; antiplane; and a traction (t, s, T)."""

    plane: Compliance
    antiplane: Any = None
    traction: Any = None


# Adds to a face the graded layer of this number, by a rule and the unit of moduli; or its part
# below a height s, above s if the rule goes downwards.
AddGraded = Callable[[int, Any, Rule, Array, Array | None], Any]


class Run(NamedTuple):
    """Homogeneous layers in a row, surface first, by their numbers in the stack.

    Thickness [m], E_r in the unit of the column, and e = 1 - 2ν.
    """

    members: tuple[int, ...]
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
        members = tuple(members)
        if graded:
            runs += members
        else:
            parts = zip(*(reduced(moduli[i]) for i in members), strict=True)
            sizes = [thickness[i] for i in members]
            runs.append(Run(members, *(_stacked(values, q) for values in (sizes, *parts))))
    base = base if isinstance(base, Rigid | Free) else reduced(base)
    return Column(tuple(runs), base, unit, q)


def climb_through(
    column: Column,
    face: Any,
    rule: Rule,
    add_graded: AddGraded | None,
    *,
    parts: Sequence[Array] | None = None,
    heights: Mapping[int, Array] = MappingProxyType({}),
) -> Any:
    """Returns the state at the other end of a column from that at one end.

    **Arguments:**

    - `face`: at the base, or for a `rule` that goes downwards at the surface.
    - `parts`: what is there of the thickness of each homogeneous layer [m].
    - `heights`: s at which each graded layer is cut.
    """
    for run in column.runs if rule.down else reversed(column.runs):
        if isinstance(run, int):
            assert add_graded is not None
            face = add_graded(run, face, rule, column.unit, heights.get(run))
            continue
        if parts is not None:
            run = run._replace(thickness=_stacked([parts[i] for i in run.members], column.q))
        face = _through(run, column.q, face, rule)
    return face


def _through(run, q, face, rule):
    layers = run.thickness, run.reduced, run.e

    def step(face, layer):
        d, reduced, e = layer
        return rule.add(face, q * d, reduced, e)

    if face is None:
        face = step(None, [part[-1] for part in layers])
        layers = tuple(part[:-1] for part in layers)
    if len(layers[0]) == 0:
        return face
    # The carry keeps one shape and dtype from the first step on.
    like = stable_shape(lambda face: step(face, [part[0] for part in layers]), face)
    return jax.lax.scan(
        lambda face, layer: (cast_like(step(face, layer), like), None),
        cast_like(face, like),
        layers,
        reverse=not rule.down,
    )[0]


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
    if is_concrete(waves["omega"]) and np.any(np.asarray(waves["omega"]) == 0):
        check_at_rest(stack)
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
    climb: Callable[[AddGraded | None], tuple[Array, ...]],
    measure: Callable[[Sequence[Array], Sequence[Array]], Float[Array, "*w"]],
    stack: Stack,
    q: Float[Array, "..."],
    omega: Float[Array, "..."],
    rtol: float,
    throw: bool = True,
) -> tuple[tuple[Array, ...], Float[Array, "*w"]]:
    """Returns the values and the error from `graded_solver`; the error may be one to raise.

    Of a stack without graded layers the recursion is exact.
    """
    if not is_graded(stack):
        return climb(None), jnp.zeros_like(q)
    values, error = graded_solver.solve(climb, measure, stack, q, omega, rtol)
    error = jax.lax.stop_gradient(error)
    if throw:
        # Written so that NaN fails.
        values = eqx.error_if(values, jnp.any(~(error <= rtol)), _NOT_REACHED)
    return values, error
