"""The main job: a rough rigid surface sliding on a layered viscoelastic block.

The surface h(x - vt) is pressed on the block by a mean pressure and moves steadily with the
velocity v. In the frame of the surface everything stands still, and every wavevector q of the
pressure works the block at the frequency ω = -q·v.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..contact.area import (
    contact_area,
    contact_area_corrected,
    contact_area_error,
    contact_area_smooth,
    edge_stiffness,
)
from ..contact.douglas_rachford import DouglasRachford
from ..contact.friction_and_area import FrictionAndArea
from ..contact.implicit import displace
from ..contact.law import AbstractLaw, HardWall
from ..contact.observables import (
    energy_imbalance,
    friction,
    friction_error,
    friction_share,
    slope_in_contact,
    unmeasured_shares,
)
from ..contact.problem import RTOL, solve_contact
from ..contact.solution import RESULTS, ContactSolution
from ..contact.solver import AbstractContactSolver
from ..core.checks import Numbers, as_float, check_tolerance, check_types, is_concrete, short
from ..core.derivative import derivative_apart
from ..core.display import shown
from ..core.memory import check_memory, num_numbers, sliding_memory
from ..core.warnings import caveats_of
from ..fields.devices import num_devices
from ..fields.grid import Grid, wave_frequencies
from ..response.grading import AbstractGradedSolver
from ..response.kernel import attempted_kernel, stack_kernel
from ..response.layering import Layering
from ..response.stack import Stack
from ..rheology.measured import coverage, is_unknown
from ..roughness.surface import Surface


@shown(..., "caveats")
class Sliding(eqx.Module):
    """Friction, contact area and fields of a sliding contact.

    Errors and `energy_imbalance` have no derivative.

    **Fields:**

    - `friction`: force opposing the motion over the load [1]; >= 0 for passive materials, nan
      where a mean gap leaves no contact.
    - `friction_error`: estimated error of the friction that the solver left [1]. That of the grid
      comes on top, see `geometric_friction`.
    - `contact_area`: fraction of points in contact [1]. A pixel count, without a derivative.
    - `contact_area_error`: fraction of points that the solver may have put on the wrong side [1];
      if `friction_rtol` was asked for, the error that it left in `contact_area_smooth`.
    - `contact_area_corrected`: the same less its known excess at the edges [1].
    - `contact_area_smooth`: sub-pixel area fraction [1], for gradients.
    - `geometric_friction`: friction from the surface's slope instead of the block's [1]. Its
      distance from `friction` is the error of the grid.
    - `energy_imbalance`: work of friction against dissipation in the block, relative [1].
    - `slope_in_contact`: rms slope of the block where it carries the load [1]: the strains there.
    - `unmeasured_area`, `unmeasured_friction`: shares of the contact area and of the friction on
      points that were filled or tapered, not measured [1]; 0 where `Surface.measured` is None.
    - `extrapolated_friction`: share of the friction from waves that excite frequencies at which a
      material was not measured [1]: its modulus there is an extrapolation. See `coverage`.
    - `contact`: pressure, gap and convergence, see `ContactSolution`; also reached directly as
      `.pressure`, `.gap`, `.displacement` [Pa, m, m], `.mean_gap` [m], `.error`, `.num_fft_pairs`
      and `.result`.
    """

    friction: Float[Array, ""]
    friction_error: Float[Array, ""]
    contact_area: Float[Array, ""]
    contact_area_error: Float[Array, ""]
    contact_area_corrected: Float[Array, ""]
    contact_area_smooth: Float[Array, ""]
    geometric_friction: Float[Array, ""]
    energy_imbalance: Float[Array, ""]
    slope_in_contact: Float[Array, ""]
    unmeasured_area: Float[Array, ""]
    unmeasured_friction: Float[Array, ""]
    extrapolated_friction: Float[Array, ""]
    contact: ContactSolution

    @property
    def caveats(self) -> tuple[str, ...]:
        """What makes these numbers doubtful, one sentence each; not under `jit`."""
        return tuple(caveat.sentence for caveat in caveats_of(self))

    @property
    def pressure(self) -> Float[Array, "*shape"]:
        return self.contact.pressure

    @property
    def gap(self) -> Float[Array, "*shape"]:
        return self.contact.gap

    @property
    def displacement(self) -> Float[Array, "*shape"]:
        return self.contact.displacement

    @property
    def mean_gap(self) -> Float[Array, ""]:
        return self.contact.mean_gap

    @property
    def error(self) -> Float[Array, ""]:
        return self.contact.error

    @property
    def num_fft_pairs(self) -> Float[Array, ""]:
        return self.contact.num_fft_pairs

    @property
    def result(self) -> RESULTS:
        return self.contact.result


@check_types
def slide(
    stack: Stack,
    surface: Surface,
    *,
    pressure: ScalarLike | None = None,
    mean_gap: ScalarLike | None = None,
    velocity: Numbers,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    solver: AbstractContactSolver = DouglasRachford(),  # noqa: B008
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008
    rtol: float | None = None,
    friction_rtol: float | None = None,
    start: Numbers | None = None,
    throw: bool = True,
) -> Sliding:
    """Returns friction, contact area and fields of a rough surface sliding on a block.

    Differentiable in every leaf of `stack`, `surface` and `law`, in `pressure` or `mean_gap` and in
    `velocity`: `jax.grad(lambda s: slide(s, surface, pressure=p, velocity=v).friction)(stack)` is a
    stack of derivatives. Works under `jit` and `vmap`; for a batch on a CPU prefer `jax.lax.map`,
    see `solve_contact`.

    **Arguments:**

    - `stack`: the block, see `Stack`. `stack.at(temperature)` is the block at another temperature.
    - `surface`: the rough surface; heights count into the block.
    - `pressure`: mean pressure σ0 [Pa]; or
    - `mean_gap`: mean of the gap [m], counted from the mean of the heights.
    - `velocity`: of the surface over the block [m/s]: a number (along x) or `(vx, vy)`. Two numbers
      are one velocity, not two speeds as in a scene: for several speeds use `sweep` or
      `jax.lax.map`. At rest (0, known beforehand) the relaxed moduli act and a real kernel is used.
    - `graded_solver`: the solver of graded layers and its tolerance, `Layering()` or `Riccati()`.
    - `friction_rtol`: wanted relative error of friction and of the sub-pixel contact area [1];
      nothing better is asked for than a tenth of what the grid leaves, and than a hundredth of the
      slope in place of a friction less than that. Or
    - `rtol`: wanted relative error of the pressure [1]; 5e-5 if neither is given: the error of
      friction is then at most about 1e-4 of it.
    - `law`, `solver`, `start`, `throw`: as in `solve_contact`. Without `throw` a graded
      layer whose kernel misses its tolerance is a `.result` as well, and all numbers are NaN.

    **Returns:** friction, areas, errors and the contact itself, see `Sliding`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if kernel or solve fail.
    """
    kernel, velocity, reached = kernel_and_velocity(
        stack, surface, velocity, solver, graded_solver, throw
    )
    rtol, wanted = _aim(rtol, friction_rtol, kernel, surface, velocity, law)
    contact = solve_contact(
        kernel,
        surface.heights,
        pressure,
        mean_gap=mean_gap,
        law=law,
        solver=solver,
        rtol=rtol,
        wanted=wanted,
        start=start,
        throw=throw,
    )
    contact = _told(contact, reached)
    heights, measured, grid = surface.heights, surface.measured, surface.grid
    known = _coverage(stack)
    return observe(contact, kernel, heights, measured, grid, velocity, law, known)


_coverage = eqx.filter_jit(coverage)


def _told(contact: ContactSolution, reached) -> ContactSolution:
    """The contact, its result that of the kernel if that was not reached."""
    if reached is True:
        return contact
    result = RESULTS.where(reached, contact.result, RESULTS.inaccurate_kernel)
    return dataclasses.replace(contact, result=result)


def _aim(rtol, friction_rtol, kernel, surface: Surface, velocity, law):
    """The tolerance of the solve, and of what other than the pressure, if any."""
    if rtol is not None and friction_rtol is not None:
        raise ValueError(
            f"`rtol={rtol}` and `friction_rtol={friction_rtol}`: give at most one of the two."
        )
    if friction_rtol is None:
        return RTOL if rtol is None else rtol, None
    check_tolerance("friction_rtol", friction_rtol, surface.heights)
    heights = surface.heights
    velocity, tolerance = (jnp.asarray(a, heights.dtype) for a in (velocity, friction_rtol))
    return friction_rtol, FrictionAndArea(kernel, heights, surface.grid, velocity, law, tolerance)


def kernel_and_velocity(stack, surface, velocity, solver, graded_solver, throw):
    """The kernel on the surface's grid, the velocity as an array, and if the kernel is good."""
    if not isinstance(stack, Stack):
        raise ValueError(f"`stack={short(stack)}` must be a `Stack(layers=..., base=...)`.")
    if not isinstance(surface, Surface):
        raise ValueError(f"`surface={short(surface)}` must be a `Surface(heights, grid)`.")
    velocity = as_float(velocity, "velocity")
    numbers, oblique = num_numbers(stack), velocity.ndim > 0
    check_memory(
        "surface",
        surface.grid.shape,
        lambda shape: sliding_memory(
            shape, surface.heights.dtype.itemsize, numbers, oblique, solver.memory
        ),
        "sliding",
        num_devices(surface.grid.size),
    )
    if throw:
        kernel, reached = (
            stack_kernel(stack, surface.grid, velocity, graded_solver=graded_solver),
            True,
        )
    else:
        kernel, reached = attempted_kernel(
            stack, surface.grid, velocity, graded_solver=graded_solver
        )
    at_rest = is_concrete(velocity) and not np.any(np.asarray(velocity))
    return (kernel.real if at_rest else kernel), velocity, reached


