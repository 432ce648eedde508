"""Branches of a series: what an exponential of strength one contributes to a measurement."""

from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

Kind = Literal["frequency", "relaxation", "creep"]
FARTHEST = 1e60  # ωτ, or its reciprocal, beyond which a branch no longer changes


def branches(kind: Kind, x: Any, times: Any) -> tuple[Any, Any, Any]:
    """Returns φ and its first two derivatives by ln τ, each of shape `(terms, rows)`."""
    xp = array_module(x)
    if kind == "frequency":
        # Beyond these limits a branch is complete or absent, and powers of z overflow.
        z = xp.clip(times[:, None] * x, 1 / FARTHEST, FARTHEST)
        inverse = 1 / z
        loss, storage = 1 / (z + inverse), 1 / (1 + inverse**2)
        loss2, tilt = loss**2, 1 - 2 * storage
        return (
            xp.concatenate([storage, loss], axis=1),
            xp.concatenate([2 * loss2, loss * tilt], axis=1),
            xp.concatenate([4 * loss2 * tilt, loss * (1 - 8 * loss2)], axis=1),
        )
    z = x / times[:, None]
    decay = xp.exp(-z)
    slope = z * decay
    curvature = (z - 1) * slope
    if kind == "creep":
        return -xp.expm1(-z), -slope, -curvature
    return decay, slope, curvature


def array_module(values: Any) -> Any:
    """Returns `jax.numpy` for JAX's arrays and `numpy` for all others."""
    return jnp if isinstance(values, jax.Array) else np
