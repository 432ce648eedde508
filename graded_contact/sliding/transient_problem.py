"""The problem of a contact in a transient motion: both bodies with their memories, and the path."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import Stack
from ..contacts.operators.operator import AbstractOperator
from ..contacts.operators.window import Window
from ..core.compilation import compiled
from ..fields.grid import Grid, Waves, mode_numbers, to_field, to_spectrum, wavevector
from ..kernels.creep import Creep
from ..kernels.periodic import quadrant
from ..kernels.window import doubled, long_cell, without_images
from .case import GROUND
from .motion.motion import components
from .problem import AbstractProblem


class OneStep(AbstractOperator):
    """The bodies in one step of a transient motion.

    **Fields:**

    - `kernel`: I(Δ)/Δ [m/Pa], see `Creep`.
    - `aged`: J(t) of a pressure that acts since t = 0 [m/Pa]: edges of contact that rest are soft.
    """

    kernel: Waves
    aged: Waves

    def at_edges(self, load):
        return jnp.stack([self.kernel, self.aged])


class OneStepOnWindow(OneStep, Window):
    """The bodies in one step of a transient motion, on a window."""


class TransientProblem(AbstractProblem):
    """A surface in a transient motion, on a block.

    **Fields:**

    - `bodies`, `creeps`: the block and the counterface, unless it is rigid, and their memories.
    - `times`: ends of the steps [s], shape `(nt,)`.
    - `displacement`: s of the surface at these times [m], since t = 0, shape `(nt,)` or `(nt, 2)`.
    - `given`: at these times the pressure [Pa] or the mean gap [m], or of an approach the place of
      the block's undeformed surface in the frame of the heights [m].
    - `path`: points of the part of the block over which a window moves, or None. Static.
    """

    bodies: tuple[Stack, ...]
    creeps: tuple[Creep, ...]
    times: Float[Array, " nt"]
    displacement: Float[Array, "nt ..."]
    given: Float[Array, " nt"]
    path: tuple[int, ...] | None = eqx.field(default=None, static=True)

    @property
    def operator(self) -> OneStep:
        """The bodies in the last step."""
        last = (jnp.stack([creep.now[0, -1], creep.aged[-1]]) for creep in self.creeps)
        found = functools.reduce(jnp.add, map(self.responses, self.creeps, last))
        return self.operator_of(*on_half(found, mode_numbers(self.memory_grid.shape)))

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
        """The cell of the memory of the bodies: around a window's path, without its copies."""
        return self.grid if self.path is None else doubled(self._all_of_path)

    @property
    def waves_between(self) -> Float[Array, "2"]:
        """The lowest and the highest wavenumber at which responses are needed [rad/m]."""
        grid, of_path = self.memory_grid, self.path is not None
        cells = [long_cell(self._all_of_path), grid] if of_path else [grid]
        return _waves_between(cells)

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
            on_half(_at_positive(creep, cell, table, axis), mode_numbers(cell.shape), axis)
            for cell in cells
        )
        if axis is None:
            return without_images(near, far, path, GROUND in self.facts)
        return without_images(1j * near, 1j * far, path, False)

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


@compiled
def _waves_between(cells: list[Grid]) -> Array:
    """The lowest wavenumber of the first cell, and the highest of all."""
    highest = [jnp.pi * jnp.sqrt(jnp.sum(cell.spacing**-2)) for cell in cells]
    lowest = 2 * jnp.pi / jnp.max(cells[0].size)
    return jnp.stack([lowest, functools.reduce(jnp.maximum, highest)])


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


def on_half(found: Array, numbers: tuple[np.ndarray, ...], axis: int | None = None) -> Array:
    """Responses at mode numbers from those at positive ones; to traction but for a factor i."""
    if len(numbers) == 2:
        found = jnp.take(found, np.abs(numbers[0]).ravel(), axis=-2)
    return found if axis is None else found * np.sign(numbers[axis])
