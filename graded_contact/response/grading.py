"""The surface compliance of stacks that hold continuously graded layers.

`Layering` replaces a graded layer by homogeneous ones that have its moduli at their middles,
on a mesh adapted to the profile and to each wavenumber (`mesh`), and refines them n-fold. The
error is even in 1/n within every cell of the mesh, whatever the mesh, so that extrapolation in
1/n² (Richardson, Phil. Trans. R. Soc. A 226 (1927) 299, doi:10.1098/rsta.1927.0008) over
n = 1, 2, 3, 4, 6, 8 gives order 12. The layers themselves are exact (`slab`), passive, and need
no derivative of the profile. `Riccati` integrates the differential equation instead.

Both return an estimate of their relative error; a tolerance that is not met is an error.
"""

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from .._checks import (
    Numbers,
    as_float,
    check_positive,
    check_together,
    check_tolerance,
    check_type,
    check_values,
    check_whole,
    door,
)
from ..rheology.measured import check_frequencies
from .mesh import WINDOW, build_mesh, cells_of, coarsened, position, span, visible
from .profile import check_profile, moduli_at
from .riccati import integrate, invert
from .slab import Compliance, factors, free, half_space, reciprocal, stack_on, times
from .stack import Free, GradedLayer, HalfSpace, Rigid, Stack

# Layers per cell of the mesh. Longer rows gain order but lose digits to their weights.
_REFINEMENT = (1, 2, 3, 4, 6, 8)
_SUBLAYERS = {
    "level": np.repeat(np.arange(len(_REFINEMENT)), _REFINEMENT),
    "middle": np.concatenate([(np.arange(n) + 0.5) / n for n in _REFINEMENT]),
    "width": np.concatenate([np.full(n, 1 / n) for n in _REFINEMENT]),
    "lowest": np.concatenate([np.arange(n) == 0 for n in _REFINEMENT]),
}
_HIGHEST = np.cumsum(_REFINEMENT) - 1  # the upmost sublayer of each refinement
# How much finer the mesh of a second attempt is.
_SPLIT = 5
# Rounding: what no refinement removes, and the tightest tolerance worth trying.
_FLOOR, _REFUSED_BELOW = 100.0, 400.0
_NOT_REACHED = (
    "The tolerance was not reached in a graded layer: its profile varies too sharply. Put "
    "boundaries between layers at its jumps and list its kinks in `breaks`, pass a larger "
    "`rtol`, or read `graded_compliance(..., throw=False).error`."
)


class GradedCompliance(eqx.Module):
    """A surface compliance with its estimated error.

    **Fields:**

    - `value`: M_zz [m/Pa], shape `(*w)`.
    - `error`: estimated relative error of `value` [1], shape `(*w)`.
    """

    value: Inexact[Array, "*w"]
    error: Float[Array, "*w"]


class AbstractGradedSolver(eqx.Module):
    """A way to find the compliance of a stack with graded layers."""

    @abc.abstractmethod
    def solve(
        self, stack: Stack, q: Float[Array, "..."], omega: Float[Array, "..."], rtol: float
    ) -> GradedCompliance:
        """Returns M_zz at `q` [rad/m] and `omega` [rad/s] of equal rank, aiming at `rtol`."""


class Layering(AbstractGradedSolver):
    """Homogeneous layers at middle heights, extrapolated.

    If the error estimate exceeds the tolerance anywhere, everything is done again on a mesh of
    five times as many cells.

    **Fields:**

    - `num_cells`: cells of the mesh of each graded layer, 24 layers of work each; by default
      chosen for the tolerance. Static.
    - `retry`: whether to try the finer mesh. Static.
    """

    num_cells: int | None = eqx.field(static=True, default=None)
    retry: bool = eqx.field(static=True, default=True)

    def __check_init__(self):
        if self.num_cells is not None:
            check_whole("num_cells", self.num_cells, 1)
        check_type("retry", self.retry, bool)

    def solve(
        self, stack: Stack, q: Float[Array, "..."], omega: Float[Array, "..."], rtol: float
    ) -> GradedCompliance:
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
        coarse = {i: coarsened(mesh, split) for i, mesh in meshes.items()}
        found = _extrapolated(stack, q, omega, coarse)
        if not self.retry:
            return found
        # A derivative recomputes the finer one rather than store it.
        return jax.lax.cond(
            jnp.all(found.error <= rtol),
            lambda *_: found,
            jax.checkpoint(_extrapolated),
            *(stack, q, omega, meshes),
        )


