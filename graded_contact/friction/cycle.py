"""A rough rigid surface in any periodic motion on a layered viscoelastic block.

The surface h(x - s(t)) is pressed on the block while it moves by s(t): back and forth, with starts
and stops, under a load that varies. One contact problem in space and time gives the periodic state
at once (`contact/space_time.py`); nothing is stepped in time.

Per cycle and area the surface does the work ∮ τ·v dt of friction, with the traction
τ = -⟨σ ∇w⟩ that opposes its motion, and the load the work ∮ ⟨σ ∂w/∂t⟩ dt, at a fixed point of the
surface. The block turns their sum to heat: T Σ -ω Im M |σ_qω|².
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, ScalarLike

from ..contact.adjoint import Inputs, LinearSolver, LinearSplitting
from ..contact.area import (
    contact_area,
    contact_area_corrected,
    contact_area_smooth,
    edge_stiffness,
)
from ..contact.estimates import error_of
from ..contact.law import AbstractLaw, HardWall, check_law
from ..contact.nested_solve import DouglasRachford
from ..contact.operator import nonzero
from ..contact.problem import RTOL, contact_of, loading_of
from ..contact.solution import RESULTS, ContactSolution
from ..contact.space_time import SpaceTime, in_motion
from ..contact.target import ObservableTarget
from ..core.checks import (
    Numbers,
    as_float,
    as_scalar,
    check_positive,
    check_squares,
    check_tolerance,
    check_types,
    check_values,
    short,
)
from ..core.derivative import derivative_apart
from ..core.display import shown
from ..core.memory import check_memory, cycle_memory
from ..core.warnings import LIMIT, SLIDING_RULES, Rule, caveats_of
from ..fields.devices import required
from ..fields.grid import Grid, derivative, multiplicity
from ..response.grading import AbstractGradedSolver, graded_tolerance
from ..response.layering import Layering
from ..response.periodic import period_frequencies, periodic_kernel
from ..response.stack import Stack
from ..rheology.measured import coverage, is_unknown
from ..roughness.surface import Surface

_FEWEST = 4  # times in a period
_LEAST_SHARE = 0.01  # of the slope: friction below it has the tolerance of that share


@shown(
    "mean_friction", "mean_friction_error", "peak_friction", "peak_friction_error", "work",
    "load_work", "dissipated_power", "phase", "friction", "contact_area", "mean_gap", "load",
    "energy_imbalance", "slope_in_contact", "largest_step", "contact", "caveats",
)  # fmt: skip
class CyclicSliding(eqx.Module):
    """Friction, contact area and fields over a cycle.

    Arrays over time have the shape `(nt,)`; those along the motion `(nt, 2)` if the displacement
    has two components. Errors and `energy_imbalance` have no derivative.

    **Observables:** over time

    - `friction`: traction over load [1], positive where it opposes a motion along +x; NaN where
      a mean gap leaves no contact. Over `displacement` it draws the hysteresis loop.
    - `traction`: τ [Pa], the shear stress on the whole area.
    - `load`: mean pressure [Pa].
    - `mean_gap`: mean of the gap [m].
    - `contact_area`, `contact_area_corrected`, `contact_area_smooth`: as those of `Sliding` [1].
    - `geometric_friction`: friction from the surface's slope [1]. Its difference from `friction` is
      the error of the grid.

    and of the whole cycle

    - `work`: of friction per area [J/m²].
    - `load_work`: of the load on the block per area [J/m²]; the dissipated energy is the sum.
    - `dissipated_power`: mean power lost in the block per area [W/m²].
    - `dissipation`: its parts at the frequencies ω = 2π k/T, k = 0, 1, ..., shape `(nt//2 + 1,)`.
    - `mean_friction`: work over ∮ load |v| dt [1], 0 without motion; under steady sliding the
      friction coefficient.
    - `peak_friction`: the largest |friction| of any time [1].
    - `mean_friction_error`, `peak_friction_error`: their estimated errors from the solver [1].
    - `phase`: by which the first harmonic of the traction leads that of the displacement [rad]:
      0 for a spring, π/2 for a dashpot; 0 without motion.
    - `slope_in_contact`: rms slope of the block where it carries the load, the largest of all times
      [1].
    - `load_mismatch`: difference of `load_work` from -∮ σ0 dū, its other form, over the energy
      dissipated [1]: the error of grid and times, 0 without dissipation.
    - `energy_imbalance`: works of friction and load against dissipation, relative [1].
    - `largest_step`: largest distance that the surface moves from one time to the next, in spacings
      of the grid, along x plus along y [1].
    - `unresolved_motion`: share of the velocity at the upper half of the frequencies [1].
    - `extrapolated_friction`: share of the dissipation at frequencies at which a material was not
      measured [1].

    **Fields:**

    - `contact`: pressure, gap and convergence, see `ContactSolution`; the fields have the shape
      `(nt, *grid.shape)`. Also reached directly as `.pressure`, `.gap` [Pa, m] and `.result`.
    - `operator`: the block in space and time.
    - `heights`, `grid`, `law`: of the surface and of the contact.
    - `displacement`, `velocity`: s(t) and ds/dt of the surface [m, m/s].
    - `period`: T [s].
    """

    friction: Float[Array, "nt ..."]
    traction: Float[Array, "nt ..."]
    load: Float[Array, " nt"]
    mean_gap: Float[Array, " nt"]
    contact_area: Float[Array, " nt"]
    contact_area_corrected: Float[Array, " nt"]
    contact_area_smooth: Float[Array, " nt"]
    geometric_friction: Float[Array, "nt ..."]
    work: Float[Array, ""]
    load_work: Float[Array, ""]
    dissipated_power: Float[Array, ""]
    dissipation: Float[Array, " nw"]
    mean_friction: Float[Array, ""]
    peak_friction: Float[Array, ""]
    mean_friction_error: Float[Array, ""]
    peak_friction_error: Float[Array, ""]
    phase: Float[Array, ""]
    slope_in_contact: Float[Array, ""]
    energy_imbalance: Float[Array, ""]
    load_mismatch: Float[Array, ""]
    largest_step: Float[Array, ""]
    unresolved_motion: Float[Array, ""]
    extrapolated_friction: Float[Array, ""]
    contact: ContactSolution
    operator: SpaceTime
    heights: Float[Array, "..."]
    grid: Grid
    law: AbstractLaw
    displacement: Float[Array, "nt ..."]
    velocity: Float[Array, "nt ..."]
    period: Float[Array, ""]

    @property
    def times(self) -> Float[Array, " nt"]:
        """The times of all arrays over time [s]."""
        count = len(self.displacement)
        return self.period * jnp.arange(count, dtype=self.period.dtype) / count

    @property
    def caveats(self) -> tuple[str, ...]:
        """Warnings about these numbers, one sentence each; not under `jit`."""
        return tuple(caveat.sentence for caveat in caveats_of(self, RULES))

    @property
    def pressure(self) -> Float[Array, "nt *shape"]:
        return self.contact.pressure

    @property
    def gap(self) -> Float[Array, "nt *shape"]:
        return self.contact.gap

    @property
    def result(self) -> RESULTS:
        return self.contact.result


@check_types
def slide_cycle(
    stack: Stack,
    surface: Surface,
    *,
    displacement: Numbers,
    period: ScalarLike,
    pressure: Numbers | None = None,
    mean_gap: Numbers | None = None,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    solver: DouglasRachford = DouglasRachford(),  # noqa: B008
    adjoint: LinearSolver = LinearSplitting(),  # noqa: B008
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008
    rtol: float | None = None,
    friction_rtol: float | None = None,
    start: Numbers | None = None,
    throw: bool = True,
) -> CyclicSliding:
    """Returns friction, contact area and fields of a surface in periodic motion on a block.

    The periodic state, which a motion repeated for ever approaches. Differentiable in every leaf of
    `stack`, `surface` and `law`, in the motion and in what is prescribed; works under `jit` and
    `vmap`.

    **Arguments:**

    - `stack`: the block, see `Stack`. `stack.at(temperature)` is the block at another temperature.
    - `surface`: the rough surface; heights count into the block.
    - `displacement`: s [m] of the surface at equally spaced times of a period, shape `(nt,)` (along
      x) or `(nt, 2)`, nt at least 4; see `sinusoidal`, `start_stop`, `steady`, `recorded`. Over
      a period the surface may advance by whole cells: by the number of them that closes the period
      with a step like its neighbours.
    - `period`: T [s].
    - `pressure`: mean pressure σ0 [Pa], a number or one at each time; or
    - `mean_gap`: mean of the gap [m], a number or one at each time, counted from the mean of the
      heights.
    - `friction_rtol`: requested relative error of the mean and the peak friction and of the mean
      sub-pixel contact area [1]; for frictions below 1 % of the slope in contact, relative to that
      1 %. Or
    - `rtol`: requested relative error of the pressure [1]; 5e-5 if neither is given.
    - `law`, `solver`, `adjoint`, `start`, `throw`: as in `solve_contact`; the law has no memory.
    - `graded_solver`: as in `slide`.

    **Returns:** friction and areas over time, works, errors and the contact, see `CyclicSliding`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if kernel or solve fail.
    """
    displacement, period = _motion(stack, surface, displacement, period)
    if rtol is not None and friction_rtol is not None:
        raise ValueError(
            f"`rtol={rtol}` and `friction_rtol={friction_rtol}`: give at most one of the two."
        )
    check_law(law)
    grid, num_times = surface.grid, len(displacement)
    check_squares("heights", surface.heights, "m")
    heights = jnp.broadcast_to(surface.heights, (num_times, *grid.shape))
    check_memory(
        "displacement",
        heights.shape,
        lambda shape: cycle_memory(shape, heights.dtype.itemsize, solver.history_length),
        "a cycle",
    )
    loading = loading_of(pressure, mean_gap, law, heights, num_times)
    kernel, error = periodic_kernel(stack, grid, num_times, period, graded_solver)
    reached = error <= graded_tolerance(graded_solver, None, grid.size)
    if throw:
        kernel = required(kernel, reached, lambda x, bad: eqx.error_if(x, bad, _NOT_REACHED))
    operator = _operator(kernel, displacement, grid)
    target = None
    if friction_rtol is not None:
        check_tolerance("friction_rtol", friction_rtol, heights)
        tolerance = jnp.asarray(friction_rtol, heights.dtype)
        target = MeanAndPeak(operator, grid, law, displacement, period, tolerance)
    contact = contact_of(
        Inputs(operator, heights, law, loading),
        solver,
        adjoint,
        friction_rtol or rtol or RTOL,
        target,
        start,
        None,
        throw,
    )
    if not throw:
        result = RESULTS.where(reached, contact.result, RESULTS.inaccurate_kernel)
        contact = eqx.tree_at(lambda c: c.result, contact, result)
    numbers = _numbers(contact, operator, surface, law, displacement, period, coverage(stack))
    return CyclicSliding(
        **numbers,
        contact=contact,
        operator=operator,
        heights=surface.heights,
        grid=grid,
        law=law,
        displacement=displacement,
        period=period,
    )


RULES = (
    *SLIDING_RULES,
    Rule(
        lambda found: found.largest_step,
        1.0 + LIMIT,
        "The surface moves by up to {worst:.2g} spacings of the grid from one time to the next: "
        "the times do not resolve how the shortest waves move. Take more times.",
    ),
    Rule(
        lambda found: found.load_mismatch,
        LIMIT,
        "The work of the load, in two forms, differs by {worst:.0%} of the dissipated energy: grid "
        "and times do not resolve the contact. Take more of both, or a smoother motion.",
    ),
    Rule(
        lambda found: found.unresolved_motion,
        LIMIT,
        "{worst:.0%} of the velocity is at the upper half of the frequencies that the times "
        "resolve: the motion has kinks or jumps. Take more times, or a smoother motion.",
    ),
)
_NOT_REACHED = (
    "The tolerance was not reached in the kernel of a graded layer: its profile varies too "
    "sharply. Put boundaries between layers at its jumps and list its kinks in `breaks`, or pass a "
    "`graded_solver` with a larger `rtol`."
)


def _motion(stack, surface, displacement, period):
    """The checked displacement and period."""
    if not isinstance(stack, Stack):
        raise ValueError(f"`stack={short(stack)}` must be a `Stack(layers=..., base=...)`.")
    if not isinstance(surface, Surface):
        raise ValueError(f"`surface={short(surface)}` must be a `Surface(heights, grid)`.")
    displacement, period = as_float(displacement, "displacement"), as_scalar(period, "period")
    components = displacement.shape[1:]
    few = displacement.ndim == 0 or len(displacement) < _FEWEST
    if few or components not in ((), (2,)) or len(components) >= surface.grid.ndim:
        raise ValueError(
            f"`displacement` has shape {displacement.shape}; `(nt,)` or, on a grid in two "
            f"dimensions, `(nt, 2)` is needed, with nt of at least {_FEWEST} times."
        )
    check_values("displacement", displacement, "a displacement [m] must be finite")
    check_positive("period", period, "[s]")
    return displacement, period


@derivative_apart
@eqx.filter_jit
def _operator(kernel, displacement, grid: Grid) -> SpaceTime:
    moved = _components(displacement)
    missing = grid.ndim - moved.shape[1]
    return in_motion(kernel, jnp.pad(moved, [(0, 0), (0, missing)]), grid)


def _components(over_time):
    """An array over time, with its components on the second axis."""
    return over_time.reshape(len(over_time), -1)


def velocity_of(
    displacement: Float[Array, "nt ..."], period: Float[Array, ""], grid: Grid
) -> tuple[Float[Array, "nt ..."], Float[Array, "nt ..."]]:
    """Returns ds/dt [m/s], and the part of s [m] that comes back after each period.

    The surface advances by the number of cells that closes the period with a step like its
    neighbours.
    """
    moved = _components(displacement)
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
    return jnp.where(loaded[:, None], friction, jnp.nan), mean, jnp.max(_length(friction))


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
        velocity = _components(velocity_of(self.displacement, self.period, self.grid)[0])
        traction = tractions(pressure, moved, self.grid, velocity.shape[1])
        _, mean, peak = _mean_and_peak(traction, _mean_over(pressure), velocity)
        slope = jnp.max(_slopes(pressure, moved, self.grid))
        return jnp.stack([mean, peak]), jnp.stack([slope, slope])


def _indicator(law, contact: ContactSolution, operator: SpaceTime, grid: Grid):
    stiffness = edge_stiffness(operator.typical, grid)
    return law.contact_indicator(contact.pressure, contact.gap, stiffness)


@derivative_apart
@eqx.filter_jit
def _numbers(contact, operator: SpaceTime, surface: Surface, law, displacement, period, measured):
    """The observables of a cycle, by name."""
    grid, pressure = surface.grid, contact.pressure
    count = len(pressure)
    moving, back = velocity_of(displacement, period, grid)
    velocity, shape = _components(moving), displacement.shape
    moved = operator.displace(pressure)
    load = _mean_over(pressure)
    traction = tractions(pressure, moved, grid, velocity.shape[1])
    friction, mean, peak = _mean_and_peak(traction, load, velocity)
    heights = jnp.broadcast_to(surface.heights, pressure.shape)
    geometric = tractions(pressure, heights, grid, velocity.shape[1])
    power = jnp.mean(jnp.sum(traction * velocity, axis=1))
    omega = _odd_frequencies(count, period)
    signed = jnp.concatenate([omega, -omega[1 : (count + 1) // 2][::-1]])
    rate = operator.filtered(
        1j * signed.reshape(-1, *[1] * grid.ndim) * operator.compliance, pressure
    )
    exchanged = jnp.mean(pressure * rate)
    dissipation = _dissipation(operator, pressure, omega)
    lost, size = jnp.sum(dissipation), jnp.mean(jnp.abs(pressure * rate))
    first = jnp.fft.rfft(traction, axis=0)[1], jnp.fft.rfft(_components(back), axis=0)[1]
    by_gap = -jnp.mean(load * _rate(contact.mean_gap.reshape(count, 1), omega)[:, 0])
    lead = jnp.sum(first[0] * jnp.conj(first[1]))
    indicator = _indicator(law, contact, operator, grid)
    touching = indicator > 0
    target = MeanAndPeak(operator, grid, law, displacement, period, jnp.zeros_like(period))
    errors = contact.target_error
    if errors is None:
        errors = jax.lax.stop_gradient(_friction_errors(target, contact))
    waves = jnp.abs(jnp.fft.rfft(velocity, axis=0)) ** 2
    upper = jnp.sum(waves[count // 4 + 1 :]) / nonzero(jnp.sum(waves))
    steps = jnp.diff(_components(displacement), axis=0)
    outside = 0.0
    if measured is not None:
        unknown = is_unknown(omega, measured)
        outside = jnp.sum(jnp.where(unknown, jnp.abs(dissipation), 0)) / nonzero(lost)
    return dict(
        friction=friction.reshape(shape),
        traction=traction.reshape(shape),
        load=load,
        mean_gap=contact.mean_gap.reshape(count),
        contact_area=jax.vmap(contact_area)(touching).astype(load.dtype),
        contact_area_corrected=jax.vmap(contact_area_corrected)(touching).astype(load.dtype),
        contact_area_smooth=jax.vmap(contact_area_smooth)(indicator),
        geometric_friction=(geometric / jnp.where(load > 0, load, jnp.nan)[:, None]).reshape(shape),
        work=power * period,
        load_work=(exchanged - power) * period,
        dissipated_power=lost,
        dissipation=dissipation,
        mean_friction=mean,
        peak_friction=peak,
        mean_friction_error=errors[0],
        peak_friction_error=errors[1],
        phase=jnp.angle(jnp.where(jnp.abs(lead) > 0, lead, 1)),
        slope_in_contact=jnp.max(_slopes(pressure, contact.displacement, grid)),
        energy_imbalance=jax.lax.stop_gradient(jnp.abs(exchanged - lost) / nonzero(size)),
        load_mismatch=jnp.abs(exchanged - power - by_gap) / nonzero(lost),
        largest_step=jnp.max(jnp.sum(jnp.abs(steps) / grid.spacing[: steps.shape[1]], axis=1)),
        unresolved_motion=jnp.sqrt(upper),
        extrapolated_friction=jnp.asarray(outside, load.dtype),
        velocity=moving,
    )


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
