"""What decides a contact in a motion that happens once, and its waves in the bodies.

A wave of pressure is at rest in the block: its phase exp(-iq·s) takes it there and back. In the
counter it rests as it is. Waves with two points along an axis x count for both signs of their
number (`both_signs`).
"""

import functools
import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..blocks.creep import Creep
from ..blocks.stack import Stack
from ..contacts.law import AbstractLaw
from ..contacts.operator import AbstractOperator, nonzero
from ..fields.grid import (
    Grid,
    Waves,
    both_signs,
    mode_numbers,
    multiplicity,
    nyquist_lines,
    to_field,
    wavenumber,
    wavevector,
)
from .motion import components
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

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the fields at one time."""
        return self.grid.shape

    @property
    def operator(self) -> OneStep:
        """The bodies in the last step."""
        waves = HistoryWaves(self.grid, self.creeps)
        last = (jnp.stack([creep.now[-1], creep.aged[-1]]) for creep in self.creeps)
        return OneStep(*functools.reduce(jnp.add, map(waves.kernel, last)))

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


class HistoryWaves(eqx.Module):
    """The waves of a grid in the bodies: with both signs of the highest number along x.

    **Fields:**

    - `grid`: of the surface.
    - `q`: wavenumbers of the positive components [rad/m], a placeholder at 0.
    - `shares`: of the wavenumbers of a `Creep` at these, for interpolation.
    - `memories`: w_k M(s_k) of the waves of each force: the pressure on each body, and with a
      traction that moves the surfaces this one on each of them; of the shape `(nodes, *waves)`.
    """

    grid: Grid
    q: Float[Array, "*quadrant"]
    shares: Float[Array, "waves points"]
    memories: tuple[Complex[Array, "nodes *half"], ...]

    def __init__(self, grid: Grid, creeps: tuple[Creep, ...]):
        counts = [np.arange(n // 2 + 1) for n in grid.shape]
        mesh = jnp.meshgrid(*map(jnp.multiply, 2 * np.pi / grid.size, counts), indexing="ij")
        squared = jnp.sum(jnp.stack(mesh) ** 2, axis=0)
        self.grid, lowest = grid, jnp.exp(creeps[0].log_q[0])
        self.q = jnp.sqrt(jnp.where(squared > 0, squared, lowest**2))
        self.shares = creeps[0].shares(self.q.ravel())
        memories = [self._on(creep.kernels, self.numbers) for creep in creeps]
        for creep, memory in zip(creeps, memories[:], strict=True):
            if creep.lift is not None:
                memories.append(memory * self._at(creep.lift[0], self.numbers))
        self.memories = tuple(memories)

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
        size = jnp.where(self.is_wave, 1 / self.q, 0)
        return self._at(table, numbers, lambda found: jnp.exp(found) * size)

    def _at(self, table: Array, numbers: tuple[np.ndarray, ...], of=lambda found: found) -> Array:
        """A function of a table, such as `Creep.lift`, at the waves of these mode numbers."""
        found = table @ self.shares.astype(table.dtype)
        found = of(found.reshape(*table.shape[:-1], *self.q.shape))
        if self.grid.ndim == 1:
            return found
        return jnp.take(found, np.abs(numbers[0]).ravel(), axis=-2)

    def kernel(self, table: Array, lift: Array | None = None) -> Array:
        """A table of `Creep` on the half spectrum; of traction with the ratios of its `lift`."""
        numbers = mode_numbers(self.grid.shape)
        found = self._on(table, numbers)
        return found if lift is None else found * self._at(lift, numbers)

    def along(self, direction: Array) -> Array:
        """i q·e/|q| on the half spectrum, e along the first axes; 0 on Nyquist lines."""
        size = nonzero(wavenumber(self.grid))
        kept = ~nyquist_lines(self.grid.shape)
        a = sum(e * q for e, q in zip(direction, wavevector(self.grid), strict=False))
        return 1j * jnp.where(kept, a / size, 0)

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
