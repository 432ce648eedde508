"""Errors by the grid: from the contact on half of it, and from changes between the points.

Let m be the change of a number from the grid to half of it, without the waves that half the grid
lacks, and l the change by these waves (`neighbours.py`). A number converges with the square of the
spacing, roughly, so that m contains its error several times; l counts since such waves have
neighbours that the grid lacks. Two changes of both signs may cancel in m by chance. The area in
doubt does not: besides m and l it has a part that grows with the length of the edges, the
difference from the count of points, and the openings between points. So the error of any other
number contains its own size times the relative error of the area.

Two things happen between the points, and no number of them shows it:

- Near full contact the pressure may be positive at the points and negative between them. There a
  finer grid opens.
- A wave with two points along an axis has no direction on the grid, so it dissipates nothing. On a
  finer grid each of its two directions has a quarter of its power.
"""

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ...contacts.operators.operator import nonzero
from ...fields.frequency import direction_and_speed
from ...fields.grid import mode_numbers, multiplicity, to_field, to_spectrum
from ..case import WINDOW
from ..energy import frequencies
from ..formulas import loaded, loaded_path, mean_load, shared, touching
from ..number import Found, value_of
from ..problem import CycleProblem, SteadyProblem
from ..transient_problem import TransientProblem


class Weights(NamedTuple):
    """Weights in the error of a number: of m, of l, and of its size times other errors.

    **Fields:**

    - `moved`, `lacking`: of m and l.
    - `relative_area`: of the relative error of the area.
    - `of_lacking`: of the relative error of the area, times the share of the squared slope that
      half the grid lacks.
    - `relative_open`: of the relative error of the area out of contact.
    - `most`: the largest relative error of an area that counts; contacts of few points have any.
    - `on_line`: times `relative_area` in one dimension, where few edges make up for each other.
    """

    moved: float
    lacking: float
    relative_area: float
    of_lacking: float
    relative_open: float
    most: float
    on_line: float = 1.0


# With these weights 97 of 100 claims of `bench_contact.py grid` hold, 87 to 100 of each kind.
OF_FORCE = Weights(0.5, 0.0, 0.11, 0.6, 0.0, 10.0)  # friction, work and power
OF_SHEAR = Weights(1.5, 0.5, 0.0, 0.0, 0.0, 0.0)  # shear in the contact, which follows the area
OF_PLACE = Weights(0.45, 0.3, 0.012, 0.0, 0.06, 1.0, 2.0)  # gap, approach, pressure at these
_AREA_MOVED, _AREA_LACKING, _EDGES, _OPENINGS = 1.2, 0.4, 0.4, 5.0
_UNSEEN = 6.0  # times the power of waves without a direction
_DOUBT = 0.25  # of the dip between two points: how far the lowest pressure may be below that seen


def by_grid(
    name: str,
    weights: Weights,
    also: Callable[[Found], Array] | None = None,
    shear: str | None = None,
) -> Callable[[Found], Array]:
    """Returns the formula of the error of a number by the grid.

    **Arguments:**

    - `name`: of the number.
    - `weights`: `OF_FORCE`, `OF_SHEAR` or `OF_PLACE`.
    - `also`: what is added, such as the power that no point shows.
    - `shear`: name of the part of the number by shear in the contact, which has its own error.
    """

    def error(found):
        exact = getattr(found.law, "hardness", None) is None  # where it flows the gap is 0
        if exact and found.problem.prescribed == name:
            return jnp.zeros((), found.pressure.dtype)
        (own, moved, missed), lacking = _changes(name, found), found.near.lacking
        area, doubt = value_of("contact_area", found), _area_in_doubt(found)
        if own.ndim:  # at each time of a transient solve
            area, doubt = (a.reshape(-1, *[1] * (own.ndim - 1)) for a in (area, doubt))
        else:
            area, doubt = jnp.mean(area), jnp.mean(doubt)
        relative = jnp.minimum(doubt / nonzero(area), weights.most)
        share = weights.relative_area * (weights.on_line if found.grid.ndim == 1 else 1)
        relative = relative * (share + weights.of_lacking * lacking)
        # At most 1: a contact that is full, or nearly so, may be open by all that is in doubt.
        opened = jnp.minimum(doubt / nonzero(1 - area), 1) * weights.relative_open
        total = weights.moved * moved + weights.lacking * missed
        if shear is not None:
            own = own - value_of(shear, found)
            total = total + by_grid(shear, OF_SHEAR)(found)
        total = total + jnp.abs(own) * (relative + opened)
        return total if also is None else total + also(found)

    return error


def friction_by_grid(
    name: str, also: Callable[[Found], Array] | None = None, shear: str | None = None
):
    """Returns the formula of the error of a friction by the grid, see `by_grid`.

    At a given gap or approach the load has an error, too. In full contact, where the traction does
    not depend on the load, friction has the same.
    """
    of_force = by_grid(name, OF_FORCE, also, shear)

    def error(found):
        own = of_force(found)
        if found.problem.prescribed == "pressure":
            return own
        load = "mean_pressure" if isinstance(found.problem, SteadyProblem) else "load"
        part = by_grid(load, OF_PLACE)(found) / nonzero(value_of(load, found))
        part = part * value_of("contact_area", found) ** 2
        part = part.reshape(-1, *[1] * (own.ndim - 1)) if own.ndim else jnp.mean(part)
        return jnp.maximum(own, part * jnp.abs(value_of(name, found)))

    return error


def area_by_grid(found: Found) -> Array:
    """The error of the contact area by the grid [1], in a cycle at each time."""
    area = value_of("contact_area", found)
    return jnp.minimum(_area_in_doubt(found), jnp.maximum(area, 1 - area))


