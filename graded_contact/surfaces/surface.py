"""Rough surfaces: heights h [m] that point into the solid, on a grid."""

import equinox as eqx
from jax import Array
from jaxtyping import Float

from ..core.checks import Numbers, as_float, check_shape, check_type, check_values
from ..core.display import shown
from ..fields.devices import spread
from ..fields.grid import Grid


@shown("grid", "heights", "periodic", "measured", "history", "warnings", units=False)
class Surface(eqx.Module):
    """Heights of a rough surface: periodic, or on a window with no pressure around it.

    **Fields:**

    - `heights`: h [m], shape `grid.shape`. The mean need not be zero; contact ignores it.
    - `grid`: the periodic cell, or the window.
    - `history`: the changes of the heights, one sentence each. Static.
    - `measured`: how much of each height was measured [1], shape `grid.shape`: 1 as measured, 0
      invented to fill a hole; None: all alike.
    - `periodic`: whether the surface repeats. If not, as an indenter or the edge of a block, the
      block's surface around the window is free of load. Static.
    - `warnings`: about contact on this surface, one sentence each. Static.
    """

    heights: Float[Array, "*shape"]
    grid: Grid
    history: tuple[str, ...] = eqx.field(static=True)
    # Not Boolean: `jax.grad` by a surface needs numbers in every leaf.
    measured: Float[Array, "*shape"] | None
    periodic: bool = eqx.field(static=True)
    warnings: tuple[str, ...] = eqx.field(static=True)

    def __init__(
        self,
        heights: Numbers,
        grid: Grid,
        history: tuple[str, ...] = (),
        measured: Numbers | None = None,
        periodic: bool = True,
        warnings: tuple[str, ...] = (),
    ):
        check_type("grid", grid, Grid)
        check_type("periodic", periodic, bool)
        check_type("history", history, tuple)
        check_type("warnings", warnings, tuple)
        self.grid, self.history, self.periodic = grid, history, periodic
        self.warnings = warnings
        self.heights = _on_grid("heights", heights, grid)
        check_values("heights", self.heights, "heights must be finite numbers [m]")
        self.measured = None if measured is None else _on_grid("measured", measured, grid)
        if self.measured is not None:
            reason = "a share lies between 0 and 1"
            check_values("measured", self.measured, reason, at_least=0, at_most=1)


def check_periodic(surface: Surface) -> None:
    """Raises `ValueError` for a surface on a window."""
    if not surface.periodic:
        raise ValueError("`surface` is on a window (`periodic=False`); a periodic one is needed.")


def _on_grid(name: str, field: Numbers, grid: Grid) -> Array:
    """A field of the grid, on its devices."""
    field = as_float(field, name)
    check_shape(name, field, grid.shape)
    return spread(field, grid.size)
