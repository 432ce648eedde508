"""The temperature by the heat of friction, and its effect on friction.

The temperature in the frame of the surface is steady. In a layer of conductivity κ and diffusivity
D each wave of the temperature obeys

    T'' = k² T - W/κ,      k = √(q² + iω/D), ω = -q·v

(H. S. Carslaw, J. C. Jaeger, Conduction of Heat in Solids, Oxford 1959, chapter 10), T and the flux
-κT' being continuous. The heat W is constant on slices of the depth, and the solution on each slice
is exact. A recursion upwards, from the half space below, where the flux is κkT, gives the flux Y T
+ F into the block below each edge; a recursion downwards gives the temperatures. The rough
counterface is at rest in this frame: k = |q|. The part β of the heat flows into the counterface,
distributed as the pressure. β makes the mean temperatures of both surfaces over the contact,
weighted by the pressure, equal (the partition of H. Blok, 1937). The mode q = 0 (bulk heating) is
left out: temperatures are above the mean of each plane, and both bodies have the same bulk
temperature.

With `slide(..., heating=...)` the block has the temperature of its contact. The mean rise over the
contact at each depth, weighted by the pressure, sets the relaxation times there: the block becomes
a stack of thin layers, each at its temperature. The fixed point is found in steps of a contact and
its temperatures (`core/fixed_point.py`): first by a bracket of the largest rise, up to the highest
temperature that materials can have, then by Anderson's acceleration. The derivative is implicit.

With `slide_cycle(..., heating=...)` one temperature of each depth holds for the whole cycle. It is
that of steady sliding at the mean speed and the mean load of the cycle, times the mean power of the
cycle over the power of that sliding. The power is that of all forces, friction and load: what the
block loses and what heats the interface. This is a mean: at the highest speed the contact is
warmer, and at a turn it cools. And each pass is to meet rubber that has cooled since the last one,
which is so if the stroke is longer than the spots of contact.
"""

import dataclasses
from typing import cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.heated_stack import HeatedContact, check_bulk, check_heated, heated
from ..blocks.stack import Stack, interface_depths
from ..contacts.area import area_in_doubt
from ..contacts.solution import RESULTS, ended
from ..core.checks import (
    Numbers,
    check_types,
    is_concrete,
)
from ..core.compilation import jit
from ..core.derivative import derivative_apart, still
from ..core.fixed_point import attach_fixed_point, find_fixed_point, has_reached
from ..fields.devices import required
from ..fields.frequency import wave_frequencies
from ..fields.grid import Grid, multiplicity, to_field, to_spectrum, wavenumber
from ..materials.shift import HOTTEST, as_temperature
from ..materials.softening import at_strain
from ..surfaces.surface import check_periodic
from .case import Case, Heating
from .facts import facts_of
from .formulas import lengths
from .heat_source import (
    as_depths,
    check_series,
    gauss_within,
    heat_depths,
    heat_source,
    heat_where,
    intervals,
    shear_heat,
)
from .isothermal import solve_isothermal
from .motion import refined
from .numerics import Numerics
from .result import CyclicSliding, Found, Sliding
from .traction import interface_power

NUM_CELLS = 8  # of the depth, each at one temperature
_SAFETY = 4.0  # of the change of friction by twice the cells
_HOTTEST = HOTTEST * (1 - 1e-6)  # of iterates: rounding must not carry them beyond
_FIRST = 0.25  # depth of the first cell [spacings]; the last one ends at the size of the surface


