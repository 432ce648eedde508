"""Numbers that only a transient motion has; all are recorded step by step."""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..case import SHEARED
from ..formulas import lengths
from ..number import Found, observable


@observable("work of friction so far", "J/m²")
def work_done(found: Found) -> Array:
    """Work of friction per area since t = 0 [J/m²], with the work of shear."""
    return found.recorded["work_done"]


@observable("work of the load so far", "J/m²")
def load_work_done(found: Found) -> Array:
    """Work of the load on the block per area since t = 0 [J/m²].

    The sum of both, less the work of shear, is stored and dissipated in the block. How much is
    stored does not follow from the response: bodies of equal response may store different parts.
    What an unloading gives back shows how much of it was free.
    """
    return found.recorded["load_work_done"]


@observable("work of shear in the contact so far", "J/m²", needs=[SHEARED])
def shear_work_done(found: Found) -> Array:
    """The part of `work_done` by shear in the contact [J/m²]."""
    return found.recorded["shear_work_done"]


@observable("time since the last start or stop", "s")
def time_since_change(found: Found) -> Array:
    """Time since the surface last started or stopped [s]; before that since t = 0."""
    steps, way = found.problem.steps
    ends, moves = found.times, lengths(way) > 0
    changes = jnp.append(False, moves[1:] != moves[:-1])
    return ends - jax.lax.cummax(jnp.where(changes, ends - steps, 0))


@observable("time from the last start or stop to the largest friction", "s")
def time_to_peak(found: Found) -> Array:
    """Time from the last start or stop of the surface to the largest friction [s]; NaN at rest."""
    sizes = lengths(found.recorded["friction"].reshape(len(found.times), -1))
    peak = jnp.argmax(jnp.where(found.recorded["load"] > 0, sizes, -1))
    moves = jnp.any(found.problem.steps[1] != 0)
    return jnp.where(moves, time_since_change(found)[peak], jnp.nan)
