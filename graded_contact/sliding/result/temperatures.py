"""The temperatures of a heated contact."""

import equinox as eqx
from jaxtyping import Array, Float

from ...core.display import shown


@shown()
class HeatedContact(eqx.Module):
    """The temperatures of a heated contact.

    **Fields:**

    - `surface_rise`: temperature of the surface above the bulk [K], mean over the contact.
    - `rises`: the same of each cell of the depth [K], shape `(cells,)`.
    - `edges`: depths between which the cells lie [m], from 0, shape `(cells + 1,)`.
    - `error`: change of the temperatures in the last step over the largest rise [1].
    - `friction_error`, `area_error`: estimated errors of friction and contact area [1], by `error`
      and by the finite number of cells.
    """

    surface_rise: Float[Array, ""]
    rises: Float[Array, " cells"]
    edges: Float[Array, " edges"]
    error: Float[Array, ""]
    friction_error: Float[Array, ""]
    area_error: Float[Array, ""]
