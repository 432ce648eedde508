"""The contact on one grid as the splitting takes it, and what it begins from."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..fields.grid import to_field, to_spectrum
from .anderson import sums
from .law import AbstractLaw
from .solver import (
    Prescribed,
    first_mode,
    least_compliance,
    participation,
    penalty_for,
    third_mode,
    to_mean,
)
from .splitting import Solid, Splitting

_COLD_PARTICIPATION = 0.05  # ⟨σ⟩²/⟨σ²⟩ expected before anything is known
_NEARLY = 0.98  # share of points touching, from which full contact is looked for
_HIGHEST = 1e3  # pressure of a start, in what it takes to flatten the stiffest wave

Factor = float | Float[Array, ""]  # of a penalty, over the first


class Scene(NamedTuple):
    """Kernel [m/Pa] and heights [m], both of any mean, on one grid, and a typical pressure [Pa]."""

    kernel: Inexact[Array, "*half"]
    heights: Float[Array, "*shape"]
    unit: Float[Array, ""]


class OnGrid(eqx.Module):
    """The contact on one grid, dimensionless: see `splitting.py`."""

    scene: Scene
    penalty: Float[Array, ""]  # [Pa/m] over the unit
    law: AbstractLaw
    target: Float[Array, ""]  # mean of the pressure, or if that is free of the gap
    free_mean: bool = eqx.field(static=True)

    @property
    def unit(self) -> Float[Array, ""]:
        """Of pressure [Pa]."""
        return self.scene.unit

    @property
    def length(self) -> Float[Array, ""]:
        """The unit of length [m]."""
        return self.scene.unit / self.penalty

    def heights(self, factor: Factor = 1.0) -> Float[Array, "*shape"]:
        """Those of zero mean, with a penalty this many times as large."""
        scale = factor / self.length
        # Scaled first: else a loop would keep another field.
        return scale * self.scene.heights - scale * jnp.mean(self.scene.heights)

    def law_at(self, factor) -> AbstractLaw:
        """The law with a penalty this many times as large."""
        return self.law.in_units(1.0, 1 / factor)

    def solid_at(self, factor: Factor = 1.0) -> Solid:
        """The solid with a penalty this many times as large."""
        return Solid(self.scene.kernel, factor * self.penalty, self.free_mean)

    def shift(self, factor) -> Float[Array, "*shape"]:
        """What heights and target add to the map of the solid."""
        mean = -factor * self.target if self.free_mean else self.target
        return mean + self.solid_at(factor)(self.heights(factor))

    def splitting(self, factor, shift) -> Splitting:
        """What is iterated with a penalty this many times as large, and its shift."""
        return Splitting(self.solid_at(factor), shift, self.law_at(factor).proximal)

    def at_load(self, pressure):
        """A pressure of the law with the load that is prescribed, if any."""
        return pressure if self.free_mean else to_mean(pressure, self.target, self.law.bounds)


def on_grid(scene: Scene, law, prescribed: Prescribed, guess) -> OnGrid:
    """Returns the contact in units of a pressure, with a penalty that suits the guess of it."""
    kernel, heights, unit = scene
    cold = jnp.asarray(_COLD_PARTICIPATION, heights.dtype)
    penalty = penalty_for(kernel, cold if guess is None else participation(guess), law)
    length = unit / penalty
    free_mean = prescribed.pressure is None
    (given,) = (value for value in prescribed if value is not None)
    target = given / (length if free_mean else unit)
    return OnGrid(scene, penalty, law.in_units(unit, length), target, free_mean)


def as_guess(scene: Scene, law, prescribed: Prescribed, pressure):
    """Returns a pressure to begin from, in its unit, made possible for the law and the load."""
    kernel, _, unit = scene
    guess = pressure / unit
    low, high = law.in_units(unit, 1.0).bounds
    # A guess of another scale would drown all else.
    stiffest = third_mode(jnp.abs(kernel)) / least_compliance(kernel)
    guess = jnp.clip(guess, low, jnp.minimum(high, _HIGHEST * stiffest))
    if prescribed.pressure is None:
        return guess
    # What is missing is spread evenly: a small contact scaled up would be far off.
    mean = prescribed.pressure / unit
    guess = guess + jnp.maximum(mean - jnp.mean(guess), 0)
    return to_mean(jnp.clip(guess, low, high), mean, (low, high))


def full_or(problem: OnGrid, guess, touching):
    """Returns the pressure of full contact if that is the solution, else the guess; and FFT pairs.

    It is looked for if the share of points `touching` on the grid before was large.
    """

    def look():
        kernel = problem.solid_at().compliance
        mean = first_mode(kernel.shape)
        waves = to_spectrum(problem.heights())
        spectrum = jnp.where(mean, 0, waves / jnp.where(mean, 1, kernel))
        flat = problem.target + to_field(spectrum, guess.shape)
        return jnp.where(jnp.min(flat) > 0, flat, guess), jnp.ones_like(touching)

    return jax.lax.cond(touching > _NEARLY, look, lambda: (guess, jnp.zeros_like(touching)))


def start_of(problem: OnGrid, guess):
    """Returns z to begin from: that of a guessed pressure, or without one of points on springs."""
    heights, law, target = problem.heights(), problem.law, problem.target
    if guess is None:
        if problem.free_mean or law.attracts:
            return target - heights

        def halve(_, bracket):
            middle = jnp.mean(bracket)
            light = jnp.mean(law.proximal(middle + heights)) < target
            return jnp.where(light, bracket.at[0].set(middle), bracket.at[1].set(middle))

        # Pressed down until they carry the load: else surfaces may start far apart.
        ends = jnp.stack([-2 * jnp.max(heights), target - jnp.min(heights)])
        v = jax.lax.fori_loop(0, 40, halve, ends)[1] + heights
        return 2 * law.proximal(v) - v
    gap = to_field(problem.solid_at().compliance * to_spectrum(guess), heights.shape) - heights
    total, weighed, mean = sums(jnp.abs(guess), jnp.abs(guess) * gap, gap)
    loaded = (total > 0) & (not problem.free_mean)
    gap = gap - jnp.where(loaded, weighed, mean) / jnp.where(loaded, total, gap.size)
    if problem.free_mean:
        gap = gap + target
    # The law's own pressure and gap nearest to the guess; in contact, where the gap is but the
    # guess's error, the pressure alone.
    y = law.proximal(guess - gap)
    return jnp.where(guess > jnp.abs(gap), guess, 2 * y - (guess - gap))
