"""The mean field by quadrature over wavenumber and angle.

In log q it is Clenshaw and Curtis's rule on every smooth piece of the spectrum. For the angle
see `angles.py`.

A spectrum with a lay varies with the angle to the direction across the lay, on the scale 1/γ. This
direction and that across the velocity cut the half turn into two parts; a rule that is dense at
both ends (`between_ends`) resolves either scale in each of them.

M is the sum of the block's M(q, -q·v) and, under a counterface, of the counterface's M(q, 0).

The rubber's own roughness moves with the rubber: its waves excite no frequency there, so that they
add C_own q dq ∫dφ |1/M(q, 0)|² to the variance and nothing to the loss. Over a counterface they
move: then the counterface has the frequencies, and adds its loss.

The error is the sum of two changes of friction and area: by every second wavenumber, and by every
second angle.
"""

from functools import cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import chebyshev

from ..blocks.stack import Stack
from ..core.compilation import compiled
from ..core.derivative import root_or_zero
from ..fields.frequency import direction_and_speed, sliding_frequency
from ..materials.coverage import coverage, is_unknown
from ..materials.softening import at_strain, softens
from ..response.compliance import surface_compliance_unchecked
from ..response.grading import graded_tolerance
from ..surfaces.spectrum import SelfAffine, between_ends, narrowing
from ..surfaces.spectrum_table import Spectrum
from .angles import LAST_COSINE, angles
from .diffusion import Correction, area, mean_square_growth, slowed
from .heating_by_scale import between_scales


class FieldInputs(eqx.Module):
    """The inputs of a mean field.

    Block, spectra of the track and of the block itself, pressure, velocity, the strain amplitude
    per slope or None, and the counterface or None.
    """

    stack: Stack
    spectrum: Spectrum
    own: Spectrum | None
    pressure: Float[Array, ""]
    velocity: Float[Array, "..."]
    strain_per_slope: Float[Array, ""] | None
    counterface: Stack | None = None

    @property
    def moving(self) -> Any:
        """The bodies over which some roughness moves, so that they dissipate."""
        return self.stack if self.own is None else (self.stack, self.counterface)


class Rules(NamedTuple):
    """Even numbers of intervals on each piece of the spectrum and of the angle."""

    correction: Correction
    num_wavenumbers: int
    num_angles: int


@compiled
def end_frequencies(spectrum: Spectrum, velocity: Array) -> tuple[Array, Array]:
    """Returns the speed [m/s], and the lowest and the highest frequency of a spectrum [rad/s]."""
    edges, speed = smooth_edges(spectrum), direction_and_speed(velocity)[1]
    # The longest wave at the last angle has the lowest.
    return speed, speed * jnp.stack([edges[0] * LAST_COSINE, edges[-1]])


