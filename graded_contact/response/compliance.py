"""The surface compliance M_zz(q, ω) of a stack: normal displacement per pressure, in Fourier space.

Displacement into the solid per pressure in compression, for fields exp(i(q·x + ωt)); passive
solids have Im M_zz <= 0 for ω > 0, and M_zz(-ω) = conj M_zz(ω). Frequency enters through the
complex moduli alone (correspondence principle: R. M. Christensen, Theory of Viscoelasticity,
Academic Press 1982), so that a Poisson's ratio which varies with frequency is one more complex
modulus. (The paper's p₀ formulas differ there; `docs/theory.md` shows why they violate
equilibrium.)
"""

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Inexact

from .._checks import Numbers, as_float, check_poisson, check_positive, check_values, is_concrete
from ..grid import Grid, nyquist_lines, wavenumber, wavevector
from .slab import clamped, factors, free, half_space, stack_on
from .stack import Free, HalfSpace, Rigid, Stack

# Unrolled layers run faster and scanned ones compile faster; they cross here.
_UNROLLED_LAYERS = 4


def layered_compliance(
    q: Numbers,
    thickness: Numbers,
    modulus: Numbers,
    poisson: Numbers,
    base: Rigid | Free | tuple[Numbers, Numbers],
) -> Inexact[Array, "*w"]:
    """Returns M_zz [m/Pa] of layers given by their moduli at one frequency per entry of `q`.

    **Arguments:**

    - `q`: wavenumbers [rad/m], shape `(*w)`, positive.
    - `thickness`: d [m], shape `(n,)`, surface first; `n = 0` is allowed on a half space.
    - `modulus`: Young's moduli E(ω) [Pa], real or complex, shape `(n,)` or `(n, *w)`.
    - `poisson`: Poisson's ratios [1], real or complex, shape `(n,)` or `(n, *w)`.
    - `base`: `Rigid()`, `Free()`, or the half space's `(modulus, poisson)`.

    **Returns:** M_zz, shape `(*w)`, real if all moduli are.
    """
    q, thickness = as_float(q), as_float(thickness)
    modulus, poisson = _as_inexact("modulus", modulus), _as_inexact("poisson", poisson)
    check_positive("q", q, "[rad/m]")
    if thickness.ndim != 1:
        raise ValueError(f"`thickness` has shape {thickness.shape}; one axis, layers, is needed.")
    check_values("thickness", thickness, "a thickness [m] is zero or positive", at_least=0)
    for name, value in (("modulus", modulus), ("poisson", poisson)):
        if value.ndim < 1 or value.shape[0] != len(thickness):
            raise ValueError(
                f"`{name}` has shape {value.shape}; its first axis must hold the "
                f"{len(thickness)} layers of `thickness`."
            )
    if not isinstance(base, Rigid | Free):
        if not (isinstance(base, tuple) and len(base) == 2):
            raise ValueError(f"`base={base!r}` must be Rigid(), Free() or (modulus, poisson).")
        base = (_as_inexact("base[0]", base[0]), _as_inexact("base[1]", base[1]))
        _check_moduli("base[0]", base[0], "base[1]", base[1])
    elif len(thickness) == 0:
        raise ValueError(f"`thickness` is empty on {base!r}: there is nothing to deform.")
    _check_moduli("modulus", modulus, "poisson", poisson)
    return _layered_compliance(q, thickness, modulus, poisson, base)


def surface_compliance(stack: Stack, q: Numbers, omega: Numbers) -> Inexact[Array, "*w"]:
    """Returns the surface compliance M_zz [m/Pa] of a stack.

    **Arguments:**

    - `stack`: the block.
    - `q`: wavenumbers |q| [rad/m], positive.
    - `omega`: angular frequencies ω [rad/s], of either sign.

    **Returns:** M_zz, of the shape to which `q` and `omega` broadcast; complex unless every
    material is elastic.
    """
    q, omega = as_float(q), as_float(omega)
    check_positive("q", q, "[rad/m]")
    check_values("omega", omega, "frequencies [rad/s] must be finite")
    return _surface_compliance(stack, *_same_rank(q, omega))


def effective_modulus(stack: Stack, q: Numbers, omega: Numbers) -> Inexact[Array, "*w"]:
    """Returns 2/(q M_zz) [Pa]: the E/(1-ν²) of the half space that would respond alike.

    Its imaginary over its real part is the loss tangent of the composite. Arguments as in
    `surface_compliance`.
    """
    return 2 / (as_float(q) * surface_compliance(stack, q, omega))


def stack_kernel(stack: Stack, grid: Grid, velocity: Numbers = 0.0) -> Inexact[Array, "*half"]:
    """Returns M_zz [m/Pa] of a stack on the half spectrum of a grid, for steady sliding.

    **Arguments:**

    - `stack`: the block.
    - `grid`: the periodic cell.
    - `velocity`: of the rough surface over the block [m/s]: a number (along x) or `(vx, vy)`.
      Each wavevector is excited at ω = -q·v.

    **Returns:** the kernel, shape of the half spectrum. The q = 0 entry is 0 (the mean
    displacement belongs to the mean gap) and Nyquist lines hold the real part, the even one.
    It is real when every material is elastic.
    """
    velocity = as_float(velocity)
    if velocity.shape not in ((), (2,)) or (velocity.shape == (2,) and grid.ndim == 1):
        raise ValueError(
            f"`velocity` has shape {velocity.shape}; a number (along x) or, on a grid in two "
            "dimensions, two components are needed."
        )
    check_values("velocity", velocity, "a velocity [m/s] must be finite")
    return _stack_kernel(stack, grid, velocity)


