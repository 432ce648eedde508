"""The contact solution: pressure, gap, their errors, and how the solve ended.

A solve that failed, see `FAILURES`, has no numbers: they are NaN, and so are all its observables.
A solve that did not converge has partial results.
"""

import dataclasses
import functools
import operator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..core.display import shown
from .operators.operator import Field, Scalar


class RESULTS(eqx.Enumeration):
    """How a solve ended."""

    successful = "successful"
    max_steps_reached = (
        "The contact solver reached `max_steps` before `rtol`. Raise `max_steps` of the solver or "
        "loosen `rtol`; at a mean gap near full contact, prescribe `pressure`; "
        "under an attraction that does not hold the load, prescribe `mean_gap` (`approach`)."
    )
    rounding = (
        "Rounding hides the remaining error, which may be more than `rtol`. Loosen `rtol`; in "
        "float32, enable `jax_enable_x64`."
    )
    not_finite = (
        "The solve failed: the kernel, the heights, the pressure or the approach is not finite or "
        "too large (a negative thickness, modulus or shear, a liquid (`equilibrium=0`) at rest, "
        "heat that grows without end, times that do not ascend). In float32, enable "
        "`jax_enable_x64`."
    )
    unresolved = (
        "The attraction of the law rises too steeply for the grid: the computed equilibrium may be "
        "unstable. Refine the grid until its shortest wave is three times as stiff as the "
        "attraction rises, or in Python use `solver=ResidualDynamics()`."
    )
    inaccurate_kernel = (
        "The kernel of the block did not reach its tolerance: the profile of a graded layer varies "
        "too sharply. Put boundaries between layers at its jumps and list its kinks in `breaks`."
    )
    gap_unresolved = (
        "Pressure, friction and contact area have converged, but gaps may be wrong by more than a "
        "tenth of the rms height. Tighten `rtol`, or do not use gaps and displacements."
    )
    not_settled = (
        "The temperatures of the contact, the traction that moves its surface, or in a cycle the "
        "memory of the counterface did not settle. A block whose losses change fast with "
        "temperature may have several temperatures, and one whose stiffness a traction outweighs "
        "has no steady state: lower the shear, with `heating` also the velocity, to a half or a "
        "tenth. Another `rtol` does not help."
    )
    too_hot = (
        "No steady temperature of the contact was found up to the highest that materials can have: "
        "friction makes more heat than flows away. Lower the velocity, the load or the shear, or "
        "raise the conductivities in `heating`."
    )
    not_positive = (
        "The contact solver did not converge. The real part of the kernel is not positive at some "
        "wavelength: a modulus is negative, or a traction of friction outweighs the stiffness of "
        "the block. There the splitting may not converge, although a contact may exist. With "
        "friction, lower the `coefficient` of `shear`, pass `coupled=False`, or give a `start`."
    )
    bad_pressure = "The law of contact cannot have this mean pressure (a hard wall: not positive)."


ROUNDING = 10  # of the precision

# After these ends no number means anything.
FAILURES = (
    RESULTS.not_finite, RESULTS.inaccurate_kernel, RESULTS.not_positive,
    RESULTS.bad_pressure,
)  # fmt: skip


def has_failed(result: RESULTS) -> Bool[Array, "..."]:
    """Returns whether a solve has no numbers."""
    return functools.reduce(operator.or_, (result == end for end in FAILURES))


def if_known(result: RESULTS, numbers: Any) -> Any:
    """Returns a tree whose numbers, and their derivatives, are NaN if the solve has failed."""
    known = jnp.where(has_failed(result), jnp.nan, 1)
    times = lambda leaf: leaf * known.astype(leaf.dtype) if eqx.is_inexact_array(leaf) else leaf  # noqa: E731
    return jax.tree.map(times, numbers)


def ended(contact: "ContactSolution", good: Any, end: RESULTS) -> "ContactSolution":
    """Returns a contact with another end unless it is `good`; a failure stays a failure."""
    fails = end in FAILURES
    stays = good if fails else good | has_failed(contact.result)
    result = RESULTS.where(stays, contact.result, end)
    return dataclasses.replace(if_known(result, contact) if fails else contact, result=result)


@shown()
class ContactSolution(eqx.Module):
    """Pressure and gap of a contact, and their errors.

    **Fields:**

    - `pressure`: σ [Pa], of the law; its mean is exactly the load, if that was prescribed. Shape of
      the heights.
    - `displacement`: w [m], of zero mean, positive into the solid: M σ, but without the rest of
      the error of σ in the soft waves, which would magnify it.
    - `gap`: u = w - h + ū [m], zero in hard contact up to the error.
    - `mean_pressure`: mean of σ [Pa].
    - `mean_gap`: mean of the gap ū [m], counted as 0 where the body flows (`hardness`); prescribe
      the mean of `gap`, which is below 0 there. Of a periodic motion one for each time.
    - `correction`: estimated change of the pressure to the exact contact [Pa], see
      `contacts/estimates.py`. Without a derivative.
    - `error`: estimated relative error of the pressure [1] (root mean square); 0 where there is no
      pressure. Under a law that attracts it may exceed `rtol` two or three times, near a jump more.
    - `gap_error`: estimated error of the gap (root mean square) over the rms height [1];
      `displacement` and `mean_gap` have no larger errors.
    - `num_steps`: iterations on the full grid.
    - `num_fft_pairs`: transforms spent, forward and back [1]; coarse grids counted by their size.
    - `result`: a member of `RESULTS`.
    """

    pressure: Field
    displacement: Field
    gap: Field
    mean_pressure: Scalar
    mean_gap: Float[Array, "..."]
    correction: Field
    error: Scalar
    gap_error: Scalar
    num_steps: Array
    num_fft_pairs: Scalar
    result: RESULTS

    @property
    def noise(self) -> dict[str, float]:
        """The size of rounding by the unit of a number: prints show less as 0.

        The heights, the pressures and 1 are the scales.
        """
        if np.ndim(self.error):
            return {}
        displacement, gap, pressure = map(np.asarray, (self.displacement, self.gap, self.pressure))
        heights = displacement - gap
        eps = ROUNDING * np.finfo(heights.dtype).eps
        scales = {"m": np.std(heights), "Pa": np.mean(np.abs(pressure)), "1": 1.0}
        return {unit: float(eps * scale) for unit, scale in scales.items()}

    @property
    def state(self) -> str:
        """A remark on all numbers, for prints; empty for a batch, whose solves end differently."""
        if np.ndim(self.error) or self.result == RESULTS.successful:
            return ""
        failed = bool(has_failed(self.result))
        return "failed: no numbers" if failed else "not converged: partial results"