@compiled
@eqx.filter_checkpoint
def integrate(
    field: FieldInputs, rules: Rules, temperatures: Float[Array, " scales"] | None = None
) -> tuple[Array, ...]:
    """Returns wavenumbers [rad/m], diffusion x [1] and friction [1] up to them, and the error.

    At last the share of friction [1] from frequencies at which a material was not measured, as it
    is summed: not to the digits of the friction. `temperatures` [K] are those at `scales`, see
    `heating_by_scale.py`.
    """
    num_intervals, num_angles = rules.num_wavenumbers, rules.num_angles
    edges = joined_edges(field.spectrum, field.own)
    lengths = jnp.log(edges[1:] / edges[:-1])
    q = _nodes_between(edges, lengths, num_intervals)
    direction, speed = direction_and_speed(field.velocity)
    turn = turn_of(field.spectrum, direction)
    rule = _clenshaw_curtis(num_intervals)
    strain = None
    if field.strain_per_slope is not None:
        rate = 2 * np.pi * (root_density(field.spectrum, q, mean=True) * q**2) ** 2
        strain = field.strain_per_slope * root_or_zero(_integral(rate, lengths, rule))
    temperature = None if temperatures is None else between_scales(temperatures, q)
    along, offset, weights = _angles(turn, num_angles, q.dtype)
    rates = _rates_of_waves(field, speed, q, (strain, temperature), (along, offset))
    averages = _over_angles(rates, weights)
    # Every second angle, and every second wavenumber: only their changes are used.
    coarse = jax.lax.stop_gradient(rates[..., ::2, :])
    fewer = (
        _over_angles(coarse, _angles(turn, num_angles // 2, q.dtype)[2]),
        jax.lax.stop_gradient(averages)[:, ::2],
    )
    cuts = rule, rule, _clenshaw_curtis(num_intervals // 2)
    variants = [
        _progress(each, lengths, cut, rules.correction)
        for each, cut in zip((averages, *fewer), cuts, strict=True)
    ]
    x, friction, product = variants[0]
    ends = [jnp.stack([friction[-1], area(x[-1])]) for x, friction, _ in variants]
    share, known = jnp.zeros_like(q[0]), coverage(field.moving)
    if known is not None:
        omega = sliding_frequency(q[:, None, None] * along, 0.0, speed)
        lost = _over_angles(jnp.where(is_unknown(omega, known), rates[1], 0), weights)
        share = _share(lost / jnp.where(averages[1] == 0, 1, averages[1]), friction)
    return q, x, friction, jax.lax.stop_gradient(_error_of_nodes(ends, product)), share


def _over_angles(rate, weights):
    return jnp.einsum("...mk,mk", rate, weights)


def _progress(averages, lengths, rule, correction):
    """Diffusion and friction up to each node, and the product by which rounding is measured."""
    growth, loss = averages
    x = slowed(correction, _integral(growth, lengths, rule))
    total = mean_square_growth(x)
    ratio = loss / jnp.where(growth == 0, 1, growth)
    # By parts the friction is a difference of products.
    return x, _stieltjes(ratio, total, rule), jnp.max(jnp.abs(ratio)) * total[-1]


def _rates_of_waves(field, speed, q, state, angle):
    """Growth of the variance and of the friction of complete contact, per log q and angle."""
    along, offset = angle
    tolerance = graded_tolerance(field.stack, q)
    q = q[:, None, None]

    def response(q, omega, of_counterface, state):
        strain, temperature = state
        block = _softened(field.stack, strain)
        block = block if temperature is None else block.at(temperature)
        found = surface_compliance_unchecked(block, q, omega, tolerance)
        if field.counterface is None:
            return found
        counterface = _softened(field.counterface, strain)
        tolerance_of = graded_tolerance(counterface, q)
        return found + surface_compliance_unchecked(counterface, q, of_counterface, tolerance_of)

    def relative_to(amplitude, omega, of_counterface):
        # The block is in another state at each q.
        at = jax.vmap(response) if jax.tree.leaves(state) else response
        # √C q/(M σ0): squares of its factors may leave the range of float32.
        relative = amplitude / (field.pressure * at(q, omega, of_counterface, state))
        return relative.real**2 + relative.imag**2, relative.imag

    amplitude = root_density(field.spectrum, q) * q * root_narrowing(field.spectrum, q, offset)
    omega, rest = sliding_frequency(q * along, 0.0, speed), jnp.zeros_like(q)
    growth, lost = relative_to(amplitude, omega, rest)
    loss = -amplitude * q * along * lost
    if field.own is not None:
        own = root_density(field.own, q, mean=True) * q
        moving = rest if field.counterface is None else omega
        added, lost = relative_to(own, rest, moving)
        growth = growth + added
        loss = loss if field.counterface is None else loss - own * q * along * lost
    return jnp.stack([growth, loss])


def _softened(stack: Stack, strain) -> Stack:
    return at_strain(stack, strain) if strain is not None and softens(stack) else stack


def _share(part, friction):
    """The share of the growth of `friction` that is a `part` [1] at each point of it."""
    step = jnp.abs(jnp.diff(friction))
    total = jnp.sum(step)
    return jnp.sum(step * (part[1:] + part[:-1]) / 2) / jnp.where(total == 0, 1, total)


def _error_of_nodes(ends, product):
    """The largest relative error of friction and area; `product` has the size of rounding."""
    result, fewer_angles, fewer_wavenumbers = ends

    def change(other):
        # Relative to whichever is smaller.
        least = jnp.minimum(jnp.abs(result), jnp.abs(other))
        return jnp.abs(result - other) / jnp.where(least == 0, 1, least)

    friction = jnp.abs(result[0])
    rounding = jnp.finfo(friction.dtype).eps * product / jnp.where(friction == 0, 1, friction)
    return jnp.max(change(fewer_angles) + change(fewer_wavenumbers)) + 4 * rounding


def _nodes_between(edges, lengths, num_intervals):
    """Nodes q [rad/m] of all pieces."""
    t = jnp.asarray(_clenshaw_curtis(num_intervals).nodes, lengths.dtype)
    # From the nearer edge, so that the edges themselves are exact: C is 0 beyond them.
    from_below = edges[:-1, None] * jnp.exp(t * lengths[:, None])
    from_above = edges[1:, None] * jnp.exp((t - 1) * lengths[:, None])
    return _joined_pieces(jnp.where(t < 0.5, from_below, from_above))


def _joined_pieces(pieces):
    """Values at the nodes of all pieces in a row, shared ends once."""
    return jnp.append(pieces[:, :-1].ravel(), pieces[-1, -1])


def _split(values, rule):
    """The inverse of `_joined_pieces`, shape `(pieces, nodes)`."""
    n = len(rule.nodes) - 1
    return jnp.concatenate([values[:-1].reshape(-1, n), values[n::n, None]], axis=1)


def _running(pieces):
    """Integrals from the start of each piece, made integrals from the first node on."""
    before = jnp.cumsum(pieces[:, -1]) - pieces[:, -1]
    return _joined_pieces(before[:, None] + pieces)


def _integral(rate, lengths, rule):
    """∫ rate d(log q) from the first node to every node."""
    pieces = _split(rate, rule) @ jnp.asarray(rule.integration.T, rate.dtype)
    return _running(lengths[:, None] * pieces)


def _stieltjes(ratio, total, rule):
    """∫ ratio d(total) from the first node to every node.

    By parts: in light contact `total` leaves the first node as a root, the ratio is smooth.
    """
    ratio, total = _split(ratio, rule), _split(total, rule)
    product = ratio * total
    slope = ratio @ jnp.asarray(rule.differentiation.T, ratio.dtype)
    rest = (slope * total) @ jnp.asarray(rule.integration.T, ratio.dtype)
    return _running(product - product[:, :1] - rest)


class _Rule(NamedTuple):
    """Nodes in [0, 1]; matrices of the integral from 0 and of the slope of an interpolant."""

    nodes: np.ndarray
    integration: np.ndarray
    differentiation: np.ndarray


@cache
def _clenshaw_curtis(num_intervals: int) -> _Rule:
    x = -np.cos(np.pi * np.arange(num_intervals + 1) / num_intervals)
    coefficients = np.linalg.inv(chebyshev.chebvander(x, num_intervals))
    integral = chebyshev.chebint(coefficients, lbnd=-1)
    slope = chebyshev.chebder(coefficients)
    integration = chebyshev.chebvander(x, num_intervals + 1) @ integral / 2
    integration[0] = 0  # which rounding may miss: nothing has spread at the first node
    differentiation = chebyshev.chebvander(x, num_intervals - 1) @ slope * 2
    return _Rule((1 + x) / 2, integration, differentiation)


def _angles(turn, num_angles, dtype):
    """At the nodes, the component of q/|q| along the velocity and the angle from across the lay;
    and the nodes' weights, which sum to the whole turn, 2π.

    Each of shape (nodes, parts of the turn).
    """
    if turn is None:
        cosine, weight = (jnp.asarray(a, dtype)[:, None] for a in angles(num_angles))
        return cosine, jnp.zeros_like(cosine), weight
    # From across the lay to across the velocity, one way round and the other.
    parts = jnp.stack([turn, np.pi - turn])
    away, left, weight = (jnp.asarray(a, dtype)[:, None] for a in between_ends(3 * num_angles))
    return jnp.sin(parts * left), parts * away, 2 * weight * parts


# Spectra: smooth pieces, with or without a lay.


def smooth_edges(spectrum: Spectrum) -> Float[Array, " points"]:
    """Returns wavenumbers [rad/m], increasing, between which C(q) is smooth."""
    if isinstance(spectrum, SelfAffine):
        return jnp.stack([spectrum.q_low, spectrum.q_roll, spectrum.q_high])
    return spectrum.q


def joined_edges(track: Spectrum, own: Spectrum | None) -> Float[Array, " points"]:
    """Returns wavenumbers [rad/m] between which both spectra are smooth.

    The ends of each are two edges, closely below and above: C jumps there.
    """
    if own is None:
        return smooth_edges(track)
    edges = smooth_edges(track), smooth_edges(own)
    away = 64 * float(jnp.finfo(edges[0].dtype).eps)
    ends = [each[i] * by for each in edges for i in (0, -1) for by in (1 - away, 1 + away)]
    return jnp.sort(jnp.concatenate([jnp.stack(ends), *(each[1:-1] for each in edges)]))


def turn_of(spectrum: Spectrum, direction: Float[Array, " components"]) -> Array | None:
    """Returns the angle from the lay to a direction, from 0 to π [rad], or None."""
    if spectrum.angle is None:
        return None
    # A profile has one component.
    x, y = direction if len(direction) == 2 else (direction[0], jnp.zeros_like(direction[0]))
    return jnp.mod(jnp.arctan2(y, x) - spectrum.angle, np.pi)


def root_density(
    spectrum: Spectrum, q: Float[Array, "*n"], *, mean: bool = False
) -> Float[Array, "*n"]:
    """Returns √C [m²] across the lay, or of the `mean` over directions; 0 outside."""
    if mean or not isinstance(spectrum, SelfAffine) or spectrum.angle is None:
        density = spectrum.density(q)
    else:
        density = spectrum.density(q, 2, spectrum.angle + np.pi / 2)
    return root_or_zero(density)


def root_narrowing(spectrum: Spectrum, q: Array, offset: Array) -> Array:
    """Returns the ratio of √C at angles from the direction across the lay to √C across [1]."""
    if not isinstance(spectrum, SelfAffine) or spectrum.angle is None:
        return jnp.ones((), q.dtype)
    return jnp.sqrt(narrowing(spectrum, q / spectrum.q_roll, offset))