@shared
def _area_in_doubt(found: Found) -> Array:
    own, moved, missed = _changes("contact_area", found)
    edges = jnp.abs(value_of("contact_area_pixels", found) - own)
    total = _AREA_MOVED * moved + _AREA_LACKING * missed + _EDGES * edges
    return total + unseen_area(found)


def unseen_area(found: Found) -> Array:
    """The error of the area between the points [1]."""
    if isinstance(found.problem, TransientProblem):
        return found.recorded["unseen_area"]
    return (_edges_by_chance if found.law.attracts else _hidden_openings)(found)


def _edges_by_chance(found: Found) -> Array:
    """The area by edges, each half a spacing off: the tension around them is not Hertz's."""
    inside = touching(found)
    axes = tuple(range(-found.grid.ndim, 0))
    crossed = sum(jnp.sum(inside != jnp.roll(inside, 1, axis), axis=axes) for axis in axes)
    size = jnp.asarray(found.grid.ndim * math.prod(found.grid.shape), found.pressure.dtype)
    return 0.5 * jnp.sqrt(crossed) / size


def _changes(name: str, found: Found) -> tuple[Array, Array, Array]:
    """A number, and the sizes of its changes m and l; NaN if the grid has no half."""
    near = found.near
    own, same, half = (value_of(name, one) for one in (found, *near.both(found)))
    changes = jnp.abs(jnp.stack([same - half, own - same]))
    # A neighbour may fail, or lose a contact of few points, and with it the number. A time without
    # contact, which has no friction, says nothing about the others.
    changes = jnp.where(jnp.isnan(changes), jnp.abs(jnp.nan_to_num(own)), changes)
    # At one time they may cancel by chance.
    if own.ndim:
        changes = jnp.maximum(changes, jnp.mean(changes, axis=1, keepdims=True))
    moved, missed = jnp.where(jnp.isnan(near.lacking), jnp.nan, changes)
    return own, moved, missed


@shared
def _hidden_openings(found: Found) -> Array:
    """The error of the area by openings between points in contact [1], in a cycle at each time.

    The pressure between the points is the sum of its waves. It is computed at all points of twice
    the grid whose neighbours touch. Its lowest value may lie between these, below by about a
    quarter of the dip from their neighbours: near 0 a point counts in part.
    """
    if WINDOW in found.facts:  # without waves of its own
        return jnp.zeros((), found.pressure.dtype)
    return _OPENINGS * found.operator.at_each_time(openings, found.pressure, touching(found))


def openings(pressure: Array, touches: Array) -> Array:
    """The share of the points of twice the grid at which contact opens between points [1]."""
    waves, shape = to_spectrum(pressure), pressure.shape
    total = jnp.zeros((), pressure.dtype)
    for shift in itertools.product((0, 1), repeat=len(shape)):
        axes = [axis for axis, moves in enumerate(shift) if moves]
        around, held, at = pressure, touches, pressure
        for axis in axes:
            around = (around + jnp.roll(around, -1, axis)) / 2
            held = held & jnp.roll(held, -1, axis)
        if axes:
            at = to_field(waves * math.prod(_half_step(shape, axis) for axis in axes), shape)
        else:
            beside = [(axis, way) for axis in range(len(shape)) for way in (-1, 1)]
            around = sum(jnp.roll(pressure, way, axis) for axis, way in beside) / len(beside)
            for axis, way in beside:
                held = held & jnp.roll(touches, way, axis)
        dip = _DOUBT * jnp.maximum(around - at, 0)
        share = jnp.clip((1 - at / jnp.where(dip > 0, dip, 1)) / 2, 0, 1)
        share = jnp.where(dip > 0, share, at < 0)
        total = total + jnp.mean(jnp.where(held, share, 0))
    return total / 2 ** len(shape)


def _half_step(shape: tuple[int, ...], axis: int):
    """The factors that move a field by half a spacing along an axis, on its half spectrum."""
    k, n = mode_numbers(shape)[axis], shape[axis]
    phase = jnp.exp(jnp.asarray(1j * math.pi / n * k))
    return jnp.where(2 * abs(k) == n, 0, phase)  # of both directions the mean


@shared
def unseen_power(found: Found) -> Array:
    """The error by the power that waves with two points along an axis would dissipate [W/m²].

    They dissipate as the waves of the next lower number do under the same pressure.
    """
    total = jnp.zeros((), found.pressure.dtype)
    if WINDOW in found.facts:
        return total
    shape, pressure = found.grid.shape, loaded(found)[0]
    size = jnp.abs(found.operator.to_waves(pressure) / pressure.size) ** 2
    size = size * multiplicity(pressure.shape)
    loss = -frequencies(found) * jnp.imag(found.problem.block.compliance)
    for axis, n in enumerate(shape):
        if n % 2:
            continue
        highest, way = n // 2, axis - len(shape)
        # Half an axis has one of the two waves beside the highest.
        beside = highest - 1, highest - 1 if way == -1 else highest + 1
        expected = sum(jnp.take(loss, at, way) for at in beside) / 2
        seen = jnp.take(loss, highest, way)
        lost = jnp.sum(jnp.take(size, highest, way) * (expected - seen))
        total = total + jnp.maximum(lost, 0) / 2
    return _UNSEEN * total


def beside_changes(found: Found) -> Array:
    """The error of friction beside the changes m and l [1]; of a cycle, the error of its mean.

    It is the friction of waves without a direction, and the error of shear in the contact.
    """
    size, cyclic = mean_load(found), isinstance(found.problem, CycleProblem)
    path = loaded_path(found, size) if cyclic else size * direction_and_speed(found.velocity)[1]
    hidden = unseen_power(found) / nonzero(path)
    if found.shear is None:
        return hidden
    name = "mean_shear_friction" if cyclic else "shear_friction"
    return hidden + by_grid(name, OF_SHEAR)(found)