def solve_heated(case: Case, numerics: Numerics, start: Numbers | None = None) -> Found:
    """Returns the contact of a `Case` at the temperatures that it causes; see `slide`."""
    check_periodic(case.rough)
    check_heated(case.stack)
    if (
        case.velocity is None
        and is_concrete(case.displacement)
        and not np.any(np.ptp(np.asarray(case.displacement), axis=0))
    ):
        raise ValueError("`heating` is refused: `displacement` does not move.")
    grid, dtype = case.rough.grid, case.rough.grid.size.dtype
    temperature = as_temperature(check_bulk(case.temperature)).astype(dtype)
    case.stack.at(temperature)  # refuses what a material cannot have
    edges, padded, finer = _cells(grid, NUM_CELLS)
    given = dataclasses.replace(case, temperature=temperature)
    fixed = still(given)
    heat = fixed.heating, fixed.stack
    rtol = 10 * numerics.rtol  # temperatures are as noisy as the contact is inaccurate

    def contact(
        x, case: Case, edges, starts=(None, None), solutions=(None, None)
    ) -> tuple[Found, Sliding, Stack, Array | float]:
        """The contact at rises of the surface and of the cells, the contact with its heat, its
        block, and the factor of the heat.
        """
        block, temperature = _block(case.stack, case.temperature, x, edges)
        inner = dataclasses.replace(case, stack=block, temperature=temperature, heating=None)
        if case.velocity is None:
            cycle = cast(CyclicSliding, solve_isothermal(inner, numerics, starts[0], solutions[0]))
            inner, power = _of_mean(inner, cycle)
            s = cast(Sliding, solve_isothermal(inner, numerics, starts[1], solutions[1]))
            own = s.friction * jnp.mean(s.pressure) * s.speed
            return cycle, s, block, jnp.where(own > 0, power / jnp.where(own > 0, own, 1), 0)
        s = cast(Sliding, solve_isothermal(inner, numerics, starts[0], solutions[0]))
        if (ratio := case.strain_per_slope) is not None:
            block = at_strain(block, ratio * s.slope_in_contact)
        return s, s, block, 1.0

    def step(x, state):
        starts, pairs = state
        found, s, block, factor = contact(x, fixed, edges, starts)
        pairs = pairs + found.num_fft_pairs
        rises = _rises(factor, s, *heat, block, padded)[: len(x)]
        return rises, ((found.pressure, s.pressure), pairs)

    state = (start, None), jnp.zeros((), dtype)
    none = jnp.zeros(NUM_CELLS + 1, dtype)
    most = (_HOTTEST - fixed.temperature).astype(dtype)
    point = find_fixed_point(step, none, state, jnp.asarray(rtol, dtype), most)
    x = jax.lax.stop_gradient(point.x)
    starts, pairs = point.state
    found, s, block, factor = contact(x, fixed, edges, starts)
    # One more step with twice the cells has less error, of the iteration and of the depths.
    rises = _rises(factor, s, *heat, block, finer)
    # One that did not settle may cause temperatures that no material can have.
    rises = jnp.where(point.error <= rtol, rises, jnp.clip(rises, jnp.min(x), most))
    closer = contact(rises, fixed, finer, (found.pressure, s.pressure))[0]
    errors = still(_errors(found, closer))
    pairs = pairs + found.num_fft_pairs + closer.num_fft_pairs
    # Derivatives are attached only where something is traced.
    if not all(map(is_concrete, jax.tree.leaves(given))):
        known = still((found.contact, s.contact))

        def image(given, x):
            _, s, block, factor = contact(x, given, edges, solutions=known)
            return _rises(factor, s, given.heating, given.stack, block, padded)[: len(x)]

        x = attach_fixed_point(image, given, x)
        found, _, block, _ = contact(x, given, edges, solutions=known)
    reached, hottest = point.error <= rtol, has_reached(x, most)
    ends = (reached | hottest, RESULTS.not_settled), (reached | ~hottest, RESULTS.too_hot)
    solution = _with_ends(found.contact, ends, x[0], point.error, numerics.throw)
    return dataclasses.replace(
        found,
        contact=dataclasses.replace(solution, num_fft_pairs=pairs),
        problem=dataclasses.replace(found.problem, facts=facts_of(case)),
        heated=HeatedContact(block, x[0], x[1:], edges, point.error, *errors),
    )


def _with_ends(solution, ends, rise, change, throw: bool):
    """The solution with how the search of temperatures ended; raises if it failed and `throw`."""
    for good, end in ends:
        solution = ended(solution, good, end)
        if not throw:
            continue
        if is_concrete(good) and not good:
            raise RuntimeError(
                f"{RESULTS[end]} The last contact is {float(rise):.4g} K above the bulk; its heat "
                f"changes temperatures by {float(change):.2g} of the largest rise."
            )
        solution = required(solution, good, end.error_if)
    return solution


def _of_mean(case: Case, cycle: CyclicSliding) -> tuple[Case, Array]:
    """The case of steady sliding at the mean speed and load of a cycle, and its mean power [W/m²].

    The velocity is along the fastest part of the path, if the path is not straight.
    """
    velocity = refined(cycle.motion_of_surface[0])
    speed = lengths(velocity)
    top = jnp.argmax(speed)
    mean = jnp.mean(speed) * velocity[top] / speed[top]
    steady = dataclasses.replace(
        case, displacement=None, period=None, velocity=mean.reshape(cycle.displacement.shape[1:]),
        pressure=cycle.contact.mean_pressure, mean_gap=None,
    )  # fmt: skip
    # With coupling some of the work of shear is lost in the block: it counts once.
    return steady, cycle.dissipated_power + interface_power(cycle)


