"""The heat of friction in the block and in the contact.

In a Prony solid branch k is a spring E_k and a dashpot. Under steady sliding its stress is, for
each wave, the solid's times g_k(ω) = [E_k iωτ_k/(1 + iωτ_k)]/E(ω), since all branches have one
Poisson's ratio ν. Its dashpot turns

    W_k = [(1 + ν) s:s - ν (tr s)²]/(τ_k E_k) >= 0   [W/m³],      s = stress of branch k,

into heat. There is no average over time and no assumption about the depth of a wave: the integral
of W = Σ W_k over the depth is hysteresis friction times load times speed; with a traction that
moves the surface, `block_friction` takes its place. In a `StrainSoftening` the dashpots have the
factor of the loss modulus. Shear in the contact makes the heat τ_f |v| [W/m²] at the surface, with
coupling times the speed of slip over |v|.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...blocks.stack import HalfSpace, Stack, by_kind, interface_depths, materials_of
from ...core.compilation import compiled
from ...core.derivative import derivative_apart
from ...fields.frequency import direction_and_speed, wave_frequencies
from ...fields.grid import to_field
from ...materials.material import AbstractMaterial, Elastic, Prony
from ...materials.softening import StrainSoftening
from ...response.stress import stress_waves
from ..formulas import tractions_on
from ..numbers.friction import slip
from ..result import Sliding

_NODES = 2  # of Gauss's rule in each interval of the depth


def intervals(first: Array, last: Array, number: int) -> Float[Array, " edges"]:
    """Returns the edges of intervals from 0 to `last` [m] that grow geometrically from `first`."""
    t = jnp.arange(number, dtype=last.dtype) / (number - 1)
    return jnp.append(jnp.zeros_like(last), first * (last / first) ** t)


def gauss_within(
    stack: Stack, edges: Float[Array, " edges"]
) -> tuple[Float[Array, " depths"], Float[Array, " depths"]]:
    """Returns depths and weights [m] of Gauss's rule between edges and interfaces of a block."""
    interfaces, deepest = interface_depths(stack).astype(edges.dtype), edges[-1]
    if not isinstance(stack.base, HalfSpace):
        deepest = jnp.minimum(deepest, interfaces[-1])
    # Moduli jump at interfaces: no interval crosses one.
    edges = jnp.minimum(jnp.sort(jnp.concatenate([edges, interfaces])), deepest)
    x, w = (jnp.asarray(a, edges.dtype) for a in np.polynomial.legendre.leggauss(_NODES))
    half = jnp.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()


@derivative_apart
@compiled
def heat_source(sliding: Sliding, depths, needed) -> Array:
    """Returns the heat that hysteresis makes in the block [W/m³], at depths where it is `needed`.

    It is 0 at others. Shape `(depths, *grid.shape)`.
    """
    stack = sliding.bodies[0]
    grid, velocity, pressure = sliding.grid, sliding.velocity, sliding.pressure
    omega = wave_frequencies(grid, velocity)
    traction = shear_traction(sliding) if sliding.coupling.lift else None

    def at(depth):
        waves = stress_waves(stack, grid, pressure, traction, depth, velocity)
        normal, shear = waves[3:6], waves[6:]
        equilibrium, strengths, losses, times, poisson = _series_at(stack, depth)
        flows = 1j * omega[..., None] * times
        flows = flows / (1 + flows)
        modulus = equilibrium + flows.real @ strengths + 1j * (flows.imag @ losses)
        # At ω = 0 no dashpot moves, and the modulus may be 0.
        compliance = jnp.where(omega == 0, 0, 1 / jnp.where(omega == 0, 1, modulus))

        # One after the other: all branches at once would take as many fields.
        def add(total, branch):
            loss, time = branch
            flow = 1j * omega * time
            share = flow / (1 + flow) * compliance
            along, across = (
                [to_field(spectrum * share, grid.shape) for spectrum in spectra]
                for spectra in (normal, shear)
            )
            square = sum(s**2 for s in along) + 2 * sum(s**2 for s in across)
            lost = (1 + poisson) * square - poisson * sum(along) ** 2
            return total + loss / time * lost, None

        return jax.lax.scan(add, none, (losses, times))[0]

    none = jnp.zeros(grid.shape, pressure.dtype)

    def if_needed(place):
        needed, depth = place
        # A derivative computes the stresses again rather than store all depths.
        return jax.lax.cond(needed, jax.checkpoint(at), lambda _: none, depth)

    return jax.lax.map(if_needed, (needed, depths))


def shear_traction(sliding: Sliding) -> Array | None:
    """Returns the tangential traction on the block [Pa], as `stress_field` takes it, or None."""
    if sliding.shear is None:
        return None
    (stress,), direction = tractions_on(sliding), direction_and_speed(sliding.velocity)[0]
    return stress * direction[0] if len(direction) == 1 else stress[..., None] * direction


@compiled
def shear_heat(sliding: Sliding) -> Float[Array, "*shape"]:
    """Returns the heat of shear in the contact [W/m²]; its mean is the power of the shear."""
    if sliding.shear is None:
        return jnp.zeros_like(sliding.pressure)
    (stress,) = tractions_on(sliding)
    heat = jnp.abs(sliding.speed) * stress
    return heat * slip(sliding) if sliding.coupling.lift else heat


def _series_at(stack: Stack, depth):
    """E_eq, E_k, E_k of the loss [Pa], τ_k [s] and ν at a depth, with equally many branches."""
    tops = jnp.append(0.0, interface_depths(stack)).astype(depth.dtype)
    materials = materials_of(stack)
    rows, order = by_kind(_series, materials)
    most = max(row[1].shape[-1] for row in rows)
    # Branches without strength, of the time 1 s, make all materials alike.
    fills = (0, 0, 0, 1, 0)
    place = jnp.asarray(order)[jnp.clip(jnp.sum(depth >= tops) - 1, 0, len(materials) - 1)]

    def there(column, fill):
        pad = lambda a: [(0, 0), (0, most - a.shape[-1])][: a.ndim]  # noqa: E731
        alike = [jnp.pad(a, pad(a), constant_values=fill) for a in column]
        return jnp.concatenate(alike)[place]

    return tuple(map(there, zip(*rows, strict=True), fills))


def _series(material: AbstractMaterial):
    if isinstance(material, Elastic):
        none = jnp.zeros(0, material.modulus.dtype)
        return material.modulus, none, none, none, material.poisson
    if isinstance(material, Prony):
        strengths = material.strengths
        return material.equilibrium, strengths, strengths, material.times, material.poisson
    if isinstance(material, StrainSoftening):
        equilibrium, strengths, losses, times, poisson = _series(material.material)
        f, g = material.factors()
        return f * equilibrium, f * strengths, g * losses, times, poisson
    raise ValueError(
        f"`stack` has a {type(material).__name__}: only `Prony` and `Elastic` materials, also in "
        "`StrainSoftening`, are possible here. Fit a Prony series with `fit_prony`."
    )
