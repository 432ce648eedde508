"""Residuals molecular dynamics: the gap moves as masses driven by the residual of the equations.

The reference method of M. Scaraggi & D. Comingio (the paper of this package) and of B. N. J.
Persson & M. Scaraggi, J. Chem. Phys. 141 (2014) 124701. With the residual

    L = -u + (ū + w - h),   w = M σ mode by mode,   σ = f(u) point by point,

the gap u of every point follows m ü = L - c u̇ by damped Verlet steps of length 1 until

    ⟨(L/u)²⟩^(1/2) < ε   and   ⟨[(uⁿ - uⁿ⁻¹)/uⁿ⁻¹]²⟩^(1/2) < ε,

one FFT pair a step. The law must be smooth. No rule for mass and damping is given; those here:

- mass: m = (1 + |M|max k)/2 with k = max(-dσ/du, 0) at the point. For laws that attract, which
  would never come to rest, the largest of them for all points. With a
  symmetric kernel all frequencies are then below √2, within the 2 that Verlet's method allows.
- damping: critical for the slowest motion, c = 2 m ω with ω² the Rayleigh quotient of the last step
  (P. Underwood, Dynamic relaxation, in Computational Methods for Transient Analysis, 1983, 245).
- mean gap: if the load is prescribed, the ū for which the residuals change the mean pressure by
  half its error.
- a point closes at most a tenth of its gap in a step, which keeps σ = f(u) within the law.
- start: every point alone on a spring, stiff as the solid to a wave of a third of the cell, or
  twice as stiff as the attraction rises.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from ...core.checks import check_whole, short
from ..law import SmoothLaw
from ..operators.operator import Field, Scalar, root_mean_square
from .abstract_solver import AbstractContactSolver, Inputs, SolverOutput, run_steps

_LEAST_RATIO = 0.9  # of a point's gaps after and before a step
_LOAD_RATE = 0.5  # share of the load's error that the residuals work against


class ResidualDynamics(AbstractContactSolver):
    """Settings of residuals molecular dynamics. All static.

    `rtol` of the solve is the ε of both criteria, and `error` the larger of them: of gaps, not of
    pressures.

    **Fields:**

    - `max_steps`: steps allowed before giving up.
    """

    max_steps: int = eqx.field(default=100_000, static=True)

    def __check_init__(self):
        check_whole("max_steps", self.max_steps, 1)

    def solve(self, operator, heights, law, loading, *, rtol, start):
        """Returns the contact; `start` is a pressure [Pa] to begin from."""
        if not isinstance(law, SmoothLaw):
            raise ValueError(
                f"`law={short(law)}` is refused: residuals molecular dynamics needs a smooth law, "
                "`RepulsiveLJ` or `AdhesiveLJ`. Pass `solver=DouglasRachford()`."
            )
        heights = heights - jnp.mean(heights)
        unit = operator.pressure_unit(heights, *loading)
        length = unit * jnp.max(jnp.abs(operator.compliance))  # so that |M|max = 1
        scaled: Any = law.in_units(unit, length)
        given = zip(loading, (unit, length), strict=True)
        loading = loading._make(None if a is None else a / size for a, size in given)
        problem = Inputs(operator.scaled(unit / length), heights / length, scaled, loading)
        gap = _first_gap(problem, None if start is None else start / unit)
        last = run_steps(_Verlet(problem, scaled, rtol), gap, self.max_steps)
        gap = last.gap
        pressure = scaled.pressure_at(gap)
        residual, _ = _residual(problem, gap, pressure, _stiffness(scaled, gap))
        if loading.pressure is not None:
            pressure = operator.to_mean(pressure, loading.pressure, scaled.bounds)
        return SolverOutput(
            pressure=pressure * unit, gap=gap * length,
            displacement=(residual + gap + problem.heights) * length,
            error=last.error, ended=last.error <= rtol, num_steps=last.num_steps,
            num_fft_pairs=last.num_steps + jnp.asarray(1 if start is None else 2, gap.dtype),
        )  # fmt: skip


class _Motion(NamedTuple):
    gap: Field
    velocity: Field
    residual: Field
    error: Scalar
    num_steps: Array


class _Verlet(NamedTuple):
    """The steps, for `run_steps`."""

    problem: Inputs
    law: SmoothLaw
    rtol: Scalar

    def init(self, start):
        still = jnp.zeros_like(start)
        return _Motion(start, still, still, jnp.asarray(jnp.inf, start.dtype), jnp.asarray(0))

    def step(self, state: _Motion) -> _Motion:
        u, v, law = state.gap, state.velocity, self.law
        pressure, stiffness = law.pressure_at(u), _stiffness(law, u)
        residual, load_error = _residual(self.problem, u, pressure, stiffness)
        mass = _mass(stiffness)
        # Points of different mass would never come to rest under a law that attracts.
        mass = jnp.max(mass) if law.attracts else mass
        work, energy = jnp.sum(v * (state.residual - residual)), jnp.sum(mass * v * v)
        quotient = work / jnp.where(energy > 0, energy, 1)
        damping = 2 * jnp.sqrt(jnp.minimum(jnp.abs(quotient), 1))
        v = ((2 - damping) * v + 2 * residual / mass) / (2 + damping)
        halted = v < (_LEAST_RATIO - 1) * u
        moved = jnp.where(halted, _LEAST_RATIO * u, u + v)
        errors = [root_mean_square(residual / u), root_mean_square((moved - u) / u), load_error]
        v, error = jnp.where(halted, 0, v), jnp.max(jnp.stack(errors))
        return _Motion(moved, v, residual, error, state.num_steps + 1)

    def done(self, state: _Motion):
        return ~(state.error > self.rtol)


def _residual(problem: Inputs, u, pressure, stiffness):
    """L with the mean gap ū, and the relative error of the load."""
    displacement = problem.operator.displace(pressure)
    residual = displacement - problem.heights - u
    if problem.loading.gap is not None:
        return residual + problem.loading.gap, jnp.zeros((), u.dtype)
    assert problem.loading.pressure is not None  # one of the two is prescribed
    excess = jnp.mean(pressure) - problem.loading.pressure
    rate = stiffness / _mass(stiffness)
    mean_gap = (_LOAD_RATE * excess - jnp.mean(rate * residual)) / jnp.mean(rate)
    return residual + mean_gap, jnp.abs(excess) / jnp.mean(jnp.abs(pressure))


def _mass(stiffness):
    return (1 + stiffness) / 2


def _stiffness(law, u):
    return jnp.maximum(-jax.jvp(law.pressure_at, (u,), (jnp.ones_like(u),))[1], 0)


def _first_gap(problem: Inputs, start):
    """The gaps of points alone on springs, under a pressure or none."""
    pressure, mean_gap = problem.loading
    offset = -problem.heights + (0 if mean_gap is None else mean_gap)
    if start is not None:
        offset = offset + problem.operator.displace(start)
    elif pressure is not None:
        start = pressure
    spring = 1 / jnp.maximum(1 / problem.operator.long_wave, 2 * problem.law.steepest_rise)
    rest = (0 if start is None else start) - offset / spring
    return spring * (problem.law.in_units(1.0, spring).proximal(rest) - rest)
