"""The temperature of both bodies by the heat of friction.

The temperature in the frame of the surface is steady. In a layer of conductivity κ and diffusivity
D each wave of the temperature obeys

    T'' = k² T - W/κ,      k = √(q² + iω/D), ω = -q·v

(H. S. Carslaw, J. C. Jaeger, Conduction of Heat in Solids, Oxford 1959, chapter 10), T and the flux
-κT' being continuous. The heat W is constant on slices of the depth, and the solution on each slice
is exact. A recursion upwards, from the half space below, where the flux is κkT, gives the flux Y T
+ F into the block below each edge; a recursion downwards gives the temperatures. The counterface is
at rest in this frame: k = |q|. The part β of the heat flows into the counterface, distributed as
the pressure. β makes the mean temperatures of both surfaces over the contact, weighted by the
pressure, equal (the partition of H. Blok, 1937). The mode q = 0 (bulk heating) is left out:
temperatures are above the mean of each plane, and both bodies have the same bulk temperature.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...blocks.stack import Stack, interface_depths
from ...core.compilation import compiled
from ...fields.frequency import wave_frequencies
from ...fields.grid import Grid, multiplicity, to_spectrum, wavenumber
from ..case import Heating
from ..result import Sliding


class Heat(NamedTuple):
    """The heat in both bodies.

    **Fields:**

    - `source`: of slices of the block [W/m³], from the surface down.
    - `thickness`: of the slices [m].
    - `shear`: at the contact [W/m²].
    - `lost`: in the counterface, its mean [W/m²]; distributed over its surface as the pressure.
    """

    source: Array
    thickness: Array
    shear: Array
    lost: Array | float = 0.0


@compiled
def temperatures(sliding: Sliding, bodies, heating: Heating, heat: Heat, depths) -> list[Array]:
    """Returns the spectra of the temperature at depths of the block and of the counterface.

    `bodies` may be the block alone. A counterface that is None is a half space.
    """
    grid, weight = sliding.grid, to_spectrum(pressure_weight(sliding))
    stack, counterface = bodies if len(bodies) == 2 else (*bodies, None)
    conductivity, diffusivity, parts = of_parts(heating, stack, counterface)
    kappa = heating.counterface_conductivity
    # Its conductivity may be 0: temperatures depend on the ratios of its layers.
    first, ratios = (parts[0], jnp.ones_like(parts)) if kappa.ndim == 0 else (1.0, parts)
    made = jax.vmap(to_spectrum)(heat.source)
    bottoms = jnp.cumsum(heat.thickness)
    here, flux, block_at = _conduction(
        grid, sliding.velocity, stack, conductivity, diffusivity, made, bottoms, depths[0]
    )
    rest = depths[1] if len(depths) == 2 else jnp.zeros(1, depths[0].dtype)
    there, _, counterface_at = _conduction(
        grid,
        jnp.zeros_like(sliding.velocity),
        counterface,
        ratios,
        jnp.ones_like(ratios),
        made[:0],
        bottoms[:0],
        rest,
    )
    alone = (to_spectrum(heat.shear) - flux) / here
    # The heat that leaves, distributed as the pressure, makes the means of both surfaces equal.
    mean, by_block, by_counterface = (
        over_contact(weight, spectrum, grid) for spectrum in (alone, weight / here, weight / there)
    )
    into = (mean + heat.lost * by_block) / (first * by_block + by_counterface)
    left = first * into - heat.lost
    found = [block_at(alone - left * weight / here), counterface_at(into * weight / there)]
    return [jax.vmap(_without_mean)(spectra) for spectra in found[: len(depths)]]


def of_parts(heating: Heating, stack: Stack, counterface: Stack | None) -> list[Array]:
    """Returns conductivity and diffusivity of the block, and conductivity of the counterface.

    Each of all layers and of what is below them. Raises `ValueError` for another number of them.
    """
    found = []
    for name, body in (
        ("conductivity", stack),
        ("diffusivity", stack),
        ("counterface_conductivity", counterface),
    ):
        value, layers = getattr(heating, name), 0 if body is None else len(body.layers)
        if value.shape not in ((), (layers + 1,)):
            raise ValueError(
                f"`{name}` has shape {value.shape}; one number is needed, or {layers + 1}: one for "
                f"each of the {layers} layers of the body and one for what is below."
            )
        found.append(jnp.broadcast_to(value, (layers + 1,)))
    return found


def _conduction(
    grid: Grid, velocity, stack: Stack | None, conductivity, diffusivity, heat, bottoms, depths
):
    """The admittance of a body, the flux into it at a cold surface, and what gives the spectra of
    the temperature at `depths` from the temperature of the surface.

    `heat` has the spectra of slices that end at `bottoms`; there is none below.
    """
    interfaces = jnp.zeros(0) if stack is None else interface_depths(stack)
    interfaces = interfaces.astype(depths.dtype)
    edges = jnp.sort(jnp.concatenate([jnp.zeros(1, depths.dtype), bottoms, interfaces, depths]))
    middles = (edges[1:] + edges[:-1]) / 2
    k = thermal_wavenumber(grid, velocity, diffusivity[-1])
    heat = jnp.concatenate([heat, jnp.zeros((1, *k.shape), k.dtype)])

    def cell(i):
        """Thickness, κk, k and the heat of a cell between two edges."""
        layer = jnp.sum(middles[i] >= interfaces)
        k = thermal_wavenumber(grid, velocity, diffusivity[layer])
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

    below = conductivity[-1] * k, jnp.zeros_like(k)
    (admittance, flux), steps = jax.lax.scan(up, below, jnp.arange(len(middles)), reverse=True)

    def at_depths(surface):
        def down(above, step):
            found = step[0] * above + step[1]
            return found, found

        rest = jax.lax.scan(down, surface, steps)[1]
        return jnp.concatenate([surface[None], rest])[jnp.searchsorted(edges, depths)]

    return admittance, flux, at_depths


def over_contact(weight, spectrum, grid: Grid) -> Array:
    """Returns the mean over the contact of a field without its mode q = 0, by the pressure."""
    parts = (jnp.conj(weight) * spectrum).real * multiplicity(grid.shape)
    return jnp.sum(_without_mean(parts)) / np.prod(grid.shape) ** 2


def pressure_weight(sliding: Sliding) -> Array:
    """Returns the pressure over its mean [1]."""
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
