"""The power that the block takes, wave by wave.

The power of the traction τ·v, and in a cycle that of the load ⟨σ ∂w/∂t⟩ at a fixed point of the
surface, add up to the dissipation -Σ ω Im M |σ_qω|² over all waves of both signs, which is never
negative for a passive solid. At a fixed point of the block, w changes at the rate U* iωM U σ, so
that both sides agree to rounding.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array

from ..fields.frequency import wave_frequencies
from ..fields.grid import multiplicity
from .formulas import loaded, shared, tractions_on
from .motion import odd_frequencies
from .result import Found, Sliding


@shared
def frequencies(found: Found) -> Array:
    """ω of each wave of the pressure [rad/s]; the highest of an even number of times is 0."""
    if isinstance(found, Sliding):
        return wave_frequencies(found.cell, found.velocity)
    count = len(found.pressure)
    omega = odd_frequencies(count, found.period)
    signed = jnp.concatenate([omega, -omega[1 : (count + 1) // 2][::-1]])
    return signed.reshape(-1, *[1] * found.grid.ndim)


@shared
def dissipation_of_waves(found: Found) -> Array:
    """Returns the power lost in each wave and its conjugate [W/m²], on the half spectrum."""
    pressure, omega = loaded(found)[0], frequencies(found)
    if found.coupling is None:
        return found.operator.dissipation(pressure, omega)
    forces, moved = waves_of(found)
    work = sum(jnp.imag(jnp.conj(f) * u) for f, u in zip(forces, moved, strict=True))
    return jnp.asarray(-omega * work * multiplicity(pressure.shape))


@shared
def waves_of(found: Found) -> tuple[list[Array], list[Array]]:
    """Waves of pressure and tractions [Pa], and of the displacements along them [m]."""
    assert found.coupling is not None
    return found.coupling.waves(found.operator, loaded(found)[0], tractions_on(found))


@shared
def exchange(found: Found) -> tuple[Array, Array]:
    """Power that the pressure exchanges with the block, and the sum of its sizes [W/m²]."""
    pressure, operator, omega = loaded(found)[0], found.operator, frequencies(found)
    if found.coupling is None:
        rate = operator.filtered(1j * omega * operator.compliance, pressure)
    else:
        rate = rates_of(found)[0]
    power = pressure * rate
    return jnp.mean(power), jnp.mean(jnp.abs(power))


@shared
def rates_of(found: Found) -> list[Array]:
    """The rates of the displacements of `waves_of` at a fixed point of the block [m/s]."""
    shape = loaded(found)[0].shape
    waves = (1j * frequencies(found) * u * math.prod(shape) for u in waves_of(found)[1])
    return [found.operator.to_field(w, shape) for w in waves]
