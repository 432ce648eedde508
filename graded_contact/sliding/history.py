"""A rough rigid surface in a motion that happens once: start, dwell, braking, steps of the load.

Before t = 0 nothing touches. The times cut the history into steps, in each of which the pressure
grows linearly. In the frame of the block a wave of the pressure leaves the displacement

    u_n = I(Δ)/Δ p_n + [J(Δ) - I(Δ)/Δ] p_(n-1) + Re Σ_k w_k M(s_k) exp(s_k Δ) y_k

at the end of a step Δ (`blocks/creep.py`): the first term has a real and positive kernel, the
others are known. So each step is one ordinary contact of the heights less what is known, in the
frame of the surface, started from the pressure before:

    y, p, s(t) ──> displacement that is known ──> contact ──> p ──> y        (one scan)

A wave of pressure is at rest in the block: its phase exp(-iq·s) takes it there and back. Waves with
two points along an axis x count for both signs (`both_signs`).

A derivative is that of the contact of each step. It keeps the contacts, and computes the memory
once more from every √n-th step on.
"""

import dataclasses
import functools
import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.ad_checkpoint import checkpoint_name
from jaxtyping import Array, Complex, Float

from ..blocks.creep import Creep
from ..contacts.abstract_solver import Inputs, Loading
from ..contacts.law import AbstractLaw
from ..contacts.operator import Field, Steady, work_of_waves
from ..contacts.solution import RESULTS, ContactSolution
from ..contacts.solve import contact_of
from ..core.compilation import jit
from ..fields.grid import (
    Grid,
    Waves,
    both_signs,
    mode_numbers,
    multiplicity,
    odd_wavevector,
    to_field,
    to_spectrum,
    zero_mode,
)
from .area import contact_area, contact_area_pixels
from .formulas import edges_of, indicator_of, slopes, touching
from .grid_errors import openings
from .motion import components
from .numerics import Numerics
from .problem import Range, SteadyProblem
from .result import Sliding
from .shear import ShearStress, shear_over_load


