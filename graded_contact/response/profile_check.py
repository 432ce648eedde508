"""Whether a profile is usable: sampled over its height before it is solved."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import is_concrete
from .profile import SAMPLES, moduli_at

# A change that a smooth profile spreads over more than 2^-40 of the layer.
_HALVINGS = 40


def check_profile(name: str, profile: Any, omega: Float[Array, "..."]) -> None:
    """Raises `ValueError` naming the height at which a profile is not usable, if it is known.

    Sampled at 65 heights and up to five of the frequencies: finite E of positive real part, ν
    of real part in (-1, 1/2], and no jump between samples.
    """
    if not all(is_concrete(leaf) for leaf in jax.tree.leaves((profile, omega))):
        return
    sizes = jnp.sort(jnp.abs(jnp.ravel(omega)))
    if sizes.size == 0:
        return
    omega = sizes[np.linspace(0, sizes.size - 1, min(sizes.size, 5)).astype(int)]
    s = jnp.linspace(0, 1, SAMPLES + 1, dtype=omega.dtype)
    _check_shapes(name, profile, s, omega)
    modulus, poisson, where, jump = (np.array(part) for part in _survey(profile, s, omega))

    def refuse(bad, value, why):
        i, j = (int(k) for k in np.argwhere(bad)[0])
        raise ValueError(
            f"`{name}` at s={float(s[i]):g}, omega={float(omega[j]):g}: {why}, got {value[i, j]:g}."
        )

    for bad, value, why in (
        (~np.isfinite(modulus), modulus, "the modulus [Pa] must be finite"),
        (~np.isfinite(poisson), poisson, "Poisson's ratio must be finite"),
        (~(np.real(modulus) > 0), modulus, "the modulus [Pa] must have a positive real part"),
        (
            ~((np.real(poisson) > -1) & (np.real(poisson) <= 0.5 + 1e-6)),
            poisson,
            "Poisson's ratio must be greater than -1 and at most 0.5",
        ),
    ):
        if np.any(bad):
            refuse(bad, value, why)
    if np.any(jump > 1e-2):
        i = int(np.argmax(jump))
        raise ValueError(
            f"`{name}` jumps at s={where[i]:.6g}. Put a boundary between two layers there."
        )


def _check_shapes(name, profile, s, omega):
    expected = (s.size, omega.size)
    try:
        modulus, poisson = jax.eval_shape(moduli_at, profile, s[:, None], omega)
        shape = jnp.broadcast_shapes(modulus.shape, poisson.shape)
        fits = jnp.broadcast_shapes(shape, expected) == expected
        got = f"E of shape {modulus.shape} and ν of shape {poisson.shape}"
    except (TypeError, ValueError, AttributeError) as error:
        fits, got = False, f"{type(error).__name__}: {error}"
    if not fits:
        raise ValueError(
            f"`{name}` must return a pair (E, ν) that broadcasts to {expected} for s of shape "
            f"{(s.size, 1)} and omega of shape {omega.shape}; it gave {got}."
        )


@jax.jit
def _survey(profile, s, omega):
    """Samples of the profile, and the largest change left after halving every interval."""

    def sample(s):
        modulus, poisson = moduli_at(profile, s[..., None], omega)
        shape = (*s.shape, omega.size)
        return jnp.broadcast_to(modulus, shape), jnp.broadcast_to(poisson, shape)

    def changes(s):
        """Of each height to the next, along the first axis."""
        modulus, poisson = sample(s)
        change = jnp.abs(jnp.log(modulus[1:] / modulus[:-1])) + jnp.abs(jnp.diff(poisson, axis=0))
        return jnp.max(change, axis=-1)

    def halve(_, ends):
        low, high = ends
        middle = (low + high) / 2
        lower, upper = changes(jnp.stack([low, middle, high]))
        return jnp.where(upper > lower, middle, low), jnp.where(upper > lower, high, middle)

    halvings = min(_HALVINGS, int(-np.log2(float(jnp.finfo(s.dtype).eps))) - 8)
    ends = jax.lax.fori_loop(0, halvings, halve, (s[:-1], s[1:]))
    return *sample(s), ends[1], changes(jnp.stack(ends))[0]
