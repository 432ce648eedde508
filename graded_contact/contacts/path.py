"""Contact along a path of loads or gaps: each solution is the start of the next."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..core.checks import Numbers, as_float, check_types, check_values
from ..core.compilation import alone, compiled
from ..core.derivative import still
from ..core.display import shown
from .adjoint import LinearSolver, LinearSplitting
from .law import AbstractLaw, check_pressure
from .solution import RESULTS, ContactSolution, has_failed
from .solve import solve_contact
from .solver.abstract_solver import AbstractContactSolver
from .solver.nested_solve import DouglasRachford


@shown()
class ContactPath(eqx.Module):
    """Contacts along a path, in its order.

    **Fields:**

    - `mean_gap`, `mean_pressure`: [m], [Pa], shape `(steps,)`.
    - `contact_area`: fraction of points in contact [1], shape `(steps,)`.
    - `unloading`: whether the surfaces were moving apart, shape `(steps,)`. The path begins with
      open surfaces.
    - `num_fft_pairs`, `result`: of each solve [1], shape `(steps,)`; `result == RESULTS.successful`
      is an array.
    - `last`: the last contact.
    """

    mean_gap: Float[Array, " steps"]
    mean_pressure: Float[Array, " steps"]
    contact_area: Float[Array, " steps"]
    unloading: Bool[Array, " steps"]
    num_fft_pairs: Float[Array, " steps"]
    result: RESULTS
    last: ContactSolution


@check_types
def follow_contact(
    kernel: Numbers,
    heights: Numbers,
    pressure: Numbers | None = None,
    *,
    mean_gap: Numbers | None = None,
    approach: Numbers | None = None,
    law: AbstractLaw,
    solver: AbstractContactSolver = DouglasRachford(),  # noqa: B008 (immutable)
    adjoint: LinearSolver = LinearSplitting(),  # noqa: B008
    rtol: float | None = None,
    throw: bool = True,
) -> ContactPath:
    """Returns the contacts along a path of mean pressures, mean gaps or approaches.

    With a law that attracts, a contact depends on its history. Let a path of gaps begin where the
    surfaces do not touch, close and open again. With small steps it follows the loading branch
    through the snap into contact, and the unloading branch through the snap out of contact. At a
    jump it continues with the state that the solver finds. Prefer gaps to pressures: at a given
    load the whole surface is unstable where the pressure rises with the gap.

    Differentiable and usable under `jit`, as `solve_contact`.

    **Arguments:**

    - `pressure` [Pa], `mean_gap` [m] or, on a window, `approach` [m]: the path, shape `(steps,)`.
    - `solver`: if a grid does not resolve the attraction, `ResidualDynamics()` finds stable states.
    - the others: as in `solve_contact`.

    **Returns:** means, areas and ends of all contacts and the whole of the last, see `ContactPath`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if a solve fails.
    """
    given = {"pressure": pressure, "mean_gap": mean_gap, "approach": approach}
    given = {name: path for name, path in given.items() if path is not None}
    if len(given) != 1:
        raise ValueError("Give exactly one of `pressure`, `mean_gap` and `approach`.")
    [(name, path)] = given.items()
    targets = as_float(path, name)
    if targets.ndim != 1 or len(targets) == 0:
        raise ValueError(f"`{name}` has shape {targets.shape}; a path of numbers is needed.")
    if name == "pressure":  # inside the loop its values are traced
        check_pressure(targets, law)
    else:
        check_values(name, targets, "numbers [m] must be finite")
    how: Any = dict(law=law, solver=solver, adjoint=adjoint, rtol=rtol, throw=throw)

    def advance(last, target):
        # Surfaces that parted are open.
        start = None if last is None else jnp.where(has_failed(last.result), 0, last.pressure)
        contact = solve_contact(kernel, heights, **{name: target}, start=start, **how)
        means = contact.mean_gap, contact.mean_pressure
        return contact, (*means, _area(law, contact), contact.num_fft_pairs, contact.result)

    last, begun = advance(None, targets[0])
    # Outside `jit` the programs of one contact serve all.
    if alone(still((kernel, heights, law, targets))):
        rows = [begun]
        for target in targets[1:]:
            last, row = advance(last, target)
            rows.append(row)
        rows = _stacked(rows)
    else:
        last, rest = jax.lax.scan(advance, last, targets[1:])
        rows = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), begun, rest)
    gaps, pressures, areas, pairs, result = rows
    falling = jnp.diff(targets) < 0
    unloading = jnp.concatenate([jnp.zeros(1, bool), falling if mean_gap is None else ~falling])
    return ContactPath(gaps, pressures, areas, unloading, pairs, result, last)


@compiled
def _area(law: AbstractLaw, contact: ContactSolution):
    touching = law.contact_indicator(contact.pressure, contact.gap, 1.0) > 0
    return jnp.mean(touching, dtype=contact.gap.dtype)


@compiled
def _stacked(rows):
    return jax.tree.map(lambda *row: jnp.stack(row), *rows)
