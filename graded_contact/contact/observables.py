"""Observables of a contact solution: friction, its error, dissipation per wavenumber.

The surface h(x - vt) moves with velocity v over the solid. On the moving surface the pressure σ
does the work ⟨σ ∇w⟩·v per area and time against the solid, w being its displacement: the
friction force opposing v is its negative over the speed, and it equals the dissipation
-Σ ω Im M |σ_q|² summed over all modes of both signs, which is never negative for a passive solid.

In contact ∇w = ∇h, and for the continuous problem ⟨σ ∇w⟩ = ⟨σ ∇h⟩ exactly. On a grid the two
differ by ⟨σ ∇u⟩, which arises at the edges of the contact. `Sliding.friction` uses the slope of the
displacement, which converges faster (ten times less error at 8 points per shortest wavelength,
`benchmarks/bench_contact.py`). `Sliding.geometric_friction` uses the slope of the surface. The
difference of the two is the error of the grid.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Inexact

from ..core.checks import Numbers, as_float, check_shape, check_types, check_whole
from ..core.compilation import compiled
from ..core.derivative import largest
from ..fields.devices import binned
from ..fields.grid import (
    Grid,
    as_velocity,
    derivative,
    direction_and_speed,
    multiplicity,
    to_spectrum,
    wave_frequencies,
    wavenumber,
)
from ..roughness.cutoff import CutoffCurve
from .area import contact_area_smooth
from .estimates import error_of
from .operator import displace


def friction(
    pressure: Float[Array, "*shape"],
    profile: Float[Array, "*shape"],
    grid: Grid,
    velocity: Numbers,
) -> Float[Array, ""]:
    """Returns the friction coefficient -⟨σ ∂f/∂x_v⟩/⟨σ⟩ [1], x_v along the velocity.

    `profile` f [m] is the displacement w of the solid, or the heights h of the surface: see
    above for how the two differ. At rest the direction is x.
    """
    return -jnp.sum(_work(pressure, profile, grid, velocity)) / jnp.mean(pressure)


def shear_friction(
    pressure: Float[Array, "*shape"],
    indicator: Float[Array, "*shape"],
    stress: Callable[[Float[Array, "*shape"]], Float[Array, "*shape"]] | None,
) -> Float[Array, ""]:
    """Returns the shear force in the contact over the load [1], ∫τ_f dA/∫σ dA; 0 without `stress`.

    `stress` gives τ_f [Pa] at a pressure [Pa]. Its value without pressure acts on the sub-pixel
    area, see `contact_area_smooth`. What pressure adds vanishes at the edge of contact and is
    summed over the points: friction in proportion to the pressure is exact.
    """
    if stress is None:
        return jnp.zeros((), pressure.dtype)
    least, added = shear_parts(pressure, stress)
    return (least * contact_area_smooth(indicator) + jnp.mean(added)) / jnp.mean(pressure)


def shear_parts(
    pressure: Float[Array, "*shape"],
    stress: Callable[[Float[Array, "..."]], Float[Array, "..."]],
) -> tuple[Float[Array, ""], Float[Array, "*shape"]]:
    """Returns the shear stress without pressure and what the pressure adds to it [Pa]."""
    least = stress(jnp.zeros((), pressure.dtype))
    pressed = pressure != 0  # elsewhere a power of the pressure may have no derivative
    return least, jnp.where(pressed, stress(jnp.where(pressed, pressure, 1)) - least, 0)


def shear_friction_error(
    pressure: Float[Array, "*shape"],
    correction: Float[Array, "*shape"],
    indicator: Float[Array, "*shape"],
    stress: Callable[[Float[Array, "*shape"]], Float[Array, "*shape"]],
) -> Float[Array, ""]:
    """Returns an estimate of the error of `shear_friction` that the solver left [1].

    It is what the `correction` of the pressure changes in the contact, see `estimates.py`.
    """

    def of(change):
        # In contact the indicator of a hard wall is the pressure.
        return shear_friction(pressure + change, indicator + change, stress)[None]

    value = of(jnp.zeros_like(pressure))
    return error_of(of, value, correction, jnp.abs(value))[0]


def dissipation(
    pressure: Float[Array, "*shape"],
    kernel: Inexact[Array, "*half"],
    grid: Grid,
    velocity: Numbers,
) -> Float[Array, "*half"]:
    """Returns the power lost per area [W/m²] in each mode of the half spectrum.

    Entries stand for themselves and their conjugates, so that the sum is the whole power,
    μ ⟨σ⟩ |v|.
    """
    omega = wave_frequencies(grid, velocity)
    amplitude = to_spectrum(pressure) / np.prod(grid.shape)
    power = (amplitude.real**2 + amplitude.imag**2) * -omega * jnp.imag(kernel)
    return power * multiplicity(grid.shape)


def friction_error(
    pressure: Float[Array, "*shape"],
    correction: Float[Array, "*shape"],
    kernel: Inexact[Array, "*half"],
    grid: Grid,
    velocity: Numbers,
) -> Float[Array, ""]:
    """Returns an estimate of the error of the friction coefficient that the solver left [1].

    It is the change by the `correction` of the pressure, see `estimates.py`; the error of the grid
    adds to it. At rest it is the error of rounding.
    """

    def of(change):
        changed = pressure + change
        return friction(changed, displace(kernel, changed), grid, velocity)[None]

    size = slope_in_contact(pressure, displace(kernel, pressure), grid)
    return error_of(of, of(jnp.zeros_like(pressure)), correction, size)[0]


@check_types
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
    work = _work(pressure, displacement, grid, velocity)
    edges = jnp.geomspace(2 * np.pi / jnp.max(grid.size), largest(q), num_wavenumbers)
    # Waves on an edge belong to it, whatever the rounding.
    place = jnp.searchsorted(edges, q * (1 - 1e-6))
    place = jnp.minimum(place, num_wavenumbers - 1)
    share = binned(place, work, num_wavenumbers)
    return CutoffCurve(edges, -jnp.cumsum(share) / jnp.mean(pressure))


def friction_share(
    pressure: Float[Array, "*shape"],
    displacement: Float[Array, "*shape"],
    grid: Grid,
    velocity: Numbers,
    chosen: Bool[Array, "..."],
) -> Float[Array, ""]:
    """Returns the share of the friction that the `chosen` waves contribute [1].

    `chosen` broadcasts to the half spectrum. Each wave contributes the work that it does on its own
    displacement. 0 without friction.
    """
    work = jnp.abs(_work(pressure, displacement, grid, velocity))
    total = jnp.sum(work)
    return jnp.sum(jnp.where(chosen, work, 0)) / jnp.where(total == 0, 1, total)


def energy_imbalance(
    pressure: Float[Array, "*shape"],
    displacement: Float[Array, "*shape"],
    kernel: Inexact[Array, "*half"],
    grid: Grid,
    velocity: Numbers,
) -> Float[Array, ""]:
    """Returns |work of friction - dissipation| over the work exchanged, ⟨|σ ∂w|⟩ |v| [1]."""
    slope, speed = _slope_along(displacement, grid, velocity)
    power = pressure * slope * speed
    lost = jnp.sum(dissipation(pressure, kernel, grid, velocity))
    exchanged = jnp.mean(jnp.abs(power))
    return jnp.abs(-jnp.mean(power) - lost) / jnp.where(exchanged > 0, exchanged, 1)


def slope_in_contact(
    pressure: Float[Array, "*shape"], displacement: Float[Array, "*shape"], grid: Grid
) -> Float[Array, ""]:
    """Returns the rms slope of the block's surface, weighted by |pressure| [1].

    It is the slope of the surface where it touches, and the size of the strains there; 0 without
    contact. The friction coefficient of a hard wall never exceeds it.
    """
    slopes = (derivative(displacement, grid, axis) for axis in range(grid.ndim))
    weight = jnp.abs(pressure)
    load = jnp.mean(weight)
    squared = jnp.mean(weight * sum(slope**2 for slope in slopes)) / jnp.where(load > 0, load, 1)
    return jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1)), 0)


def unmeasured_shares(
    measured: Float[Array, "*shape"],
    contact: Bool[Array, "*shape"],
    pressure: Float[Array, "*shape"],
    displacement: Float[Array, "*shape"],
    grid: Grid,
    velocity: Numbers,
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Returns the shares of contact area and friction on points that were not measured [1].

    `measured` is the measured share of each height, see `Surface`. The share of friction is that of
    the tangential traction |σ ∂w/∂x_v|, because tractions up and down the slopes nearly cancel in
    friction. 0 without contact.
    """
    lost = 1 - measured
    touching = contact.astype(measured.dtype)
    traction = jnp.abs(pressure * _slope_along(displacement, grid, velocity)[0])

    def share(weight):
        total = jnp.sum(weight)
        return jnp.sum(weight * lost) / jnp.where(total > 0, total, 1)

    return share(touching), share(traction)


def _work(pressure, profile, grid, velocity):
    """⟨σ ∂f/∂x_v⟩ [Pa], x_v along the velocity, of each mode and its conjugate."""
    along = wave_frequencies(grid, direction_and_speed(as_float(velocity, "velocity"))[0])
    # The real part of conj(σ) i q f, where -q along the velocity is ω at unit speed.
    found = along * (jnp.conj(to_spectrum(pressure)) * to_spectrum(profile)).imag
    return found * multiplicity(grid.shape) / np.prod(grid.shape) ** 2


def _slope_along(field, grid, velocity):
    """The derivative of a field along the velocity (along x at rest), and the speed."""
    direction, speed = direction_and_speed(as_float(velocity, "velocity"))
    axes = range(len(direction))
    return sum(direction[axis] * derivative(field, grid, axis) for axis in axes), speed
