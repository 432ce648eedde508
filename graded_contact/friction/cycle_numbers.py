"""The numbers of a cycle: frictions, areas, works and their errors, from the pressure.

At a fixed point of the surface the block's displacement changes at the rate
∂w/∂t = U* iωK U σ + v·∇w, see `contact/space_time.py`. So the works of friction and load equal the
dissipation to rounding.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..contact.area import (
    contact_area,
    contact_area_corrected,
    contact_area_smooth,
    edge_stiffness,
)
from ..contact.estimates import error_of
from ..contact.law import AbstractLaw
from ..contact.operator import nonzero
from ..contact.solution import ContactSolution
from ..contact.space_time import SpaceTime
from ..contact.target import ObservableTarget
from ..core.derivative import derivative_apart, largest
from ..fields.grid import Grid, derivative, multiplicity
from ..response.periodic import period_frequencies
from ..rheology.measured import is_unknown
from ..roughness.surface import Surface

_LEAST_SHARE = 0.01  # of the slope; below it the tolerance of friction is relative to that share


def components(over_time: Float[Array, "nt ..."]) -> Float[Array, "nt components"]:
    """Returns an array over time, with its components on the second axis."""
    return over_time.reshape(len(over_time), -1)


def velocity_of(
    displacement: Float[Array, "nt ..."], period: Float[Array, ""], grid: Grid
) -> tuple[Float[Array, "nt ..."], Float[Array, "nt ..."]]:
    """Returns ds/dt [m/s], and the part of s [m] that comes back after each period.

    The surface advances by the number of cells that closes the period with a step like its
    neighbours.
    """
    moved = components(displacement)
    count, size = len(moved), grid.size[: moved.shape[1]]
    closing = (moved[-1] - moved[-2] + moved[1] - moved[0]) / 2
    cells = jnp.round(jax.lax.stop_gradient((moved[-1] + closing - moved[0]) / size))
    drift = cells * size
    share = jnp.arange(count, dtype=moved.dtype)[:, None] / count
    back = moved - drift * share
    velocity = _rate(back, _odd_frequencies(count, period)) + drift / period
    return velocity.reshape(displacement.shape), back.reshape(displacement.shape)


def _odd_frequencies(count: int, period):
    """The frequencies ω >= 0 of a period; the highest of an even count has no sign and is 0."""
    omega = period_frequencies(count, period)
    return omega if count % 2 else omega.at[-1].set(0)


def _rate(values, omega):
    """The derivative by time of periodic values, shape `(nt, n)`."""
    waves = 1j * omega[:, None] * jnp.fft.rfft(values, axis=0)
    return jnp.fft.irfft(waves, len(values), axis=0)


def _mean_over(field):
    """The mean over space at each time."""
    return jnp.mean(field, axis=tuple(range(1, field.ndim)))


def tractions(
    pressure: Float[Array, "nt *shape"],
    profile: Float[Array, "nt *shape"],
    grid: Grid,
    num_components: int,
) -> Float[Array, "nt components"]:
    """Returns -⟨σ ∂f/∂x⟩ [Pa] along the first axes of the grid, at each time."""

    slopes = (_slope_along(profile, grid, axis) for axis in range(num_components))
    return jnp.stack([-_mean_over(pressure * slope) for slope in slopes], axis=1)


def _slope_along(field, grid: Grid, axis: int):
    """The derivative of a field at each time along one axis of space."""
    return jax.vmap(lambda one: derivative(one, grid, axis))(field)


def _mean_and_peak(traction, load, velocity):
    """Friction at each time, its mean over the path and its largest size."""
    loaded = load > 0
    friction = traction / jnp.where(loaded, load, 1)[:, None]
    speed = _length(velocity)
    path = jnp.mean(load * speed)
    mean = jnp.mean(jnp.sum(traction * velocity, axis=1)) / nonzero(path)
    return jnp.where(loaded[:, None], friction, jnp.nan), mean, largest(_length(friction))


def _length(vectors):
    """The lengths of vectors, with the derivative 0 where they vanish."""
    squared = jnp.sum(vectors**2, axis=1)
    return jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1)), 0)


def _slopes(pressure, displacement, grid):
    """The rms slope of the block where it carries the load, at each time."""
    axes = range(grid.ndim)
    slopes = [
        jax.vmap(lambda one, axis=axis: derivative(one, grid, axis))(displacement) for axis in axes
    ]
    weight = jnp.abs(pressure)
    squared = _mean_over(weight * sum(slope**2 for slope in slopes))
    squared = squared / nonzero(_mean_over(weight))
    return jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1)), 0)


class MeanAndPeak(eqx.Module):
    """Mean and peak friction and the mean sub-pixel contact area to `friction_rtol`."""

    operator: SpaceTime
    grid: Grid
    law: AbstractLaw
    displacement: Float[Array, "nt ..."]
    period: Float[Array, ""]
    rtol: Float[Array, ""]

    def __call__(self, contact: ContactSolution) -> ObservableTarget:
        value, size = self.frictions(contact.pressure)
        indicator = _indicator(self.law, contact, self.operator, self.grid)
        area = jnp.mean(jax.vmap(contact_area_smooth)(indicator))
        value, size = jnp.append(value, area), jnp.append(size, area)
        tolerance = self.rtol * jnp.maximum(jnp.abs(value), _LEAST_SHARE * size)
        return ObservableTarget(value, size, tolerance)

    def frictions(self, pressure: Float[Array, "nt *shape"]):
        """Returns mean and peak friction, and the slopes, of which they are differences."""
        moved = self.operator.displace(pressure)
        velocity = components(velocity_of(self.displacement, self.period, self.grid)[0])
        traction = tractions(pressure, moved, self.grid, velocity.shape[1])
        _, mean, peak = _mean_and_peak(traction, _mean_over(pressure), velocity)
        slope = jnp.max(_slopes(pressure, moved, self.grid))
        return jnp.stack([mean, peak]), jnp.stack([slope, slope])


def _indicator(law, contact: ContactSolution, operator: SpaceTime, grid: Grid):
    stiffness = edge_stiffness(operator.typical, grid)
    return law.contact_indicator(contact.pressure, contact.gap, stiffness)


@derivative_apart
@eqx.filter_jit
def cycle_numbers(
    contact: ContactSolution,
    operator: SpaceTime,
    surface: Surface,
    law: AbstractLaw,
    displacement: Float[Array, "nt ..."],
    period: Float[Array, ""],
    measured: tuple[Float[Array, ""], Float[Array, ""]] | None,
) -> dict[str, Array]:
    """Returns the observables of a cycle by name, see `CyclicSliding`."""
    grid, pressure, shape = surface.grid, contact.pressure, displacement.shape
    moving, back = velocity_of(displacement, period, grid)
    velocity, load = components(moving), _mean_over(pressure)
    traction = tractions(pressure, operator.displace(pressure), grid, velocity.shape[1])
    friction, mean, peak = _mean_and_peak(traction, load, velocity)
    heights = jnp.broadcast_to(surface.heights, pressure.shape)
    geometric = tractions(pressure, heights, grid, velocity.shape[1])
    geometric = geometric / jnp.where(load > 0, load, jnp.nan)[:, None]
    errors = contact.target_error
    if errors is None:
        target = MeanAndPeak(operator, grid, law, displacement, period, jnp.zeros_like(period))
        errors = jax.lax.stop_gradient(_friction_errors(target, contact))
    power = jnp.mean(jnp.sum(traction * velocity, axis=1))
    indicator = _indicator(law, contact, operator, grid)
    touching = indicator > 0
    waves = jnp.abs(jnp.fft.rfft(velocity, axis=0)) ** 2
    upper = jnp.sum(waves[len(load) // 4 + 1 :]) / nonzero(jnp.sum(waves))
    steps = jnp.abs(jnp.diff(components(displacement), axis=0))
    area = jax.vmap(contact_area)(touching).astype(load.dtype)
    return _works(operator, contact, power, load, period, measured) | dict(
        friction=friction.reshape(shape),
        traction=traction.reshape(shape),
        load=load,
        mean_gap=contact.mean_gap.reshape(load.shape),
        contact_area=area,
        time_in_contact=jnp.mean(area > 0, dtype=load.dtype),
        contact_area_corrected=jax.vmap(contact_area_corrected)(touching).astype(load.dtype),
        contact_area_smooth=jax.vmap(contact_area_smooth)(indicator),
        geometric_friction=geometric.reshape(shape),
        mean_friction=mean,
        peak_friction=peak,
        mean_friction_error=errors[0],
        peak_friction_error=errors[1],
        phase=_lead(traction, components(back)),
        slope_in_contact=largest(_slopes(pressure, contact.displacement, grid)),
        largest_step=largest(jnp.sum(steps / grid.spacing[: steps.shape[1]], axis=1)),
        unresolved_motion=jnp.sqrt(upper),
        velocity=moving,
    )


def _works(operator: SpaceTime, contact: ContactSolution, power, load, period, measured):
    """Works, dissipation and their balance, by name; `power` is that of friction."""
    pressure, count = contact.pressure, len(load)
    omega = _odd_frequencies(count, period)
    signed = jnp.concatenate([omega, -omega[1 : (count + 1) // 2][::-1]])
    change = 1j * signed.reshape(-1, *[1] * (pressure.ndim - 1))
    rate = operator.filtered(change * operator.compliance, pressure)
    exchanged, size = jnp.mean(pressure * rate), jnp.mean(jnp.abs(pressure * rate))
    dissipation = _dissipation(operator, pressure, omega)
    lost = jnp.sum(dissipation)
    by_gap = -jnp.mean(load * _rate(contact.mean_gap.reshape(count, 1), omega)[:, 0])
    outside = jnp.zeros_like(lost)
    if measured is not None:
        unknown = is_unknown(omega, measured)
        outside = jnp.sum(jnp.where(unknown, jnp.abs(dissipation), 0)) / nonzero(lost)
    return dict(
        work=power * period,
        load_work=(exchanged - power) * period,
        dissipated_power=lost,
        dissipation=dissipation,
        energy_imbalance=jax.lax.stop_gradient(jnp.abs(exchanged - lost) / nonzero(size)),
        load_mismatch=jnp.abs(exchanged - power - by_gap) / nonzero(lost),
        extrapolated_friction=outside,
    )


def _lead(traction, back):
    """The phase of the first harmonic of the traction before that of the displacement."""
    force, moved = (jnp.fft.rfft(a, axis=0)[1] for a in (traction, back))
    lead = jnp.sum(force * jnp.conj(moved))
    return jnp.angle(jnp.where(jnp.abs(lead) > 0, lead, 1))


def _dissipation(operator: SpaceTime, pressure, omega):
    """The power lost at each frequency ω >= 0, per area [W/m²]."""
    amplitude = operator.to_waves(pressure) / pressure.size
    power = (amplitude.real**2 + amplitude.imag**2) * multiplicity(pressure.shape)
    count = len(pressure)
    lost = -jnp.imag(operator.compliance) * power
    lost = jnp.sum(lost, axis=tuple(range(1, lost.ndim)))
    # Both signs of a frequency lose the same.
    half, other = lost[: count // 2 + 1], lost[count // 2 + 1 :][::-1]
    both = half.at[1 : len(other) + 1].add(-other)
    return omega * both


def _friction_errors(target: MeanAndPeak, contact: ContactSolution):
    def of(change):
        return target.frictions(contact.pressure + change)[0]

    value, size = target.frictions(contact.pressure)
    return error_of(of, value, contact.correction, size)
