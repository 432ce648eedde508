"""Friction, its parts and its error.

In contact ∇w = ∇h, and for the continuous problem ⟨σ ∇w⟩ = ⟨σ ∇h⟩ exactly. On a grid the two
differ by ⟨σ ∇u⟩, which arises at the edges of the contact. `friction` uses the slope of the
displacement, which converges faster (ten times less error at 8 points per shortest wavelength,
`benchmarks/bench_contact.py`). `geometric_friction` uses the slope of the surface. A part
of their difference counts as an error of the grid.

A traction that moves the surface of the block (`solve/steady.py`) does the work τ e·u̇ on it, and
the rest of τ v heats the interface, where the surfaces slip by v - e·u̇. So the friction, the sum of
shear and slopes, is

    ⟨τ⟩ - ⟨σ ∂w/∂x⟩ = [-⟨σ ∂w/∂x⟩ - ⟨τ ∂u/∂x⟩] + ⟨τ (1 + ∂u/∂x)⟩,

the part lost in the block, Σ -ω Im(tᴴ C t)/v with t = (τ, σ), plus the heat of the interface. Both
sides agree to rounding.

The law takes the stress σ normal to the mean plane: then the force is right to first order in the
slope. If the law takes the pressure normal to the slope ∂w/∂x, the force is to this order

    τ(σ) - σ ∂w/∂x - τ τ' ∂w/∂x.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...contacts.estimates import error_of
from ...contacts.operators.operator import work_of_waves
from ...core.checks import check_whole
from ...core.compilation import compiled
from ...core.derivative import largest
from ...fields.devices import binned
from ...fields.grid import wavenumber
from ...surfaces.spectrum import CutoffCurve
from ..case import COUPLED, HEATED
from ..energy import powers_of_traction, waves_of
from ..errors.grid import beside_changes, friction_by_grid
from ..errors.parts import changes_by_kernel, over_friction, solver_errors, with_chance
from ..formulas import (
    all_tractions,
    along_motion,
    counterface_displacement,
    edges_of,
    frictions,
    indicator_of,
    loaded,
    mean_load,
    over_load,
    own_tractions,
    shear_power,
    sheared,
    slopes,
    tractions_of,
    tractions_on,
)
from ..number import Found, observable
from ..problem import CycleProblem
from ..shear import shear_over_load
from .warnings import APART, NEVER_LOADED

_BY_SLOPES = 0.08  # weight of the difference of `friction` and `geometric_friction`
# Of the friction: a nearly elastic block has far less than the error of the surface's slope.
_MOST_BY_SLOPES = 0.1


@observable("friction coefficient")
def friction(found: Found) -> Array:
    """Force opposing the motion over the load [1], hysteresis and shear together.

    It is >= 0 for passive materials in steady sliding, and NaN without contact. In a cycle it is
    positive where it opposes a motion along +x; over the displacement it draws the hysteresis loop.
    """
    if isinstance(found.problem, CycleProblem):
        return over_load(found, all_tractions(found))
    return pressure_friction(found) + shear_friction(found)


@observable("part of the friction by the pressure on slopes", warns=APART)
def pressure_friction(found: Found) -> Array:
    """The part of the friction that the pressure exerts on slopes [1].

    Without coupling the block loses it. With coupling it may be negative, and an elastic block may
    have it: `block_friction` is the part that the block loses.
    """
    return over_load(found, own_tractions(found))


@observable("friction coefficient of shear in the contact")
def shear_friction(found: Found) -> Array:
    """The part from shear in the contact area [1]; 0 without `shear`."""
    if isinstance(found.problem, CycleProblem):
        return over_load(found, sheared(found)[0])
    return shear_over_load(found.pressure, indicator_of(found), edges_of(found), found.shear)


@observable("temperature of the contact above the bulk", "K", needs=[HEATED])
def surface_rise(found: Found) -> Array:
    """Temperature of the contact above the bulk, with heating [K]; the mean over a cycle."""
    assert found.heated is not None
    return found.heated.surface_rise


# Where the power of a traction goes that moves the surface of the block.


def slip(found: Found) -> Array:
    """Returns the speed of slip over the speed of sliding [1], on the cell of steady sliding."""
    (along,), moved = along_motion(found), waves_of(found)[0][1][1]
    shape = loaded(found)[0].shape
    return 1 + found.operator.to_field(1j * along * moved, shape) * math.prod(shape)


@observable("friction lost in the block", needs=[COUPLED])
def block_friction(found: Found) -> Array:
    """The part of the friction that is dissipated in the block [1], by pressure and traction."""
    return friction(found) - interface_friction(found)


@observable("friction that heats the interface", needs=[COUPLED])
def interface_friction(found: Found) -> Array:
    """The part of the friction that heats the interface [1]; without coupling `shear_friction`."""
    if not found.coupling.lift:
        return shear_friction(found)
    (stress,) = tractions_on(found)
    return jnp.mean(stress * slip(found)) / mean_load(found)


@observable("mean power that heats the interface", "W/m²", needs=[COUPLED])
def interface_power(found: Found) -> Array:
    """Mean power that heats the interface per area [W/m²].

    The work of friction and of the load is this, `dissipated_power` and `counterface_power`.
    """
    return shear_power(found) - sum(map(jnp.mean, powers_of_traction(found)))


def geometric_friction(found: Found) -> Array:
    """Returns the friction by the surface's slope instead of the block's [1].

    With a counterface the surface is deformed. Its difference from `friction` shows the error of
    the grid.
    """
    pressure = loaded(found)[0]
    heights = found.operator.on_cell(found.heights, "symmetric")
    if found.problem.counterface is not None:
        heights = heights - counterface_displacement(found, pressure)
    return over_load(found, tractions_of(found, pressure, heights)) + shear_friction(found)


@observable("shear stress that opposes the motion", "Pa")
def traction(found: Found) -> Array:
    """τ [Pa], the shear stress on the whole area, of hysteresis and shear together."""
    return all_tractions(found).reshape(found.displacement.shape)


@observable("mean pressure at each time", "Pa", warns=NEVER_LOADED)
def load(found: Found) -> Array:
    """Mean pressure [Pa]."""
    return mean_load(found)


def _image_error(found: Found) -> Array:
    """The change of friction by the errors of a window's kernel: at this pressure, and by the load.

    Contributions of single points may cancel in the estimate by chance: so twice their root sum of
    squares is added (`docs/theory/contact.md`).
    """
    assert found.problem.kernel_error is not None
    pressure = loaded(found)[0]
    moved = [found.operator.with_kernel(k).displace(pressure) for k in found.problem.kernel_error]
    sums = sum(jnp.abs(jnp.sum(tractions_of(found, pressure, w)) / mean_load(found)) for w in moved)
    steep = sum(slopes(found, pressure, w) for w in moved)
    by_kernel = sums + 2 * steep / jnp.sqrt(jnp.sum(pressure != 0))
    if found.problem.prescribed != "approach":
        return by_kernel
    indicator, edges = indicator_of(found), edges_of(found)

    def friction_under(p):
        own = frictions(found, found.operator.on_cell(p), indicator)[0]
        return own + shear_over_load(p, indicator + p - found.pressure, edges, found.shear)

    pull = jax.grad(friction_under)(found.pressure)
    return by_kernel + sum(with_chance(pull * change) for change in changes_by_kernel(found))


def _friction_by_solver(found: Found) -> Array:
    error = solver_errors(found)[0]
    if found.shear is None:
        return error
    indicator, value = indicator_of(found), jnp.abs(shear_friction(found))
    edges, pressure = edges_of(found), found.pressure

    def of(change):  # in contact the indicator of a hard wall is the pressure
        return shear_over_load(pressure + change, indicator + change, edges, found.shear)[None]

    return error + error_of(of, of(jnp.zeros_like(indicator)), found.contact.correction, value)[0]


# `bench_contact.py grid` has how often these are below the true error, and how far above it.


def _beside(found: Found) -> Array:
    """`beside_changes`, and a part of the difference of the frictions by the two slopes [1]."""
    by_slopes = _BY_SLOPES * jnp.abs(geometric_friction(found) - friction(found))
    most = _MOST_BY_SLOPES * jnp.abs(pressure_friction(found))
    return beside_changes(found) + jnp.minimum(by_slopes, most)


friction_error = friction.error(
    {
        "solver": _friction_by_solver,
        "grid": friction_by_grid("friction", _beside),
        "kernel": _image_error,
        "temperature": lambda found: found.heated.friction_error,
    },
    over=over_friction,
)


# Which wavelengths matter.


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
