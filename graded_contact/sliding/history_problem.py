"""What decides a contact in a motion that happens once, and its waves in the bodies.

A wave of pressure is at rest in the block: its phase exp(-iq·s) takes it there and back. In the
counter it rests as it is. Waves with two points along an axis x count for both signs of their
number (`both_signs`).
"""

import functools
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..blocks.stack import Stack
from ..contacts.law import AbstractLaw
from ..contacts.operators.operator import AbstractOperator
from ..contacts.operators.window import Window
from ..fields.grid import (
    Grid,
    Waves,
    both_signs,
    mode_numbers,
    multiplicity,
    to_field,
    to_spectrum,
    wavevector,
)
from ..kernels.memory import Creep
from ..kernels.periodic import quadrant
from ..kernels.window import doubled, long_cell, without_images
from .facts import GROUND
from .over_period import components
from .shear import ShearStress


class OneStep(AbstractOperator):
    """The bodies in one step of a history.

    **Fields:**

    - `kernel`: I(Δ)/Δ [m/Pa], see `Creep`.
    - `aged`: J(t) of a pressure that acts since t = 0 [m/Pa]: edges of contact that rest are soft.
    """

    kernel: Waves
    aged: Waves

    def at_edges(self, load):
        return jnp.stack([self.kernel, self.aged])


class OneStepOnWindow(OneStep, Window):
    """The bodies in one step of a history, on a window."""


class HistoryProblem(eqx.Module):
    """A surface in a motion that happens once, on a block.

    **Fields:**

    - `bodies`, `creeps`: the block and the counter, unless it is rigid, and their memories.
    - `heights`, `grid`, `law`, `shear`, `facts`: as in `SteadyProblem`.
    - `block_heights`: of the block's own surface [m], out of the block, or None.
    - `prescribed`: what is given: "pressure" or "mean_gap". Static.
    - `times`: ends of the steps [s], shape `(nt,)`.
    - `displacement`: s of the surface at these times [m], since t = 0, shape `(nt,)` or `(nt, 2)`.
    - `given`: pressure [Pa] or mean gap [m] at these times.
    """

    bodies: tuple[Stack, ...]
    creeps: tuple[Creep, ...]
    heights: Float[Array, "..."]
    grid: Grid
    law: AbstractLaw
    prescribed: str = eqx.field(default="pressure", static=True, kw_only=True)
    times: Float[Array, " nt"]
    displacement: Float[Array, "nt ..."]
    given: Float[Array, " nt"]
    shear: ShearStress | None = None
    block_heights: Float[Array, "..."] | None = None
    facts: frozenset[str] = eqx.field(default=frozenset(), static=True)
    path: tuple[int, ...] | None = eqx.field(default=None, static=True)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the fields at one time."""
        return self.grid.shape

    @property
    def operator(self) -> OneStep:
        """The bodies in the last step."""
        last = (jnp.stack([creep.now[0, -1], creep.aged[-1]]) for creep in self.creeps)
        found = functools.reduce(jnp.add, map(self.responses, self.creeps, last))
        return self.operator_of(*_on_half(found, mode_numbers(self.memory_grid.shape)))

    def operator_of(self, kernel: Waves, aged: Waves) -> OneStep:
        """Returns the operator of kernels on `memory_grid`; a window has it on twice its length."""
        if self.path is None:
            return OneStep(kernel, aged)
        window = self.grid.shape
        places = np.ix_(*((np.arange(2 * n) + n) % (2 * n) - n for n in window))

        def cut(kernel):
            if self.path == window:
                return kernel
            waves = to_spectrum(to_field(kernel + 0j, self.memory_grid.shape)[places])
            return waves if jnp.iscomplexobj(kernel) else waves.real

        return OneStepOnWindow(cut(kernel), cut(aged))

    @property
    def memory_grid(self) -> Grid:
        """The cell of what the bodies remember: around a window's path, without its copies."""
        return self.grid if self.path is None else doubled(self._all_of_path)

    @property
    def waves_between(self) -> Float[Array, "2"]:
        """The lowest and the highest wavenumber at which responses are needed [rad/m]."""
        grid, of_path = self.memory_grid, self.path is not None
        cells = [long_cell(self._all_of_path), grid] if of_path else [grid]
        highest = [jnp.pi * jnp.sqrt(jnp.sum(cell.spacing**-2)) for cell in cells]
        lowest = 2 * jnp.pi / jnp.max(cells[0].size)
        return jnp.stack([lowest, functools.reduce(jnp.maximum, highest)])

    @property
    def _all_of_path(self) -> Grid:
        assert self.path is not None
        return Grid(self.path, self.grid.spacing * np.array(self.path))

    def responses(self, creep: Creep, tables: Array, axis: int | None = None) -> Array:
        """Returns the responses to tables of `Creep` at the positive numbers of `memory_grid`.

        They are those to a pressure, or but for i and a sign to a traction along an axis.
        """
        if self.path is None:
            return _at_positive(creep, self.grid, tables, axis)
        positive = slice(0, self.path[0] + 1)

        def on_window(table):
            kernel = self.around_path(creep, table, axis)[0][positive]
            return kernel if axis is None else kernel.imag

        return jax.lax.map(on_window, tables)

    def around_path(self, creep: Creep, table: Array, axis: int | None = None) -> tuple[Array, ...]:
        """Returns the kernel of a table on `memory_grid` around a window's path, and its errors."""
        path = self._all_of_path
        cells = doubled(path), long_cell(path)
        near, far = (
            _on_half(_at_positive(creep, cell, table, axis), mode_numbers(cell.shape), axis)
            for cell in cells
        )
        if axis is None:
            return without_images(near, far, path, GROUND in self.facts)
        return without_images(1j * near, 1j * far, path, False)

    @property
    def roughness(self) -> tuple[Float[Array, "..."], ...]:
        """The heights of the bodies that are rough: of the surface, and of the block."""
        both = self.heights, self.block_heights
        return tuple(heights for heights in both if heights is not None)

    @property
    def moved(self) -> Float[Array, "nt components"]:
        """The displacement, its components on the second axis [m]."""
        return components(self.displacement)

    @property
    def steps(self) -> tuple[Float[Array, " nt"], Float[Array, "nt components"]]:
        """The lengths of the steps [s], and how far the surface moves in them [m]."""
        before = jnp.zeros((1, self.moved.shape[1]), self.moved.dtype)
        way = jnp.diff(self.moved, axis=0, prepend=before)
        # What a sum or a turn leaves of a rest by rounding is no motion, and has no direction.
        least = 16 * jnp.finfo(way.dtype).eps * jnp.max(jnp.abs(self.moved))
        return steps_of(self.times), jnp.where(jnp.abs(way) > least, way, 0)


