"""The waves of a transient motion in the bodies.

A wave of pressure is at rest in the block: its phase exp(-iq·s) takes it there and back. In the
counterface it rests as it is. Waves with two points along an axis x count for both signs of their
number (`both_signs`).
"""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ...fields.grid import Grid, both_signs, mode_numbers, multiplicity, to_field, wavevector
from ...kernels.periodic import quadrant
from ..transient_problem import TransientProblem, on_half


class TransientWaves(eqx.Module):
    """The waves of a grid in the bodies: with both signs of the highest number along x.

    The forces are the pressure on each body, and with a traction that moves the surfaces each of
    its components on each body.

    **Fields:**

    - `grid`: of the block's surface that waves fill: the cell, or one for a window's whole path.
    - `surface`: points of the rough surface, which is its first part. Static.
    - `shares`: of each force, what a table of `Creep` is multiplied with; at positive numbers.
    - `axes`: of each force: the axis of a component of traction, or None. Static.
    - `memories`: w_k M(s_k) of the waves of each force, of the shape `(nodes, *waves)`.
    """

    grid: Grid
    surface: tuple[int, ...] = eqx.field(static=True)
    shares: tuple[Float[Array, "waves *quadrant"], ...]
    axes: tuple[int | None, ...] = eqx.field(static=True)
    memories: tuple[Complex[Array, "nodes *half"], ...]

    def __init__(self, problem: TransientProblem):
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
        return on_half(found, numbers, self.axes[force])

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
