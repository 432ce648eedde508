"""Spectra as the quadrature of the mean field takes them: smooth pieces, with or without a lay."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.derivative import root_or_zero
from ..surfaces.spectrum import SelfAffine, narrowing
from ..surfaces.spectrum_table import Spectrum


def smooth_edges(spectrum: Spectrum) -> Float[Array, " points"]:
    """Returns wavenumbers [rad/m], increasing, between which C(q) is smooth."""
    if isinstance(spectrum, SelfAffine):
        return jnp.stack([spectrum.q_low, spectrum.q_roll, spectrum.q_high])
    return spectrum.q


def joined_edges(track: Spectrum, own: Spectrum | None) -> Float[Array, " points"]:
    """Returns wavenumbers [rad/m] between which both spectra are smooth.

    The ends of each are two edges, closely below and above: C jumps there.
    """
    if own is None:
        return smooth_edges(track)
    edges = smooth_edges(track), smooth_edges(own)
    away = 64 * float(jnp.finfo(edges[0].dtype).eps)
    ends = [each[i] * by for each in edges for i in (0, -1) for by in (1 - away, 1 + away)]
    return jnp.sort(jnp.concatenate([jnp.stack(ends), *(each[1:-1] for each in edges)]))


def turn_of(spectrum: Spectrum, direction: Float[Array, " components"]) -> Array | None:
    """Returns the angle from the lay to a direction, from 0 to π [rad], or None."""
    if spectrum.angle is None:
        return None
    # A profile has one component.
    x, y = direction if len(direction) == 2 else (direction[0], jnp.zeros_like(direction[0]))
    return jnp.mod(jnp.arctan2(y, x) - spectrum.angle, np.pi)


def root_density(
    spectrum: Spectrum, q: Float[Array, "*n"], *, mean: bool = False
) -> Float[Array, "*n"]:
    """Returns √C [m²] across the lay, or of the `mean` over directions; 0 outside."""
    if mean or not isinstance(spectrum, SelfAffine) or spectrum.angle is None:
        density = spectrum.density(q)
    else:
        density = spectrum.density(q, 2, spectrum.angle + np.pi / 2)
    return root_or_zero(density)


def root_narrowing(spectrum: Spectrum, q: Array, offset: Array) -> Array:
    """Returns the ratio of √C at angles from the direction across the lay to √C across [1]."""
    if not isinstance(spectrum, SelfAffine) or spectrum.angle is None:
        return jnp.ones((), q.dtype)
    return jnp.sqrt(narrowing(spectrum, q / spectrum.q_roll, offset))
