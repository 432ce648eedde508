"""Contact area and friction as shorter waves are added to the surface: which wavelengths matter."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ScalarLike

from ..contact.adjoint import LinearSolver, LinearSplitting
from ..contact.law import AbstractLaw, HardWall
from ..contact.nested_solve import DouglasRachford
from ..contact.problem import RTOL, solve_contact
from ..contact.solver import AbstractContactSolver
from ..core.checks import Numbers, as_float, check_positive, check_types, is_concrete
from ..fields.grid import Grid, to_field, to_spectrum, wavenumber
from ..response.grading import AbstractGradedSolver
from ..response.layering import Layering
from ..response.stack import Stack
from ..roughness.cutoff import CutoffCurve
from ..roughness.surface import Surface, check_periodic
from .slide import kernel_and_velocity
from .sliding import Sliding


@check_types
def area_against_cutoff(
    stack: Stack,
    surface: Surface,
    cutoffs: Numbers,
    *,
    pressure: ScalarLike,
    velocity: Numbers,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    solver: AbstractContactSolver = DouglasRachford(),  # noqa: B008
    adjoint: LinearSolver = LinearSplitting(),  # noqa: B008
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008
    rtol: float = RTOL,
    throw: bool = True,
) -> CutoffCurve:
    """Returns contact area and friction with only the waves up to each cut-off on the surface.

    The waves between two cut-offs cause the difference of their areas: A(q) is the area at the
    magnification q/q0. Each contact starts from the contact before.

    **Arguments:**

    - `cutoffs`: wavenumbers |q| [rad/m], ascending, shape `(cutoffs,)`; waves beyond are left out.
    - the others: as in `slide`.

    **Returns:** a `CutoffCurve` of the cut-offs; without `throw`, of NaN if the kernel failed.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if kernel or solve fail.
    """
    cutoffs = as_float(cutoffs, "cutoffs")
    if cutoffs.ndim != 1 or len(cutoffs) == 0:
        raise ValueError(f"`cutoffs` has shape {cutoffs.shape}; a row of wavenumbers is needed.")
    check_positive("cutoffs", cutoffs, "[rad/m]")
    if is_concrete(cutoffs) and np.any(np.diff(cutoffs) <= 0):
        raise ValueError(f"`cutoffs={np.asarray(cutoffs)}` must ascend.")
    check_periodic(surface)
    kernel, velocity, *_ = kernel_and_velocity(
        stack, surface, velocity, solver, graded_solver, throw
    )
    grid = surface.grid
    known = jnp.all(jnp.isfinite(kernel))

    def solve(cutoff, start):
        heights = _waves_up_to(cutoff, surface.heights, grid)
        contact = solve_contact(
            kernel,
            heights,
            pressure,
            law=law,
            solver=solver,
            adjoint=adjoint,
            rtol=rtol,
            start=start,
            throw=throw,
        )
        s = Sliding(
            contact=contact,
            kernel=kernel,
            heights=heights,
            measured=None,
            grid=grid,
            velocity=velocity,
            law=law,
        )
        found = jnp.stack(s.compute("friction", "contact_area", "contact_area_smooth"))
        return contact.pressure, jnp.where(known, found, jnp.nan)

    start, first = solve(cutoffs[0], None)
    _, rest = jax.lax.scan(lambda start, cutoff: solve(cutoff, start), start, cutoffs[1:])
    return CutoffCurve(cutoffs, *jnp.concatenate([first[None], rest]).T)


@eqx.filter_jit
def _waves_up_to(cutoff, heights, grid: Grid):
    kept = wavenumber(grid) <= cutoff * (1 + 1e-6)
    return to_field(jnp.where(kept, to_spectrum(heights), 0), grid.shape)
