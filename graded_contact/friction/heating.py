"""The temperature that the heat of friction causes, and what it does to friction.

The temperature in the frame of the surface is steady. A wave of sources at the depth z' in a half
space with an insulated surface, of conductivity κ and diffusivity D, causes

    T(q, z) = W(q, z') [exp(-k|z - z'|) + exp(-k(z + z'))]/(2 κ k),      k = √(q² + iω/D), ω = -q·v

(H. S. Carslaw, J. C. Jaeger, Conduction of Heat in Solids, Oxford 1959, chapter 10). W is constant
on slices of the depth, and the integral over each slice is exact. The rough counterface is at rest
in this frame: k = |q|. Of the heat the part β flows into the counterface, in the shape of the
pressure, such that the mean temperatures of both surfaces over the contact, weighted by the
pressure, are equal (the partition of H. Blok, 1937). The mode q = 0, the bulk heating up, is left
out: temperatures are above the mean of each plane, and the bulk temperatures of both bodies are
taken as equal.

With `slide(..., heating=...)` the block has the temperature of its contact. The mean rise over the
contact at each depth, weighted by the pressure, sets the relaxation times there: the block becomes
a stack of thin layers, each at its temperature. Friction heats the contact, heat softens the block
and lowers the friction. The fixed point of this loop is found by Anderson's acceleration, a contact
and its temperatures in each step, and differentiated implicitly.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..contact.solution import RESULTS
from ..core.checks import (
    Numbers,
    as_float,
    check_positive,
    check_types,
    check_values,
    is_concrete,
    scalar,
)
from ..core.derivative import still
from ..core.display import shown
from ..core.fixed_point import attach_fixed_point, find_fixed_point
from ..fields.grid import (
    Grid,
    direction_and_speed,
    multiplicity,
    to_field,
    to_spectrum,
    wave_frequencies,
    wavenumber,
)
from ..response.grading import AbstractGradedSolver
from ..response.heated import AbstractHeating, HeatedContact, check_bulk, check_heated, heated
from ..response.layering import Layering
from ..response.stack import Stack
from ..rheology.shift import as_temperature
from .heat import gauss_within, heat_depths, heat_source, intervals, shear_heat
from .sliding import Sliding

NUM_CELLS = 8  # of the depth, each at one temperature
_FIRST = 0.25  # depth of the first cell [spacings]; the last one ends at the size of the surface


@shown()
class Heating(AbstractHeating):
    """How heat flows in the block and in the counterface.

    Thermally the block is one half space, whatever its layers.

    **Fields:**

    - `conductivity`: κ of the block [W/(m K)].
    - `diffusivity`: D of the block [m²/s].
    - `counterface_conductivity`: κ of the rough counterface [W/(m K)]; 0 if no heat flows into it.
    """

    conductivity: Float[Array, ""] = eqx.field(converter=scalar("conductivity"))
    diffusivity: Float[Array, ""] = eqx.field(converter=scalar("diffusivity"))
    counterface_conductivity: Float[Array, ""] = eqx.field(
        converter=scalar("counterface_conductivity"), default=0.0
    )

    def __check_init__(self):
        check_positive("conductivity", self.conductivity, "[W/(m K)]")
        check_positive("diffusivity", self.diffusivity, "[m²/s]")
        allowed = "a conductivity [W/(m K)] is zero or positive"
        check_values("counterface_conductivity", self.counterface_conductivity, allowed, at_least=0)

    def settle(
        self,
        solve: Callable[..., Sliding],
        stack: Stack,
        grid: Grid,
        inputs: dict[str, Any],
        rtol: float,
        throw: bool,
    ) -> Sliding:
        temperature = as_temperature(check_bulk(inputs["temperature"])).astype(grid.size.dtype)
        inputs = inputs | {"temperature": temperature}
        check_heated(stack)
        first, last = _FIRST * jnp.min(grid.spacing), jnp.max(grid.size)
        edges = jax.lax.stop_gradient(intervals(first, last, NUM_CELLS))
        given = self, stack, inputs
        fixed = still(given)

        def contact(x, values, **how):
            """The rises that a contact causes at rises of the surface and of the cells, and it."""
            heating, stack, inputs = values
            block = heated(stack, inputs["temperature"], x[1:], edges)
            at_surface = {"temperature": inputs["temperature"] + x[0]}
            s = solve(block, **inputs | at_surface | how)
            return _rises(s, heating, stack, block, edges), s, block

        def step(x, start):
            image, s, _ = contact(x, fixed, start=start)
            return image, s.pressure

        none = jnp.zeros(NUM_CELLS + 1, edges.dtype)
        point = find_fixed_point(step, none, fixed[2]["start"], jnp.asarray(rtol, edges.dtype))
        x = jax.lax.stop_gradient(point.x)
        _, s, block = contact(x, fixed, start=point.state)
        if not all(map(is_concrete, jax.tree.leaves(given))):
            found = {"start": None, "solution": still(s.contact)}
            x = attach_fixed_point(lambda x: contact(x, given, **found)[0], x)
            _, s, block = contact(x, given, **found)
        reached = point.error <= rtol
        if throw:
            x = eqx.error_if(x, ~reached, RESULTS[RESULTS.not_settled])
        result = RESULTS.where(reached, s.result, RESULTS.not_settled)
        return dataclasses.replace(
            s,
            contact=dataclasses.replace(s.contact, result=result),
            heated=HeatedContact(block, x[0], x[1:], edges, point.error),
        )


@eqx.filter_jit
def _rises(s: Sliding, heating: Heating, stack: Stack, block: Stack, edges):
    """The mean rises of the surface and of the cells over the contact [K]."""
    depths, weights = gauss_within(stack, edges)
    source = heat_source(s, block, depths)
    # A few depths miss some of the heat.
    made = jnp.sum(jnp.mean(source, tuple(range(1, source.ndim))) * weights)
    power = s.hysteresis_friction * jnp.mean(s.pressure) * direction_and_speed(s.velocity)[1]
    source = source * jnp.where(made > 0, jnp.abs(power) / jnp.where(made > 0, made, 1), 0)
    spectra = temperatures(s, heating, source, weights, jnp.append(0.0, depths))
    surface, *inside = jax.vmap(lambda spectrum: mean_in_contact(s, spectrum))(spectra)
    inside = jnp.stack(inside)
    share = jnp.where((depths > edges[:-1, None]) & (depths < edges[1:, None]), weights, 0)
    total = jnp.sum(share, 1)
    return jnp.append(surface, share @ inside / jnp.where(total > 0, total, 1))


@check_types
def flash_temperature(
    sliding: Sliding,
    stack: Stack,
    heating: Heating,
    depths: Numbers,
    *,
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008 (immutable)
) -> Float[Array, "depths *shape"]:
    """Returns the temperature in the block above the mean of each depth [K].

    Hysteresis and the shear of `sliding` heat the block. Differentiable as `heat_source`, and in
    `heating`.

    **Arguments:**

    - `sliding`, `stack`, `graded_solver`: as in `heat_source`.
    - `heating`: conductivities and diffusivity.
    - `depths`: z [m], shape `(depths,)`; 0 is the surface.

    **Returns:** T, shape `(depths, *grid.shape)`. Add the bulk temperature.

    **Raises:** `ValueError` for a refused argument.
    """
    depths = as_float(depths, "depths")
    if depths.ndim != 1 or len(depths) == 0:
        raise ValueError(f"`depths` has shape {depths.shape}; a row of depths [m] is needed.")
    check_values("depths", depths, "a depth [m] is zero (the surface) or positive", at_least=0)
    nodes, thickness = heat_depths(stack, sliding.grid)
    source = heat_source(sliding, stack, nodes, graded_solver=graded_solver)
    return _fields(sliding, temperatures(sliding, heating, source, thickness, depths))


@eqx.filter_jit
def _fields(sliding: Sliding, spectra):
    return jax.vmap(lambda spectrum: to_field(spectrum, sliding.grid.shape))(spectra)


@eqx.filter_jit
def temperatures(
    sliding: Sliding,
    heating: Heating,
    source: Float[Array, "slices *shape"],
    thickness: Float[Array, " slices"],
    depths: Float[Array, " depths"],
) -> Complex[Array, "depths *half"]:
    """Returns the spectra of the temperature at `depths` from heat in slices and at the surface."""
    grid = sliding.grid
    k = thermal_wavenumber(grid, sliding.velocity, heating.diffusivity)
    edges = jnp.append(0.0, jnp.cumsum(thickness))
    spectra = jax.vmap(to_spectrum)(source)
    jumps = jnp.diff(spectra, axis=0, prepend=0, append=0)  # of the heat, at the edges

    def inside(depth):
        """∫ W(z') [exp(-k|z - z'|) + exp(-k(z + z'))] dz'/(2κk), by parts at each edge."""

        def reach(u):
            return jnp.sign(u) * -jnp.expm1(-k * jnp.abs(u)) / k

        def add(total, edge):
            place, jump = edge
            return total + jump * (reach(depth - place) - reach(depth + place)), None

        total = jax.lax.scan(add, jnp.zeros_like(spectra[0]), (edges, jumps))[0]
        return total / (2 * heating.conductivity * k)

    shape = to_spectrum(_weight(sliding))
    made = to_spectrum(shear_heat(sliding))
    own = mean_in_contact(sliding, inside(0.0) + made / (heating.conductivity * k))
    kappa, still = heating.counterface_conductivity, wavenumber(grid)
    there = mean_in_contact(sliding, shape / jnp.where(still == 0, 1, still))
    here = mean_in_contact(sliding, shape / (heating.conductivity * k))
    # The heat that leaves makes the means of both surfaces equal.
    flux = (made - kappa * own / (kappa * here + there) * shape) / (heating.conductivity * k)
    found = jax.lax.map(lambda depth: inside(depth) + flux * jnp.exp(-k * depth), depths)
    return jax.vmap(_without_mean)(found)


def mean_in_contact(sliding: Sliding, spectrum: Complex[Array, "*half"]) -> Float[Array, ""]:
    """Returns the mean over the contact of a field without its mode q = 0, by the pressure."""
    weight = to_spectrum(_weight(sliding)) / np.prod(sliding.grid.shape) ** 2
    parts = (jnp.conj(weight) * spectrum).real * multiplicity(sliding.grid.shape)
    return jnp.sum(_without_mean(parts))


def _weight(sliding):
    pressed = jnp.maximum(sliding.pressure, 0)
    return pressed / jnp.mean(pressed)


def thermal_wavenumber(
    grid: Grid, velocity: Float[Array, "..."], diffusivity: Float[Array, ""]
) -> Complex[Array, "*half"]:
    """Returns k = √(q² + iω/D) [1/m], 1 at q = 0: temperatures decay as exp(-kz)."""
    q = wavenumber(grid)
    squared = q**2 + 1j * wave_frequencies(grid, velocity) / diffusivity
    return jnp.sqrt(jnp.where(q == 0, 1, squared))


def _without_mean(spectrum):
    return spectrum.at[(0,) * spectrum.ndim].set(0)
