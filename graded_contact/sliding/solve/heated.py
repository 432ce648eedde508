"""The effect of the heat of friction on friction.

With `slide(..., heating=...)` the block has the temperature of its contact. The mean rise over the
contact at each depth, weighted by the pressure, sets the relaxation times there: the block becomes
a stack of thin layers, each at its temperature (`conduction.py`), and so does a counterface that
deforms. The fixed point is found in steps of a contact and its temperatures
(`core/fixed_point.py`): first by a bracket of the largest rise, up to the highest temperature that
materials can have, then by Anderson's acceleration. The derivative is implicit.

With `slide_cycle(..., heating=...)` one temperature of each depth holds for the whole cycle. It is
found in steady sliding at the mean speed and the mean load of the cycle, times the mean power of
the cycle over the power of this sliding. The power is of all forces, friction and load: what the
block loses and what heats the interface. What the counterface loses is made at its surface,
distributed as the pressure, which overestimates its effect. This is a mean: at the highest speed
the contact is warmer, and at a turn it cools. The model assumes that rubber cools
between passes, which holds if the stroke is longer than the spots of contact.
"""

import dataclasses
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...blocks.heated_stack import check_heated, heated
from ...blocks.stack import Stack
from ...contacts.area import area_in_doubt
from ...contacts.solution import RESULTS, ContactSolution, ended
from ...core.checks import Numbers, is_concrete
from ...core.compilation import compiled, say_compiling
from ...core.derivative import derivative_apart, still
from ...core.fixed_point import attach_fixed_point, find_fixed_point, has_reached
from ...fields.devices import required
from ...fields.grid import Grid, to_spectrum
from ...materials.shift import HOTTEST, as_temperature
from ...materials.softening import at_strain
from ...surfaces.surface import check_periodic
from ..case import Case, HeatedContact, Heating, Numerics, facts_of
from ..formulas import indicator_of, lengths
from ..interior.conduction import Heat, over_contact, pressure_weight, temperatures
from ..interior.heat_source import gauss_within, heat_source, intervals, shear_heat
from ..motion.motion import refined
from ..numbers.friction import interface_power
from ..result import CyclicSliding, Sliding
from .isothermal import solve_isothermal

NUM_CELLS = 8  # of the depth, each at one temperature
_SAFETY = 4.0  # of the change of friction by twice the cells
_HOTTEST = HOTTEST * (1 - 1e-6)  # of iterates: rounding must not carry them beyond
_FIRST = 0.25  # depth of the first cell [spacings]; the last one ends at the size of the surface


def solve_heated(
    case: Case, numerics: Numerics, start: Numbers | None = None
) -> Sliding | CyclicSliding:
    """Returns the contact of a `Case` at the temperatures that it causes; see `slide`."""
    grid, dtype = case.surface.grid, case.surface.grid.size.dtype
    temperature = _bulk_of(case)
    say_compiling("a heated contact: minutes on large grids")
    edges, padded, finer = _cells(grid, NUM_CELLS)
    given = dataclasses.replace(case, temperature=temperature)
    fixed = still(given)
    rtol = 10 * numerics.rtol  # temperatures are as noisy as the contact is inaccurate

    def step(x, state):
        starts, pairs = state
        warm = _warm_contact(numerics, x, fixed, edges, starts)
        rises = _shorter(_rises(warm, fixed, padded), fixed.temperature)
        return rises, (warm.pressures, pairs + warm.found.num_fft_pairs)

    state = (start, None), jnp.zeros((), dtype)
    none = jnp.zeros(len(case.bodies) * (NUM_CELLS + 1), dtype)
    most = (_HOTTEST - fixed.temperature).astype(dtype)
    point = find_fixed_point(step, none, state, jnp.asarray(rtol, dtype), most)
    x = jax.lax.stop_gradient(point.x)
    starts, pairs = point.state
    warm = _warm_contact(numerics, x, fixed, edges, starts)
    # One more step with twice the cells has less error, of the iteration and of the depths.
    rises = _rises(warm, fixed, finer)
    rises, settled, hottest = _possible(rises, x, most, point.error, rtol)
    closer = _warm_contact(numerics, rises, fixed, finer, warm.pressures).found
    errors = still(_errors(warm.found, closer))
    pairs = pairs + warm.found.num_fft_pairs + closer.num_fft_pairs
    # Derivatives are attached only where something is traced.
    if not all(map(is_concrete, jax.tree.leaves(given))):
        known = still((warm.found.contact, warm.steady.contact))

        def image(given, x):
            warm = _warm_contact(numerics, x, given, edges, known=known)
            return _shorter(_rises(warm, given, padded), given.temperature)

        x = attach_fixed_point(image, given, x)
        warm = _warm_contact(numerics, x, given, edges, known=known)
    solution = _ended(warm.found.contact, settled, hottest, numerics.throw)
    surface, inside = _of_block(x, len(case.bodies))
    return dataclasses.replace(
        warm.found,
        contact=dataclasses.replace(solution, num_fft_pairs=pairs),
        problem=dataclasses.replace(warm.found.problem, facts=facts_of(case)),
        heated=HeatedContact(surface, inside, edges, point.error, *errors),
    )


