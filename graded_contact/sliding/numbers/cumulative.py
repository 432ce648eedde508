"""Friction of all waves up to each wavenumber: which wavelengths matter."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...contacts.operators.operator import work_of_waves
from ...core.checks import Numbers, as_float, check_shape, check_whole
from ...core.compilation import compiled
from ...core.derivative import largest
from ...fields.devices import binned
from ...fields.frequency import as_velocity, direction_and_speed, wave_frequencies
from ...fields.grid import Grid, wavenumber
from ...surfaces.spectrum import CutoffCurve


def cumulative_friction(
    pressure: Float[Array, "*shape"],
    displacement: Float[Array, "*shape"],
    grid: Grid,
    velocity: Numbers,
    num_wavenumbers: int = 64,
) -> CutoffCurve:
    """Returns the friction of all waves up to each wavenumber.

    Each wave of the pressure contributes its work on its own displacement. In a passive block no
    contribution is negative, up to the error of the solution. The last entry of `friction` is the
    friction coefficient.

    **Arguments:**

    - `pressure`, `displacement`: of a solution [Pa, m], shape of `grid`.
    - `velocity`: that of the solution [m/s], a number (along x) or `(vx, vy)`; only its direction
      counts, and with the opposite one friction is negative.
    - `num_wavenumbers`: at least 2.

    **Returns:** a `CutoffCurve` without areas, its cut-offs spaced geometrically from the lowest
    wavenumber of the cell to the highest of the grid.

    **Raises:** `ValueError` for a refused argument.
    """
    pressure = as_float(pressure, "pressure")
    displacement = as_float(displacement, "displacement")
    for name, field in (("pressure", pressure), ("displacement", displacement)):
        check_shape(name, field, grid.shape)
    check_whole("num_wavenumbers", num_wavenumbers, 2)
    velocity = as_velocity(velocity, grid)
    return _cumulative_friction(pressure, displacement, grid, velocity, num_wavenumbers)


@compiled
def _cumulative_friction(pressure, displacement, grid, velocity, num_wavenumbers: int):
    q = wavenumber(grid)
    along = -wave_frequencies(grid, direction_and_speed(velocity)[0])
    work = work_of_waves(pressure, displacement, along)
    edges = jnp.geomspace(2 * np.pi / jnp.max(grid.size), largest(q), num_wavenumbers)
    # Waves on an edge belong to it, whatever the rounding.
    place = jnp.searchsorted(edges, q * (1 - 1e-6))
    place = jnp.minimum(place, num_wavenumbers - 1)
    share = binned(place, work, num_wavenumbers)
    return CutoffCurve(edges, jnp.cumsum(share) / jnp.mean(pressure))
