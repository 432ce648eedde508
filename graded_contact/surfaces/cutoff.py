"""Friction and contact area as functions of the cut-off of the roughness."""

import equinox as eqx
from jaxtyping import Array, Float

from ..core.display import shown


@shown()
class CutoffCurve(eqx.Module):
    """Friction and contact area up to each cut-off.

    Which waves count depends on the function: `cumulative_friction` adds up the waves of one
    contact, `area_against_cutoff` and `mean_field_friction` leave out those of the surface.

    **Fields:**

    - `cutoff`: wavenumbers q [rad/m], increasing, shape `(cutoffs,)`.
    - `friction`: force opposing the motion over the load [1], shape `(cutoffs,)`.
    - `contact_area`: fraction of the nominal area in contact [1], shape `(cutoffs,)`; None where
      there is one contact.
    - `contact_area_smooth`: that with sub-pixel edges [1], shape `(cutoffs,)`; None without a grid.
    """

    cutoff: Float[Array, " cutoffs"]
    friction: Float[Array, " cutoffs"]
    contact_area: Float[Array, " cutoffs"] | None = None
    contact_area_smooth: Float[Array, " cutoffs"] | None = None