def _errors(s: Found, closer: Found):
    """The errors of friction and contact area, from a contact of less error."""
    names = (
        "mean_friction" if isinstance(s, CyclicSliding) else "friction",
        "contact_area",
        "contact_indicator",
    )
    return _differences(*((*one.compute(*names), one.pressure) for one in (s, closer)))


@jit
def _differences(found, closer):
    """The errors of friction and area from both, indicators and pressures."""
    by_friction, by_area = (
        _SAFETY * jnp.max(jnp.abs(a - b)) for a, b in zip(found[:2], closer[:2], strict=True)
    )
    return by_friction, jnp.maximum(by_area, area_in_doubt(found[2], closer[3] - found[3]))


@jit
def _cells(grid: Grid, number: int) -> tuple[Array, ...]:
    """The edges of the cells, these once more, and those of twice as many cells [m].

    In the second the last edge is repeated: one program serves both numbers of cells.
    """
    ends = _FIRST * jnp.min(grid.spacing), jnp.max(grid.size)
    edges, finer = intervals(*ends, number), intervals(*ends, 2 * number)
    padded = jnp.append(edges, jnp.full(number, edges[-1]))
    # The cells are a choice of the method: they have no derivative.
    return jax.lax.stop_gradient((edges, padded, finer))


@derivative_apart
@jit
def _block(stack: Stack, temperature, x, edges) -> tuple[Stack, Array]:
    """The block at rises of the surface and of the cells, and the temperature of the surface."""
    return heated(stack, temperature, x[1:], edges), temperature + x[0]


@derivative_apart
@jit
def _rises(factor, s: Sliding, heating: Heating | None, stack: Stack, block: Stack, edges) -> Array:
    """The mean rises of the surface and of the cells over the contact, times a factor [K]."""
    assert heating is not None
    depths, weights = gauss_within(stack, edges)
    check_series(block)
    source = heat_where(weights > 0, s, block, depths)
    # A few depths miss some of the heat.
    made = jnp.sum(jnp.mean(source, tuple(range(1, source.ndim))) * weights)
    lost = s.hysteresis_friction if s.coupling is None else s.block_friction
    power = lost * jnp.mean(s.pressure) * s.speed
    source = source * jnp.where(made > 0, jnp.abs(power) / jnp.where(made > 0, made, 1), 0)
    spectra = temperatures(s, stack, heating, source, weights, jnp.append(0.0, depths))
    weight = to_spectrum(_weight(s))
    rises = jax.vmap(lambda spectrum: _over_contact(weight, spectrum, s.grid))(spectra)
    share = jnp.where((depths > edges[:-1, None]) & (depths < edges[1:, None]), weights, 0)
    total = jnp.sum(share, 1)
    return factor * jnp.append(rises[0], share @ rises[1:] / jnp.where(total > 0, total, 1))


@check_types
def flash_temperature(
    sliding: Sliding,
    stack: Stack,
    heating: Heating,
    depths: Numbers,
) -> Float[Array, "depths *shape"]:
    """Returns the temperature in the block above the mean of each depth [K].

    Hysteresis and the shear of `sliding` heat the block. Differentiable as `heat_source`, and in
    `heating`.

    **Arguments:**

    - `sliding`, `stack`: as in `heat_source`; `stack` as given to `slide`.
    - `heating`: conductivities and diffusivities.
    - `depths`: z [m], shape `(depths,)`; 0 is the surface.

    **Returns:** T, shape `(depths, *grid.shape)`. Add the bulk temperature.

    **Raises:** `ValueError` for a refused argument.
    """
    depths = as_depths(depths)
    nodes, thickness = heat_depths(stack, sliding.grid)
    block = stack if sliding.heated is None else sliding.heated.stack
    source = heat_source(sliding, block, nodes)
    spectra = temperatures(sliding, stack, heating, source, thickness, depths)
    return jax.vmap(lambda spectrum: to_field(spectrum, sliding.grid.shape))(spectra)


