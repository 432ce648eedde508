"""Contacts on a window, with no pressure around it: indenters, spheres, edges of blocks.

A kernel of a cell of twice the window's length gives the displacement of a pressure on the window
(`kernels/window.py`). The window is the first half of each axis of that cell. The contact
on the cell is solved as usual, with a law that allows no pressure outside the window. The heights
outside do not matter; mirrored ones have the mean and the rms of the window, and no steps.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from ...fields.grid import Grid, Waves, half_shape, to_spectrum
from .operator import AbstractOperator, Field, Steady, first_mode, positions


class Window(AbstractOperator):
    """Steady sliding on a window, with no pressure around it.

    **Fields:**

    - `kernel`: M on the cell of twice the length, see `window_kernel`.
    - `grounded`: whether the entry of the mean counts. Then the displacement is relative to the
      block far away, no mean is open, and a prescribed gap belongs to the undeformed block. Static.
    """

    kernel: Waves
    grounded: bool = eqx.field(default=False, static=True, kw_only=True)

    def mean(self, field):
        return jnp.zeros((), field.dtype) if self.grounded else jnp.mean(field)

    @property
    def is_mean(self):
        return first_mode(self.kernel.shape) & (not self.grounded)

    def cell(self, grid):
        return Grid(tuple(2 * n for n in grid.shape), 2 * grid.size)

    def on_cell(self, field, mode="constant"):
        return jnp.pad(field, [(0, n) for n in field.shape], mode=mode)

    def on_surface(self, field):
        return field[tuple(slice(0, n // 2) for n in field.shape)]

    def at_edges(self, load):
        # The wake of sliding ends there with a step, of opposite sign in every other wave along x.
        both = jnp.roll(self.kernel, 1, 0) + jnp.roll(self.kernel, -1, 0)
        return (self.kernel / 2 + both / 4)[None]

    def change_by(self, error: Waves, pressure: Field, touching, at_approach: bool) -> Field:
        """Returns the change of the pressure [Pa] by an error of the kernel.

        At a given approach or load. As in `estimates.py`, by the inverse of M on the whole cell
        instead of on the contact.
        """
        operator = with_ground(self, pressure.shape) if at_approach else self

        def in_contact(field):
            mean = 0 if at_approach else jnp.sum(jnp.where(touching, field, 0)) / jnp.sum(touching)
            return jnp.where(touching, field - mean, 0)

        moved = operator.with_kernel(error).displace(self.on_cell(pressure))
        lifted = self.on_cell(in_contact(self.on_surface(moved)))
        return -in_contact(self.on_surface(operator.filtered(operator.inverse, lifted)))


def operator_of(kernel: Waves, shape: tuple[int, ...]) -> Steady | Window:
    """Returns the operator of a kernel for heights of this shape: on a window or not."""
    if kernel.shape == half_shape(tuple(2 * n for n in shape)):
        return Window(kernel)
    return Steady(kernel)


def inside(shape: tuple[int, ...]) -> Bool[Array, "*shape"]:
    """Returns where the window is in a cell of this shape: in the first half of each axis."""
    first, *others = (2 * i < n for i, n in zip(positions(shape), shape, strict=True))
    return first & others[0] if others else first


def with_ground(operator: AbstractOperator, shape: tuple[int, ...]) -> Window:
    """The operator with an entry for the mean above 0; NaN if it has none.

    An incompressible slab has none to speak of. A constant where two points are one window apart
    along an axis, which no two points of the window are, raises it without another effect.
    """
    kernel = operator.kernel
    mean, sizes = first_mode(kernel.shape), jnp.where(first_mode(kernel.shape), jnp.inf, kernel)
    entry = jnp.real(kernel[(0,) * len(shape)])
    missing = jax.lax.stop_gradient(jnp.maximum(jnp.min(jnp.abs(sizes)) / 4 - entry, 0))
    whole = tuple(2 * n for n in shape)
    near = [i != n for i, n in zip(positions(whole), shape, strict=True)]
    apart = 1 - jnp.prod(jnp.stack(near), axis=0, dtype=entry.dtype)
    unused = to_spectrum(apart).real / jnp.sum(apart)
    raised = jnp.where(mean & (entry == 0), jnp.nan, kernel + missing * unused)
    return Window(raised, grounded=True)
