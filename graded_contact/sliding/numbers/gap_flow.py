"""Flow of a thin fluid through the gap of a contact, as in a seal.

Reynolds' equation div(u³ ∇p) = 0 on the periodic cell gives the mean flow per width
q = -K/(12 η) ∇p̄ [m²/s], with the conductance K [m³] along x and along y; parallel plates have
K = u³. In finite volumes the flow between neighbouring points has the harmonic mean of their u³, so
no flow passes a contact, and the least dissipation

    K = min ⟨u³ |∇p|²⟩   over all pressures of unit mean gradient

is a sum over these links. At the minimum a change of p changes nothing to first order: the
derivative of K by the conductance of a link is the square of its drop.

N. Patir & H. S. Cheng, J. Lubr. Technol. 100 (1978) 12, doi:10.1115/1.3453103; B. N. J. Persson &
C. Yang, J. Phys.: Condens. Matter 20 (2008) 315011, doi:10.1088/0953-8984/20/31/315011.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ...core.checks import Numbers, as_float, check_positive, check_shape, check_type, check_values
from ...core.compilation import compiled
from ...core.display import shown
from ...fields.grid import Grid
from ..case import FLOW
from ..formulas import indicator_of, shared
from ..number import Found, observable, value_of
from ..transient_problem import TransientProblem

ALONG = {"entries": ("along x", "along y")}  # how arrays print
# Of the changes of K with the grid, and with the gap by the errors of its mean. With these weights
# 97 of 100 claims hold: 128 cells of 32 and 64 points along an edge, beside grids of four times as
# many. Near percolation a claim may be as large as K.
_MOVED, _LACKING, _WIDER = 1.0, 0.5, 2.0


@shown()
class GapFlow(eqx.Module):
    """The conductance of a gap for a thin fluid.

    **Fields:**

    - `conductance`: K along x and along y [m³]: the mean flow per width is K/(12 η) times the
      gradient of the pressure. Over the cube of the mean gap it is the flow factor of Patir and
      Cheng.
    - `percolates`: whether the gap is connected along x and along y; without, K is 0.
    """

    conductance: Float[Array, "2"] = eqx.field(metadata=ALONG)
    percolates: Bool[Array, "2"] = eqx.field(metadata=ALONG)


@shown()
@dataclasses.dataclass(frozen=True)
class Fluid:
    """A fluid on both sides of a seal, thin enough that its pressure carries no load.

    **Fields:**

    - `viscosity`: η of the fluid [Pa s].
    - `pressure_difference`: Δp of the fluid [Pa], over the length of a period.
    """

    viscosity: float
    pressure_difference: float

    def __post_init__(self):
        check_positive("viscosity", self.viscosity, "[Pa s]")
        check_positive("pressure_difference", self.pressure_difference, "[Pa]")

    def leakage(self, conductance: Numbers, grid: Grid) -> Float[Array, "*any 2"]:
        """Returns the volume that passes a period in two dimensions, along x and along y [m³/s].

        Q_x = K_x Δp L_y/(12 η L_x). A seal of length l around and width w across has l/w times as
        much as a square cell.

        **Arguments:**

        - `conductance`: K along x and along y [m³], shape `(..., 2)`, of `GapFlow`.
        - `grid`: the cell.

        **Returns:** the leakage.
        """
        across = grid.size[::-1] / grid.size
        per_area = self.pressure_difference / (12 * self.viscosity)
        return as_float(conductance, "conductance") * per_area * across


def gap_flow(gap: Numbers, grid: Grid, *, contact: Numbers | None = None) -> GapFlow:
    """Returns the conductance of a gap for a thin fluid, by Reynolds' equation.

    Differentiable in `gap` and `grid`, usable under `jit` and `vmap`; the equations are solved by
    SciPy's sparse elimination, on one processor. A profile `(nx,)` is one of grooves along y.

    **Arguments:**

    - `gap`: u [m], shape `grid.shape`; closed where u <= 0.
    - `grid`: the periodic cell. The gap of a window does not repeat: its conductance is not this.
    - `contact`: closed points as a mask, such as `sliding.pressure > 0`, whose gap is 0 only up to
      the solver's error.

    **Returns:** conductance and percolation.

    **Raises:** `ValueError` for a refused argument.
    """
    check_type("grid", grid, Grid)
    gap = as_float(gap, "gap")
    check_shape("gap", gap, grid.shape)
    check_values("gap", gap, "gaps [m] must be finite")
    if contact is not None:
        closed = as_float(contact, "contact")
        check_shape("contact", closed, grid.shape)
        gap = jnp.where(closed != 0, 0, gap)
    return _gap_flow(gap, grid)


def _conductance(found: Found, wider: Any = 0.0) -> Float[Array, "*times 2"]:
    """K along x and along y, where the open gap is wider by a length [m]; at each kept time."""
    at_one = lambda at: gap_flow(at[0] + at[2], found.grid, contact=at[1]).conductance  # noqa: E731
    of_times = found.gap.shape[: found.gap.ndim - found.grid.ndim]
    fields = found.gap, indicator_of(found) > 0, jnp.broadcast_to(wider, of_times)
    return jax.lax.map(at_one, fields) if of_times else at_one(fields)


_flow = shared(_conductance)


@observable("conductance of the gap for a fluid along x", "m³", needs=[FLOW])
def flow_along_x(found: Found) -> Float[Array, "..."]:
    """Conductance of the gap along x [m³]; for a profile, across its grooves. See `gap_flow`.

    Of a transient solve one number at each of its `field_times`.
    """
    return _flow(found)[..., 0]


@observable("conductance of the gap for a fluid along y", "m³", needs=[FLOW])
def flow_along_y(found: Found) -> Float[Array, "..."]:
    """Conductance of the gap along y [m³]; for a profile, along its grooves. See `gap_flow`.

    Of a transient solve one number at each of its `field_times`.
    """
    return _flow(found)[..., 1]


def _by_gap(cause: str) -> Callable[[Found], Array]:
    """The formula of the error by the mean gap: the flow through a gap wider by its error."""

    @shared
    def error(found):
        wider = value_of("mean_gap_error", found)[cause]
        if isinstance(found.problem, TransientProblem):
            wider = wider[np.array(found.kept_steps)]
        return _WIDER * (_conductance(found, wider) - _flow(found))

    return error


_BY_GAP = {cause: _by_gap(cause) for cause in ("solver", "grid", "time", "memory")}


@shared
def _by_grid(found: Found) -> Array:
    near = found.near
    own, same, half = map(_flow, (found, *near.both(found)))
    changes = jnp.abs(jnp.stack([same - half, own - same]))
    moved, lacking = jnp.where(jnp.isnan(changes), own, changes)  # a neighbour may fail
    error = _MOVED * moved + _LACKING * lacking + _BY_GAP["grid"](found)
    return jnp.where(jnp.isnan(near.lacking), jnp.nan, error)


def flow_errors(axis: int, *causes: str) -> dict[str, Callable[[Found], Array]]:
    """Returns the formulas of the errors of the conductance along an axis, by their causes."""
    formulas = _BY_GAP | {"grid": _by_grid}
    return {cause: lambda found, of=formulas[cause]: of(found)[..., axis] for cause in causes}


@compiled
def _gap_flow(gap, grid: Grid) -> GapFlow:
    # A failed solve has no gap, of which SciPy would find no flow.
    known = jnp.all(jnp.isfinite(gap))
    gap = jnp.where(known, gap, 0)
    # In units of the largest gap: products of cubes in metres would underflow.
    unit = jnp.max(jnp.abs(jax.lax.stop_gradient(gap)))
    unit = jnp.where(unit > 0, unit, 1)
    open_gap = (jnp.maximum(gap, 0) / unit).reshape(gap.shape[0], -1)
    cube = open_gap**3
    beyond = jnp.stack([jnp.roll(cube, -1, axis) for axis in (0, 1)])
    # Two half links in series: the harmonic mean, 0 if one is closed.
    total = jnp.where((cube > 0) & (beyond > 0), cube + beyond, jnp.inf)
    spacing = jnp.broadcast_to(grid.spacing, (2,))
    ratio = jnp.stack([spacing[1] / spacing[0], spacing[0] / spacing[1]])
    weights = 2 * cube * beyond / total * ratio[:, None, None]
    dtype = weights.dtype
    shapes = jax.ShapeDtypeStruct((2, *cube.shape), dtype), jax.ShapeDtypeStruct((2,), bool)
    pressure, percolates = jax.pure_callback(
        partial(_solve, dtype=dtype),
        shapes,
        *jax.lax.stop_gradient((weights, spacing)),
        vmap_method="sequential",
    )
    rise = jnp.eye(2, dtype=dtype)[:, :, None, None] * spacing[:, None, None]
    drops = rise + jnp.stack([jnp.roll(pressure, -1, axis) - pressure for axis in (1, 2)], 1)
    area = cube.size * spacing[0] * spacing[1]
    # No derivative through the pressures: to first order K does not change with them.
    found = jnp.sum(weights * drops**2, axis=(1, 2, 3)) / area
    unit = jnp.where(known, unit, jnp.nan)
    return GapFlow(jnp.where(percolates, found, 0) * unit**3, percolates)


def _solve(weights, spacing, *, dtype):
    """The pressures beside the mean gradients along x and y, and whether each lets flow through."""
    from scipy.sparse import coo_array, csgraph, diags_array
    from scipy.sparse.linalg import splu

    weights, spacing = np.asarray(weights, float), np.asarray(spacing, float)
    points = np.arange(weights[0].size).reshape(weights[0].shape)
    first = np.concatenate([points.ravel()] * 2)
    second = np.concatenate([np.roll(points, -1, axis).ravel() for axis in (0, 1)])
    weight, size = weights.ravel(), points.size
    # A link from a point to itself, on a profile, only winds around.
    links = coo_array((weight * (first != second), (first, second)), (size, size)).tocsr()
    links = links + links.T
    links.eliminate_zeros()
    _, label = csgraph.connected_components(links)
    # A pressure is known up to a constant in each connected part: one of its points is tied to 0.
    roots = np.unique(label, return_index=True)[1]
    ground = np.zeros(size)
    ground[roots] = 1
    total = np.asarray(links.sum(axis=1)).ravel()
    # Scaled to a unit diagonal: conductances differ by many powers of ten.
    scale = 1 / np.sqrt(np.where(total > 0, total, 1))
    matrix = diags_array(scale) @ (diags_array(total * (1 + ground)) - links) @ diags_array(scale)
    matrix = matrix + diags_array((total == 0).astype(float))
    factor = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    pressure = []
    for axis in (0, 1):
        flow = weights[axis] * spacing[axis]
        source = flow - np.roll(flow, 1, axis)
        pressure.append(scale * factor.solve(scale * source.ravel()))
    pressure = np.reshape(pressure, weights.shape).astype(dtype)
    return pressure, _winds(links, roots, points.shape, first, second, weight > 0)


def _winds(links, roots, shape, first, second, open_):
    """Whether a path of open links winds around the cell along x and along y.

    A tree joins the points of each connected part, and is laid out on the plane, beyond the edges
    of the cell. A link whose ends are no neighbours there closes a path that winds, any number of
    times.
    """
    from scipy.sparse import block_array, coo_array, csgraph

    size = links.shape[0]
    # One more point, joined to a point of each part, makes one tree of all.
    stem = coo_array((np.ones(len(roots)), (np.zeros(len(roots), int), roots)), (1, size))
    joined = block_array([[links, None], [stem, coo_array((1, 1))]], format="csr")
    parent = csgraph.breadth_first_order(joined, size)[1][:size]
    parent[roots] = roots
    place = np.stack(np.unravel_index(np.arange(size), shape))
    period = np.reshape(shape, (2, 1))
    laid = place - place[:, parent]
    laid -= period * np.rint(laid / period).astype(int)
    # Each round doubles the part of the path from the root that is summed.
    while np.any(parent != (further := parent[parent])):
        laid, parent = laid + laid[:, parent], further
    laid = laid + laid[:, parent]
    along = np.repeat(np.eye(2, dtype=int), size, axis=1)
    return np.any((laid[:, second] - laid[:, first] != along) & open_, axis=1)