def steps_of(times: Float[Array, " nt"]) -> Float[Array, " nt"]:
    """Returns the lengths of the steps that end at these times [s]."""
    return jnp.diff(times, prepend=jnp.zeros((1,), times.dtype))


def _at_positive(creep: Creep, cell: Grid, tables: Array, axis: int | None) -> Array:
    """The responses to tables at a cell's positive numbers; of traction but for i and a sign."""
    q, is_wave = quadrant(cell)
    found = (tables @ creep.shares(q)).reshape(*tables.shape[:-1], *is_wave.shape)
    found = jnp.where(is_wave, found, 0)
    if axis is None:
        return found
    numbers = np.ix_(*map(np.arange, is_wave.shape))
    along = jnp.where(2 * numbers[axis] < cell.shape[axis], wavevector(cell, numbers)[axis], 0)
    return found * along / q.reshape(is_wave.shape)


def _on_half(found: Array, numbers: tuple[np.ndarray, ...], axis: int | None = None) -> Array:
    """Responses at mode numbers from those at positive ones; to traction but for a factor i."""
    if len(numbers) == 2:
        found = jnp.take(found, np.abs(numbers[0]).ravel(), axis=-2)
    return found if axis is None else found * np.sign(numbers[axis])


class HistoryWaves(eqx.Module):
    """The waves of a grid in the bodies: with both signs of the highest number along x.

    The forces are the pressure on each body, and with a traction that moves the surfaces each of
    its components on each body.

    **Fields:**

    - `grid`: of the block's surface that waves fill: the cell, or that of a window's whole path.
    - `surface`: points of the rough surface, which is its first part. Static.
    - `shares`: of each force, what a table of `Creep` is multiplied with; at positive numbers.
    - `axes`: of each force: that of a component of traction, or None. Static.
    - `memories`: w_k M(s_k) of the waves of each force, of the shape `(nodes, *waves)`.
    """

    grid: Grid
    surface: tuple[int, ...] = eqx.field(static=True)
    shares: tuple[Float[Array, "waves *quadrant"], ...]
    axes: tuple[int | None, ...] = eqx.field(static=True)
    memories: tuple[Complex[Array, "nodes *half"], ...]

    def __init__(self, problem: "HistoryProblem"):
        creeps, self.grid = problem.creeps, problem.memory_grid
        self.surface = problem.grid.shape
        along = range(problem.moved.shape[1]) if len(creeps[0].kernels) > 1 else ()
        each = [(creep, axis) for axis in (None, *along) for creep in creeps]
        self.axes = tuple(axis for _, axis in each)
        every = jnp.eye(len(creeps[0].longest), dtype=creeps[0].longest.dtype)
        self.shares = tuple(problem.responses(creep, every, axis) for creep, axis in each)
        self.memories = tuple(
            self._on(force, creep.kernels[int(axis is not None)], self.numbers)
            for force, (creep, axis) in enumerate(each)
        )

    @property
    def numbers(self) -> tuple[np.ndarray, ...]:
        """Mode numbers of the waves."""
        return both_signs(self.grid.shape)

    @property
    def has_two(self) -> bool:
        """Whether waves with two points along x count twice."""
        return self.grid.ndim == 2 and self.grid.shape[0] % 2 == 0

    @property
    def part(self) -> float:
        """The share of the surface in the grid."""
        return math.prod(self.surface) / math.prod(self.grid.shape)

    def kernel(self, force: int, table: Array) -> Array:
        """The response to a force on the half spectrum, by a table of `Creep`."""
        return self._on(force, table, mode_numbers(self.grid.shape))

    def _on(self, force: int, table: Array, numbers: tuple[np.ndarray, ...]) -> Array:
        found = jnp.tensordot(table, self.shares[force].astype(table.dtype), 1)
        return _on_half(found, numbers, self.axes[force])

    def on_grid(self, field: Array) -> Array:
        """Returns a field of the surface on the grid, 0 beside it."""
        lacking = zip(self.grid.shape, self.surface, strict=True)
        return jnp.pad(field, [(0, n - m) for n, m in lacking])

    def on_surface(self, field: Array) -> Array:
        """Returns the part of a field that lies on the surface."""
        return field[tuple(map(slice, self.surface))]

    def turn(self, shift: Array) -> Array:
        """exp(iq·s), broadcastable to the waves."""
        along = zip(wavevector(self.grid, self.numbers), shift, strict=False)
        turned = [jnp.exp(1j * q * s) for q, s in along]
        return math.prod(turned[1:], start=turned[0])

    def split(self, waves: Array) -> Array:
        """Returns half spectra on the waves."""
        if not self.has_two:
            return waves
        return jnp.take(waves, self.numbers[0].ravel() % self.grid.shape[0], axis=-2)

    def joined(self, waves: Array) -> Array:
        """Returns the half spectrum of waves: on the line of both signs their mean."""
        if not self.has_two:
            return waves
        half = self.grid.shape[0] // 2
        line = (waves[half] + waves[half + 1])[None] / 2
        return jnp.concatenate([waves[:half], line, waves[half + 2 :]])

    def field(self, waves: Array) -> Array:
        """Returns the field of waves."""
        return to_field(self.joined(waves), self.grid.shape)

    def mean_product(self, one: Array, other: Array) -> Array:
        """Returns ⟨f g⟩ of the fields of waves."""
        weight = multiplicity(self.grid.shape) / math.prod(self.grid.shape) ** 2
        if self.has_two:
            half = self.grid.shape[0] // 2
            rows = np.ones((len(one), 1))
            rows[half : half + 2] = 0.5
            weight = weight * rows
        product = one.real * other.real + one.imag * other.imag
        return jnp.sum(product * jnp.asarray(weight, product.dtype))
