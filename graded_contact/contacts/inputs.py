"""Inputs of a contact, checked: heights, kernel, start and loading."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..core.checks import Numbers, as_float, check_positive, check_shape, check_values, is_concrete
from ..core.compilation import compiled
from ..core.derivative import largest
from ..fields.grid import half_shape
from .law import AbstractLaw, HardWall, check_pressure, never_overlaps
from .operators.operator import Field, first_mode
from .solver.abstract_solver import Loading

LEAST_GAP = 1e-12  # mean gaps over the rms height below this are rounding


def check_heights(heights: Array) -> None:
    """Raises `ValueError` for heights [m] of another shape or dtype, or that are not finite."""
    if heights.ndim not in (1, 2) or heights.size < 2:
        raise ValueError(
            f"`heights` has shape {heights.shape}; one or two axes, and two points at least, are "
            "needed."
        )
    if heights.dtype not in (jnp.float32, jnp.float64):
        raise ValueError(f"`heights` has dtype {heights.dtype}; float32 or float64 is needed.")
    check_values("heights", heights, "heights [m] must be finite")


def check_kernel(kernel: Array, shape: tuple[int, ...], on_window: bool, throw: bool) -> None:
    """Raises `ValueError` for a kernel [m/Pa] of another shape, or that pulls a load towards it.

    Re M may be negative for some waves, on a window that cuts Green's function and under a traction
    that is part of the kernel, but not for their sum, the displacement of one loaded point.
    """
    if not on_window:
        check_shape("kernel", kernel, half_shape(shape))
    if is_concrete(kernel):
        real, imag, total = _compliances(kernel, throw)
        check_values("kernel.real", real, "it must be finite")
        # The entry that is ignored counts 1. Inside a trace even a known kernel is not looked at.
        if is_concrete(total) and np.asarray(total) <= 1:
            check_positive("kernel.real", real, "[m/Pa] for nearly all q but 0")
        check_values("kernel.imag", imag, "it must be finite")


@compiled
def _compliances(kernel, throw: bool):
    """Real and imaginary part of the kernel, 1 and 0 where it is ignored; the sum of the first."""
    ignored = first_mode(kernel.shape)
    if not throw:
        ignored = ignored | ~jnp.isfinite(kernel)  # `.result` reports them
    checked = jnp.where(ignored, 1, kernel)
    return checked.real, checked.imag, jnp.sum(checked.real)


def as_start(start: Numbers | None, heights: Array, law: AbstractLaw) -> Array | None:
    """Returns a checked pressure to start from, if there is one."""
    if start is None:
        return None
    start = as_float(start, "start")
    check_shape("start", start, heights.shape)
    low = law.bounds[0]
    if is_concrete(low):
        # A solution's own pressures may be an ulp below after a change of units.
        allowed = f"pressures [Pa] must be at least {float(low):g}"
        check_values("start", start, allowed, at_least=float(low) * (1 + 1e-5))
    return start


def check_gap(
    on_window: bool, ground: bool, pressure: Numbers | None, **gaps: Numbers | None
) -> dict[str, Numbers | None]:
    """Returns the pressure, and the approach on a window, else the mean gap, as prescribed.

    `ground` tells whether the displacement of the block has a limit far away.

    **Raises:** `ValueError` for the other one, and for an approach without such a limit.
    """
    own, other = ("approach", "mean_gap") if on_window else ("mean_gap", "approach")
    if gaps[other] is not None:
        only = "in a periodic cell" if on_window else "on a window (see `Surface.periodic`)"
        raise ValueError(
            f"`{other}={gaps[other]}` is refused: only a body {only} has one. Prescribe `{own}`."
        )
    if gaps["approach"] is not None and not ground:
        raise ValueError(
            f"`approach={gaps['approach']}` is refused: the displacement of this block has no "
            "limit far away, as of all blocks in one dimension but slabs on a `Rigid()` base. "
            "Prescribe `pressure`."
        )
    return {"pressure": pressure, own: gaps[own]}


PARTED = "; where the surfaces part, prescribe `mean_gap`"  # of a load over time


def loading_of(
    law: AbstractLaw, heights: Field, num_times: int | None = None, **given: Numbers | None
) -> Loading:
    """Returns the loading: one number, or one for each of `num_times`, the heights' first axis.

    `given` are the `pressure` and the `mean_gap` or `approach`; one of the two is None.
    """
    named = [(name, value) for name, value in given.items() if value is not None]
    if len(named) != 1:
        both = " and ".join(f"`{name}={value}`" for name, value in given.items())
        raise ValueError(f"{both}: exactly one of them must be given.")
    [(name, value)] = named
    value = spread = as_float(value, name)
    if num_times is None or value.ndim:
        check_shape(name, value, () if num_times is None else (num_times,))
    if num_times is not None:  # an array that broadcasts to the heights
        spread = jnp.broadcast_to(value, num_times).reshape(-1, *[1] * (heights.ndim - 1))
    if name == "pressure":
        check_pressure(value, law, PARTED if num_times else "")
        return Loading(spread, None)
    check_values(name, value, f"the {name.replace('_', ' ')} [m] must be finite")
    if name == "approach":
        return Loading(None, _undeformed_gap(value, law, heights))
    if never_overlaps(law):  # one point stays open: else nothing limits the pressure
        least = LEAST_GAP * jnp.std(heights)
        if is_concrete(least):  # a mean of zeros, but for rounding
            allowed = "at a hard wall it must be at least 0; in full contact prescribe `pressure`"
            check_values(name, value, allowed, at_least=-float(least))
        hidden = jax.lax.stop_gradient(jnp.where(jnp.abs(spread) < least, least - spread, 0))
        spread = spread + hidden
    return Loading(None, spread)


def _undeformed_gap(approach, law: AbstractLaw, heights):
    """The mean gap on a window if the block did not deform."""
    if isinstance(law, HardWall):  # at the first touch, nothing touches; else rounding decides
        least = LEAST_GAP * jnp.maximum(jnp.std(heights), jnp.finfo(heights.dtype).tiny ** 0.5)
        at_touch = jnp.abs(approach) <= least
        approach = approach + jax.lax.stop_gradient(jnp.where(at_touch, -least - approach, 0))
    return largest(heights) - jnp.mean(heights) - approach