class _Warm(NamedTuple):
    """A contact at given temperatures, and the heat that it makes.

    `found` is the contact of the case; `steady` the sliding whose heat, times `factor`, warms both
    bodies, the contact itself but for a cycle; `lost` is what the counterface loses [W/m²].
    """

    found: Sliding | CyclicSliding
    steady: Sliding
    factor: Array | float = 1.0
    lost: Array | float = 0.0

    @property
    def pressures(self) -> tuple[Array, Array]:
        """The pressures that the next contacts start from."""
        return self.found.pressure, self.steady.pressure


def _warm_contact(
    numerics: Numerics, x, case: Case, edges, starts=(None, None), known=(None, None)
) -> _Warm:
    """The contact at rises of both bodies; `known` are solutions of it."""
    bodies, temperature = _warm(case.bodies, case.temperature, x, edges)
    warm = dict(zip(("stack", "counterface"), bodies, strict=False))
    inner = dataclasses.replace(case, **warm, temperature=temperature, heating=None)
    found: Any = solve_isothermal(inner, numerics, starts[0], known[0])
    if case.velocity is None:
        inner, power = _of_mean(inner, found)
        s = cast(Sliding, solve_isothermal(inner, numerics, starts[1], known[1]))
        own = s.friction * jnp.mean(s.pressure) * s.speed
        factor = jnp.where(own > 0, power / jnp.where(own > 0, own, 1), 0)
        return _Warm(found, s, factor, found.counterface_power)
    if (ratio := case.strain_per_slope) is not None:
        bodies[0] = at_strain(bodies[0], ratio * found.slope_in_contact)
        found = dataclasses.replace(found, bodies=tuple(bodies))
    return _Warm(found, found)


def _ended(contact: ContactSolution, settled, hottest, throw: bool) -> ContactSolution:
    """A contact whose temperatures may not have settled, or have no limit."""
    ends = (settled | hottest, RESULTS.not_settled), (settled | ~hottest, RESULTS.too_hot)
    for good, end in ends:
        contact = required(contact, good, end.error_if) if throw else ended(contact, good, end)
    return contact


@compiled
def _shorter(rises, temperature) -> Array:
    """The rises of the cells of `_cells` without those that repeat the last edge."""
    rises = rises.reshape(-1, 2 * NUM_CELLS + 1)[:, : NUM_CELLS + 1].ravel()
    # Without losses there is rounding, which never settles.
    return jnp.where(temperature + rises == temperature, 0, rises)


@compiled
def _possible(rises, x, most, error, rtol) -> tuple[Array, ...]:
    """Rises that materials can have; whether the iteration settled, and whether x is `most`."""
    settled = error <= rtol
    # One that did not settle may cause temperatures that no material can have.
    rises = jnp.where(settled, rises, jnp.clip(rises, jnp.min(x), most))
    return rises, settled, has_reached(x, most)


@compiled
def _of_block(x, num_bodies) -> tuple[Array, Array]:
    """The rises of the surface of the block and of its cells."""
    rises = x.reshape(num_bodies, -1)[0]
    return rises[0], rises[1:]


def _bulk_of(case: Case) -> Array:
    """The bulk temperature of a case [K]; raises `ValueError` where `heating` is refused."""
    check_periodic(case.surface)
    for name, body in zip(("stack", "counterface"), case.bodies, strict=False):
        check_heated(name, body)
    if (
        case.velocity is None
        and is_concrete(case.displacement)
        and not np.any(np.ptp(np.asarray(case.displacement), axis=0))
    ):
        raise ValueError("`heating` is refused: `displacement` does not move.")
    temperature = as_temperature(case.temperature)
    temperature = temperature.astype(case.surface.grid.size.dtype)
    for body in case.bodies:
        body.at(temperature)  # refuses what a material cannot have
    return temperature


def _of_mean(case: Case, cycle: CyclicSliding) -> tuple[Case, Array]:
    """The case of steady sliding at the mean speed and load of a cycle, and its mean power [W/m²].

    The velocity is along the fastest part of the path, if the path is not straight.
    """
    mean, power = _mean_of(cycle)
    steady = dataclasses.replace(
        case, displacement=None, period=None, velocity=mean.reshape(cycle.displacement.shape[1:]),
        pressure=cycle.contact.mean_pressure, mean_gap=None,
    )  # fmt: skip
    return steady, power


