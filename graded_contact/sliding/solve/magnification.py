"""Contact area and friction up to each wavenumber: which wavelengths matter."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ...blocks.stack import Stack
from ...contacts.law import AbstractLaw, HardWall
from ...contacts.operators.operator import work_of_waves
from ...core.checks import (
    Numbers,
    as_float,
    check_increasing,
    check_positive,
    check_rows,
    check_shape,
    check_whole,
)
from ...core.compilation import compiled
from ...core.derivative import largest
from ...fields.devices import binned
from ...fields.frequency import as_velocity, direction_and_speed, wave_frequencies
from ...fields.grid import Grid, to_field, to_spectrum, wavenumber
from ...surfaces.spectrum import CutoffCurve
from ...surfaces.surface import Surface, check_periodic
from ..case import Case
from ..numerics import Numerics
from .isothermal import solve_posed
from .steady import steady_problem


def area_against_cutoff(
    stack: Stack,
    surface: Surface,
    cutoffs: Numbers,
    *,
    pressure: ScalarLike,
    velocity: Numbers,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    counterface: Stack | None = None,
    **numerics: Any,
) -> CutoffCurve:
    """Returns contact area and friction with only the waves up to each cut-off on the surface.

    The waves between two cut-offs cause the difference of their areas: A(q) is the area at the
    magnification q/q0. Each contact starts from the contact before.

    **Arguments:**

    - `cutoffs`: wavenumbers |q| [rad/m], ascending, shape `(cutoffs,)`; waves beyond are left out.
    - the others: as in `slide`, without `start` and `solution`.

    **Returns:** a `CutoffCurve` of the cut-offs; without `throw`, of NaN if the kernel failed.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if kernel or solve fail.
    """
    cutoffs = as_float(cutoffs, "cutoffs")
    check_rows(1, cutoffs=cutoffs)
    check_positive("cutoffs", cutoffs, "[rad/m]")
    check_increasing("cutoffs", cutoffs)
    check_periodic(surface)
    case = Case(
        stack=stack,
        surface=surface,
        pressure=pressure,
        velocity=velocity,
        law=law,
        counterface=counterface,
    )
    how = Numerics(**numerics).of(case.bodies, surface)
    posed = steady_problem(case, how)  # its kernel is that of all cut-offs

    def solve(start, cutoff):
        kept = wavenumber(surface.grid) <= cutoff * (1 + 1e-6)
        heights = jnp.where(kept, to_spectrum(surface.heights), 0)
        heights = to_field(heights, surface.grid.shape)
        smooth = eqx.tree_at(lambda one: one.problem.heights, posed, heights)
        s = solve_posed(smooth, how, start)
        found = jnp.stack(s.compute("friction", "contact_area"))
        # Areas without a pressure are none, not 0.
        return s.pressure, jnp.where(jnp.isfinite(found[0]), found, jnp.nan)

    # The first contact goes through coarse grids; all others are one compiled loop.
    start, first = solve(None, cutoffs[0])
    _, rest = jax.lax.scan(solve, start, cutoffs[1:])
    return CutoffCurve(cutoffs, *jnp.concatenate([first[None], rest]).T)


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
