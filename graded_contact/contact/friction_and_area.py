"""Friction and sub-pixel contact area as what a contact is wanted for: see `wanted.py`."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..fields.grid import Grid
from .area import contact_area_corrected, contact_area_smooth, edge_stiffness
from .implicit import displace
from .law import AbstractLaw
from .observables import friction, slope_in_contact
from .solution import ContactSolution
from .wanted import Asked

# A friction below this share of the rms slope is asked for as if it were that share, and friction
# and area no better than to this part of what the grid leaves.
_LEAST_SHARE = 0.01
_OF_GRID = 0.1


class FrictionAndArea(eqx.Module):
    """What `friction_rtol` is about."""

    kernel: Inexact[Array, "*half"]
    heights: Float[Array, "*shape"]
    grid: Grid
    velocity: Float[Array, "..."]
    law: AbstractLaw
    rtol: Float[Array, ""]

    def __call__(self, contact: ContactSolution) -> Asked:
        grid, sigma = self.grid, contact.pressure
        own = displace(self.kernel, sigma)
        mu, geometric = (friction(sigma, f, grid, self.velocity) for f in (own, self.heights))
        slope = slope_in_contact(sigma, own, grid)
        margin = self.law.margin(sigma, contact.gap, edge_stiffness(self.kernel, grid))
        area = contact_area_smooth(margin)
        counted = contact_area_corrected(margin > 0).astype(area.dtype)
        by_grid = jnp.abs(jnp.stack([geometric - mu, counted - area]))
        value, size = jnp.stack([mu, area]), jnp.stack([slope, area])
        tolerance = self.rtol * jnp.maximum(jnp.abs(value), _LEAST_SHARE * size)
        tolerance = jnp.maximum(tolerance, _OF_GRID * by_grid)
        # Of what does not touch there is no friction to be wrong.
        touching = jnp.any(sigma != 0)
        value, size, tolerance = (jnp.where(touching, a, 0) for a in (value, size, tolerance))
        return Asked(value, size, tolerance)