@eqx.filter_jit
def temperatures(sliding: Sliding, stack: Stack, heating: Heating, source, thickness, depths):
    """Returns the spectra of the temperature at `depths` from heat in slices and at the surface.

    `source` is the heat [W/m³] of slices of this `thickness` [m], from the surface down.
    """
    grid, weight = sliding.grid, to_spectrum(_weight(sliding))
    interfaces, bottoms = interface_depths(stack).astype(depths.dtype), jnp.cumsum(thickness)
    edges = jnp.sort(jnp.concatenate([jnp.zeros(1, depths.dtype), bottoms, interfaces, depths]))
    middles = (edges[1:] + edges[:-1]) / 2
    parts = (len(stack.layers) + 1,)
    for name in ("conductivity", "diffusivity"):
        if (shape := getattr(heating, name).shape) not in ((), parts):
            raise ValueError(
                f"`{name}` has shape {shape}; one number is needed, or one for each of the "
                f"{len(stack.layers)} layers and one for what is below."
            )
    conductivity = jnp.broadcast_to(heating.conductivity, parts)
    diffusivity = jnp.broadcast_to(heating.diffusivity, parts)
    heat = jax.vmap(to_spectrum)(source)
    heat = jnp.concatenate([heat, jnp.zeros_like(heat[:1])])  # none below the slices

    def cell(i):
        """Thickness, κk, k and the heat of a cell between two edges."""
        layer = jnp.sum(middles[i] >= interfaces)
        k = thermal_wavenumber(grid, sliding.velocity, diffusivity[layer])
        d = edges[i + 1] - edges[i]
        return d, conductivity[layer] * k, k, heat[jnp.searchsorted(bottoms, middles[i])]

    def up(below, i):
        (admittance, flux), (d, y, k, w) = below, cell(i)
        e = jnp.exp(-k * d)
        cosine, tangent = 2 * e / (1 + e**2), -jnp.expm1(-2 * k * d) / (1 + e**2)  # 1/cosh, tanh
        whole = (jnp.expm1(-k * d)) ** 2 / (1 + e**2)  # 1 - 1/cosh
        scale = 1 / (1 + admittance * tangent / y)
        # The temperature below is a times that above, plus b.
        a, b = cosine * scale, (w / (k * y) * whole - flux * tangent / y) * scale
        above = (admittance + y * tangent) * scale
        flux = a * flux - w / (k * y) * (admittance * whole + y * tangent) * scale
        return (above, flux), (a, b)

    k = thermal_wavenumber(grid, sliding.velocity, diffusivity[-1])
    below = conductivity[-1] * k, jnp.zeros_like(k)
    (admittance, flux), steps = jax.lax.scan(up, below, jnp.arange(len(middles)), reverse=True)
    own = (to_spectrum(shear_heat(sliding)) - flux) / admittance
    # The heat that leaves, distributed as the pressure, makes the means of both surfaces equal.
    kappa, q = heating.counterface_conductivity, wavenumber(grid)
    there = _over_contact(weight, weight / jnp.where(q == 0, 1, q), grid)
    here = _over_contact(weight, weight / admittance, grid)
    left = kappa * _over_contact(weight, own, grid) / (kappa * here + there)
    surface = own - left * weight / admittance

    def down(above, step):
        found = step[0] * above + step[1]
        return found, found

    rest = jax.lax.scan(down, surface, steps)[1]
    found = jnp.concatenate([surface[None], rest])[jnp.searchsorted(edges, depths)]
    return jax.vmap(_without_mean)(found)


def _over_contact(weight, spectrum, grid: Grid):
    """The mean over the contact of a field without its mode q = 0, weighted by the pressure."""
    parts = (jnp.conj(weight) * spectrum).real * multiplicity(grid.shape)
    return jnp.sum(_without_mean(parts)) / np.prod(grid.shape) ** 2


def _weight(sliding):
    # Points that pull, with adhesion, have no weight.
    pressed = jnp.maximum(sliding.pressure, 0)
    return pressed / jnp.mean(pressed)


def thermal_wavenumber(grid, velocity, diffusivity):
    """Returns k = √(q² + iω/D) [1/m], 1 at q = 0: temperatures decay as exp(-kz)."""
    q = wavenumber(grid)
    squared = q**2 + 1j * wave_frequencies(grid, velocity) / diffusivity
    return jnp.sqrt(jnp.where(q == 0, 1, squared))


def _without_mean(spectrum):
    return spectrum.at[(0,) * spectrum.ndim].set(0)
