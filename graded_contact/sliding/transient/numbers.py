"""Numbers that only a transient motion has; all are recorded step by step."""

from jaxtyping import Array

from ..case import SHEARED
from ..number import Found, observable


@observable("work of friction so far", "W", "J/m²")
def work_done(found: Found) -> Array:
    """Work of friction per area since t = 0 [J/m²], that of shear included."""
    return found.recorded["work_done"]


@observable("work of the load so far", r"W_\sigma", "J/m²")
def load_work_done(found: Found) -> Array:
    """Work of the load on the block per area since t = 0 [J/m²].

    The sum of both, less the work of shear, is stored and dissipated in the block. How much is
    stored does not follow from the response: bodies of equal response may store different parts.
    What an unloading gives back shows how much of it was free.
    """
    return found.recorded["load_work_done"]


@observable("work of shear in the contact so far", r"W_\mathrm{shear}", "J/m²", needs=[SHEARED])
def shear_work_done(found: Found) -> Array:
    """The part of `work_done` by shear in the contact [J/m²]."""
    return found.recorded["shear_work_done"]