class Riccati(AbstractGradedSolver):
    """The differential equation of the compliance, integrated by diffrax.

    The tolerance of a step is `rtol`/30; the error is estimated by a second integration with
    one ten times larger. Four to seven times slower than `Layering` for an equal error, and
    independent of it. Its steps are differentiated in one mode only; `Layering` serves both.

    **Fields:**

    - `method`: a diffrax solver; by default `Dopri8()`.
    - `forward`: whether derivatives are taken in forward mode (`jax.jvp`, `jax.jacfwd`) rather
      than in reverse (`jax.grad`). Static.
    """

    method: Any = None
    forward: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        check_type("forward", self.forward, bool)

    def solve(
        self, stack: Stack, q: Float[Array, "..."], omega: Float[Array, "..."], rtol: float
    ) -> GradedCompliance:
        # The tolerance is that of a step; errors of steps add up.
        step = rtol / 30
        value = _integrated(stack, q, omega, step, self)
        rough = jax.lax.stop_gradient(_integrated(stack, q, omega, 10 * step, self))
        # Both may happen to take the same steps.
        return GradedCompliance(value, _relative(value - rough, value) + step)


@door
def graded_compliance(
    stack: Stack,
    q: Numbers,
    omega: Numbers,
    *,
    rtol: float | None = None,
    solver: AbstractGradedSolver | None = None,
    throw: bool = True,
) -> GradedCompliance:
    """Returns M_zz of a stack with graded layers, and an estimate of its error.

    **Arguments:**

    - `stack`: the block; layers of every kind, any base.
    - `q`: wavenumbers |q| [rad/m], positive.
    - `omega`: angular frequencies ω [rad/s], of either sign.
    - `rtol`: relative tolerance; by default 1e-9, in float32 1e-4.
    - `solver`: `Layering()` (the default) or `Riccati()`.
    - `throw`: whether a tolerance that is not reached is an error.

    **Returns:** a `GradedCompliance` of the shape to which `q` and `omega` broadcast.
    """
    q, omega = as_float(q, "q"), as_float(omega, "omega")
    check_positive("q", q, "[rad/m]")
    check_values("omega", omega, "frequencies [rad/s] must be finite")
    check_together(q=q, omega=omega)
    if not any(isinstance(layer, GradedLayer) for layer in stack.layers):
        raise ValueError("`stack` has no `GradedLayer`: take `surface_compliance`.")
    check_profiles(stack, omega)
    rtol = graded_tolerance(rtol, q)
    solver = Layering() if solver is None else solver
    rank = max(q.ndim, omega.ndim)
    q, omega = (x.reshape((1,) * (rank - x.ndim) + x.shape) for x in (q, omega))
    return _solve(stack, q, omega, solver, rtol, throw)


def check_profiles(stack: Stack, omega: Float[Array, "..."]) -> None:
    """Raises `ValueError` for frequencies that a table refuses, or a profile that is not usable.

    Of a profile it names the layer and the height.
    """
    check_frequencies(stack, omega)
    for i, layer in enumerate(stack.layers):
        if isinstance(layer, GradedLayer):
            check_profile(f"layers[{i}].profile", layer.profile, omega)


def graded_tolerance(rtol: float | None, like: Array) -> float:
    """Returns the tolerance to use, refusing what the dtype of `like` cannot reach."""
    if rtol is None:
        return 1e-9 if like.dtype == jnp.float64 else 1e-4
    check_tolerance("rtol", rtol, like, floor_factor=_REFUSED_BELOW)
    return float(rtol)