@jax.jit
def _stack_kernel(stack, grid, velocity):
    q, components = wavenumber(grid), wavevector(grid)
    zero = q == 0
    q = jnp.where(zero, components[0].ravel()[1], q)
    if velocity.shape == (2,):
        omega = -(components[0] * velocity[0] + components[1] * velocity[1])
        kernel = _surface_compliance(stack, q, omega)
    else:
        # Sliding along x: rows ±qx are conjugates, and ω depends on the row alone.
        rows = grid.shape[0] // 2 + 1 if grid.ndim == 2 else q.shape[0]
        kernel = _surface_compliance(stack, q[:rows], -components[0][:rows] * velocity)
        mirrored = kernel[1 : q.shape[0] - rows + 1][::-1]
        kernel = jnp.concatenate([kernel, jnp.conj(mirrored)])
    kernel = jnp.where(zero, 0, kernel)
    if jnp.iscomplexobj(kernel):
        kernel = jnp.where(nyquist_lines(grid.shape), kernel.real.astype(kernel.dtype), kernel)
    return kernel


@jax.jit
def _surface_compliance(stack, q, omega):
    """`q` and `omega` of equal rank: a modulus is computed once per entry of `omega`."""
    layers = [
        (layer.material.modulus(omega), layer.material.poisson_ratio(omega))
        for layer in stack.layers
    ]
    thickness = [layer.thickness for layer in stack.layers]
    base = stack.base
    if isinstance(base, HalfSpace):
        base = (base.material.modulus(omega), base.material.poisson_ratio(omega))
    shape = jnp.broadcast_shapes(q.shape, omega.shape)
    compliance = _layered_compliance(
        q, thickness, [m for m, _ in layers], [p for _, p in layers], base
    )
    return jnp.broadcast_to(compliance, shape)


@jax.jit
def _layered_compliance(q, thickness, modulus, poisson, base):
    """The recursion upwards; sequences or arrays with the layers along their first axis."""
    # In units of the largest modulus, derivatives in float32 neither overflow nor underflow.
    moduli = [*modulus, *([] if isinstance(base, Rigid | Free) else [base[0]])]
    unit = jax.lax.stop_gradient(jnp.max(jnp.array([jnp.max(jnp.abs(m)) for m in moduli])))

    def plane_strain(modulus, poisson):
        return (modulus / unit) / (1 - poisson**2)

    def add(below, layer):
        state, reduced_below = below
        d, modulus, poisson = layer
        reduced = plane_strain(modulus, poisson)
        slab = factors(q * d, 1 - 2 * poisson)
        return (stack_on(state, slab, reduced / reduced_below), reduced), None

    layers = [(thickness[i], modulus[i], poisson[i]) for i in range(len(thickness))]
    if isinstance(base, Rigid | Free):
        d, e_modulus, nu = layers.pop()
        e = 1 - 2 * nu
        state = free(q * d, e) if isinstance(base, Free) else clamped(factors(q * d, e))
        reduced = plane_strain(e_modulus, nu)
    else:
        state, reduced = half_space(1 - 2 * base[1]), plane_strain(*base)
    below = (state, reduced)
    if len(layers) <= _UNROLLED_LAYERS:
        for layer in reversed(layers):
            below, _ = add(below, layer)
    else:
        stacked = jax.tree.map(lambda *parts: jnp.stack(jnp.broadcast_arrays(*parts)), *layers)
        # The carry keeps one shape and dtype from the first step on.
        like = jax.eval_shape(lambda b: add(b, layers[0])[0], below)
        like = jax.eval_shape(lambda b: add(b, layers[0])[0], like)
        below = jax.tree.map(lambda b, l: jnp.broadcast_to(b, l.shape).astype(l.dtype), below, like)
        below, _ = jax.lax.scan(add, below, stacked, reverse=True)
    state, reduced = below
    return state.c22 * (2 / unit) / (reduced * q)


def _same_rank(q: Array, omega: Array) -> tuple[Array, Array]:
    rank = max(q.ndim, omega.ndim)
    jnp.broadcast_shapes(q.shape, omega.shape)
    return tuple(x.reshape((1,) * (rank - x.ndim) + x.shape) for x in (q, omega))


def _as_inexact(name: str, value) -> Inexact[Array, "..."]:
    array = jnp.asarray(value)
    if jnp.issubdtype(array.dtype, jnp.complexfloating):
        return jnp.asarray(array, array.dtype)
    return as_float(array)


def _check_moduli(modulus_name: str, modulus: Array, poisson_name: str, poisson: Array) -> None:
    for part in (modulus.real, modulus.imag):
        check_values(modulus_name, part, "a modulus [Pa] must be finite")
    if is_concrete(modulus) and bool(jnp.any(modulus == 0)):
        raise ValueError(f"`{modulus_name}` holds a zero: a modulus [Pa] must not vanish.")
    if jnp.iscomplexobj(poisson):
        for part in (poisson.real, poisson.imag):
            check_values(poisson_name, part, "Poisson's ratio must be finite")
    else:
        check_poisson(poisson_name, poisson)
