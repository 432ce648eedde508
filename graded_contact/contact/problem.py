"""Contact of a rough rigid surface pressed on a solid by a mean pressure.

Find σ >= 0 and u = w - h + ū >= 0 with σ u = 0 and mean σ given, where the displacement is
w = M σ mode by mode: M is the kernel, w and h count into the solid, and ū is whatever constant
makes it so.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import (
    Numbers,
    as_float,
    check_positive,
    check_shape,
    check_tolerance,
    check_values,
    is_concrete,
)
from ..grid import half_shape, to_field, to_spectrum
from .douglas_rachford import ERROR_PER_RESIDUAL, DouglasRachford
from .implicit import attach_gradient
from .law import HardWall


class RESULTS(eqx.Enumeration):
    """How a solve ended."""

    successful = ""
    max_steps_reached = (
        "The contact solver reached `max_steps` before `rtol`. Raise `max_steps` "
        "(`solver=DouglasRachford(max_steps=...)`), loosen `rtol`, or pass `throw=False` to "
        "get the partial result."
    )
    not_finite = (
        "The contact solver met a value that is not finite. Check the kernel (a negative "
        "thickness or modulus under `jit` ends here), the heights and the pressure; in float32, "
        "enable `jax_enable_x64`."
    )
    bad_pressure = "The mean pressure is not positive, so there is no contact to solve."


class ContactSolution(eqx.Module):
    """Pressure and gap of a contact, and how well they were found.

    **Fields:**

    - `pressure`: σ [Pa], >= 0, its mean exactly the load. Shape of the heights.
    - `displacement`: w [m], of zero mean, positive into the solid.
    - `gap`: u [m], zero in contact up to the error.
    - `mean_gap`: mean of the gap [m].
    - `error`: estimated relative error of the pressure [1] (root mean square).
    - `complementarity_error`: mean of σ|u| over the load and the rms height [1].
    - `penetration`: largest interpenetration -min(u, 0) over the rms height [1].
    - `num_steps`: iterations on the full grid.
    - `num_fft_pairs`: transforms spent (forward and back), coarse grids counted by their size.
    - `result`: a member of `RESULTS`.
    """

    pressure: Float[Array, "*shape"]
    displacement: Float[Array, "*shape"]
    gap: Float[Array, "*shape"]
    mean_gap: Float[Array, ""]
    error: Float[Array, ""]
    complementarity_error: Float[Array, ""]
    penetration: Float[Array, ""]
    num_steps: Array
    num_fft_pairs: Float[Array, ""]
    result: RESULTS


def solve_contact(
    kernel: Numbers,
    heights: Numbers,
    pressure: Numbers,
    *,
    law: HardWall = HardWall(),  # noqa: B008 (immutable)
    solver: DouglasRachford = DouglasRachford(),  # noqa: B008
    rtol: float = 1e-6,
    start: Numbers | None = None,
    throw: bool = True,
) -> ContactSolution:
    """Returns the contact of a rough surface with a solid under a mean pressure.

    Differentiable in `kernel`, `heights` and `pressure` (forward and reverse, one linear solve;
    see `contact/implicit.py` for where the derivative is one-sided), and works under `jit` and
    `vmap`; a batch runs until its slowest member has converged.

    **Arguments:**

    - `kernel`: M(q) [m/Pa] on the half spectrum of the heights, real or complex, Re M > 0; the
      q = 0 entry is ignored. See `stack_kernel`.
    - `heights`: h [m], positive into the solid, shape `(nx, ny)` or `(nx,)`; the mean is ignored.
    - `pressure`: mean pressure σ0 [Pa], positive.
    - `law`: of contact.
    - `solver`: algorithm and its limits.
    - `rtol`: wanted relative error of the pressure [1].
    - `start`: a pressure field [Pa] to start from, such as a neighbouring solution.
    - `throw`: whether to raise if the solver fails; otherwise look at `.result`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if the solve fails.
    """
    heights, load = as_float(heights), as_float(pressure)
    kernel = jnp.asarray(kernel)
    if heights.ndim not in (1, 2):
        raise ValueError(f"`heights` has shape {heights.shape}; one or two axes are needed.")
    check_values("heights", heights, "heights [m] must be finite")
    check_shape("kernel", kernel, half_shape(heights.shape))
    if is_concrete(kernel):
        real = kernel.real.at[(0,) * kernel.ndim].set(1)
        check_positive("kernel.real", real, "[m/Pa] for every q but 0")
        check_values("kernel.imag", kernel.imag, "it must be finite")
    check_shape("pressure", load, ())
    check_positive("pressure", load, "[Pa]")
    if start is not None:
        start = as_float(start)
        check_shape("start", start, heights.shape)
        check_values("start", start, "pressures [Pa] must be finite and not negative", at_least=0)
        if is_concrete(start) and not bool(jnp.any(start > 0)):
            raise ValueError("`start` is zero everywhere: it must be a pressure field [Pa].")
    check_tolerance("rtol", rtol, heights)
    solution = _solve_contact(kernel, heights, load, law, solver, jnp.asarray(rtol), start)
    if throw:
        solution = solution.result.error_if(solution, solution.result != RESULTS.successful)
    return solution


@eqx.filter_jit
def _solve_contact(kernel, heights, load, law, solver, rtol, start) -> ContactSolution:
    rtol = rtol.astype(heights.dtype)
    found = solver.solve(
        *jax.lax.stop_gradient((kernel, heights, load)), law, rtol, jax.lax.stop_gradient(start)
    )
    found = jax.lax.stop_gradient(found)
    pressure = attach_gradient(
        found.pressure * jax.lax.stop_gradient(load),
        kernel,
        heights,
        load,
        law.in_contact(found.pressure),
        jax.tree_util.Partial(DouglasRachford.solve_linear, solver, rtol),
    )
    displacement = to_field(kernel * to_spectrum(pressure), heights.shape)
    displacement = displacement - jnp.mean(displacement)
    gap = displacement - (heights - jnp.mean(heights))
    gap = gap - jnp.mean(pressure * gap) / jnp.mean(pressure)
    error, rms = ERROR_PER_RESIDUAL * found.residual, jnp.std(heights)
    unit = jnp.where(rms > 0, rms, 1)
    finite = jnp.isfinite(error) & jnp.all(jnp.isfinite(found.pressure))
    result = RESULTS.where(
        finite,
        RESULTS.where(error <= rtol, RESULTS.successful, RESULTS.max_steps_reached),
        RESULTS.not_finite,
    )
    # At the door the value is unknown if the pressure is traced.
    result = RESULTS.where(load > 0, result, RESULTS.bad_pressure)
    return ContactSolution(
        pressure=pressure,
        displacement=displacement,
        gap=gap,
        mean_gap=jnp.mean(gap),
        error=error,
        complementarity_error=jnp.mean(pressure * jnp.abs(gap)) / (load * unit),
        penetration=jnp.max(jnp.maximum(-gap, 0)) / unit,
        num_steps=found.num_steps,
        num_fft_pairs=found.num_fft_pairs + 1,
        result=result,
    )
