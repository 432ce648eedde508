"""The heat of friction in the block and in the contact.

In a Prony solid branch k is a spring E_k and a dashpot. Under steady sliding its stress is, for
each wave, that of the solid times g_k(ω) = [E_k iωτ_k/(1 + iωτ_k)]/E(ω), since all branches have
the same Poisson's ratio ν. Its dashpot turns

    W_k = [(1 + ν) s:s - ν (tr s)²]/(τ_k E_k) >= 0   [W/m³],      s = stress of branch k,

into heat. There is no average over time and no assumption about the depth of a wave: the integral
of W = Σ W_k over the depth is hysteresis friction times load times speed; with a traction that
moves the surface, `block_friction` takes its place. In a `StrainSoftening` the dashpots have the
factor of the loss modulus. Shear in the contact makes the heat τ_f |v| [W/m²] at the surface, with
coupling times the speed of slip over |v|.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...blocks.profile import Blend
from ...blocks.stack import GradedLayer, HalfSpace, Layer, Stack, by_kind, interface_depths
from ...core.checks import Numbers, as_float, check_rows, check_values, check_whole
from ...core.compilation import compiled
from ...core.derivative import derivative_apart
from ...fields.frequency import direction_and_speed, wave_frequencies
from ...fields.grid import Grid, to_field
from ...materials.material import AbstractMaterial, Elastic, Prony
from ...materials.softening import StrainSoftening
from ...response.grading import graded_tolerance
from ...response.stress import stress_waves
from ..formulas import tractions_on
from ..numbers.traction import slip
from ..result import Sliding

_NODES = 2  # of Gauss's rule in each interval of the depth
_FIRST, _LAST = 0.05, 3.0  # ends of the first interval [spacings] and of the last one [cells]


def heat_depths(
    stack: Stack, grid: Grid, num_intervals: int = 18
) -> tuple[Float[Array, " depths"], Float[Array, " depths"]]:
    """Returns depths [m] and weights [m] of a quadrature over the depth of a block.

    Two Gauss nodes in each interval. The intervals grow geometrically from a twentieth of the
    spacing to three times the cell, and end at interfaces too.

    **Arguments:**

    - `stack`: the block.
    - `grid`: of the surface.
    - `num_intervals`: from the surface down, at least 2.

    **Returns:** depths and weights; at a bottom above the last interval the weights are 0.
    """
    check_whole("num_intervals", num_intervals, 2)
    return _heat_depths(stack, grid, num_intervals)


@compiled
def _heat_depths(stack: Stack, grid: Grid, num_intervals: int) -> tuple[Array, Array]:
    # Short waves make their heat near the surface, the longest down to the size of the cell.
    ends = _FIRST * jnp.min(grid.spacing), _LAST * jnp.max(grid.size)
    return gauss_within(stack, intervals(*ends, num_intervals))


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


def heat_source(sliding: Sliding, stack: Stack, depths: Numbers) -> Float[Array, "depths *shape"]:
    """Returns the heat that hysteresis makes in the block at some depths [W/m³].

    Differentiable in the contact, in every leaf of `stack` and in `depths`.

    **Arguments:**

    - `sliding`: a result of `slide` for this block.
    - `stack`: the block, of `Prony` and `Elastic` materials, also in `StrainSoftening`; graded
      layers `Blend` with linear mixing.
    - `depths`: z [m], shape `(depths,)`; see `heat_depths`.

    **Returns:** W, shape `(depths, *grid.shape)`.

    **Raises:** `ValueError` for a refused argument.
    """
    depths = as_depths(depths)
    check_series(stack)
    return heat_where(jnp.ones(depths.shape, bool), sliding, stack, depths)


def as_depths(depths: Numbers) -> Float[Array, " depths"]:
    """Returns depths [m] as an array; they must be a row of depths in the block."""
    depths = as_float(depths, "depths")
    check_rows(1, depths=depths)
    check_values("depths", depths, "a depth [m] is zero (the surface) or positive", at_least=0)
    return depths


@derivative_apart
@compiled
def heat_where(needed, sliding: Sliding, stack: Stack, depths) -> Array:
    """Returns the heat [W/m³] at depths where it is `needed`, 0 at others; see `heat_source`."""
    grid, velocity, pressure = sliding.grid, sliding.velocity, sliding.pressure
    omega = wave_frequencies(grid, velocity)
    traction = None if sliding.coupling is None else shear_traction(sliding)
    rtol = graded_tolerance(stack, None, pressure)

    def at(depth):
        waves = stress_waves(stack, grid, pressure, traction, depth, velocity, rtol=rtol)
        normal, shear = waves[3:6], waves[6:]
        equilibrium, strengths, losses, times, poisson = _series_in(stack, depth)
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
        # A derivative computes the stresses again rather than store those of all depths.
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
    return heat if sliding.coupling is None else heat * slip(sliding)


def check_series(stack: Stack) -> None:
    """Raises `ValueError` for a material whose heat is not known."""
    eqx.filter_eval_shape(_series_in, stack, jnp.zeros(()))


def _series_in(stack: Stack, depth):
    """E_eq, E_k, those of the loss [Pa], τ_k [s] and ν at a depth, with equally many branches."""
    tops = jnp.append(0.0, interface_depths(stack)).astype(depth.dtype)
    parts = [*stack.layers, stack.base] if isinstance(stack.base, HalfSpace) else stack.layers
    # The bottom of the base has no effect.
    places = [*zip(parts, [*tops[1:], depth], strict=False)]
    rows, order = by_kind(lambda place: _series_of(place[0], place[1], depth), places)
    most = max(row[1].shape[-1] for row in rows)
    # Branches without strength, of the time 1 s, make all parts alike.
    fills = (0, 0, 0, 1, 0)
    place = jnp.asarray(order)[jnp.clip(jnp.sum(depth >= tops) - 1, 0, len(parts) - 1)]

    def there(column, fill):
        pad = lambda a: [(0, 0), (0, most - a.shape[-1])][: a.ndim]  # noqa: E731
        alike = [jnp.pad(a, pad(a), constant_values=fill) for a in column]
        return jnp.concatenate(alike)[place]

    return tuple(map(there, zip(*rows, strict=True), fills))


def _series_of(part: Layer | GradedLayer | HalfSpace, bottom, depth):
    """E_eq, E_k, those of the loss, τ_k and ν of a part of a block with this bottom, at a depth."""
    if not isinstance(part, GradedLayer):
        return _series(part.material)
    s = jnp.clip((bottom - depth) / jnp.where(part.thickness > 0, part.thickness, 1), 0, 1)
    profile = part.profile
    if isinstance(profile, Blend) and profile.mixing == "linear":
        # A linear mixture of two series is the series with the branches of both.
        phi = profile.shape(s)
        bottom, top = _series(profile.bottom), _series(profile.top)
        return (
            (1 - phi) * bottom[0] + phi * top[0],
            *(jnp.append((1 - phi) * bottom[i], phi * top[i]) for i in (1, 2)),
            jnp.append(bottom[3], top[3]),
            (1 - phi) * bottom[4] + phi * top[4],
        )
    raise ValueError(
        f"`stack` has a graded layer with the profile {type(profile).__name__}: only "
        "`Blend` with linear mixing is possible here."
    )


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
