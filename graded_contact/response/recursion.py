"""The recursion upwards through a stack of homogeneous layers, and its derivative.

The surface compliance is the stationary value of a potential. Let v_i = (t, s) be the traction
on the upper face of layer i for a unit normal traction on the stack, and w_i the displacement of
its lower face; v_0 is the traction on the base. Then, with Q, G, P of `slab` and in one unit,

    M_zz = Φ = Σ_i [v_iᵀ Q_i v_i + 2 v_iᵀ P_i w_i - w_iᵀ G_i w_i] + v_0ᵀ c_0 v_0,

and the derivative of M_zz by any property is that of Φ at fixed v and w: a sum over layers, without
the chain rule through the recursion. It costs a second sweep, downwards, for v and w;
differentiation of the recursion itself costs about a hundred evaluations.
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Inexact

from ..blocks.stack import Free, Layer, Rigid, Stack, moduli_of, moduli_of_all
from .column import scan_layers, unit_of_moduli
from .slab import factors, free, half_space, hyperbolic, plane_strain, push_down, rigid, stack_on

# Unrolled layers run faster and scanned ones compile faster; they cross here.
UNROLLED_LAYERS = 4


@jax.jit
def compliance_of_layers(q, thickness, modulus, poisson, base) -> Array:
    """Returns M_zz [m/Pa] of a few layers in sequences, or of any number in arrays, on first axes.

    Arguments as in `layered_compliance`, unchecked; `base` is `Rigid()`, `Free()` or
    `(modulus, poisson)`.
    """
    supported = isinstance(base, Rigid | Free)
    unit = unit_of_moduli([*(() if supported else base[:1]), *jax.tree.leaves(modulus)])
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
        # A scan needs one rank; moduli may or may not vary with the wave.
        rank = max(part.ndim for part in (thickness, modulus, poisson))
        d, e, nu = (
            part.reshape(part.shape[:1] + (1,) * (rank - part.ndim) + part.shape[1:])
            for part in (thickness, modulus, poisson)
        )
        layers = (d, *plane_strain(e / unit, nu))
        state, reduced, above = _lowest(q, (tuple(part[-1] for part in layers),), base)
        upwards = layers if above else tuple(part[:-1] for part in layers)
        state, reduced = scan_layers(partial(_add, q), (state, reduced), upwards, reverse=True)
        value = state.c22 / reduced
    return value * (2 / unit) / q


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
    # The dearest part: computed once for both sweeps.
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
        energy = _form(slab.q, v) + _form(slab.g, w)
        w, v_below, energy = _computed_once((w, v_below, energy))
        potential = partial(_layer_potential, x=q * d, v=v, w=w)
        change += _layer_change(q, d_q, layer, d_layer, (v_below, w, energy), potential)
        v = v_below
    if isinstance(base, Free):
        d, reduced, e = layers[-1]
        w, nothing = push_down(v, factors(q * d, e))
        potential = lambda e: _form(free(q * d, e), v)  # noqa: E731
        fields = (nothing, w, potential(e))
        change += _layer_change(q, d_q, layers[-1], d_layers[-1], fields, potential)
    elif not isinstance(base, Rigid):
        (reduced, e), (d_reduced, d_e) = base, d_base
        potential = lambda e: _form(half_space(e), v)  # noqa: E731
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
    return _form(s.q, v) + 2 * across - _form(s.g, w)


def _form(c, v):
    """vᵀ c v."""
    return c.c11 * v[0] ** 2 + 2 * c.c12 * v[0] * v[1] + c.c22 * v[1] ** 2


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


def layers_of(stack: Stack, omega: Inexact[Array, "..."]) -> tuple[Any, Any, Any]:
    """Returns thicknesses, E and ν of homogeneous layers, as lists or, if they are many, arrays."""
    layers = [layer for layer in stack.layers if isinstance(layer, Layer)]
    thickness = [layer.thickness for layer in layers]
    if len(layers) <= UNROLLED_LAYERS:
        moduli = [moduli_of(layer.material, omega) for layer in layers]
        return thickness, [modulus for modulus, _ in moduli], [poisson for _, poisson in moduli]
    modulus, poisson = moduli_of_all([layer.material for layer in layers], omega)
    return jnp.stack(thickness), modulus, poisson
