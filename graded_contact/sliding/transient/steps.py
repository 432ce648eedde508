"""A rough surface in a transient motion: start, dwell, braking, steps of the load.

Before t = 0 nothing touches. The times cut the motion into steps, in each of which the pressure
grows linearly. In the frame of the block a wave of the pressure leaves the displacement

    u_n = I(Δ)/Δ p_n + [J(Δ) - I(Δ)/Δ] p_(n-1) + Re Σ_k w_k M(s_k) exp(s_k Δ) y_k

at the end of a step Δ (`kernels/creep.py`): the first term has a real and positive kernel, the
others are known. So each step is one ordinary contact of the heights less what is known, in the
frame of the surface, started from the pressure before:

    y, p, s(t) ──> displacement that is known ──> contact ──> p ──> y        (one scan)

The counterface has a memory like the block's, whose waves rest under the surface: both kernels add
up, and so do both known displacements.
"""

import dataclasses
import functools
import itertools
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.ad_checkpoint import checkpoint_name
from jaxtyping import Array

from ...contacts.area import contact_shares
from ...contacts.operators.operator import Field, work_of_waves
from ...contacts.solution import RESULTS, ContactSolution
from ...contacts.solve import contact_of
from ...contacts.solver.abstract_solver import Inputs, Loading
from ...core.quantities import TRANSIENT
from ...fields.grid import odd_wavevector, to_field, to_spectrum
from ..case import WINDOW, Numerics
from ..errors.grid import unseen_area
from ..formulas import edges_of, indicator_of, touching_at, weighted_slope
from ..number import AbstractSliding
from ..numbers.contact import contact_area, contact_area_pixels
from ..problem import SteadyProblem
from ..shear import Coulomb, shear_over_load, shear_parts
from ..transient_problem import OneStep, TransientProblem
from .step_inputs import StepInputs
from .waves import TransientWaves


class Past(NamedTuple):
    """The past of a force on a body, from step to step.

    The memory of the nodes, real and imaginary parts as of the waves; the waves of the
    force (of a traction times i) at the end of the step and before it, and of the displacement.
    """

    memory: tuple[Array, Array]
    pressed: Array
    before: Array
    moved: Array


class TransientState(NamedTuple):
    """The state of a transient solve, from step to step.

    The past of each force; the pressure, and how fast it rises; the share of contact at each point;
    the traction of slopes, and of shear at the speed of the next step; works; the kept fields;
    the first failure.
    """

    pasts: tuple[Past, ...]
    pressure: Array
    rise: Array
    shares: Array
    traction: Array
    sheared: Array
    works: Array
    kept: Any
    result: RESULTS
    failed: Array


class _OfStep(AbstractSliding):
    """The contact of a step, of which formulas compute numbers."""

    contact: ContactSolution
    problem: SteadyProblem
    bodies: tuple[()] = ()
    kind: ClassVar[str] = TRANSIENT


