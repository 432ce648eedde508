"""The power that both bodies take, wave by wave.

The power of the traction τ·v, and in a cycle of the load, ⟨σ ∂(w + w_c)/∂t⟩ at a fixed point of
the surface, add up to the dissipation in block and counterface, -Σ ω Im M |σ_qω|² over all waves of
both signs of each, which is never negative for a passive solid. At a fixed point of the block, w
changes at the rate U* iωM U σ, so that both sides agree to rounding. So does w_c at a fixed point
of the counterface. Under steady sliding the counterface is at rest there, and takes no power.
"""

import functools
import math
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..contacts.operators.operator import AbstractOperator
from ..fields.frequency import wave_frequencies
from ..fields.grid import multiplicity
from .bodies import Coupling
from .formulas import loaded, shared, tractions_on
from .motion.motion import odd_frequencies
from .number import Found
from .problem import SteadyProblem


class Body(NamedTuple):
    """A body whose surface moves, and the tractions on it.

    **Fields:**

    - `operator`: M_zz [m/Pa].
    - `coupling`: how traction moves the surface.
    - `tractions`: on this body that move it [Pa].
    """

    operator: AbstractOperator
    coupling: Coupling
    tractions: list[Array]


@shared
def frequencies(found: Found) -> Array:
    """ω of each wave of the pressure [rad/s]; the highest of an even number of times is 0."""
    if isinstance(found.problem, SteadyProblem):
        return wave_frequencies(found.cell, found.velocity)
    count = len(found.pressure)
    omega = odd_frequencies(count, found.period)
    signed = jnp.concatenate([omega, -omega[1 : (count + 1) // 2][::-1]])
    return signed.reshape(-1, *[1] * found.grid.ndim)


@shared
def bodies_of(found: Found) -> list[Body]:
    """The bodies that take power: the block, and in a cycle the counterface, unless it is rigid."""
    tractions = tractions_on(found) if found.coupling.lift else []
    block = Body(found.problem.block, found.coupling, tractions)
    counterface = found.problem.counterface
    if counterface is None or isinstance(found.problem, SteadyProblem):
        return [block]
    return [block, Body(counterface.operator, counterface.coupling, [-t for t in tractions])]


@shared
def waves_of(found: Found) -> list[tuple[list[Array], list[Array]]]:
    """For each body, waves of pressure and tractions [Pa], and of the displacements [m]."""
    pressure = loaded(found)[0]
    bodies = bodies_of(found)
    return [body.coupling.waves(body.operator, pressure, body.tractions) for body in bodies]


@shared
def losses(found: Found) -> list[Array]:
    """The power lost in each wave and its conjugate [W/m²], on the half spectrum, for each body."""
    pressure, omega = loaded(found)[0], frequencies(found)
    if not found.coupling.lift:  # an elastic body loses nothing, not even by rounding
        return [body.operator.dissipation(pressure, omega) for body in bodies_of(found)]
    lost = []
    for forces, moved in waves_of(found):
        work = sum(jnp.imag(jnp.conj(f) * u) for f, u in zip(forces, moved, strict=True))
        lost.append(jnp.asarray(-omega * work * multiplicity(pressure.shape)))
    return lost


@shared
def exchange(found: Found) -> tuple[Array, Array]:
    """Power that the pressure exchanges with the bodies, and the sum of its sizes [W/m²]."""
    powers = [loaded(found)[0] * rates[0] for rates in rates_of(found)]
    exchanged, size = (
        functools.reduce(jnp.add, map(jnp.mean, part)) for part in (powers, map(jnp.abs, powers))
    )
    return exchanged, size


@shared
def rates_of(found: Found) -> list[list[Array]]:
    """The rates of the displacements of `waves_of` at a fixed point of each body [m/s]."""
    shape, omega = loaded(found)[0].shape, frequencies(found)

    def rates(body, moved):
        waves = (1j * omega * u * math.prod(shape) for u in moved)
        return [body.operator.to_field(w, shape) for w in waves]

    of_bodies = zip(bodies_of(found), waves_of(found), strict=True)
    return [rates(body, moved) for body, (_, moved) in of_bodies]


def powers_of_traction(found: Found) -> list[Array]:
    """Returns the powers of the tractions on the surfaces of the bodies [W/m²]; none uncoupled."""
    return [
        traction * rate
        for body, rates in zip(bodies_of(found), rates_of(found), strict=True)
        for traction, rate in zip(body.tractions, rates[1:], strict=True)
    ]
