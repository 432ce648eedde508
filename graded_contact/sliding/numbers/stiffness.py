"""Stiffness and conductance of a contact, each by one linear solve.

If the mean gap closes by -dū, the pressure changes as under rigid punches in the shape of the
contact. The current between two conductors has the same distribution (J. R. Barber, Proc. R. Soc. A
459 (2003) 53, doi:10.1098/rspa.2002.1038), so

    M dσ + dū = 0 on the contact A,   dσ = 0 elsewhere,   mean dσ = dp

gives the stiffness -dp/dū with the kernel M of the block, and the conductance with (ϱ₁ + ϱ₂)/q.
Where the traction of `Coulomb` moves the surface, it is part of M.

With a set of points as A both numbers would jump whenever a point joins. So a point with the share
f in contact rests on a spring of compliance c (1 - f)/f times the block's near half the
Nyquist number (`edge_stiffness`). Here f is cut at 1/(1 + g/p) of the way to the next point, so
that the spring is a gap over a pressure. With c = 1 on a line and 0.8 on a plane, strips, spheres
and rough surfaces have the least errors. Within each spacing the
error varies: a derivative has a local error of about 30 %, and is right over several spacings.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...contacts.adjoint import opening_by_load
from ...contacts.area import contact_shares, edge_stiffness
from ...contacts.operators.operator import Steady, first_mode
from ...core.compilation import compiled
from ...fields.grid import wavenumber
from ..case import CONDUCTANCE, STIFFNESS, WINDOW
from ..formulas import edges_of, indicator_of, shared
from ..number import Found, observable

_RTOL = 1e-8
_YIELDING = {1: 1.0, 2: 0.8}  # compliance of half a point over the block's, by dimensions
# Parts of the error: the changes from half as many points and by softer springs. With them 119
# of 124 claims held.
_FROM_HALF, _SOFTER = 0.75, 1.25
_LACKING = 8.0  # times the share of the squared slope in waves that half the grid lacks


@observable("contact stiffness", "Pa/m", needs=[STIFFNESS])
def contact_stiffness(found: Found) -> Float[Array, ""]:
    """-dp/dū [Pa/m], by which the mean pressure rises as the mean gap closes.

    It is per area of the whole surface; infinite in full contact. The block acts as at the given
    velocity, at rest with its relaxed moduli; a traction of `Coulomb` that moves the surface
    follows the pressure. Laws other than the hard wall enter by their contact area.
    """
    if found.coupling.lags:
        raise ValueError("A stiffness under coupled shear needs the law of `Coulomb`.")
    return _stiffness(_periodic(found))


@observable("contact conductance times both resistivities", "1/m", needs=[CONDUCTANCE])
def specific_conductance(found: Found) -> Float[Array, ""]:
    """Contact conductance of two half spaces times the sum of their resistivities [1/m].

    It is per area, and in excess of full contact. Current flows through the contact area only. Over
    the sum of both 1/λ [m K/W] it is the thermal conductance [W/(m² K)]. For a homogeneous elastic
    block it is 2k/E*, k being the `contact_stiffness` (Barber's analogy).
    """
    q = wavenumber(found.grid)
    return _stiffness(_periodic(found), kernel=1 / jnp.where(first_mode(q.shape), 1, q))


@shared
def _error_by_grid(found: Found) -> Float[Array, ""]:
    """The error of the stiffness by the grid [Pa/m].

    3/4 of the change from half as many points (see `sliding/errors/neighbours.py`), plus the change
    by springs at the edges that are a quarter softer.
    """
    near = found.near
    same, half = near.both(_periodic(found))
    own, other, softer = _stiffness(same), _stiffness(half), _stiffness(same, _SOFTER)
    missed = 1 + _LACKING * near.lacking
    return missed * (_FROM_HALF * jnp.abs(own - other) + jnp.abs(own - softer))


def _conductance_by_grid(found: Found) -> Float[Array, ""]:
    """The conductance has the same relative error as the stiffness."""
    return _error_by_grid(found) / _stiffness(found) * specific_conductance(found)


contact_stiffness_error = contact_stiffness.error({"grid": _error_by_grid})
specific_conductance_error = specific_conductance.error({"grid": _conductance_by_grid})


def _periodic(found: Found) -> Found:
    """The contact itself; raises `ValueError` unless its surface is periodic."""
    if WINDOW in found.facts:
        raise ValueError("A stiffness needs a periodic surface.")
    return found


def _cut(ratio: Array, ndim: int) -> Array:
    """The distance of the last point in contact from the edge at which the field is cut."""
    return 1 / (1 + ratio)


@compiled
def _stiffness(sliding: Found, softness: float = 1.0, kernel=None):
    """The stiffness of the block under its traction, or with a kernel in the place of both."""
    operator = sliding.operator if kernel is None else Steady(kernel)
    indicator, edges = indicator_of(sliding), edges_of(sliding)
    share = contact_shares(indicator, edges, _cut)
    penalty = operator.penalty_for(jnp.mean(share), sliding.law.steepest_rise)
    stiffness = edge_stiffness(operator.kernel[None], sliding.grid)[1]
    yielding = softness * _YIELDING[share.ndim] / stiffness
    soft = penalty * yielding * (1 - share)
    # Points far from contact carry nothing; 0/0 would spoil the derivative.
    s = jnp.where(share > 0, share / jnp.where(share > 0, share + soft, 1), 0)
    rtol = jnp.asarray(_RTOL, share.dtype)
    return -penalty / opening_by_load(operator.scaled(penalty), s, rtol)
