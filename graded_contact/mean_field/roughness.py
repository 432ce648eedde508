"""Spectra as the quadrature of the mean field takes them: smooth pieces, with or without a lay."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import as_float, check_rows, is_concrete, short
from ..surfaces.spectrum import SelfAffine, narrowing
from ..surfaces.spectrum_table import Spectrum, SpectrumTable, check_table


class Roughness(eqx.Module):
    """A spectrum in smooth pieces.

    **Fields:**

    - `edges`: wavenumbers [rad/m] between which C(q) is smooth, increasing, shape `(points,)`.
    - `source`: the spectrum.
    """

    edges: Float[Array, " points"]
    source: Spectrum

    @property
    def lay(self) -> Float[Array, ""] | None:
        """The angle of the lay from the x axis [rad], or None."""
        return self.source.angle if isinstance(self.source, SelfAffine) else None

    def turn_of(self, direction: Float[Array, " components"]) -> Float[Array, ""] | None:
        """Returns the angle from the lay to a direction, from 0 to π [rad], or None."""
        if self.lay is None:
            return None
        # A profile has one component.
        x, y = direction if len(direction) == 2 else (direction[0], jnp.zeros_like(direction[0]))
        return jnp.mod(jnp.arctan2(y, x) - self.lay, np.pi)

    def root_density(self, q: Float[Array, "*n"], mean: bool = False) -> Float[Array, "*n"]:
        """Returns √C [m²] across the lay, or that of the `mean` over directions; 0 outside."""
        if isinstance(self.source, SelfAffine):
            across = None if mean or self.lay is None else self.lay + np.pi / 2
            density = self.source.density(q, 2, across)
        else:
            density = self.source.density(q)
        # The derivative of the root at 0 is infinite.
        return jnp.where(density > 0, jnp.sqrt(jnp.where(density > 0, density, 1)), 0)

    def root_narrowing(self, q: Array, offset: Array) -> Array:
        """Returns the ratio of √C at angles from the direction across the lay to √C across [1]."""
        if not isinstance(self.source, SelfAffine) or self.lay is None:
            return jnp.ones((), q.dtype)
        return jnp.sqrt(narrowing(self.source, q / self.source.q_roll, offset))


def joined_edges(track: Roughness, own: Roughness | None) -> Float[Array, " points"]:
    """Returns wavenumbers between which both spectra are smooth.

    The ends of each are two edges, closely below and above: C jumps there.
    """
    if own is None:
        return track.edges
    away = 64 * float(jnp.finfo(track.edges.dtype).eps)
    ends = [r.edges[i] * by for r in (track, own) for i in (0, -1) for by in (1 - away, 1 + away)]
    inner = [r.edges[1:-1] for r in (track, own)]
    return jnp.sort(jnp.concatenate([jnp.stack(ends), *inner]))


def as_roughness(spectrum: object, name: str = "spectrum") -> Roughness:
    """Returns a spectrum, or a pair (q, C) of arrays, in pieces; refuses anything else."""
    if isinstance(spectrum, SelfAffine):
        edges = jnp.stack([spectrum.q_low, spectrum.q_roll, spectrum.q_high])
        return Roughness(edges, spectrum)
    if isinstance(spectrum, SpectrumTable):
        return Roughness(spectrum.q, spectrum)
    if not (isinstance(spectrum, tuple | list) and len(spectrum) == 2):
        raise ValueError(
            f"`{name}={short(spectrum)}` must be a `SelfAffine`, a `SpectrumTable`, "
            f"{'a `Surface` ' if name == 'spectrum' else ''}or a pair (q, C)."
        )
    q, c = map(as_float, spectrum)
    names = f"{name}[0]", f"{name}[1]"
    check_rows(2, **dict(zip(names, (q, c), strict=True)))
    if is_concrete(q) and is_concrete(c):
        known = ~np.isnan(np.asarray(c))
        q, c = q[known], c[known]
    if len(q) < 2:
        raise ValueError(f"`{name}` has C(q) at {len(q)} wavenumbers; at least 2 are needed.")
    check_table(**dict(zip(names, (q, c), strict=True)))
    return Roughness(q, SpectrumTable(q, c))
