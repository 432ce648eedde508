"""The fast solver: the splitting of `splitting.py` on nested grids.

Coarse grids find a start for finer ones. A solve that takes long begins again with the penalty that
suits the area found in contact.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from .._checks import check_whole
from ..grid import interpolate, resample_spectrum, to_field, to_spectrum
from .law import AbstractLaw
from .linear import LinearSplitting
from .solver import (
    AbstractContactSolver,
    Iterated,
    LinearSolver,
    Prescribed,
    least_compliance,
    participation,
    penalty_for,
    pressure_unit,
    root_mean_square,
    slope,
    third_mode,
    to_mean,
    watch_of,
)
from .splitting import (
    CYCLE,
    Solid,
    Splitting,
    check_relaxation,
    draft,
    gap_error,
    iterate,
    rounding_error,
    solid_of,
)

# All within 2 % of the fewest FFT pairs of `bench_contact.py viscoelastic`.
_COARSE_ERROR = 0.02  # of the nested coarse grids, which only give a start
_COLD_PARTICIPATION = 0.05  # ⟨σ⟩²/⟨σ²⟩ expected before anything is known
_HIGHEST = 1e3  # pressure of a start, in what it takes to flatten the stiffest wave
_EPOCH = 50  # steps before the penalty is chosen anew; then as many as were done


class DouglasRachford(AbstractContactSolver):
    """Settings of the splitting. All static, but for `linear`.

    **Fields:**

    - `max_steps`: steps allowed on each grid before giving up, and in the draft of a large one;
      they are done in twos.
    - `relaxation`: α [1], between 0 and 1.
    - `memory`: earlier iterates that the acceleration combines; each stores two fields, on a large
      grid three quarters of one.
    - `coarsest`: nesting starts from the first grid with fewer than twice this many points a side.
    - `linear`: finds derivatives, see `AbstractContactSolver`.
    - `keep`: called with the pressure [Pa] on the finest grid now and then while a solve goes on.
    """

    max_steps: int = eqx.field(default=4000, static=True)
    relaxation: float = eqx.field(default=0.95, static=True)
    memory: int = eqx.field(default=5, static=True)
    coarsest: int = eqx.field(default=64, static=True)
    linear: LinearSolver = LinearSplitting()
    keep: Callable[[Array], None] | None = None
    finds_unstable: ClassVar[bool] = True

    def __check_init__(self):
        check_whole("max_steps", self.max_steps, 1)
        check_whole("memory", self.memory, 1)
        check_whole("coarsest", self.coarsest, 4)
        check_relaxation(self.relaxation)

    def solve(
        self,
        kernel: Inexact[Array, "*half"],
        heights: Float[Array, "*shape"],
        law: AbstractLaw,
        prescribed: Prescribed,
        *,
        rtol: Float[Array, ""],
        start: Float[Array, "*shape"] | None,
    ) -> Iterated:
        """Returns the contact; `start` is a pressure [Pa] to begin from."""
        shape = heights.shape
        # A coarse grid would pull surfaces together that on the fine one stay apart.
        nested = start is None and not law.attracts
        shapes = _nested_shapes(shape, self.coarsest) if nested else [shape]
        heights = heights - jnp.mean(heights)
        spectrum = to_spectrum(heights)
        found, pressure = None, start
        pairs = jnp.asarray(0.5, heights.dtype)
        for level in shapes:
            share = float(np.prod(level) / np.prod(shape))
            finest = level == shape
            waves = spectrum if finest else resample_spectrum(spectrum, shape, level) * share
            near = resample_spectrum(kernel, shape, level)
            rough = heights if finest else to_field(waves, level)
            unit = pressure_unit(near, rough, prescribed)
            guess = None
            if pressure is not None:
                guess = _as_guess(near, law, prescribed, unit, interpolate(pressure, level))
            found = self._solve_on(
                _on_grid(near, rough, waves, law, prescribed, unit, guess),
                guess,
                rtol if finest else jnp.asarray(_COARSE_ERROR, rtol.dtype),
                self.keep if finest else None,
            )
            pressure = found.pressure
            pairs = pairs + share * (found.num_fft_pairs + (0 if finest else 0.5))
        assert found is not None  # there is at least one grid
        return dataclasses.replace(found, num_fft_pairs=pairs)

    def _solve_on(self, problem: "_OnGrid", guess, rtol, keep) -> Iterated:
        """Solves on one grid, from a pressure or from none."""
        how: dict[str, Any] = dict(rtol=rtol, relaxation=self.relaxation, memory=self.memory)
        how["watch"] = watch_of(keep, problem.unit)
        z = _start(problem, guess)
        z, drafted = draft(problem.splitting(1.0), z, max_steps=self.max_steps, **how)
        z, factor, steps, epochs, error, going_on = self._epochs(problem, z, how)
        found = _found(problem, z, factor, error, ~going_on, rtol)
        # A guess takes one pair, and a draft half a one beside its steps. An epoch takes one half,
        # beginning again 1.5, what is found 3.5.
        begun = (0.0 if guess is None else 1.0) + jnp.where(drafted > 0, drafted + 0.5, 0.0)
        pairs = (begun + steps + 2.0 * epochs + 2).astype(z.dtype)
        return dataclasses.replace(found, num_steps=drafted + steps, num_fft_pairs=pairs)

    def _epochs(self, problem: "_OnGrid", z, how):
        """Iterates from z, again and again with another penalty if it takes long.

        Returns z, the penalty over the first, steps, epochs, the error and if it was `going_on`.
        """

        def begin_again(z, factor):
            """The same pressures and gaps with the penalty for the area in contact by now."""
            solid, near = problem.at(factor)
            _, y, gap = _meet(solid, near, z)
            change = penalty_for(factor * problem.kernel, participation(y), near)
            return y + change * gap, factor * change

        def epoch(state):
            z, factor, steps, epochs, *_ = state
            z, factor = jax.lax.cond(epochs > 0, begin_again, lambda *same: same, z, factor)
            limit = jnp.clip(steps, _EPOCH, self.max_steps - steps)
            last = iterate(problem.splitting(factor), z, max_steps=limit, **how)
            steps = steps + last.cycles * CYCLE
            return last.z, factor, steps, epochs + 1, last.error, last.going_on

        def running(state):
            _, _, steps, *_, going_on = state
            return going_on & (steps < self.max_steps)

        one, none = jnp.ones((), z.dtype), jnp.asarray(0)
        state = (z, one, none, none, one * jnp.inf, jnp.asarray(True))
        return jax.lax.while_loop(running, epoch, state)


class _OnGrid(eqx.Module):
    """The contact on one grid, dimensionless: see `splitting.py`."""

    kernel: Inexact[Array, "*half"]
    heights: Float[Array, "*shape"]
    waves: Inexact[Array, "*half"]  # their spectrum [m]
    law: AbstractLaw
    target: Float[Array, ""]  # mean of the pressure, or if that is free of the gap
    free_mean: bool = eqx.field(static=True)
    unit: Float[Array, ""]  # of pressure [Pa]
    length: Float[Array, ""]  # [m]

    def at(self, factor) -> tuple[Solid, AbstractLaw]:
        """The solid and the law with a penalty this many times as large."""
        shift = -factor * self.target if self.free_mean else self.target
        shift = jnp.broadcast_to(shift, self.heights.shape)
        waves = self.waves * (factor / self.length)
        solid = solid_of(factor * self.kernel, waves, shift, self.free_mean)
        return solid, self.law.in_units(1.0, 1 / factor)

    def splitting(self, factor) -> Splitting:
        """What is iterated with a penalty this many times as large."""
        solid, law = self.at(factor)
        return Splitting(solid, law.proximal)


def _on_grid(kernel, heights, waves, law, prescribed: Prescribed, unit, guess) -> _OnGrid:
    """The contact in units of a pressure, with a penalty that suits the guess of it."""
    cold = jnp.asarray(_COLD_PARTICIPATION, heights.dtype)
    penalty = penalty_for(kernel, cold if guess is None else participation(guess), law)
    length = unit / penalty
    load, mean_gap = prescribed
    return _OnGrid(
        kernel=penalty * kernel,
        heights=heights / length,
        waves=waves,
        law=law.in_units(unit, length),
        target=mean_gap / length if load is None else load / unit,
        free_mean=load is None,
        unit=unit,
        length=length,
    )


def _as_guess(kernel, law, prescribed: Prescribed, unit, pressure):
    """A pressure to begin from, in its unit, made possible for the law and the load."""
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


def _start(problem: _OnGrid, guess):
    """z to begin from: that of a guessed pressure, or without one of points on springs."""
    heights, law, target = problem.heights, problem.law, problem.target
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
    gap = to_field(problem.kernel * to_spectrum(guess), heights.shape) - heights
    gap = gap - jnp.mean(gap)
    if problem.free_mean:
        gap = gap + target
    else:
        weight = jnp.where(jnp.any(guess != 0), jnp.abs(guess), 1)
        gap = gap - jnp.sum(weight * gap) / jnp.sum(weight)
    # The law's own pressure and gap nearest to the guess; in contact, where the gap is but the
    # guess's error, the pressure alone.
    y = law.proximal(guess - gap)
    return jnp.where(guess > jnp.abs(gap), guess, 2 * y - (guess - gap))


def _meet(solid: Callable, law: AbstractLaw, z):
    """The pressures of solid and law, x and y, and the gap at which the law has the latter."""
    x = solid(z)
    v = 2 * x - z
    y = law.proximal(v)
    return x, y, y - v


def _found(problem: _OnGrid, z, factor, error, ended, rtol) -> Iterated:
    """The contact of z at this penalty over the first, but for what it cost."""
    solid, law = problem.at(factor)
    x, y, gap = _meet(solid, law, z)
    # Where rounding ended the solve, the residual is noise, most of it out of contact.
    error = jax.lax.cond(
        ended & (error > rtol),
        lambda: jnp.minimum(error, rounding_error(solid, law, x, y, gap)),
        lambda: error,
    )
    pressure = y if problem.free_mean else to_mean(y, problem.target, problem.law.bounds)
    # The displacement has the stiff waves of the law's pressure and the soft ones of the
    # solid's: each would magnify what is left of the error in the others.
    stiff = to_field(solid.filter * to_spectrum(pressure - x), x.shape)
    solid_gap = (z - x + (pressure - x) - stiff) / factor
    held = slope(law, y - gap)
    offset = root_mean_square(stiff) + root_mean_square(pressure - y)
    gaps = gap_error(factor * problem.kernel, held, offset, (1 - held) * (y - x), gap)
    unit, length = problem.unit, problem.length
    return Iterated(
        pressure=pressure * unit,
        gap=gap * (length / factor),
        mismatch=(x - y) * unit,
        displacement=(solid_gap + problem.heights) * length,
        error=error,
        gap_error=gaps * (length / factor),
        ended=ended,
        num_steps=jnp.asarray(0),
        num_fft_pairs=jnp.zeros((), z.dtype),
    )


def _nested_shapes(shape: tuple[int, ...], coarsest: int) -> list[tuple[int, ...]]:
    shapes = [shape]
    while min(shapes[0]) >= 2 * coarsest:
        shapes.insert(0, tuple(-(-n // 2) for n in shapes[0]))
    return shapes
