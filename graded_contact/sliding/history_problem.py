"""What decides a contact in a motion that happens once, and its waves in the block.

A wave of pressure is at rest in the block: its phase exp(-iq·s) takes it there and back. Waves with
two points along an axis x count for both signs of their number (`both_signs`).
"""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.creep import Creep
from ..contacts.law import AbstractLaw
from ..contacts.operator import AbstractOperator
from ..fields.grid import Grid, Waves, both_signs, mode_numbers, multiplicity
from .motion import components
from .problem import Range
from .shear import ShearStress


class OneStep(AbstractOperator):
    """The block in one step of a history.

    **Fields:**

    - `kernel`: I(Δ)/Δ [m/Pa], see `Creep`.
    - `aged`: J(t) of a pressure that acts since t = 0 [m/Pa]: edges of contact that rest are soft.
    """

    kernel: Waves
    aged: Waves

    def at_edges(self, load):
        return jnp.stack([self.kernel, self.aged])


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
    def operator(self) -> OneStep:
        """The block in the last step."""
        return OneStep(
            *BlockWaves(self).kernel(jnp.stack([self.creep.now[-1], self.creep.aged[-1]]))
        )

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


class BlockWaves:
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
        self.components = [
            2 * np.pi * k / length for k, length in zip(self.numbers, self.grid.size, strict=True)
        ]

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
        total = (one.real * other.real + one.imag * other.imag) * jnp.asarray(
            weight, one.real.dtype
        )
        return jnp.sum(total) / math.prod(self.shape) ** 2