@derivative_apart
@compiled
def _mean_of(cycle: CyclicSliding) -> tuple[Array, Array]:
    """The velocity of a cycle whose speed is the mean one, and its mean power."""
    velocity = refined(cycle.motion_of_surface[0])
    speed = lengths(velocity)
    # There and back it is as fast: the first of them, which rounding must not choose.
    top = jnp.argmax(speed >= (1 - 1e-9) * jnp.max(speed))
    mean = jnp.mean(speed) * velocity[top] / speed[top]
    # With coupling some of the work of shear is lost in the block: it counts once.
    return mean, cycle.dissipated_power + interface_power(cycle)


def _errors(s: Sliding | CyclicSliding, closer: Sliding | CyclicSliding):
    """The errors of friction and contact area, from a contact of less error."""
    names = "mean_friction" if isinstance(s, CyclicSliding) else "friction", "contact_area"
    return _by_changes(s.compute(*names), closer.compute(*names), s, closer.pressure)


@compiled
def _by_changes(numbers, closer, s: Sliding | CyclicSliding, pressure: Array):
    changes = zip(numbers, closer, strict=True)
    by_friction, by_area = (_SAFETY * jnp.max(jnp.abs(a - b)) for a, b in changes)
    return by_friction, jnp.maximum(by_area, area_in_doubt(indicator_of(s), pressure - s.pressure))


@compiled
def _cells(grid: Grid, number: int) -> tuple[Array, ...]:
    """The edges of the cells, padded, and the edges of twice as many cells [m].

    In the second the last edge is repeated: one program serves both numbers of cells.
    """
    ends = _FIRST * jnp.min(grid.spacing), jnp.max(grid.size)
    edges, finer = intervals(*ends, number), intervals(*ends, 2 * number)
    padded = jnp.append(edges, jnp.full(number, edges[-1]))
    # The cells are a choice of the method: they have no derivative.
    return jax.lax.stop_gradient((edges, padded, finer))


@derivative_apart
@compiled
def _warm(bodies: tuple[Stack, ...], temperature, x, edges) -> tuple[list[Stack], Array]:
    """The bodies at rises of their surfaces and cells, and the temperature of the contact."""
    rises = x.reshape(len(bodies), -1)[:, 1:]
    warm = [heated(body, temperature, own, edges) for body, own in zip(bodies, rises, strict=True)]
    return warm, temperature + x[0]


def _rises(warm: _Warm, case: Case, edges) -> Array:
    """The mean rises over the contact of the surface and of the cells of each body [K]."""
    s = warm.steady
    nodes, needed = _nodes(case.bodies, edges)
    source = heat_source(s, nodes[0][0], needed)
    given = case.heating, case.bodies, nodes, source, edges
    return _risen(warm.factor, warm.lost, s, *given)


@derivative_apart
@compiled
def _nodes(bodies: tuple[Stack, ...], edges) -> tuple[list[tuple[Array, Array]], Array]:
    """Depths and weights [m] of quadratures over each body, and whether those of a block count."""
    nodes = [gauss_within(body, edges) for body in bodies]
    return nodes, nodes[0][1] > 0


@derivative_apart
@compiled
def _risen(factor, lost, s: Sliding, heating: Heating | None, bodies, nodes, source, edges):
    """The rises by the heat at the nodes of the block [W/m³]."""
    assert heating is not None
    weights = nodes[0][1]
    # A few depths miss some of the heat.
    made = jnp.sum(jnp.mean(source, tuple(range(1, source.ndim))) * weights)
    own = s.block_friction if s.coupling.lift else s.pressure_friction
    power = factor * own * jnp.mean(s.pressure) * s.speed
    source = source * jnp.where(made > 0, jnp.abs(power) / jnp.where(made > 0, made, 1), 0)
    heat = Heat(source, weights, factor * shear_heat(s), lost)
    places = [jnp.append(0.0, depths) for depths, _ in nodes]
    weight = to_spectrum(pressure_weight(s))
    found = []
    for spectra, (depths, weights) in zip(
        temperatures(s, bodies, heating, heat, places), nodes, strict=True
    ):
        rises = jax.vmap(lambda spectrum: over_contact(weight, spectrum, s.grid))(spectra)
        share = jnp.where((depths > edges[:-1, None]) & (depths < edges[1:, None]), weights, 0)
        total = jnp.sum(share, 1)
        found += [rises[:1], share @ rises[1:] / jnp.where(total > 0, total, 1)]
    return jnp.concatenate(found)
