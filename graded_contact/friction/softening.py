"""Sliding on a block that softens with the strain of its own contact."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, ScalarLike

from ..core.checks import (
    Numbers,
    as_scalar,
    check_positive,
    check_tolerance,
    check_types,
    check_whole,
    is_concrete,
)
from ..core.derivative import still
from ..core.fixed_point import attach_fixed_point, find_fixed_point
from ..response.stack import Stack
from ..rheology.softening import at_strain
from ..roughness.surface import Surface, statistics
from .sliding import Sliding, slide


@check_types
def slide_softened(
    stack: Stack,
    surface: Surface,
    *,
    velocity: Numbers,
    strain_per_slope: ScalarLike = 1.0,
    strain_rtol: float = 1e-3,
    max_solves: int = 30,
    throw: bool = True,
    **options: object,
) -> tuple[Sliding, Float[Array, ""]]:
    """Returns the sliding contact at its own strain amplitude, and that amplitude [1].

    One amplitude stands for the whole block: ε = `strain_per_slope` times `slope_in_contact`, the
    rms slope of the block weighted by the pressure. Contact and amplitude are iterated to the fixed
    point. The derivative is that of the fixed point, by one more derivative of a contact. (The mean
    field has an amplitude for every scale instead.)

    **Arguments:**

    - `stack`: with a `StrainSoftening`, see `materials`.
    - `surface`, `velocity`: as in `slide`.
    - `strain_per_slope`: ε over the rms slope [1], of order 1. Strain under a wave of slope h q
      decays with depth as (h q) exp(-q z); 1 is its value at the surface, Persson's convention.
    - `strain_rtol`: requested relative error of ε [1].
    - `max_solves`: limit of the iteration.
    - `throw`: whether to raise if a solve fails; otherwise look at `.result`, and ε is NaN if it
      was not found.
    - `options`: all other arguments of `slide`, such as `pressure` and `friction_rtol`.

    **Returns:** the `Sliding` and ε.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if a solve or ε fail.
    """
    ratio = as_scalar(strain_per_slope, "strain_per_slope")
    check_positive("strain_per_slope", ratio, "[1]")
    check_tolerance("strain_rtol", strain_rtol, surface.heights)
    check_whole("max_solves", max_solves, 1)

    given = stack, surface, velocity, ratio, options

    def sliding(strain, values, throw=False):
        stack, surface, velocity, _, options = values
        block = at_strain(stack, strain[0])
        return slide(block, surface, velocity=velocity, throw=throw, **options)  # pyright: ignore

    def image(strain, values):
        return jnp.atleast_1d(values[3] * sliding(strain, values).slope_in_contact)

    fixed = still(given)
    start = jnp.atleast_1d(fixed[3] * statistics(fixed[1]).rms_slope)
    point = find_fixed_point(
        lambda strain, state: (image(strain, fixed), state),
        start,
        None,
        jnp.asarray(strain_rtol / 2, start.dtype),
        max_solves,
    )
    strain = jax.lax.stop_gradient(point.x)
    if not all(map(is_concrete, jax.tree.leaves(given))):
        strain = attach_fixed_point(lambda strain: image(strain, given), strain)
    found = sliding(strain, given, throw)
    left = jax.lax.stop_gradient(jnp.abs(ratio * found.slope_in_contact / strain[0] - 1))
    # Written so that NaN fails.
    failed = ~(left <= strain_rtol)
    strain = jnp.where(failed, jnp.nan, strain[0])
    if throw:
        strain = eqx.error_if(
            strain, failed, "The strain amplitude did not converge. Raise `max_solves`."
        )
    return found, strain
