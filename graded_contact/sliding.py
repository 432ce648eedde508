"""The main job: a rough rigid surface sliding on a layered viscoelastic block.

The surface h(x - vt) is pressed on the block by a mean pressure and moves steadily with the
velocity v. In the frame of the surface everything stands still, and every wavevector q of the
pressure works the block at the frequency ω = -q·v.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Inexact

from ._checks import Numbers, as_float, is_concrete
from .contact.douglas_rachford import DouglasRachford
from .contact.law import HardWall
from .contact.observables import (
    contact_area,
    contact_area_corrected,
    contact_area_smooth,
    energy_imbalance,
    friction,
)
from .contact.problem import RESULTS, ContactSolution, solve_contact
from .grid import Grid
from .response.kernel import stack_kernel
from .response.stack import Stack
from .surface import Surface


class Sliding(eqx.Module):
    """Friction, contact area and fields of a sliding contact.

    **Fields:**

    - `friction`: force opposing the motion over the load [1]; >= 0 for passive materials.
    - `contact_area`: fraction of points in contact [1]. A pixel count, without a derivative.
    - `contact_area_corrected`: the same less its known excess at the edges [1].
    - `contact_area_smooth`: sub-pixel area fraction [1], for gradients.
    - `geometric_friction`: friction from the surface's slope instead of the block's [1]. Its
      distance from `friction` is the error of the grid.
    - `energy_imbalance`: work of friction against dissipation in the block, relative [1].
    - `contact`: pressure, gap and convergence, see `ContactSolution`; also reached directly as
      `.pressure`, `.gap`, `.displacement` [Pa, m, m], `.mean_gap` [m], `.error`, `.num_fft_pairs`
      and `.result`.
    """

    friction: Float[Array, ""]
    contact_area: Float[Array, ""]
    contact_area_corrected: Float[Array, ""]
    contact_area_smooth: Float[Array, ""]
    geometric_friction: Float[Array, ""]
    energy_imbalance: Float[Array, ""]
    contact: ContactSolution

    @property
    def pressure(self) -> Float[Array, "*shape"]:
        return self.contact.pressure

    @property
    def gap(self) -> Float[Array, "*shape"]:
        return self.contact.gap

    @property
    def displacement(self) -> Float[Array, "*shape"]:
        return self.contact.displacement

    @property
    def mean_gap(self) -> Float[Array, ""]:
        return self.contact.mean_gap

    @property
    def error(self) -> Float[Array, ""]:
        return self.contact.error

    @property
    def num_fft_pairs(self) -> Float[Array, ""]:
        return self.contact.num_fft_pairs

    @property
    def result(self) -> RESULTS:
        return self.contact.result


def slide(
    stack: Stack,
    surface: Surface,
    *,
    pressure: Numbers,
    velocity: Numbers,
    law: HardWall = HardWall(),  # noqa: B008 (immutable)
    solver: DouglasRachford = DouglasRachford(),  # noqa: B008
    rtol: float = 1e-6,
    start: Numbers | None = None,
    throw: bool = True,
) -> Sliding:
    """Returns friction, contact area and fields of a rough surface sliding on a block.

    Differentiable in every leaf of `stack` and `surface`, in `pressure` and in `velocity`:
    `jax.grad(lambda s: slide(s, surface, pressure=p, velocity=v).friction)(stack)` is a stack of
    derivatives. Works under `jit` and `vmap`.

    **Arguments:**

    - `stack`: the block, see `Stack`. `stack.at(temperature)` is the block at another temperature.
    - `surface`: the rough surface; heights count into the block.
    - `pressure`: mean pressure σ0 [Pa].
    - `velocity`: of the surface over the block [m/s]: a number (along x) or `(vx, vy)`. At rest
      (0, known beforehand) the relaxed moduli act and a real kernel is used.
    - `law`, `solver`, `rtol`, `start`, `throw`: as in `solve_contact`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if the solve fails.
    """
    if not isinstance(stack, Stack):
        raise ValueError(f"`stack={stack!r}` must be a `Stack(layers=..., base=...)`.")
    if not isinstance(surface, Surface):
        raise ValueError(f"`surface={surface!r}` must be a `Surface(heights, grid)`.")
    velocity = as_float(velocity)
    kernel = stack_kernel(stack, surface.grid, velocity)
    if is_concrete(velocity) and not np.any(velocity):
        kernel = kernel.real
    contact = solve_contact(
        kernel,
        surface.heights,
        pressure,
        law=law,
        solver=solver,
        rtol=rtol,
        start=start,
        throw=throw,
    )
    return _observe(contact, kernel, surface.heights, surface.grid, velocity, law)


@eqx.filter_jit
def _observe(
    contact: ContactSolution,
    kernel: Inexact[Array, "*half"],
    heights: Float[Array, "*shape"],
    grid: Grid,
    velocity: Float[Array, "..."],
    law: HardWall,
) -> Sliding:
    sigma, w = contact.pressure, contact.displacement
    touching = law.in_contact(sigma)
    return Sliding(
        friction=friction(sigma, w, grid, velocity),
        contact_area=contact_area(touching).astype(sigma.dtype),
        contact_area_corrected=contact_area_corrected(touching).astype(sigma.dtype),
        contact_area_smooth=contact_area_smooth(sigma, contact.gap, touching, kernel),
        geometric_friction=friction(sigma, heights, grid, velocity),
        energy_imbalance=energy_imbalance(sigma, w, kernel, grid, velocity),
        contact=contact,
    )
