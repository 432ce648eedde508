"""Numbers that only a transient motion has, recorded step by step, and the errors of all.

Errors by the grid follow from the transient solve on half the grid, as for other contacts, at each
time. Errors by the steps follow from the transient solve in half as many steps. Steps are of second
order: their error is a third of the change. After a sudden load or motion it is the whole change,
which the estimate therefore takes.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...contacts.operators.operator import nonzero
from ...fields.grid import to_field, to_spectrum
from ..case import LOAD_FOLLOWS, SHEARED
from ..errors.grid import OF_FORCE, OF_PLACE, area_by_grid, by_grid, friction_by_grid
from ..errors.neighbours import Neighbours, neighbours_by
from ..errors.parts import over_number
from ..formulas import lengths, shared
from ..number import Formula, Found, observable
from ..numbers.contact import contact_area, mean_gap
from ..numbers.cycle import mean_friction, peak_friction
from ..numbers.friction import friction, load
from .solve import on_grid

_LEAST_STEPS = 2  # of the transient solve in half as many
_KEPT_BY_TIMES, _MEAN_BY_TIMES = 1.0, 0.15  # of the changes with half as many steps
_OF_FIRST_STEP = 0.5  # of the work of the load: half of it is what a block of fluid loses more


@observable("work of friction so far", "J/m²")
def work_done(found: Found) -> Array:
    """Work of friction per area since t = 0 [J/m²], with the work of shear."""
    return found.recorded["work_done"]


@observable("work of the load so far", "J/m²")
def load_work_done(found: Found) -> Array:
    """Work of the load on the block per area since t = 0 [J/m²].

    The sum of both, less the work of shear, is stored and dissipated in the block. How much is
    stored does not follow from the response: bodies of equal response may store different parts.
    What an unloading gives back shows how much of it was free.
    """
    return found.recorded["load_work_done"]


@observable("work of shear in the contact so far", "J/m²", needs=[SHEARED])
def shear_work_done(found: Found) -> Array:
    """The part of `work_done` by shear in the contact [J/m²]."""
    return found.recorded["shear_work_done"]


@observable("time since the last start or stop", "s")
def time_since_change(found: Found) -> Array:
    """Time since the surface last started or stopped [s]; before that since t = 0."""
    steps, way = found.problem.steps
    ends, moves = found.times, lengths(way) > 0
    changes = jnp.append(False, moves[1:] != moves[:-1])
    return ends - jax.lax.cummax(jnp.where(changes, ends - steps, 0))


@observable("time from the last start or stop to the largest friction", "s")
def time_to_peak(found: Found) -> Array:
    """Time from the last start or stop of the surface to the largest friction [s]; NaN at rest."""
    sizes = lengths(found.recorded["friction"].reshape(len(found.times), -1))
    peak = jnp.argmax(jnp.where(found.recorded["load"] > 0, sizes, -1))
    moves = jnp.any(found.problem.steps[1] != 0)
    return jnp.where(moves, time_since_change(found)[peak], jnp.nan)


# Errors.


def neighbours_in_time(found: Found) -> Neighbours:
    """Returns the transient solves on half the grid, and in half as many steps."""
    count, fewer = len(found.times), None
    if count >= 2 * _LEAST_STEPS:
        fewer = on_grid(found, found.grid.shape, found.problem.roughness, _halved_steps(count))
    return neighbours_by(found, partial(on_grid, found), fewer)


def _halved_steps(count: int) -> tuple[int, ...]:
    """Every second step, with the last one."""
    return tuple(range(count))[::-2][::-1]


def _by_steps(name: str):
    """The formula of the error by the steps, from the transient solve with half as many."""

    def error(found):
        own, fewer = found.recorded[name], found.near.fewer
        if fewer is None:  # nothing is known of it
            return jnp.nan * own
        if own.ndim == 0:
            return _KEPT_BY_TIMES * jnp.abs(own - fewer.recorded[name])
        chosen = np.array(_halved_steps(len(own)))
        change = jnp.abs(own[chosen] - fewer.recorded[name])
        change = jnp.where(jnp.isnan(change), jnp.abs(jnp.nan_to_num(own[chosen])), change)
        columns = change.reshape(len(change), -1).T
        at = [jnp.interp(found.times, found.times[chosen], column) for column in columns]
        moved = jnp.stack(at, axis=-1).reshape(own.shape)
        return _KEPT_BY_TIMES * moved + _MEAN_BY_TIMES * jnp.mean(change, axis=0)

    return error


def _of_first_step(found: Found) -> Array:
    """The error of the work of a load that begins at once: how its pressures rise is not known."""
    return _OF_FIRST_STEP * jnp.abs(found.recorded["load_work_done"][0])


@shared
def _memory(found: Found) -> Array:
    """The relative error of the displacements by the memory, on a window also by its kernel."""
    problem = found.problem
    error = sum((creep.error for creep in problem.creeps), jnp.zeros(()))
    if problem.path is None:
        return error
    pressure, cell = found.pressure[-1], problem.memory_grid.shape
    missing = [(0, n - m) for n, m in zip(cell, pressure.shape, strict=True)]
    waves = to_spectrum(jnp.pad(pressure, missing))

    def moved(kernel):
        return jnp.std(to_field(kernel * waves, cell)[tuple(map(slice, pressure.shape))])

    for creep in problem.creeps:
        kernel, errors = problem.around_path(creep, creep.aged[-1])
        error = error + sum(map(moved, errors)) / nonzero(moved(kernel))
    return error


def _forces(found: Found) -> Array:
    """The change of the friction of each step by a relative error of pressures [1], at most."""
    return found.recorded["slope"] * found.recorded["spread"] / nonzero(found.recorded["load"])


def _roughness(found: Found) -> Array:
    """The rms roughness of both bodies, at most [m], at each time."""
    return sum(map(jnp.std, found.problem.roughness), jnp.zeros(found.times.shape))


def _works(found: Found) -> Array:
    """The same in the work of friction so far [J/m²]."""
    way = lengths(found.problem.steps[1])
    return jnp.cumsum(_forces(found) * found.recorded["load"] * way)


def _work_of_load(found: Found) -> Array:
    gap = found.recorded["mean_gap"]
    closed = jnp.abs(jnp.diff(gap, prepend=gap[:1] + 3 * _roughness(found)[:1]))
    return _works(found) + jnp.cumsum(found.recorded["load"] * closed)


def _mean_forces(found: Found) -> Array:
    return jnp.max(_forces(found))


def _itself(name: str) -> Formula:
    return lambda found: found.recorded[name]


def _parts_of(name: str, scale: Formula, by: Formula, solver: str = "step_error"):
    """The parts of the error of a number.

    `scale` returns what a relative error of the pressure changes in it, `by` is the error by the
    grid, and `solver` the name of the error that the solver left in each step.
    """

    def scaled(found, error):
        size = scale(found)
        size = (jnp.max(error) if size.ndim == 0 else error) * size
        like = found.recorded[name]
        return jnp.broadcast_to(
            size.reshape(size.shape + (1,) * (like.ndim - size.ndim)), like.shape
        )

    return {
        "grid": by,
        "time": _by_steps(name),
        "solver": lambda found: 2 * scaled(found, found.recorded[solver]),
        "memory": lambda found: scaled(found, _memory(found)),
    }


def _of_friction(name: str, scale: Formula, shear: str = "mean_shear_friction"):
    return _parts_of(name, scale, friction_by_grid(name, shear=shear))


def _with_its_step(cause: str, own: Formula) -> Formula:
    """The part of the peak's error: at least the friction's error at its step."""

    def error(found):
        count = len(found.times)
        size, at_steps = (
            lengths(part.reshape(count, -1))
            for part in (found.recorded["friction"], FRICTION_ERRORS[cause](found))
        )
        return jnp.maximum(own(found), at_steps[jnp.nanargmax(size)])

    return error


CAUSES = "solver", "grid", "time", "memory"
FRICTION_ERRORS = _of_friction("friction", _forces, "shear_friction")
_PEAK_ERRORS = {
    cause: _with_its_step(cause, own)
    for cause, own in _of_friction("peak_friction", _mean_forces).items()
}
friction_error = friction.error(FRICTION_ERRORS)
mean_friction_error = mean_friction.error(_of_friction("mean_friction", _mean_forces))
peak_friction_error = peak_friction.error(_PEAK_ERRORS)
work_done_error = work_done.error(
    _parts_of("work_done", _works, by_grid("work_done", OF_FORCE, shear="shear_work_done"))
)
load_work_done_error = load_work_done.error(
    _parts_of("load_work_done", _work_of_load, by_grid("load_work_done", OF_FORCE))
    | {"time": lambda found: _by_steps("load_work_done")(found) + _of_first_step(found)}
)
contact_area_error = contact_area.error(
    _parts_of("contact_area", _itself("contact_area"), area_by_grid), over=over_number
)
load_error = load.error(
    _parts_of("load", _itself("load"), by_grid("load", OF_PLACE)), needs=[LOAD_FOLLOWS]
)
mean_gap_error = mean_gap.error(
    _parts_of("mean_gap", _roughness, by_grid("mean_gap", OF_PLACE), "step_gap_error")
)
