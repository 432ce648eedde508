"""Stiffness and conductance of a contact, each by one linear solve.

If the mean gap closes by -dū, the pressure changes by that of rigid punches in the shape of the
contact. The current between two conductors has the same distribution (J. R. Barber, Proc. R. Soc. A
459 (2003) 53, doi:10.1098/rspa.2002.1038), so

    M dσ + dū = 0 on the contact A,   dσ = 0 elsewhere,   mean dσ = dp

gives the stiffness -dp/dū with the kernel M of the block, and the conductance with (ϱ₁ + ϱ₂)/q.
Where a traction moves the surface, its change is part of M, or if it lags it is added to M dσ.

With a set of points as A both numbers would jump whenever a point joins. So a point with the share
f in contact rests on a spring of compliance c (1 - f)/f times that of the block near half the
Nyquist number (`edge_stiffness`). Here f is cut at 1/(1 + g/p) of the way to the next point, so
that the spring is a gap over a pressure. With c = 1 on a line and 0.8 on a plane, strips, spheres
and rough surfaces have the least errors (`bench_contact.py stiffness`). Within each spacing the
error varies: a derivative has a local error of about 30 %, and is right over several spacings.
"""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, ScalarLike

from ...contacts.adjoint import LinearSolver, LinearSplitting, opening_by_load
from ...contacts.area import contact_shares, edge_stiffness
from ...contacts.operators.operator import Steady, first_mode
from ...contacts.solver.abstract_solver import penalty_for
from ...core.checks import as_scalar, check_positive, check_type
from ...core.compilation import compiled
from ...fields.grid import wavenumber
from ..bodies import lags
from ..case import CONDUCTANCE, STIFFNESS, WINDOW
from ..formulas import edges_of, indicator_of, lift
from ..number import AbstractSliding, observable
from ..problem import SteadyProblem

_RTOL = 1e-8
_YIELDING = {1: 1.0, 2: 0.8}  # compliance of half a point over that of the block, by dimensions
# Parts of the error: the change from half as many points, and that by softer springs. With them 119
# of 124 claims held (`bench_contact.py stiffness`).
_FROM_HALF, _SOFTER = 0.75, 1.25
_LACKING = 8.0  # times the share of the squared slope in waves that half the grid lacks


def contact_stiffness(
    sliding: AbstractSliding,
    *,
    adjoint: LinearSolver = LinearSplitting(),  # noqa: B008 (immutable)
) -> Float[Array, ""]:
    """Returns -dp/dū [Pa/m], by which the mean pressure rises as the mean gap closes.

    The block acts as at the given velocity, at rest with its relaxed moduli; a traction that moves
    the surface follows the pressure. Laws other than the hard wall enter by their contact area.
    Differentiable.

    **Arguments:**

    - `sliding`: a contact on a periodic surface.
    - `adjoint`: the linear solver, see `LinearSplitting`.

    **Returns:** the stiffness of the whole surface per area; infinite in full contact.

    **Raises:** `ValueError` for a surface on a window.
    """
    _check(sliding)
    return _stiffness(sliding, adjoint)


def contact_stiffness_error(
    sliding: AbstractSliding,
    *,
    adjoint: LinearSolver = LinearSplitting(),  # noqa: B008 (immutable)
) -> Float[Array, ""]:
    """Returns the estimated error of `contact_stiffness` by the grid [Pa/m].

    3/4 of the change from half as many points (see `sliding/errors/neighbours.py`), plus the change
    by springs at the edges that are a quarter softer.

    **Arguments:**

    - `sliding`: a contact on a periodic surface.
    - `adjoint`: the linear solver.

    **Returns:** the error; that of `contact_conductance` is the same part of its number.

    **Raises:** `ValueError` for a surface on a window.
    """
    _check(sliding)
    near = sliding.near
    same, half = near.both(sliding)
    own, other = (_stiffness(s, adjoint) for s in (same, half))
    softer = _stiffness(same, adjoint, _SOFTER)
    missed = 1 + _LACKING * near.lacking
    return missed * (_FROM_HALF * jnp.abs(own - other) + jnp.abs(own - softer))


