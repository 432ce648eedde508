"""Values at equally spaced times of a period: components, rates, and values between the times."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...core.compilation import compiled
from ...kernels.periodic import period_frequencies

_REFINED = 64  # times as many for the length of the path


def components(over_time: Float[Array, "nt ..."]) -> Float[Array, "nt components"]:
    """Returns an array over time, with its components on the second axis."""
    return over_time.reshape(len(over_time), -1)


def rate_of(values: Float[Array, "nt ..."], period: Float[Array, ""]) -> Float[Array, "nt ..."]:
    """Returns the derivative by time of periodic values."""
    omega = odd_frequencies(len(values), period).reshape(-1, *[1] * (values.ndim - 1))
    return jnp.fft.irfft(1j * omega * jnp.fft.rfft(values, axis=0), len(values), axis=0)


@compiled
def refined(values: Float[Array, "nt ..."]) -> Float[Array, "more ..."]:
    """Returns periodic values at `_REFINED` times as many times, by their Fourier series."""
    count = len(values)
    waves = jnp.fft.rfft(values, axis=0)
    if count % 2 == 0:  # the highest frequency is now two, of both signs
        waves = waves.at[-1].divide(2)
    return jnp.fft.irfft(waves, _REFINED * count, axis=0) * _REFINED


def odd_frequencies(count: int, period: Float[Array, ""]) -> Float[Array, " nw"]:
    """Returns the frequencies ω >= 0 of a period; the highest of an even count, which has no sign,
    is 0."""
    omega = period_frequencies(count, period)
    return omega if count % 2 else omega.at[-1].set(0)