class Advance(eqx.Module):
    """The fixed part of all steps: `init`, and `step` for `lax.scan`."""

    problem: TransientProblem
    waves: TransientWaves
    how: Numerics

    def init(self, kept: int) -> TransientState:
        """Returns the state before t = 0, with room for the fields of so many steps."""
        problem = self.problem
        dtype, memories = problem.heights.dtype, self.waves.memories
        rest = jnp.zeros_like(memories[0][0])
        nodes = jnp.zeros((len(memories[0]), 2, *rest.shape), dtype)
        field, none = jnp.zeros(problem.shape, dtype), jnp.zeros(problem.moved.shape[1], dtype)
        return TransientState(
            pasts=(Past((nodes, nodes), rest, rest, rest),) * len(memories),
            pressure=field, rise=field, shares=field,
            traction=none, sheared=none, works=jnp.zeros(3, dtype),
            kept=tuple(jnp.zeros((kept, *problem.shape), dtype) for _ in range(4)),
            result=RESULTS.successful, failed=jnp.full((), -1, int),
        )  # fmt: skip

    def step(
        self, state: TransientState, given: StepInputs
    ) -> tuple[TransientState, dict[str, Array]]:
        """Returns the state at the end of a step, and its numbers."""
        problem, waves, bodies = self.problem, self.waves, len(self.problem.creeps)
        turns = [1.0 if i % bodies else waves.turn(given.shift) for i in range(len(state.pasts))]
        parts = [self._known(force, past, given) for force, past in enumerate(state.pasts)]
        kernels, known, memories = zip(*parts, strict=True)
        factors, ahead = self._forces(state, given)
        # What is known before the contact: the memory, and a traction that lags.
        left = waves.field(_sum_of_products(known, turns))
        if ahead:
            lifted = _sum_of_products(ahead, [now for now, _ in kernels[bodies:]])
            left = left + to_field(lifted, waves.grid.shape)
        left, passing = waves.on_surface(left), jnp.zeros_like(problem.heights)
        if problem.block_heights is not None:
            passing = waves.field(waves.split(to_spectrum(problem.block_heights)) * turns[0])
        heights = problem.heights + passing - left
        together = _sum_of_products(factors, kernels)
        operator = problem.operator_of(together[0], together[1].real)
        contact = self._contact(operator, heights, state, given)
        spectrum = to_spectrum(waves.on_grid(contact.pressure))
        driven = [factor * spectrum for factor in factors] + ahead
        pasts = [
            Past(memory, waves.split(force) * jnp.conj(turn), past.pressed,
                 rest + waves.split(now * force) * jnp.conj(turn))
            for force, (now, _), rest, memory, past, turn in zip(
                driven, kernels, known, memories, state.pasts, turns, strict=True
            )
        ]  # fmt: skip
        moved, profile = self._surfaces(passing, pasts, turns)
        displacement = waves.on_surface(moved)
        displacement = displacement - jnp.mean(displacement)
        one = _OfStep(contact, SteadyProblem(
            operator=operator, heights=heights, grid=problem.grid, law=problem.law,
            velocity=jnp.ones((), heights.dtype), prescribed=problem.prescribed,
            facts=problem.facts & {WINDOW},
        ))  # fmt: skip
        traction, numbers = self._numbers(one, profile, moved)
        sheared = self._sheared(one, given.way, given.length)
        numbers |= dict(traction=traction + sheared, shear_traction=sheared)
        works = state.works + self._works(state, given, pasts, traction, sheared)
        names = ("work_done", "load_work_done", "shear_work_done")
        numbers |= dict(zip(names, works, strict=True))
        fields = contact.pressure, contact.gap, displacement, contact.correction
        kept = [
            before.at[given.slot].set(field, mode="drop")
            for before, field in zip(state.kept, fields, strict=True)
        ]
        rise = (contact.pressure - state.pressure) / given.length
        good, ends_well = state.result == RESULTS.successful, contact.result == RESULTS.successful
        return TransientState(
            pasts=tuple(pasts),
            pressure=contact.pressure,
            # What a load that begins adds in the first step does not go on.
            rise=jax.lax.stop_gradient(jnp.where(given.index > 0, rise, 0)),
            shares=contact_shares(indicator_of(one), edges_of(one)) if ahead else state.shares,
            traction=traction,
            sheared=self._sheared(one, given.next_way, given.next_length),
            works=works,
            kept=tuple(kept),
            result=RESULTS.where(good, contact.result, state.result),
            failed=jnp.where(good & ~ends_well, given.index, state.failed),
        ), numbers

    def _contact(self, operator: OneStep, heights: Field, state: TransientState, given: StepInputs):
        """The contact of a step."""
        problem, how, gap = self.problem, self.how, given.given
        if problem.prescribed == "approach":
            gap = gap - jnp.mean(heights)
        loading = (given.given, None) if problem.prescribed == "pressure" else (None, gap)
        inputs = Inputs(operator, heights, problem.law, Loading(*loading))
        # As the pressure went on in the step before: two thirds of the FFT pairs.
        start = jnp.maximum(state.pressure + given.length * state.rise, problem.law.bounds[0])
        start = jax.lax.stop_gradient(start)
        rtol = how.rtol, how.derivative_rtol
        contact = contact_of(inputs, how.solver, *rtol, start, None, False)
        return jax.tree.map(lambda leaf: checkpoint_name(leaf, STEP_CONTACT), contact)

    def _works(
        self, state: TransientState, given: StepInputs, pasts: list[Past], traction, sheared
    ):
        """The works of friction, of the load and of shear in a step [J/m²]."""
        waves = self.waves
        # Of the pressure on each body, also where traction moves it.
        pairs = list(zip(pasts, state.pasts, strict=True))
        bodies = pairs[: len(self.problem.creeps)]
        loads = [(new.pressed + old.pressed) / 2 for new, old in bodies]
        work = sum(
            waves.mean_product(load, new.moved - old.moved) / waves.part
            for load, (new, old) in zip(itertools.cycle(loads), pairs, strict=False)
        )
        by_slopes = jnp.sum((traction + state.traction) / 2 * given.way)
        by_shear = jnp.sum((sheared + state.sheared) / 2 * given.way)
        return jnp.stack([by_slopes + by_shear, work - by_slopes, by_shear])

    def _surfaces(self, passing: Field, pasts: list[Past], turns: list[Any]) -> tuple[Array, Array]:
        """The displacement of the block, and the interface, on the cell of the memory [m]."""
        problem, waves, bodies = self.problem, self.waves, len(self.problem.creeps)
        moved = [past.moved for past in pasts]
        block = waves.field(_sum_of_products(moved[::bodies], turns[::bodies]))
        if problem.block_heights is None:
            return block, block
        other = problem.heights
        if bodies > 1:
            other = other - waves.field(functools.reduce(jnp.add, moved[1::2]))
        return block, touching_at(problem.roughness, problem.grid, block - passing, other)

    def _forces(self, state: TransientState, given: StepInputs) -> tuple[list[Any], list[Array]]:
        """Each force over the pressure, and half spectra of those that do not follow its step.

        First pressures, then tractions, opposite on a counterface. Coulomb's traction is in
        proportion to the pressure. Other laws lag: their traction belongs to the contact before, at
        the speed of the step.
        """
        bodies, count = len(self.problem.creeps), len(state.pasts)
        factors: list[Any] = [1.0] * bodies
        if count == bodies:
            return factors, []
        law, (unit, far) = self.problem.shear, _direction(given.way)
        assert law is not None
        # The responses to a traction lack the factor i.
        signs = [1j * way * sign for way in unit for sign in (1, -1)[:bodies]]
        if isinstance(law.law, Coulomb):
            return factors + [law.law.coefficient * sign for sign in signs], []
        stress = dataclasses.replace(law, speed=far / given.length)
        least, added = shear_parts(state.pressure, stress)
        spectrum = to_spectrum(self.waves.on_grid(least * state.shares + added))
        return factors, [sign * spectrum for sign in signs]

    def _known(self, force: int, past: Past, given: StepInputs):
        """The kernels of a force in the step, the waves that its past leaves, and its memory."""
        parts = lambda wave: jnp.stack([wave.real, wave.imag])  # noqa: E731
        old, new, waves = parts(past.before), parts(past.pressed), self.waves

        def add(total, node):
            real, imag, decay, before, last, weight = node
            real = real + before.real * old + last.real * new
            imag = imag + before.imag * old + last.imag * new
            real, imag = (
                decay.real * real - decay.imag * imag,
                decay.real * imag + decay.imag * real,
            )
            return total + weight.real * real - weight.imag * imag, (real, imag)

        factors = given.decay, given.from_old, given.from_new, waves.memories[force]
        total, nodes = jax.lax.scan(add, jnp.zeros_like(old), (*past.memory, *factors))
        now, whole, aged = waves.kernel(force, given.tables[force])
        known = jax.lax.complex(*total) + waves.split(whole - now) * past.pressed
        return jnp.stack([now, aged]), known, nodes

    def _sheared(self, one: _OfStep, way: Array, length: Array) -> Array:
        """The traction of shear on a contact at the speed of a step [Pa]."""
        if self.problem.shear is None:
            return jnp.zeros_like(way)
        load, (unit, far) = jnp.mean(one.pressure), _direction(way)
        stress = dataclasses.replace(self.problem.shear, speed=far / length)
        size = shear_over_load(one.pressure, indicator_of(one), edges_of(one), stress)
        return unit * jnp.where(load > 0, size * load, 0)

    def _numbers(self, one: _OfStep, profile: Array, moved: Array):
        """The traction by slopes [Pa], and the numbers of the contact of a step."""
        waves, contact = self.waves, one.contact
        pressure, on_grid = contact.pressure, waves.on_grid(contact.pressure)
        axes = odd_wavevector(waves.grid)[: self.problem.moved.shape[1]]
        traction = jnp.stack([jnp.sum(work_of_waves(on_grid, profile, q)) for q in axes])
        traction = traction / waves.part
        of_contact = {f"step_{name}": getattr(contact, name) for name in OF_STEPS}
        return traction, of_contact | dict(
            load=jnp.mean(pressure),
            contact_area=contact_area(one), contact_area_pixels=contact_area_pixels(one),
            mean_gap=contact.mean_gap, slope=weighted_slope(on_grid, moved, waves.grid),
            spread=jnp.sqrt(jnp.mean(pressure**2)), unseen_area=unseen_area(one),
        )  # fmt: skip


def _sum_of_products(ones: Sequence[Any], others: Sequence[Any]) -> Array:
    return functools.reduce(jnp.add, map(jnp.multiply, ones, others))


def _direction(way: Array) -> tuple[Array, Array]:
    """The unit vector of a step and its length; at rest 0 and 1."""
    far = jnp.sqrt(jnp.sum(way**2))
    moves = far > 0
    far = jnp.where(moves, far, 1)
    return jnp.where(moves, way / far, 0), far


STEP_CONTACT = "contact"  # what a derivative keeps of each step
OF_STEPS = "error", "gap_error", "num_steps", "num_fft_pairs"
