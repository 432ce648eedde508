"""The mean field of spectra, by quadrature over wavenumber and angle, and of one surface by modes.

In log q it is Clenshaw and Curtis's rule on every smooth piece of the spectrum. For the angle
see `angles.py`.

A spectrum with a lay varies with the angle to the direction across the lay, on the scale 1/γ. This
direction and that across the velocity cut the half turn into two parts; a rule that is dense at
both ends (`between_ends`) resolves either scale in each of them.

M is the sum of the block's M(q, -q·v) and, under a counterface, of the counterface's M(q, 0).

The rubber's own roughness moves with the rubber: its waves excite no frequency there, so that they
add C_own q dq ∫dφ |1/M(q, 0)|² to the variance and nothing to the loss. Over a counterface they
move: then the counterface has the frequencies, and adds its loss.

The error is that against twice the wavenumbers. Those between have the angles between, so that
errors of either rule show as far as they do not cancel in the integral over both: those of a
table of moduli, whose interpolant has kinks, largely do. Such errors are like noise, and one
difference may be small by chance; a second one, both rules with half of the angles, is added. (An
extrapolation from coarser rules fails where a rule only begins to resolve spectrum or response.)
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
from ..fields.devices import binned
from ..fields.frequency import direction_and_speed, sliding_frequency, wave_frequencies
from ..fields.grid import multiplicity, rings, to_spectrum, zero_mode
from ..materials.coverage import coverage, is_unknown
from ..materials.softening import at_strain, softens
from ..response.compliance import surface_compliance_unchecked
from ..response.grading import graded_tolerance
from ..surfaces.spectrum import between_ends
from .angles import angles
from .diffusion import Correction, area, mean_square_growth, slowed, slowing
from .heating_by_scale import between_scales
from .roughness import Roughness, joined_edges

_SAFETY = 5.0  # of the changes by twice the nodes


class FieldInputs(eqx.Module):
    """What a mean field is integrated from.

    Block, roughness of the track and of the block itself, pressure, velocity, the strain amplitude
    per slope or None, and the counterface or None.
    """

    stack: Stack
    roughness: Any  # `Roughness`; `Surface` where modes are summed
    own: Roughness | None
    pressure: Float[Array, ""]
    velocity: Float[Array, "..."]
    strain_per_slope: Float[Array, ""] | None
    counterface: Stack | None = None

    @property
    def moving(self) -> Any:
        """The bodies over which some roughness moves, so that they dissipate."""
        return self.stack if self.own is None else (self.stack, self.counterface)


class Rules(NamedTuple):
    """How it is integrated, by so many intervals on each piece of the spectrum and of the angle.

    Both numbers are multiples of 4: they are halved twice.
    """

    correction: Correction
    num_wavenumbers: int
    num_angles: int


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
    edges = joined_edges(field.roughness, field.own)
    lengths = jnp.log(edges[1:] / edges[:-1])
    # Twice as many as the rule has: those between give the error.
    q = _nodes(edges, lengths, 2 * num_intervals)
    direction, speed = direction_and_speed(field.velocity)
    turn = field.roughness.turn_of(direction)
    strain = None
    if field.strain_per_slope is not None:
        rate = 2 * np.pi * (field.roughness.root_density(q, mean=True) * q**2) ** 2
        square = _integral(rate, lengths, _clenshaw_curtis(2 * num_intervals))
        slope = jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1)), 0)
        strain = field.strain_per_slope * slope
    temperature = None if temperatures is None else between_scales(temperatures, q)
    everything = field, speed, q, (strain, temperature), turn

    def over_angles(rate, weights):
        return jnp.einsum("...mk,mk", rate, weights)

    even, odd = slice(0, None, 2), slice(1, None, 2)
    weights, few, many = (
        _angles(turn, count, q.dtype)[2] for count in (num_angles, num_angles // 2, 2 * num_angles)
    )
    # The rule of twice as many angles is the mean of this one and of that between its angles.
    shifted = (2 * many).at[::2].add(-weights)
    every_fourth = jnp.zeros_like(many).at[::4].set(few)
    at_angle = np.flatnonzero(np.arange(len(many)) % 4 != 2)
    # The rule itself has a derivative; what only estimates its error has none.
    used = _rates(everything, even, even, rules)
    between = _rates(jax.lax.stop_gradient(everything), odd, at_angle, rules)
    fine, coarse = over_angles(used, weights), over_angles(used[..., ::2, :], few)

    def refined(at_even, weights):
        at_odd = over_angles(between, weights[at_angle])
        return jnp.zeros((2, len(q)), q.dtype).at[:, even].set(at_even).at[:, odd].set(at_odd)

    # With all and half of the angles, each with all and twice the wavenumbers.
    averages = (fine, refined(fine, shifted), coarse, refined(coarse, every_fourth))
    cuts = [_clenshaw_curtis(count * num_intervals) for count in (1, 2, 1, 2)]
    v = [_integral(a[0], lengths, cut) for a, cut in zip(averages, cuts, strict=True)]
    # All at once: it is half of what there is to compile.
    x = slowed(rules.correction, jnp.concatenate(v))
    x = jnp.split(x, np.cumsum([len(part) for part in v])[:-1])
    total = [mean_square_growth(part) for part in x]
    ratio = [a[1] / jnp.where(a[0] == 0, 1, a[0]) for a in averages]
    friction = [_stieltjes(*parts) for parts in zip(ratio, total, cuts, strict=True)]
    # By parts the friction is a difference of products.
    product = jnp.max(jnp.abs(ratio[0])) * total[0][-1]
    ends = [jnp.stack([b[-1], area(a[-1])]) for a, b in zip(x, friction, strict=True)]
    share, known = jnp.zeros_like(q[0]), coverage(field.moving)
    if known is not None:
        along = _angles(turn, 2 * num_angles, q.dtype)[0][even]
        omega = sliding_frequency(q[even][:, None, None] * along, 0.0, speed)
        lost = over_angles(jnp.where(is_unknown(omega, known), used[1], 0), weights)
        share = _share(lost / jnp.where(fine[1] == 0, 1, fine[1]), friction[0])
    return q[even], x[0], friction[0], jax.lax.stop_gradient(_error(ends, product)), share


def _rates(values, at_q, at_angle, rules):
    """Growth of the variance and of the friction of complete contact, per log q and angle."""
    field, speed, q, state, turn = values
    along, offset = (a[at_angle] for a in _angles(turn, 2 * rules.num_angles, q.dtype)[:2])
    tolerance = graded_tolerance(field.stack, None, q)
    state, q = jax.tree.map(lambda a: a[at_q], state), q[at_q][:, None, None]

    def response(q, omega, of_counterface, state):
        strain, temperature = state
        block = _softened(field.stack, strain)
        block = block if temperature is None else block.at(temperature)
        found = surface_compliance_unchecked(block, q, omega, tolerance)
        if field.counterface is None:
            return found
        counterface = _softened(field.counterface, strain)
        tolerance_of = graded_tolerance(counterface, None, q)
        return found + surface_compliance_unchecked(counterface, q, of_counterface, tolerance_of)

    def relative_to(amplitude, omega, of_counterface):
        # The block is in another state at each q.
        at = jax.vmap(response) if jax.tree.leaves(state) else response
        # √C q/(M σ0): squares of its factors may leave the range of float32.
        relative = amplitude / (field.pressure * at(q, omega, of_counterface, state))
        return relative.real**2 + relative.imag**2, relative.imag

    amplitude = field.roughness.root_density(q) * q * field.roughness.root_narrowing(q, offset)
    omega, rest = sliding_frequency(q * along, 0.0, speed), jnp.zeros_like(q)
    growth, lost = relative_to(amplitude, omega, rest)
    loss = -amplitude * q * along * lost
    if field.own is not None:
        own = field.own.root_density(q, mean=True) * q
        moving = rest if field.counterface is None else omega
        added, lost = relative_to(own, rest, moving)
        growth = growth + added
        loss = loss if field.counterface is None else loss - own * q * along * lost
    return jnp.stack([growth, loss])


def _softened(stack: Stack, strain) -> Stack:
    return at_strain(stack, strain) if strain is not None and softens(stack) else stack


@compiled
def add_up(field: FieldInputs, correction: Correction, kernel: Array) -> tuple[Array, ...]:
    """Returns wavenumbers [rad/m], diffusion x [1] and friction [1] up to them, of a surface.

    At last the share of friction [1] from frequencies at which a material was not measured. The
    modes of a ring of |q|, up to its outer edge, come into view at once.
    """
    grid, heights = field.roughness.grid, field.roughness.heights
    modes = to_spectrum(heights - jnp.mean(heights)) / np.prod(grid.shape)
    zero = zero_mode(grid.shape)
    relative = jnp.where(zero, 0, modes) / (field.pressure * jnp.where(zero, 1, kernel))
    power = (relative.real**2 + relative.imag**2) * multiplicity(grid.shape)
    along = -wave_frequencies(grid, direction_and_speed(field.velocity)[0])
    loss = power * along * jnp.imag(kernel) * field.pressure

    # Ring by ring, as the theory adds roughness.
    edges, ring = rings(grid)
    step, complete = (binned(ring, a, len(edges)) for a in (power, loss))
    v = jnp.cumsum(step)
    before = v - step
    x = slowed(correction, jnp.stack([before, before + step / 2, v]))
    # Of the mean square pressure of complete contact, the share that a ring adds: d⟨σ²⟩/dv on
    # average over the ring.
    growth = mean_square_growth(x)
    thin = step <= 1e-4 * v
    between = (growth[2] - growth[0]) / jnp.where(thin, 1, step)
    share = jnp.where(thin, area(x[1]) * slowing(correction, x[1]), between)
    friction = jnp.cumsum(complete * share)
    extrapolated, known = jnp.zeros_like(edges[0]), coverage(field.stack)
    if known is not None:
        lost = jnp.where(is_unknown(wave_frequencies(grid, field.velocity), known), loss, 0)
        lost = binned(ring, lost, len(edges))
        extrapolated = jnp.sum(lost * share) / jnp.where(friction[-1] == 0, 1, friction[-1])
    return edges, x[2], friction, extrapolated


def _share(part, friction):
    """The share of the growth of `friction` that is a `part` [1] at each point of it."""
    step = jnp.abs(jnp.diff(friction))
    total = jnp.sum(step)
    return jnp.sum(step * (part[1:] + part[:-1]) / 2) / jnp.where(total == 0, 1, total)


def _error(ends, product):
    """The largest relative error of friction and area.

    `ends` are both of the result and with twice the wavenumbers, then both with half of the angles;
    `product` is what rounding is relative to.
    """

    def change(one, other):
        # Relative to whichever is smaller.
        least = jnp.minimum(jnp.abs(one), jnp.abs(other))
        return jnp.abs(one - other) / jnp.where(least == 0, 1, least)

    result, closer, coarse, coarse_closer = ends
    friction = jnp.abs(result[0])
    rounding = jnp.finfo(friction.dtype).eps * product / jnp.where(friction == 0, 1, friction)
    changes = change(result, closer) + change(coarse, coarse_closer)
    return _SAFETY * jnp.max(changes) + 4 * rounding


def _nodes(edges, lengths, num_intervals):
    """Nodes q [rad/m] of all pieces."""
    t = jnp.asarray(_clenshaw_curtis(num_intervals).nodes, lengths.dtype)
    # From the nearer edge, so that the edges themselves are exact: C is 0 beyond them.
    from_below = edges[:-1, None] * jnp.exp(t * lengths[:, None])
    from_above = edges[1:, None] * jnp.exp((t - 1) * lengths[:, None])
    return _joined(jnp.where(t < 0.5, from_below, from_above))


def _joined(pieces):
    """Values at the nodes of all pieces in a row, shared ends once."""
    return jnp.append(pieces[:, :-1].ravel(), pieces[-1, -1])


def _split(values, rule):
    """The inverse of `_joined`, shape `(pieces, nodes)`."""
    n = len(rule.nodes) - 1
    return jnp.concatenate([values[:-1].reshape(-1, n), values[n::n, None]], axis=1)


def _running(pieces):
    """Integrals from the start of each piece, made integrals from the first node on."""
    before = jnp.cumsum(pieces[:, -1]) - pieces[:, -1]
    return _joined(before[:, None] + pieces)


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
