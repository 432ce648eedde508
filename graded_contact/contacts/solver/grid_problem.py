"""The contact on one grid, without units, and where its solve begins; see `nested_solve.py`."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..law import AbstractLaw
from ..operators.operator import AbstractOperator, Field, Scalar, Solid, nonzero
from .abstract_solver import Loading
from .splitting import Splitting

_NEARLY = 0.98  # share of points that touch, from which full contact is tried
_CLOSED = 1e-3  # mean gap over the rms height, up to which full contact is a good start
_HIGHEST = 1e3  # limit of the pressure of a start, over that which flattens the stiffest wave

Factor = float | Scalar  # of a penalty, over the first


class GridSettings(NamedTuple):
    """Settings of the solve on one grid, static except `rtol`."""

    share: float  # of its points in the points of the finest grid
    newton: bool  # whether Newton steps may follow
    draft_steps: int
    max_steps: int
    relaxation: float
    rtol: Scalar


class OneGrid(NamedTuple):
    """The inputs on one grid."""

    operator: AbstractOperator
    heights: Field
    loading: Loading

    def guess(self, law: AbstractLaw, unit, pressure):
        """Returns a pressure to begin from, in its unit, made possible for the law and the load."""
        operator, _, loading = self
        guess = pressure / unit
        low, high = law.in_units(unit, 1.0).bounds
        # A guess of another scale would dominate everything else.
        stiffest = operator.long_wave / operator.least
        guess = jnp.clip(guess, low, jnp.minimum(high, _HIGHEST * stiffest))
        if loading.pressure is None:
            return guess
        # A load that is missing is spread evenly: a small contact scaled up would be far off.
        mean = loading.pressure / unit
        guess = guess + jnp.maximum(mean - operator.mean(guess), 0)
        return operator.to_mean(jnp.clip(guess, low, high), mean, (low, high))


class GridProblem(eqx.Module):
    """The contact on one grid, dimensionless: see `splitting.py`.

    A factor is a penalty over the first one.
    """

    grid: OneGrid
    unit: Scalar  # of pressure [Pa]
    penalty: Scalar  # [Pa/m] over the unit
    law: AbstractLaw
    mean: Float[Array, "..."]  # prescribed, of the pressure, or if that is free of the gap

    @property
    def free_mean(self) -> bool:
        return self.grid.loading.pressure is None

    @property
    def length(self) -> Scalar:
        """The unit of length [m]."""
        return self.unit / self.penalty

    def scaled_heights(self, factor: Factor = 1.0) -> Field:
        """Returns the dimensionless heights, of zero mean."""
        scale = factor / self.length
        # Scaled first: else a loop would store another field.
        return scale * self.grid.heights - scale * jnp.mean(self.grid.heights)

    def law_at(self, factor) -> AbstractLaw:
        return self.law.in_units(1.0, 1 / factor)

    def solid_at(self, factor: Factor = 1.0) -> Solid:
        return Solid(self.grid.operator, factor * self.penalty, self.free_mean)

    def shift(self, factor) -> Field:
        """The part of x in the splitting by heights and mean."""
        heights, solid = self.scaled_heights(factor), self.solid_at(factor)
        if self.free_mean:
            return solid.resolve(heights - factor * self.mean)
        return self.mean + solid.resolve(heights)

    def splitting(self, state: "SolveState", settings: GridSettings) -> Splitting:
        return Splitting(
            self.solid_at(state.factor), state.shift, self.law_at(state.factor).proximal,
            settings.rtol, relaxation=settings.relaxation,
        )  # fmt: skip

    def at_load(self, pressure):
        """A pressure of the law with the load that is prescribed, if any."""
        if self.free_mean:
            return pressure
        return self.grid.operator.to_mean(pressure, self.mean, self.law.bounds)

    def flattening(self, gap: Field | float = 0.0) -> Field:
        """Returns the pressure of zero mean that closes all gaps, or leaves these."""
        solid = self.solid_at().scaled
        return solid.filtered(solid.inverse, self.scaled_heights() + gap)

    def meet(self, state: "SolveState"):
        """The pressures of solid and law, x and y, and the gap at which the law has y."""
        x = state.shift + self.solid_at(state.factor).resolve(state.z)
        v = 2 * x - state.z
        y = self.law_at(state.factor).proximal(v)
        return x, y, y - v

    def full_contact_or(self, guess, touching):
        """Returns the pressure of full contact if that is the solution, else the guess; FFT pairs.

        It is computed if the share of points `touching` on the grid before was large.
        """

        def look():
            flat = self.mean + self.flattening()
            return jnp.where(jnp.min(flat) > 0, flat, guess), jnp.ones_like(touching)

        return jax.lax.cond(touching > _NEARLY, look, lambda: (guess, jnp.zeros_like(touching)))

    def closed_or(self, z):
        """Returns z of full contact where nearly no gap is prescribed, elsewhere z; and FFT pairs.

        The pressure is the least that closes the contact: where the gap is 0, any higher one would
        do. If the points of this least pressure can have the whole gap, z belongs to the solution.
        """
        operator = self.grid.operator
        closed = jnp.abs(self.mean) <= _CLOSED * jnp.std(self.scaled_heights())

        def close():
            flat = self.flattening()
            lowest = operator.at_each_time(lambda p: p == jnp.min(p), flat).astype(z.dtype)
            share = lowest / operator.mean(lowest)
            gap = self.mean * share
            opened = self.flattening(gap)
            opened = jnp.where(lowest > 0, 0, opened - operator.mean(share * opened))
            solved = operator.at_each_time(lambda p: jnp.full_like(p, jnp.min(p)), opened) >= 0
            flat = flat - operator.mean(share * flat)
            start = jnp.where(solved, opened + gap, flat)
            return jnp.where(closed, start, z), 2 * jnp.ones((), z.dtype)

        return jax.lax.cond(jnp.any(closed), close, lambda: (z, jnp.zeros((), z.dtype)))

    def start_of(self, guess):
        """Returns z of a guessed pressure to begin from; without a guess, of points on springs."""
        heights, law, mean = self.scaled_heights(), self.law, self.mean
        average = self.grid.operator.mean
        if guess is None:
            if self.free_mean or law.attracts:
                return mean - heights

            def halve(_, bracket):
                middle = jnp.mean(bracket, axis=0)
                light = average(law.proximal(middle + heights)) < mean
                low, high = bracket
                return jnp.stack([jnp.where(light, middle, low), jnp.where(light, high, middle)])

            # Pressed down until they carry the load: else surfaces may start far from each other.
            high = mean - jnp.min(heights)
            ends = jnp.stack([jnp.full_like(high, -2 * jnp.max(heights)), high])
            v = jax.lax.fori_loop(0, 40, halve, ends)[1] + heights
            return 2 * law.proximal(v) - v
        gap = self.solid_at().scaled.displace(guess) - heights
        total, weighed = average(jnp.abs(guess)), average(jnp.abs(guess) * gap)
        loaded = (total > 0) & (not self.free_mean)
        gap = gap - jnp.where(loaded, weighed / nonzero(total), average(gap))
        if self.free_mean:
            gap = gap + mean
        # The law's own pressure and gap nearest to the guess; in contact, where the gap is only the
        # error of the guess, the pressure alone.
        y = law.proximal(guess - gap)
        return jnp.where(guess > jnp.abs(gap), guess, 2 * y - (guess - gap))


class SolveState(NamedTuple):
    """State of a solve on one grid."""

    z: Array
    shift: Array  # of the splitting
    factor: Array  # the penalty over the first
    error: Array
    converged: Array
    next: Array  # an epoch, Newton steps, or nothing
    confirming: Array  # whether Newton steps found a contact, which the splitting is to confirm
    coat: Array  # of the next Newton steps
    drafted: Array  # steps of the draft
    steps: Array  # of all epochs
    newton_pairs: Array
    pairs: Array  # FFT pairs so far, of all grids by their size
