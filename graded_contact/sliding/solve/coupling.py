"""Traction that moves the surface of a body under steady sliding: its kernels.

In gross sliding the shear stress τ acts on the block along the motion e. It moves the surface by
M_ze τ along z, so that

    w = M_zz σ + M_ze τ(σ).

On the counterface, if there is one, it acts in the opposite direction (`bodies.py`).

Under Coulomb's law, w = (M_zz + f M_ze) σ: a contact without traction, of another kernel, whose
real part may be negative for some waves. Under other laws the traction lags (`isothermal.py`).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Array, Bool

from ...blocks.stack import Stack
from ...core.checks import as_float, is_concrete
from ...core.compilation import compiled
from ...fields.frequency import direction_and_speed
from ...fields.grid import Grid, Waves
from ...kernels.tangential import tangential_kernels
from ...kernels.window import without_images
from ..bodies import Coupling
from ..case import Case
from ..shear import Coulomb


def steady_coupling(
    case: Case,
    stack: Stack,
    velocity: Any,
    cells: Sequence[Grid],
    strain: tuple[Array, Array] | None,
) -> tuple[Coupling, Waves | None, Bool[Array, ""]]:
    """Returns the coupling of a body of a `Case`, errors of M_ze, and whether it is good.

    `velocity` is the surface's over the body; `cells` are the cell of a periodic surface, or two
    for a non-periodic one, which has errors.
    """
    if len(cells) == 2 and not isinstance(case.shear, Coulomb):
        raise ValueError(
            "`shear` is not supported: on a non-periodic surface only `Coulomb` can be coupled. "
            "Pass `coupled=False`, or put the body into a periodic cell."
        )
    direction, velocity = direction_and_speed(case.velocity)[0], as_float(velocity)
    found = [tangential_kernels(stack, cell, velocity, direction, strain) for cell in cells]
    ((lift,), ((along,),), good), error = found[0], None
    if len(cells) == 2:
        ((far_lift,), ((far_along,),), far_good), window = found[1], case.surface.grid
        lift, error = without_images(lift, far_lift, window, False)
        along, _ = without_images(along, far_along, window, False)
        good = good & far_good
    return Coupling((lift,), ((along,),), isinstance(case.shear, Coulomb)), error, good


def under_coulomb(coefficient: Array, parts: Sequence[Any], lifts: Sequence[Any]) -> Sequence[Any]:
    """Returns M_zz + f M_ze of a kernel and of its errors on a window, or None if it has none."""
    # Without friction a real kernel stays real.
    if is_concrete(coefficient) and np.asarray(coefficient) == 0:
        return parts
    pairs = zip(parts, lifts, strict=True)
    return [None if lift is None else _lifted(part, coefficient, lift) for part, lift in pairs]


@compiled
def _lifted(part: Array, coefficient: Array, lift: Array) -> Array:
    return part + coefficient.astype(part.real.dtype) * lift
