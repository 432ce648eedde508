"""Numbers of a whole cycle: its friction, work and power."""

import functools
from collections.abc import Callable

import jax.numpy as jnp
from jaxtyping import Array

from ...contacts.operators.operator import nonzero
from ..case import COUNTERFACE, SHEARED
from ..energy import exchange, losses
from ..errors.grid import OF_FORCE, beside_changes, by_grid, friction_by_grid, unseen_power
from ..errors.parts import by_times, over_friction, solver_errors
from ..formulas import (
    all_tractions,
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
from ..number import Found, observable, value_of
from .friction import friction


@observable("work of friction over load and path")
def mean_friction(found: Found) -> Array:
    """Work over ∮ load |v| dt [1]; under steady sliding the friction.

    0 without motion, NaN without contact.
    """
    return frictions(found, loaded(found)[0], indicator_of(found))[0]


@observable("mean friction by shear in the contact", needs=[SHEARED])
def mean_shear_friction(found: Found) -> Array:
    """The part of `mean_friction` from shear in the contact area, with `shear` [1]."""
    return over_path(found, shear_power(found), mean_load(found))


@observable("largest friction coefficient of a cycle")
def peak_friction(found: Found) -> Array:
    """The largest |friction|, also between the times [1]."""
    return frictions(found, loaded(found)[0], indicator_of(found))[1]


@observable("work of friction in a cycle", "J/m²")
def work(found: Found) -> Array:
    """Work of friction per area and cycle, with the work of shear [J/m²]."""
    return (power_of(found, own_tractions(found)) + shear_power(found)) * found.period


@observable("work of the load in a cycle", "J/m²")
def load_work(found: Found) -> Array:
    """Work of the load on the block, and on the counterface, per area and cycle [J/m²].

    The sum of both, less the work of shear, is dissipated in the block and in the counterface.
    """
    return (exchange(found)[0] - power_of(found, own_tractions(found))) * found.period


@observable("mean power that the block dissipates", "W/m²")
def dissipated_power(found: Found) -> Array:
    """Mean power lost in the block per area [W/m²]."""
    return jnp.sum(losses(found)[0])


@observable("mean power lost in the counterface", "W/m²", needs=[COUNTERFACE])
def counterface_power(found: Found) -> Array:
    """Mean power lost in the counterface per area [W/m²]; 0 if it is rigid."""
    return sum(map(jnp.sum, losses(found)[1:]), jnp.zeros((), found.pressure.dtype))


def _work_over_time(found: Found) -> Array:
    """The power of friction at each time over a period [J/m²]."""
    return jnp.sum(all_tractions(found) * found.motion_of_surface[0], axis=1) * found.period


def _lost(found: Found) -> Array:
    """The power lost in both bodies at each frequency of the cycle [W/m²]."""
    parts = [jnp.sum(lost, axis=tuple(range(1, lost.ndim))) for lost in losses(found)]
    return functools.reduce(jnp.add, parts)


def _by_losses(name: str, over: Callable[[Found], Array | float]) -> Callable[[Found], Array]:
    """The error by the times of a number that is a sum of losses over the time `over`.

    It contains the change of the loss at each frequency: at each time most power is elastic.
    """

    def of_times(found):
        own, fewer = value_of(name, found), found.near.fewer
        if fewer is None:
            return jnp.abs(own)
        after, before = _lost(found), _lost(fewer)
        unseen = jnp.zeros(len(after) - len(before), after.dtype)
        low, high = jnp.split(before, [(len(before) + 1) // 2])
        moved = jnp.sum(jnp.abs(after - jnp.concatenate([low, unseen, high])))
        return jnp.abs(own - value_of(name, fewer)) / 2 + 0.3 * moved * over(found)

    return of_times


def _by_temperature(found: Found, index: int) -> Array:
    """The error of mean or peak friction by the temperatures; both have the same relative error."""
    both = frictions(found, loaded(found)[0], indicator_of(found))
    assert found.heated is not None
    return found.heated.friction_error * jnp.abs(both[index]) / nonzero(jnp.abs(both[0]))


def _beside_work(found: Found) -> Array:
    return beside_changes(found) * loaded_path(found, mean_load(found)) * found.period


def _of_frictions(name: str, index: int):
    """The parts of the error of mean or peak friction."""
    return {
        "grid": friction_by_grid(name, beside_changes),
        "time": by_times(name, friction),
        "solver": lambda found: solver_errors(found)[index],
        "temperature": lambda found: _by_temperature(found, index),
    }


mean_friction_error = mean_friction.error(_of_frictions("mean_friction", 0), over=over_friction)
peak_friction_error = peak_friction.error(_of_frictions("peak_friction", 1))
work_error = work.error(
    {"grid": by_grid("work", OF_FORCE, _beside_work), "time": by_times("work", _work_over_time)}
)
load_work_error = load_work.error(
    {
        "grid": by_grid("load_work", OF_FORCE),
        "time": _by_losses("load_work", lambda found: found.period),
    }
)
dissipated_power_error = dissipated_power.error(
    {
        "grid": by_grid("dissipated_power", OF_FORCE, unseen_power),
        "time": _by_losses("dissipated_power", lambda _: 1.0),
    }
)