@derivative_apart
def observe(
    contact: ContactSolution,
    kernel: Inexact[Array, "*half"],
    heights: Float[Array, "*shape"],
    measured: Float[Array, "*shape"] | None,
    grid: Grid,
    velocity: Float[Array, "..."],
    law: AbstractLaw,
    known: tuple[Float[Array, ""], Float[Array, ""]] | None,
) -> Sliding:
    """Returns what a contact means; in programs of their own, which hold fewer fields at once."""
    own, margin, slope = _in_contact(contact, kernel, grid, law)
    numbers = _frictions(contact, own, kernel, heights, grid, velocity, known)
    numbers |= _uncertainties(contact, own, kernel, grid, velocity)
    numbers |= _areas(contact, margin, measured, grid, velocity)
    if contact.wanted_error is not None:
        mu_error, area_error = contact.wanted_error
        numbers |= dict(friction_error=mu_error, contact_area_error=area_error)
    return Sliding(contact=contact, slope_in_contact=slope, **numbers)


@eqx.filter_jit
def _in_contact(contact: ContactSolution, kernel, grid: Grid, law: AbstractLaw):
    """The displacement of the pressure itself, which balances energy to rounding, and others."""
    margin = law.margin(contact.pressure, contact.gap, edge_stiffness(kernel, grid))
    slope = slope_in_contact(contact.pressure, contact.displacement, grid)
    return displace(kernel, contact.pressure), margin, slope