def solve_graded(
    stack: Stack,
    q: Float[Array, "..."],
    omega: Float[Array, "..."],
    solver: AbstractGradedSolver,
    rtol: float,
    throw: bool,
) -> GradedCompliance:
    """Returns M_zz and its error at `q` and `omega` of equal rank, unchecked."""
    found = solver.solve(stack, q, omega, rtol)
    error = jax.lax.stop_gradient(found.error)
    value = found.value
    if throw:
        # Written so that NaN fails.
        value = eqx.error_if(value, jnp.any(~(error <= rtol)), _NOT_REACHED)
    return GradedCompliance(value, error)


_solve = eqx.filter_jit(solve_graded)


def _relative(difference, value):
    floor = _FLOOR * jnp.finfo(value.dtype).eps
    return jax.lax.stop_gradient(jnp.abs(difference) / jnp.abs(value) + floor)


def _weights(levels):
    """Weights that extrapolate a function even in 1/n from n = `levels` to infinity."""
    squares = np.asarray(levels, float) ** 2
    return [np.prod([a / (a - b) for b in squares if b != a]) for a in squares]


class _Face(NamedTuple):
    """Compliance of a face in units of 2/(E_r q), and that E_r over the unit of moduli."""

    state: Compliance
    reduced: Inexact[Array, "..."]


def _extrapolated(stack, q, omega, meshes):
    def add(i, below, unit):
        return _add_layered(stack.layers[i], below, unit, q, omega, meshes[i])

    levels = _column(stack, q, omega, add)

    def combine(part, refinement):
        weights = jnp.asarray(_weights(refinement), part.real.dtype)
        return jnp.sum(weights.reshape(-1, *(1,) * (part.ndim - 1)) * part, axis=0)

    value = combine(levels, _REFINEMENT)
    without_coarsest = jnp.abs(value - combine(levels[1:], _REFINEMENT[1:]))
    without_finest = jnp.abs(value - combine(levels[:-1], _REFINEMENT[:-1]))
    # The first falls short of the error on the reference cases, up to fifty times where a cell
    # is deep, and the second exceeds it as much; three times their geometric mean does neither.
    estimate = 3 * jnp.sqrt(without_coarsest) * jnp.sqrt(without_finest)
    return GradedCompliance(value, _relative(estimate, value))


def _integrated(stack, q, omega, rtol, solver):
    shape = jnp.broadcast_shapes(q.shape, omega.shape)
    inverse = isinstance(stack.base, Free)

    def add(i, below, unit):
        layer = stack.layers[i]
        mesh = build_mesh(layer.profile, q * layer.thickness, omega, num_cells=4)
        rough = _add_layered(layer, below, unit, q, omega, mesh)
        rough = jax.lax.stop_gradient(jax.tree.map(lambda part: part[-1], rough))
        reference = jnp.abs(rough.reduced)
        scale = _in_units(rough.state, reference / rough.reduced)
        if below is None:  # the inverse compliance of a free base
            start = jax.tree.map(jnp.zeros_like, scale)
        else:
            start = _in_units(below.state, reference / below.reduced)
            start = invert(start) if inverse else start

        def flat(part):
            return jnp.broadcast_to(part, shape).ravel()

        x, reference, start, scale = jax.tree.map(
            flat, (q * layer.thickness, reference, start, scale)
        )
        found = integrate(
            layer.profile, x, flat(omega), start, reference * unit, scale,
            inverse=inverse, rtol=rtol, solver=solver.method, forward=solver.forward,
        )  # fmt: skip
        found, reference = jax.tree.map(lambda part: part.reshape(shape), (found, reference))
        return _Face(found, reference)

    return _column(stack, q, omega, add)


def _column(stack, q, omega, add_graded):
    """M_zz by the recursion upwards; `add_graded(i, below, unit)` adds layer i."""
    unit = _unit_modulus(stack, q, omega)

    def material_of(part):
        return _plane_strain(part.material.modulus(omega), part.material.poisson_ratio(omega), unit)

    if isinstance(stack.base, HalfSpace):
        reduced, e = material_of(stack.base)
        face = _Face(half_space(e), reduced)
    elif isinstance(stack.base, Rigid):
        nothing = jnp.zeros_like(q)
        face = _Face(Compliance(nothing, nothing, nothing, nothing), jnp.ones_like(q))
    else:
        face = None
    for i, layer in reversed(list(enumerate(stack.layers))):
        if isinstance(layer, GradedLayer):
            face = add_graded(i, face, unit)
            continue
        reduced, e = material_of(layer)
        x = q * layer.thickness
        if face is None:
            face = _Face(free(x, e), reduced)
        else:
            state = stack_on(face.state, factors(x, e), reduced / face.reduced)
            face = _Face(state, reduced)
    assert face is not None
    return face.state.c22 * (2 / unit) / (face.reduced * q)


