"""Constructors by the `kind` of a table; the keys of the table are their parameters."""

import os
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jaxtyping import ArrayLike

from .. import materials
from ..blocks import Free, GradedLayer, HalfSpace, Layer, Rigid
from ..blocks.profile import Blend
from ..blocks.shapes import ErrorFunction, Exponential, Linear, PowerLaw, Sinusoidal
from ..contacts import AdhesiveLJ, ExponentialAdhesion, HardWall, RepulsiveLJ
from ..core.checks import check_positive
from ..fields.grid import Grid
from ..materials.coverage import MeasuredRange
from ..materials.shift import LAWS
from ..readers import read_moduli, read_surface
from ..readers.series import read_motion, read_over_time
from ..response import Layering, Riccati
from ..sliding import Motion, dwell, ramp, recorded, sinusoidal, start, start_stop
from ..surfaces import SelfAffine, Surface, random_surface
from .builder import Builder, with_keys_of

DrawSurface = Callable[[ArrayLike], Surface]  # from a seed


@with_keys_of(read_moduli)
def tabulated(
    path: os.PathLike,
    poisson: float = 0.5,
    shift: materials.AbstractShift | None = None,
    **reading: Any,
) -> materials.Tabulated:
    """Returns the material of a table of moduli over frequency, see `read_moduli`."""
    found = read_moduli(path, poisson=poisson, **reading)
    return materials.Tabulated(*found.table(), poisson, shift=shift)


@with_keys_of(SelfAffine)
def self_affine(
    grid: Grid, amplitudes: Any = "exact", q_low: float | None = None, **spectrum: Any
) -> DrawSurface:
    """Returns a function that draws a random surface, see `SelfAffine` and `random_surface`.

    The longest wave is as long as the longest edge, unless `q_low` [rad/m] is given.
    """
    q_low = 2 * np.pi / float(np.max(grid.size)) if q_low is None else q_low
    waves = SelfAffine(q_low=q_low, **spectrum)
    return lambda seed: random_surface(waves, grid, jax.random.key(seed), amplitudes=amplitudes)


def sphere(grid: Grid, radius: float) -> Surface:
    """Returns the heights -r²/(2R) of a sphere on a free boundary; of a cylinder on a profile.

    It is highest in the middle of the grid, where an even number of points has none.
    """
    check_positive("radius", radius, "[m]")
    axes = [
        (np.arange(n) - (n - 1) / 2) * dx
        for n, dx in zip(grid.shape, np.asarray(grid.spacing), strict=True)
    ]
    squared = sum(x**2 for x in np.meshgrid(*axes, indexing="ij"))
    return Surface(-squared / (2 * radius), grid, periodic=False)


def read_transient(path: os.PathLike, grid: Grid) -> Motion:
    """Returns the motion of a table "time [s], displacement [m]" that need not close."""
    times, displacement = read_over_time(path, "displacements")
    return recorded(times, displacement, grid=grid)


MATERIALS = {
    "elastic": materials.Elastic,
    "prony": materials.Prony,
    "prony_creep": materials.Prony.from_creep,
    "tyre_tread": materials.tyre_tread,
    "bulk_shear": materials.BulkShear,
    "softened": materials.StrainSoftening,
    "tabulated": tabulated,
}
BASES = {"half_space": HalfSpace, "rigid": Rigid, "free": Free}
SURFACES = {"self_affine": self_affine, "sphere": sphere, "file": read_surface}
CYCLES = {"sinusoidal": sinusoidal, "start_stop": start_stop, "recorded": read_motion}
TRANSIENTS = {"start": start, "ramp": ramp, "dwell": dwell, "recorded": read_transient}
CONTACT_LAWS = {
    "hard_wall": HardWall,
    "repulsive_lj": RepulsiveLJ,
    "adhesive_lj": AdhesiveLJ,
    "exponential_adhesion": ExponentialAdhesion,
}
SHAPES = {
    "linear": Linear,
    "sinusoidal": Sinusoidal,
    "exponential": Exponential,
    "power_law": PowerLaw,
    "error_function": ErrorFunction,
}
GRADED_SOLVERS = {"layering": Layering, "riccati": Riccati}
NESTED = {
    "shift": LAWS,
    "measured": {"range": MeasuredRange},
    "shape": SHAPES,
    "graded_solver": GRADED_SOLVERS,
}


def layer_of(builder: Builder, place: str, table: dict[str, Any]) -> Layer | GradedLayer:
    """Returns a layer; it is graded if it names materials at its bottom and top."""
    if "top" not in table and "bottom" not in table:
        return builder.build(place, table, Layer)
    ends = {key: value for key, value in table.items() if key != "thickness"}
    own = {key: value for key, value in table.items() if key == "thickness"}
    return builder.build(place, own, GradedLayer, profile=builder.build(place, ends, Blend))