class HistoryProblem(eqx.Module):
    """A surface in a motion that happens once, on a block.

    **Fields:**

    - `creep`: the memory of the block.
    - `heights`, `grid`, `law`, `measured_range`, `shear`, `facts`: as in `SteadyProblem`.
    - `prescribed`: what is given: "pressure" or "mean_gap". Static.
    - `times`: ends of the steps [s], shape `(nt,)`.
    - `displacement`: s of the surface at these times [m], since t = 0, shape `(nt,)` or `(nt, 2)`.
    - `given`: pressure [Pa] or mean gap [m] at these times.
    """

    creep: Creep
    heights: Float[Array, "..."]
    grid: Grid
    law: AbstractLaw
    measured_range: Range | None = eqx.field(default=None, kw_only=True)
    prescribed: str = eqx.field(default="pressure", static=True, kw_only=True)
    times: Float[Array, " nt"]
    displacement: Float[Array, "nt ..."]
    given: Float[Array, " nt"]
    shear: ShearStress | None = None
    coupling: None = None
    facts: frozenset[str] = eqx.field(default=frozenset(), static=True)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the fields at one time."""
        return self.grid.shape

    @property
    def operator(self) -> Steady:
        """The block in the last step."""
        return Steady(_Waves(self).kernel(self.creep.now[-1]))

    @property
    def moved(self) -> Float[Array, "nt components"]:
        """The displacement, its components on the second axis [m]."""
        return components(self.displacement)

    @property
    def steps(self) -> tuple[Float[Array, " nt"], Float[Array, "nt components"]]:
        """The lengths of the steps [s], and how far the surface moves in them [m]."""
        before = jnp.zeros((1, self.moved.shape[1]), self.moved.dtype)
        return steps_of(self.times), jnp.diff(self.moved, axis=0, prepend=before)


def steps_of(times: Float[Array, " nt"]) -> Float[Array, " nt"]:
    """Returns the lengths of the steps that end at these times [s]."""
    return jnp.diff(times, prepend=jnp.zeros((1,), times.dtype))


class HistoryState(NamedTuple):
    """What a history carries from step to step.

    The memory of the nodes, real and imaginary parts for those of the waves; waves of pressure and
    displacement in the block; the pressure; traction; works; the kept fields; the first failure.
    """

    memory: tuple[Array, Array]
    old: Array
    before: Array
    moved: Array
    pressure: Array
    traction: Array
    works: Array
    kept: Any
    result: RESULTS
    failed: Array


class _Step(NamedTuple):
    """What a step is given."""

    length: Array
    shift: Array  # s [m], along each component
    way: Array  # how far the surface moves [m]
    given: Array
    now: Array  # tables of `Creep`
    whole: Array
    decay: Array  # exp(s_k Δ)
    from_old: Array  # of the step before
    from_new: Array
    slot: Array  # where its fields are kept
    index: Array
    counts: Array  # False for a step that only fills up the last segment


class _Waves:
    """The waves of a grid in the block: with both signs of the highest number along x."""

    def __init__(self, problem: HistoryProblem):
        self.problem, self.grid = problem, problem.grid
        self.shape, ndim = self.grid.shape, self.grid.ndim
        lowest = 2 * np.pi / self.grid.size
        counts = [np.arange(n // 2 + 1) for n in self.shape]
        mesh = jnp.meshgrid(*map(jnp.multiply, lowest, counts), indexing="ij")
        squared = jnp.sum(jnp.stack(mesh) ** 2, axis=0)
        self.q = jnp.sqrt(jnp.where(squared > 0, squared, jnp.min(lowest) ** 2))
        self.numbers = both_signs(self.shape)
        self.has_two = ndim == 2 and self.shape[0] % 2 == 0
        self.components = [2 * np.pi * k / length for k, length in zip(self.numbers, self.grid.size, strict=True)]

    def _on(self, quadrant: Array, numbers) -> Array:
        """What depends on |q|, from its quadrant on the rows of mode numbers; 0 at q = 0."""
        first = (0,) * self.grid.ndim
        quadrant = quadrant.at[(..., *first)].set(0)
        if self.grid.ndim == 1:
            return quadrant
        return jnp.take(quadrant, np.abs(numbers[0]).ravel(), axis=-2)

    def kernel(self, table: Array) -> Array:
        """A table of `Creep` on the half spectrum."""
        return self._on(self.problem.creep.at(table, self.q), mode_numbers(self.shape))

    def memory(self) -> Array:
        """w_k M(s_k) of the waves in the block."""
        creep = self.problem.creep
        return self._on(creep.at(creep.kernels, self.q), self.numbers)

    def turn(self, shift: Array) -> Array:
        """exp(iq·s) of the waves in the block."""
        along = zip(self.components, shift, strict=False)
        return jnp.exp(1j * sum(q * s for q, s in along))

    def split(self, waves: Array) -> Array:
        """Half spectra on the waves in the block."""
        if not self.has_two:
            return waves
        return jnp.take(waves, self.numbers[0].ravel() % self.shape[0], axis=-2)

    def joined(self, waves: Array) -> Array:
        """The half spectrum of waves in the block."""
        if not self.has_two:
            return waves
        half = self.shape[0] // 2
        line = (waves[half] + waves[half + 1])[None] / 2
        return jnp.concatenate([waves[:half], line, waves[half + 2 :]])

    def mean_product(self, one: Array, other: Array) -> Array:
        """⟨f g⟩ of the fields of waves in the block."""
        weight = np.broadcast_to(multiplicity(self.shape), one.shape[-1:]).astype(float)
        if self.has_two:
            rows = np.ones((one.shape[-2], 1))
            rows[self.shape[0] // 2 : self.shape[0] // 2 + 2] = 0.5
            weight = weight * rows
        total = (one.real * other.real + one.imag * other.imag) * jnp.asarray(weight, one.real.dtype)
        return jnp.sum(total) / math.prod(self.shape) ** 2


class Advance(eqx.Module):
    """What does not change from step to step: `init`, and `step` for `lax.scan`."""

    problem: HistoryProblem
    how: Numerics

    def init(self, kept: int) -> HistoryState:
        """Returns the state before t = 0, with room for the fields of so many steps."""
        problem = self.problem
        waves, dtype = _Waves(problem), problem.heights.dtype
        rest = jnp.zeros(waves.split(jnp.zeros(_half(problem.shape), dtype)).shape, _complex(dtype))
        nodes = jnp.zeros((len(problem.creep.nodes), 2, *rest.shape), dtype)
        field = jnp.zeros(problem.shape, dtype)
        return HistoryState(
            memory=(nodes, nodes), old=rest, before=rest, moved=rest, pressure=field,
            traction=jnp.zeros(problem.moved.shape[1], dtype), works=jnp.zeros(3, dtype),
            kept=tuple(jnp.zeros((kept, *problem.shape), dtype) for _ in range(4)),
            result=RESULTS.successful, failed=jnp.asarray(-1),
        )  # fmt: skip

    def step(self, state: HistoryState, given: _Step) -> tuple[HistoryState, dict[str, Array]]:
        """Returns the state at the end of a step, and its numbers."""
        problem, waves = self.problem, _Waves(self.problem)
        turn = waves.turn(given.shift)
        now, known, memory = self._known(state, given, waves)
        known_field = to_field(waves.joined(known * turn), problem.shape)
        heights = problem.heights - known_field
        loading = (given.given, None) if problem.prescribed == "pressure" else (None, given.given)
        inputs = Inputs(Steady(now), heights, problem.law, Loading(*loading))
        contact = contact_of(
            inputs, self.how.solver, self.how.adjoint, self.how.rtol,
            jax.lax.stop_gradient(state.pressure), None, False,
        )  # fmt: skip
        contact = jax.tree.map(lambda leaf: checkpoint_name(leaf, _CONTACT), contact)
        spectrum = to_spectrum(contact.pressure)
        pressed = waves.split(spectrum) * jnp.conj(turn)
        moved = known + waves.split(now * spectrum) * jnp.conj(turn)
        displacement = contact.displacement + known_field
        one = Sliding(contact, SteadyProblem(
            operator=Steady(now), heights=heights, grid=problem.grid, law=problem.law,
            velocity=jnp.ones((), heights.dtype), prescribed=problem.prescribed,
        ))  # fmt: skip
        traction, numbers = self._numbers(one, displacement, given)
        work = waves.mean_product(pressed + state.old, moved - state.moved) / 2
        by_slopes = jnp.sum((traction + state.traction) / 2 * given.way)
        by_shear = jnp.sum(numbers["shear_traction"] * given.way)
        works = state.works + jnp.stack([by_slopes + by_shear, work - by_slopes, by_shear])
        names = ("work_done", "load_work_done", "shear_work_done")
        numbers |= dict(zip(names, works, strict=True))
        fields = contact.pressure, contact.gap, displacement, contact.correction
        good = state.result == RESULTS.successful
        return HistoryState(
            memory=memory, old=pressed, before=state.old, moved=moved, pressure=contact.pressure,
            traction=traction, works=works,
            kept=tuple(k.at[given.slot].set(f, mode="drop") for k, f in zip(state.kept, fields, strict=True)),
            result=RESULTS.where(good, contact.result, state.result),
            failed=jnp.where(good & (contact.result != RESULTS.successful), given.index, state.failed),
        ), numbers  # fmt: skip

    def _known(self, state: HistoryState, given: _Step, waves: _Waves):
        """The kernel of the step, the waves that earlier pressures leave, and the new memory."""
        parts = lambda wave: jnp.stack([wave.real, wave.imag])  # noqa: E731
        old, new, weights = parts(state.before), parts(state.old), waves.memory()

        def add(total, node):
            real, imag, decay, before, last, weight = node
            real = real + before.real * old + last.real * new
            imag = imag + before.imag * old + last.imag * new
            real, imag = decay.real * real - decay.imag * imag, decay.real * imag + decay.imag * real
            return total + weight.real * real - weight.imag * imag, (real, imag)

        factors = given.decay, given.from_old, given.from_new, weights
        total, memory = jax.lax.scan(add, jnp.zeros_like(old), (*state.memory, *factors))
        tables = jnp.stack([given.now, given.whole])
        now, whole = waves.kernel(tables)
        known = jax.lax.complex(*total) + waves.split(whole - now) * state.old
        return now, known, memory

    def _numbers(self, one: Sliding, displacement: Field, given: _Step):
        """The traction by slopes [Pa], and the numbers of the contact of a step."""
        problem, contact, pressure = self.problem, one.contact, one.contact.pressure
        axes = odd_wavevector(problem.grid)[: len(given.way)]
        traction = jnp.stack([jnp.sum(work_of_waves(pressure, displacement, q)) for q in axes])
        load, sheared = jnp.mean(pressure), jnp.zeros_like(traction)
        if problem.shear is not None:
            far = jnp.sqrt(jnp.sum(given.way**2))
            moves = far > 0
            unit = jnp.where(moves, given.way / jnp.where(moves, far, 1), 0)
            speed = jnp.where(moves, far, 1) / given.length
            stress = dataclasses.replace(problem.shear, speed=speed)
            size = shear_over_load(pressure, indicator_of(one), edges_of(one), stress)
            sheared = unit * jnp.where(load > 0, size * load, 0)
        return traction, dict(
            traction=traction + sheared, shear_traction=sheared, load=load,
            contact_area=contact_area(one), contact_area_pixels=contact_area_pixels(one),
            mean_gap=contact.mean_gap, slope=slopes(one, pressure, displacement),
            openings=openings(pressure, touching(one)), error=contact.error,
            gap_error=contact.gap_error, num_fft_pairs=contact.num_fft_pairs,
        )  # fmt: skip


_CONTACT = "contact"  # what a derivative keeps of each step


def _half(shape: tuple[int, ...]) -> tuple[int, ...]:
    return (*shape[:-1], shape[-1] // 2 + 1)


def _complex(dtype):
    return jnp.result_type(dtype, 1j)


@jit
def run_history(
    problem: HistoryProblem, how: Numerics, kept: tuple[int, ...]
) -> tuple[HistoryState, dict[str, Array]]:
    """Returns the state after the last step, and the numbers of all steps."""
    advance, count = Advance(problem, how), len(problem.times)
    steps = _steps(problem, kept)
    # Segments of about √n steps, each computed once more in a derivative in reverse.
    length = math.ceil(math.sqrt(count))
    segments = -(-count // length)
    rows = jnp.minimum(jnp.arange(segments * length), count - 1)
    filled = jax.tree.map(lambda leaf: leaf[rows].reshape(segments, length, *leaf.shape[1:]), steps)
    counts = (jnp.arange(segments * length) < count).reshape(segments, length)
    filled = filled._replace(counts=counts)

    def one(state, given):
        like = jax.eval_shape(advance.step, state, given)[1]
        stay = lambda: (state, jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), like))  # noqa: E731
        return jax.lax.cond(given.counts, lambda: advance.step(state, given), stay)

    policy = jax.checkpoint_policies.save_only_these_names(_CONTACT)
    segment = jax.checkpoint(lambda state, given: jax.lax.scan(one, state, given), policy=policy)
    state, numbers = jax.lax.scan(segment, advance.init(len(kept)), filled)
    numbers = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:])[:count], numbers)
    return state, numbers


def _steps(problem: HistoryProblem, kept: tuple[int, ...]) -> _Step:
    """What each step is given."""
    creep, count = problem.creep, len(problem.times)
    lengths, way = problem.steps
    z = creep.nodes * lengths[:, None]
    twice = _rest_of_exponential(z)
    once = 1 + z * twice  # (exp(z) - 1)/z
    before = lambda row: jnp.concatenate([jnp.zeros_like(row[:1]), row[:-1]])  # noqa: E731
    slots = np.full(count, len(kept))
    slots[list(kept)] = np.arange(len(kept))
    return _Step(
        length=lengths, shift=problem.moved, way=way, given=problem.given, now=creep.now,
        whole=creep.whole, decay=jnp.exp(z), from_old=before(lengths[:, None] * (once - twice)),
        from_new=before(lengths[:, None] * twice), slot=jnp.asarray(slots),
        index=jnp.arange(count), counts=jnp.ones(count, bool),
    )  # fmt: skip


def _rest_of_exponential(z: Complex[Array, "..."]) -> Complex[Array, "..."]:
    """(exp(z) - 1 - z)/z², of small z by its series."""
    small = jnp.abs(z) < 1
    near, far = jnp.where(small, z, 0), jnp.where(small, 1, z)
    series = functools.reduce(lambda rest, k: rest * near / (k + 2) + 1, range(18, 0, -1), 1 + 0 * near) / 2
    return jnp.where(small, series, (jnp.exp(far) - 1 - far) / far**2)