def _plane_strain(modulus, poisson, unit):
    """E/(1 - ν²) in a unit, and 1 - 2ν."""
    return times(reciprocal(unit * (1 - poisson**2)), modulus), 1 - 2 * poisson


def _unit_modulus(stack, q, omega):
    """The largest modulus: in units of it float32 neither overflows nor underflows."""
    moduli = []
    for part in (*stack.layers, stack.base):
        if isinstance(part, GradedLayer):
            for end in (jnp.zeros_like(q), jnp.ones_like(q)):
                moduli.append(moduli_at(part.profile, end, omega)[0])
        elif not isinstance(part, Rigid | Free):
            moduli.append(part.material.modulus(omega))
    return jax.lax.stop_gradient(jnp.max(jnp.array([jnp.max(jnp.abs(m)) for m in moduli])))


def _in_units(c, ratio):
    return Compliance(ratio * c.c11, ratio * c.c12, ratio * c.c22, ratio * ratio * c.det)


def _add_layered(layer, below, unit, q, omega, mesh):
    """The upper face of a graded layer for every refinement, along a new first axis.

    `below` is None on a free base; it may have that axis already.
    """
    shape = (len(_REFINEMENT), *jnp.broadcast_shapes(q.shape, omega.shape))
    x = q * layer.thickness
    index, weight = position(mesh, x)
    seen, cut = visible(jax.lax.stop_gradient(x)), x > WINDOW

    def at(s):
        return _plane_strain(*moduli_at(layer.profile, s, omega), unit)

    reduced, e = at(1 - seen)
    entry = _Face(half_space(e), reduced)
    start = (
        entry if below is None else jax.tree.map(lambda a, b: jnp.where(cut, a, b), entry, below)
    )

    def add_cell(faces, cell):
        low, high = (
            cell[end][index] * (1 - weight) + cell[end][index + 1] * weight
            for end in ("low", "high")
        )
        length, deep = span(seen, cell["bottom"], cell["top"])

        def add_sublayer(face, sublayer):
            first = jax.tree.map(lambda part: part[sublayer["level"]], faces)
            face = jax.tree.map(lambda a, b: jnp.where(sublayer["lowest"], a, b), first, face)
            s = 1 - deep - length * (1 - low - (high - low) * sublayer["middle"])
            reduced, e = at(s)
            depth = x * (length * (high - low) * sublayer["width"])
            ratio = times(reciprocal(face.reduced), reduced)
            state = stack_on(face.state, factors(depth, e), ratio)
            if below is None:
                lowest = cell["lowest"] & sublayer["lowest"] & ~cut
                hanging = free(jnp.where(lowest, depth, 1), e)
                state = jax.tree.map(lambda a, b: jnp.where(lowest, a, b), hanging, state)
            face = jax.tree.map(lambda a: a.astype(kind), _Face(state, reduced))
            return face, face

        replaced = jax.tree.map(lambda part: part[0], faces)
        _, found = jax.lax.scan(jax.checkpoint(add_sublayer), replaced, _sublayers(x.dtype))
        return jax.tree.map(lambda part: part[_HIGHEST], found), None

    kind = jnp.result_type(*jax.tree.leaves(start), x)
    faces = jax.tree.map(lambda part: jnp.broadcast_to(part, shape).astype(kind), start)
    # The first axis of cells is what is scanned; a derivative keeps one state for each of them.
    return jax.lax.scan(jax.checkpoint(add_cell), faces, cells_of(mesh))[0]


def _sublayers(dtype):
    return {
        name: jnp.asarray(values, dtype if values.dtype.kind == "f" else None)
        for name, values in _SUBLAYERS.items()
    }