def contact_conductance(
    sliding: AbstractSliding,
    resistivity: ScalarLike,
    *,
    adjoint: LinearSolver = LinearSplitting(),  # noqa: B008 (immutable)
) -> Float[Array, ""]:
    """Returns the conductance of a contact between two half spaces, per area [S/m²].

    Current flows through the contact area only. For a homogeneous elastic block the result is
    2k/(E* ϱ), k being `contact_stiffness` (Barber's analogy).

    **Arguments:**

    - `sliding`: a contact on a periodic surface.
    - `resistivity`: ϱ, the sum of both bodies' resistivities [Ω m]. With the sum of 1/λ of their
      thermal conductivities [m K/W] the result is the thermal conductance [W/(m² K)].
    - `adjoint`: the linear solver.

    **Returns:** the current density over the drop of potential in excess of full contact.

    **Raises:** `ValueError` for a refused argument.
    """
    _check(sliding)
    resistivity = as_scalar(resistivity, "resistivity")
    check_positive("resistivity", resistivity, "[Ω m]")
    q = wavenumber(sliding.grid)
    kernel = resistivity / jnp.where(first_mode(q.shape), 1, q)
    return _stiffness(sliding, adjoint, kernel=kernel)


@observable("contact conductance times both resistivities", r"G\varrho", "1/m", needs=[CONDUCTANCE])
def specific_conductance(sliding: AbstractSliding) -> Float[Array, ""]:
    """`contact_conductance` times the sum of the resistivities of both bodies [1/m].

    Over the sum of 1/λ of their thermal conductivities it is the thermal conductance.
    """
    return contact_conductance(sliding, 1.0)


@observable("contact stiffness", "k", "Pa/m", needs=[STIFFNESS])
def stiffness(sliding: AbstractSliding) -> Float[Array, ""]:
    """-dp/dū [Pa/m], see `contact_stiffness`."""
    return contact_stiffness(sliding)


def _conductance_by_grid(sliding: AbstractSliding) -> Float[Array, ""]:
    """The same part of the conductance as that of the stiffness."""
    part = contact_stiffness_error(sliding) / contact_stiffness(sliding)
    return part * specific_conductance(sliding)


stiffness_error = stiffness.error({"grid": contact_stiffness_error})
specific_conductance_error = specific_conductance.error({"grid": _conductance_by_grid})


def _check(sliding: AbstractSliding) -> None:
    check_type("sliding", sliding, AbstractSliding)
    if WINDOW in sliding.facts or not isinstance(sliding.problem, SteadyProblem):
        raise ValueError("`sliding` must be steady sliding on a periodic surface.")


@compiled
def _stiffness(sliding: AbstractSliding, adjoint: LinearSolver, softness: float = 1.0, kernel=None):
    """The stiffness of the block under its traction, or with a kernel in the place of both."""
    follows = kernel is None and lags(sliding.coupling)
    operator = sliding.operator if kernel is None else Steady(kernel)
    indicator, edges = indicator_of(sliding), edges_of(sliding)
    share = contact_shares(indicator, edges, lambda ratio, _: 1 / (1 + ratio))
    penalty = penalty_for(operator, jnp.mean(share), sliding.law)
    stiffness = edge_stiffness(operator.kernel[None], sliding.grid)[1]
    yielding = softness * _YIELDING[share.ndim] / stiffness
    soft = penalty * yielding * (1 - share)
    # Points far from contact carry nothing; 0/0 would spoil the derivative.
    s = jnp.where(share > 0, share / jnp.where(share > 0, share + soft, 1), 0)
    rtol = jnp.asarray(_RTOL, share.dtype)

    def follow(pressure, gap):
        """The displacement under the change of the traction, times the penalty as the gap is."""
        at = sliding.pressure, sliding.gap
        return penalty * jax.jvp(partial(_lift_at, sliding), at, (pressure, gap / penalty))[1]

    by_load = opening_by_load(
        operator.scaled(penalty), s, adjoint, rtol, follow if follows else None
    )
    return -penalty / by_load


def _lift_at(sliding: AbstractSliding, pressure, gap):
    """The displacement under the traction that lags, at another pressure and gap."""
    contact = dataclasses.replace(sliding.contact, pressure=pressure, gap=gap)
    return lift(dataclasses.replace(sliding, contact=contact))
