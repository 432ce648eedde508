"""Numbers of a whole cycle: its friction, work and power."""

import jax.numpy as jnp
from jaxtyping import Array

from ...contacts.operators.operator import nonzero
from ...core.quantities import CYCLE, FOUR, TOTAL, TRANSIENT, observable, of_cycle
from ..energy import dissipation_of_waves, exchange, losses
from ..errors.grid import OF_FORCE, beside_changes, by_grid, unseen_power
from ..errors.parts import add_errors, by_times, over_friction, solver_errors
from ..facts import COUNTERFACE, SHEARED
from ..formulas import (
    all_tractions,
    friction_of_cycle,
    frictions,
    indicator_of,
    loaded,
    loaded_path,
    mean_load,
    over_path,
    own_tractions,
    power_of,
    shear_power,
)
from ..result import CyclicSliding, Found


@observable(
    r"\bar\mu",
    "1",
    "work of friction over load and path",
    column=("friction\n(mean)", FOUR),
    kinds=(CYCLE, TRANSIENT),
)
def mean_friction(found: CyclicSliding) -> Array:
    """Work over ∮ load |v| dt [1]; under steady sliding the friction.

    0 without motion, NaN without contact.
    """
    return frictions(found, loaded(found)[0], indicator_of(found))[0]


@of_cycle(
    r"\bar\mu_\mathrm{shear}", "1", "part of the mean friction from shear in the contact",
    needs=[SHEARED], column=("shear\n(mean)", FOUR),
)  # fmt: skip
def mean_shear_friction(found: CyclicSliding) -> Array:
    """The part of `mean_friction` from shear in the contact area, with `shear` [1]."""
    return over_path(found, shear_power(found), mean_load(found))


@observable(
    r"\mu_\mathrm{max}", "1", "largest friction coefficient of a cycle",
    column=("friction\n(peak)", FOUR), kinds=(CYCLE, TRANSIENT),
)  # fmt: skip
def peak_friction(found: CyclicSliding) -> Array:
    """The largest |friction|, also between the times [1]."""
    return frictions(found, loaded(found)[0], indicator_of(found))[1]


@of_cycle("W", "J/m²", "work of friction in a cycle", column=("work\n[J/m²]", FOUR))
def work(found: CyclicSliding) -> Array:
    """Work of friction per area and cycle, that of shear included [J/m²]."""
    return (power_of(found, own_tractions(found)) + shear_power(found)) * found.period


@of_cycle(r"W_\sigma", "J/m²", "work of the load in a cycle")
def load_work(found: CyclicSliding) -> Array:
    """Work of the load on the block, and on the counterface, per area and cycle [J/m²].

    The sum of both, less the work of shear, is dissipated in the block and in the counterface.
    """
    return (exchange(found)[0] - power_of(found, own_tractions(found))) * found.period


@of_cycle("P", "W/m²", "mean power that the block dissipates", column=("power\n[W/m²]", FOUR))
def dissipated_power(found: CyclicSliding) -> Array:
    """Mean power lost in the block per area [W/m²]."""
    return jnp.sum(dissipation_of_waves(found))


@of_cycle(
    r"P_\mathrm{c}", "W/m²", "mean power that the counterface dissipates", needs=[COUNTERFACE],
    column=("power of\ncounterface\n[W/m²]", FOUR),
)  # fmt: skip
def counterface_power(found: CyclicSliding) -> Array:
    """Mean power lost in the counterface per area [W/m²]; 0 if it is rigid."""
    return sum(map(jnp.sum, losses(found)[1:]), jnp.zeros((), found.pressure.dtype))


@of_cycle("P", "W/m²", "power dissipated at each frequency", stored=False)
def dissipation(found: CyclicSliding) -> Array:
    """Its parts at the frequencies ω = 2π k/T, k = 0, 1, ..., shape `(nt//2 + 1,)`."""
    lost = dissipation_of_waves(found)
    lost, count = jnp.sum(lost, axis=tuple(range(1, lost.ndim))), len(lost)
    # A frequency and its negative are one entry.
    half, other = lost[: count // 2 + 1], lost[count // 2 + 1 :][::-1]
    return half.at[1 : len(other) + 1].add(other)


@of_cycle(
    r"\delta", "1", "phase of the traction before the displacement, in radians",
    column=("phase\n[rad]", ".3f"),
)  # fmt: skip
def phase(found: CyclicSliding) -> Array:
    """By which the first harmonic of the traction leads that of the displacement [rad].

    0 for a spring, π/2 for a dashpot; 0 without motion.
    """
    fields = all_tractions(found), found.motion_of_surface[1]
    force, moved = (jnp.fft.rfft(a, axis=0)[1] for a in fields)
    lead = jnp.sum(force * jnp.conj(moved))
    # The angle of 0 has no derivative.
    return jnp.angle(jnp.where(jnp.abs(lead) > 0, lead, 1))


def _work_over_time(found: CyclicSliding) -> Array:
    """The power of friction at each time over a period [J/m²]."""
    return jnp.sum(all_tractions(found) * found.motion_of_surface[0], axis=1) * found.period


def _power_over_time(found: CyclicSliding) -> Array:
    return _work_over_time(found) / found.period


def _by_temperature(found: Found, index: int) -> Array:
    """The error of mean or peak friction by the temperatures; known is that of the mean."""
    both = frictions(found, loaded(found)[0], indicator_of(found))
    assert found.heated is not None
    return found.heated.friction_error * jnp.abs(both[index]) / nonzero(jnp.abs(both[0]))


for _number, _index, _over in (("mean_friction", 0, over_friction), ("peak_friction", 1, None)):
    add_errors(
        _number, of_cycle, TOTAL, over=_over,
        grid=by_grid(_number, OF_FORCE, beside_changes),
        time=by_times(_number, friction_of_cycle),
        solver=lambda found, index=_index: solver_errors(found)[index],
        temperature=lambda found, index=_index: _by_temperature(found, index),
    )  # fmt: skip


def _beside_work(found: Found) -> Array:
    return beside_changes(found) * loaded_path(found, mean_load(found)) * found.period


for _number, _trace, _also in (
    ("work", _work_over_time, _beside_work),
    ("load_work", _work_over_time, None),
    ("dissipated_power", _power_over_time, unseen_power),
):
    _grid, _time = by_grid(_number, OF_FORCE, _also), by_times(_number, _trace)
    add_errors(_number, of_cycle, grid=_grid, time=_time)
