"""What decides a contact in a motion that happens once, and its waves in the block.

A wave of pressure is at rest in the block: its phase exp(-iq·s) takes it there and back. Waves with
two points along an axis x count for both signs of their number (`both_signs`).
"""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..blocks.creep import Creep
from ..blocks.stack import Stack
from ..contacts.law import AbstractLaw
from ..contacts.operator import AbstractOperator
from ..fields.grid import Grid, Waves, both_signs, mode_numbers, multiplicity, wavevector
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

    - `stack`, `creep`: the block, and its memory.
    - `heights`, `grid`, `law`, `measured_range`, `shear`, `facts`: as in `SteadyProblem`.
    - `prescribed`: what is given: "pressure" or "mean_gap". Static.
    - `times`: ends of the steps [s], shape `(nt,)`.
    - `displacement`: s of the surface at these times [m], since t = 0, shape `(nt,)` or `(nt, 2)`.
    - `given`: pressure [Pa] or mean gap [m] at these times.
    """

    stack: Stack | None
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
    counter: None = None
    block_heights: None = None
    facts: frozenset[str] = eqx.field(default=frozenset(), static=True)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the fields at one time."""
        return self.grid.shape

    @property
    def operator(self) -> OneStep:
        """The block in the last step."""
        last = jnp.stack([self.creep.now[-1], self.creep.aged[-1]])
        now, aged = BlockWaves(self.grid, self.creep).kernel(last)
        return OneStep(now, aged)

    @property
    def block(self) -> OneStep:
        """The operator of the block alone."""
        return self.operator

    @property
    def roughness(self) -> tuple[Float[Array, "..."], ...]:
        """The heights of the bodies that are rough: of the surface."""
        return (self.heights,)

    @property
    def between(self) -> Float[Array, "..."]:
        """The heights of both bodies together [m]."""
        return self.heights

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


class BlockWaves(eqx.Module):
    """The waves of a grid in the block: with both signs of the highest number along x.

    **Fields:**

    - `grid`: of the surface.
    - `q`: wavenumbers of the positive components [rad/m], a placeholder at 0.
    - `shares`: of the wavenumbers of a `Creep` at these, for interpolation.
    - `memory`: w_k M(s_k) of the waves, shape `(nodes, *waves)`.
    """

    grid: Grid
    q: Float[Array, "*quadrant"]
    shares: Float[Array, "waves points"]
    memory: Complex[Array, "nodes *half"]

    def __init__(self, grid: Grid, creep: Creep):
        counts = [np.arange(n // 2 + 1) for n in grid.shape]
        mesh = jnp.meshgrid(*map(jnp.multiply, 2 * np.pi / grid.size, counts), indexing="ij")
        squared = jnp.sum(jnp.stack(mesh) ** 2, axis=0)
        self.grid, lowest = grid, jnp.exp(creep.log_q[0])
        self.q = jnp.sqrt(jnp.where(squared > 0, squared, lowest**2))
        self.shares = creep.shares(self.q.ravel())
        self.memory = self._on(creep.kernels, self.numbers)

    @property
    def numbers(self) -> tuple[np.ndarray, ...]:
        """Mode numbers of the waves."""
        return both_signs(self.grid.shape)

    @property
    def has_two(self) -> bool:
        """Whether waves with two points along x count twice."""
        return self.grid.ndim == 2 and self.grid.shape[0] % 2 == 0

    @property
    def is_wave(self) -> np.ndarray:
        """False where the positive components are 0."""
        return np.arange(self.q.size).reshape(self.q.shape) > 0

    def _on(self, table: Array, numbers: tuple[np.ndarray, ...]) -> Array:
        """A table of `Creep` at the waves of these mode numbers; 0 at q = 0."""
        found = jnp.exp(table @ self.shares.astype(table.dtype))
        found = found.reshape(*table.shape[:-1], *self.q.shape) / self.q
        found = jnp.where(self.is_wave, found, 0)
        if self.grid.ndim == 1:
            return found
        return jnp.take(found, np.abs(numbers[0]).ravel(), axis=-2)

    def kernel(self, table: Array) -> Array:
        """A table of `Creep` on the half spectrum."""
        return self._on(table, mode_numbers(self.grid.shape))

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
