"""The recursion upwards through a stack of homogeneous layers, and its derivative.

The surface compliance is the stationary value of a potential. Let v_i = (t, s) be the traction
on the upper face of layer i for a unit normal traction on the stack, and w_i the displacement of
its lower face; v_0 is the traction on the base. Then, with Q, G, P of `slab` and in one unit,

    M_zz = Φ = Σ_i [v_iᵀ Q_i v_i + 2 v_iᵀ P_i w_i - w_iᵀ G_i w_i] + v_0ᵀ c_0 v_0,

and the derivative of M_zz by any property is that of Φ at fixed v and w: a sum over layers, without
the chain rule through the recursion. It costs a second sweep, downwards, for v and w;
differentiation of the recursion itself costs about a hundred evaluations.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from ..materials.material import AbstractMaterial
from .slab import (
    factors,
    free,
    free_face,
    half_space,
    hyperbolic,
    plane_strain,
    push_down,
    rigid,
    stack_on,
)
from .stack import Free, HalfSpace, Layer, Rigid, Stack

# Unrolled layers run faster and scanned ones compile faster; they cross here.
UNROLLED_LAYERS = 4


@jax.jit
def compliance_of_layers(q, thickness, modulus, poisson, base) -> Array:
    """Returns M_zz [m/Pa]; sequences or arrays with the layers along their first axis.

    Arguments as in `layered_compliance`, unchecked; `base` is `Rigid()`, `Free()` or
    `(modulus, poisson)`.
    """
    supported = isinstance(base, Rigid | Free)
    unit = largest([*(() if supported else base[:1]), *jax.tree.leaves(modulus)])
    # On input the value is unknown if a thickness is traced: no number may come of it then.
    for d in jax.tree.leaves(thickness):
        unit = jnp.where(jnp.all(d >= 0), unit, jnp.nan)
    if not supported:
        base = plane_strain(base[0] / unit, base[1])
    if len(thickness) <= UNROLLED_LAYERS:
        parts = zip(thickness, modulus, poisson, strict=True)
        layers = tuple((d, *plane_strain(e / unit, nu)) for d, e, nu in parts)
        value = _unrolled(q, layers, base)
    else:
        d, e, nu = _stacked(thickness, modulus, poisson)
        value = _scanned(q, (d, *plane_strain(e / unit, nu)), base)
    return value * (2 / unit) / q


def largest(moduli: Sequence[Array]) -> Array:
    """Returns the largest modulus, a unit without derivative.

    In units of it derivatives in float32 neither overflow nor underflow.
    """
    sizes = [jnp.max(jnp.abs(modulus)) for modulus in moduli if modulus.size]
    return jax.lax.stop_gradient(jnp.max(jnp.array(sizes)))


def stable_shape(step: Callable[[Any], Any], face: Any) -> Any:
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


def cast_like(new: Any, old: Any) -> Any:
    """Returns `new` with the shapes and dtypes of `old`, as the carry of a scan must have."""
    return jax.tree.map(lambda n, o: jnp.broadcast_to(n, o.shape).astype(o.dtype), new, old)


def _stacked(*properties):
    """Arrays with the layers along their first axis and of one rank, from arrays or sequences."""
    arrays = [
        p if isinstance(p, jax.Array) else jnp.stack(jnp.broadcast_arrays(*p)) for p in properties
    ]
    rank = max(a.ndim for a in arrays)
    return [a.reshape(a.shape[:1] + (1,) * (rank - a.ndim) + a.shape[1:]) for a in arrays]


def _lowest(q, layers, base):
    """State, modulus, and the layers above it, of what needs no state below."""
    if isinstance(base, Rigid):
        return rigid(q), jnp.ones((), q.dtype), layers
    if isinstance(base, Free):
        d, reduced, e = layers[-1]
        return free(q * d, e), reduced, layers[:-1]
    reduced, e = base
    return half_space(e), reduced, layers


def _add(q, below, layer, functions=None):
    state, reduced_below = below
    d, reduced, e = layer
    return stack_on(state, factors(q * d, e, functions), reduced / reduced_below), reduced


def _scanned(q, layers, base):
    """As `_unrolled`, of layers along the first axes of three arrays."""

    def at(i):
        return jax.tree.map(lambda part: part[i], layers)

    state, reduced, above = _lowest(q, (at(-1),), base)
    num_above = len(layers[0]) if above else len(layers[0]) - 1
    below = (state, reduced)
    # The carry keeps one shape and dtype from the first step on.
    below = cast_like(below, stable_shape(lambda below: _add(q, below, at(0)), below))
    step = jax.checkpoint(lambda below, layer: (_add(q, below, layer), None))
    upwards = jax.tree.map(lambda part: part[:num_above], layers)
    (state, reduced), _ = jax.lax.scan(step, below, upwards, reverse=True)
    return state.c22 / reduced


@jax.custom_jvp
def _unrolled(q, layers, base):
    state, reduced, above = _lowest(q, layers, base)
    for layer in reversed(above):
        state, reduced = _add(q, (state, reduced), layer)
    return state.c22 * (1 / reduced)


@partial(_unrolled.defjvp, symbolic_zeros=True)
def _unrolled_jvp(primals, tangents):
    q, layers, base = primals
    d_q, d_layers, d_base = tangents
    state, reduced, above = _lowest(q, layers, base)
    functions = [_computed_once(hyperbolic(q * d)) for d, _, _ in above]
    states = [(state, reduced)]
    for layer, known in reversed(list(zip(above, functions, strict=True))):
        states.append(_add(q, states[-1], layer, known))
    state, reduced = states.pop()
    value = state.c22 * (1 / reduced)

    states = _computed_once(states)
    v = (jnp.zeros_like(value), jnp.ones_like(value))
    change = jnp.zeros_like(value)
    for layer, d_layer, known in zip(above, d_layers, functions, strict=False):
        below, reduced_below = states.pop()
        d, reduced, e = layer
        slab = factors(q * d, e, known)
        w, v_below = push_down(v, slab, below, reduced / reduced_below)
        energy = _form(slab.q11, slab.q12, slab.q22, v) + _form(slab.g11, slab.g12, slab.g22, w)
        w, v_below, energy = _computed_once((w, v_below, energy))
        potential = partial(_layer_potential, x=q * d, v=v, w=w)
        change += _layer_change(q, d_q, layer, d_layer, (v_below, w, energy), potential)
        v = v_below
    if isinstance(base, Free):
        d, reduced, e = layers[-1]
        w = free_face(v, factors(q * d, e))
        potential = lambda e: _quadratic(free(q * d, e), v)  # noqa: E731
        nothing = jnp.zeros_like(v[0])
        fields = ((nothing, nothing), w, potential(e))
        change += _layer_change(q, d_q, layers[-1], d_layers[-1], fields, potential)
    elif not isinstance(base, Rigid):
        (reduced, e), (d_reduced, d_e) = base, d_base
        potential = lambda e: _quadratic(half_space(e), v)  # noqa: E731
        change += _change(-potential(e) / reduced**2, d_reduced) + _change_by_poisson(
            potential, base, d_e
        )
    return value, change


def _change(slope, tangent):
    return 0 if isinstance(tangent, SymbolicZero) else slope * tangent


def _layer_change(q, d_q, layer, d_layer, fields, potential):
    """What a layer's properties change in Φ, given traction and displacement of a face of it.

    By its modulus Φ changes as by twice the energy in it. By its thickness, as by the same thin
    slice wherever it is put in: with the derivatives of Q, P and G at x = 0,

        vᵀQ'v + 2 vᵀP'w - wᵀG'w,

    which loses nothing in thick layers at the lower face, where both are small.
    """
    (d, reduced, e), (d_d, d_reduced, d_e) = layer, d_layer
    (t, s), (u, w), energy = fields
    b = 1 + e
    slope = (
        t**2 * (2 / b) + s**2 * (2 * e / b**2) - 2 * t * w + s * u * (2 * (1 - e) / b) - 2 * u**2
    )
    slope = slope / reduced
    return (
        _change(q * slope, d_d)
        + _change(d * slope, d_q)
        + _change(-energy / reduced**2, d_reduced)
        + _change_by_poisson(potential, layer[1:], d_e)
    )


def _change_by_poisson(potential, properties, d_e):
    """What e = 1 - 2ν changes in a potential(e) over E_r, where v and w are fixed."""
    if isinstance(d_e, SymbolicZero):
        return 0
    reduced, e = properties
    _, slope = jax.jvp(potential, (e,), (jnp.ones_like(e),))
    return _computed_once(slope) / reduced * d_e


def _layer_potential(e, x, v, w):
    """vᵀQv + 2vᵀPw - wᵀGw of one layer, for fixed v and w."""
    s = factors(x, e)
    across = v[0] * (s.p11 * w[0] + s.p12 * w[1]) + v[1] * (s.p21 * w[0] + s.p22 * w[1])
    return _form(s.q11, s.q12, s.q22, v) + 2 * across - _form(s.g11, s.g12, s.g22, w)


def _quadratic(state, v):
    return _form(state.c11, state.c12, state.c22, v)


def _form(a11, a12, a22, v):
    return a11 * v[0] ** 2 + 2 * a12 * v[0] * v[1] + a22 * v[1] ** 2


@jax.custom_jvp
def _computed_once(tree):
    """Returns `tree`, computed once and stored.

    XLA fuses what feeds several consumers into each of them and computes it as often: the
    derivative would cost a hundred evaluations, and its compilation minutes. A loop that it cannot
    know to run zero times is where it stops; if it does run, after a NaN, it negates twice.
    """
    if not jax.tree.leaves(tree):
        return tree
    first = jax.tree.leaves(tree)[0].real
    first = first[(0,) * first.ndim]
    rounds = jnp.where(jnp.isnan(first), 2, 0)

    def negated(state):
        return state[0] + 1, jax.tree.map(jnp.negative, state[1])

    start = (jnp.zeros_like(rounds), tree)
    return jax.lax.while_loop(lambda s: s[0] < rounds, negated, start)[1]


@_computed_once.defjvp
def _computed_once_jvp(primals, tangents):
    return _computed_once(*primals), tangents[0]


class ManyLayers(NamedTuple):
    """A long stack: materials of one kind in one, so that compilation does not grow with them."""

    thickness: Float[Array, " n"]
    kinds: list[AbstractMaterial]  # their leaves have the materials along a first axis
    order: np.ndarray  # takes the layers from kind after kind to their places
    base: HalfSpace | Rigid | Free

    def moduli(self, omega: Float[Array, "..."]) -> tuple[Array, Array]:
        """E and ν at `omega`, with the layers along a first axis."""
        found = [
            jax.vmap(lambda m: (m.modulus(omega), m.poisson_ratio(omega)))(kind)
            for kind in self.kinds
        ]
        modulus = [e for e, _ in found]
        poisson = [nu.reshape(nu.shape + (1,) * (e.ndim - nu.ndim)) for e, nu in found]
        shape = jnp.broadcast_shapes(*[nu.shape[1:] for nu in poisson])
        poisson = [jnp.broadcast_to(nu, (len(nu), *shape)) for nu in poisson]
        return jnp.concatenate(modulus)[self.order], jnp.concatenate(poisson)[self.order]


def prepared(stack: Stack) -> Stack | ManyLayers:
    """Returns a stack in the form in which it is solved often."""
    materials = [layer.material for layer in stack.layers if isinstance(layer, Layer)]
    if len(materials) < len(stack.layers) or len(materials) <= UNROLLED_LAYERS:
        return stack
    kinds = {}
    for i, material in enumerate(materials):
        leaves, structure = jax.tree.flatten(material)
        kinds.setdefault((structure, *[jnp.shape(leaf) for leaf in leaves]), []).append(i)
    return ManyLayers(
        jnp.stack([layer.thickness for layer in stack.layers]),
        [
            jax.tree.map(lambda *leaves: jnp.stack(leaves), *[materials[i] for i in members])
            for members in kinds.values()
        ],
        np.argsort(np.concatenate(list(kinds.values()))),
        stack.base,
    )
