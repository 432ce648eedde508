"""Numbers that only a transient motion has; all are recorded step by step."""

from jaxtyping import Array

from ...core.quantities import FOUR, of_transient
from ..facts import SHEARED
from ..result import TransientSliding


@of_transient("W", "J/m²", "work of friction so far", over_time=True, column=("work\n[J/m²]", FOUR))
def work_done(found: TransientSliding) -> Array:
    """Work of friction per area since t = 0 [J/m²], that of shear included."""
    return found.recorded["work_done"]


@of_transient(r"W_\sigma", "J/m²", "work of the load so far", over_time=True)
def load_work_done(found: TransientSliding) -> Array:
    """Work of the load on the block per area since t = 0 [J/m²].

    The sum of both, less the work of shear, is stored and dissipated in the block. How much is
    stored does not follow from the response: bodies of equal response may store different parts.
    What an unloading gives back shows how much of it was free.
    """
    return found.recorded["load_work_done"]


@of_transient(
    r"W_\mathrm{shear}", "J/m²", "work of shear in the contact so far", over_time=True,
    needs=[SHEARED],
)  # fmt: skip
def shear_work_done(found: TransientSliding) -> Array:
    """The part of `work_done` by shear in the contact [J/m²]."""
    return found.recorded["shear_work_done"]