@eqx.filter_jit
def _frictions(contact: ContactSolution, own, kernel, heights, grid: Grid, velocity, known):
    sigma, w = contact.pressure, contact.displacement
    extrapolated = jnp.zeros((), sigma.dtype)
    if known is not None:
        unknown = is_unknown(wave_frequencies(grid, velocity), known)
        extrapolated = friction_share(sigma, w, grid, velocity, unknown)
    return dict(
        friction=friction(sigma, own, grid, velocity),
        geometric_friction=friction(sigma, heights, grid, velocity),
        extrapolated_friction=extrapolated,
    )


@eqx.filter_jit
def _uncertainties(contact: ContactSolution, own, kernel, grid: Grid, velocity):
    # Errors have no derivative.
    s, correction, u, m, v = jax.lax.stop_gradient(
        (contact.pressure, contact.correction, own, kernel, velocity)
    )
    return dict(
        friction_error=friction_error(s, correction, m, grid, v),
        energy_imbalance=energy_imbalance(s, u, m, grid, v),
    )


@eqx.filter_jit
def _areas(contact: ContactSolution, margin, measured, grid: Grid, velocity):
    sigma, touching = contact.pressure, margin > 0
    zero = jnp.zeros((), sigma.dtype)
    area, rubbing = (
        (zero, zero)
        if measured is None
        else unmeasured_shares(measured, touching, sigma, contact.displacement, grid, velocity)
    )
    known = jax.lax.stop_gradient((margin, contact.correction))
    return dict(
        contact_area=contact_area(touching).astype(sigma.dtype),
        contact_area_error=contact_area_error(*known),
        contact_area_corrected=contact_area_corrected(touching).astype(sigma.dtype),
        contact_area_smooth=contact_area_smooth(margin),
        unmeasured_area=area,
        unmeasured_friction=rubbing,
    )
