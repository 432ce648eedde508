"""Friction of all waves up to each wavenumber: which wavelengths matter."""

import jax.numpy as jnp
import numpy as np

from ...contacts.operators.operator import work_of_waves
from ...core.checks import check_whole
from ...core.compilation import compiled
from ...core.derivative import largest
from ...fields.devices import binned
from ...fields.grid import wavenumber
from ...surfaces.spectrum import CutoffCurve
from ..formulas import along_motion, loaded
from ..number import Found


def cumulative_friction(sliding: Found, num_wavenumbers: int = 64) -> CutoffCurve:
    """Returns the hysteresis friction of all waves up to each wavenumber.

    Each wave of the pressure contributes its work on its own displacement. In a passive block no
    contribution is negative. The last entry of `friction` is the friction of the pressure.

    **Arguments:**

    - `sliding`: a result of `slide`.
    - `num_wavenumbers`: at least 2.

    **Returns:** a `CutoffCurve` without areas, its cut-offs spaced geometrically from the lowest
    wavenumber of the cell to the highest of the grid.

    **Raises:** `ValueError` for a refused argument.
    """
    check_whole("num_wavenumbers", num_wavenumbers, 2)
    return _cumulative_friction(sliding.without_bodies(), num_wavenumbers)


@compiled
def _cumulative_friction(found: Found, num_wavenumbers: int) -> CutoffCurve:
    pressure, moved = loaded(found)
    q, (along,) = wavenumber(found.cell), along_motion(found)
    work = work_of_waves(pressure, moved, along)
    edges = jnp.geomspace(2 * np.pi / jnp.max(found.cell.size), largest(q), num_wavenumbers)
    # Waves on an edge belong to it, whatever the rounding.
    place = jnp.searchsorted(edges, q * (1 - 1e-6))
    place = jnp.minimum(place, num_wavenumbers - 1)
    share = binned(place, work, num_wavenumbers)
    return CutoffCurve(edges, jnp.cumsum(share) / jnp.mean(pressure))
