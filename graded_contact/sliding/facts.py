"""Facts of a contact: an observable that `needs` some is printed and stored where they hold."""

from ..kernels.window import has_ground
from .case import Case
from .shear import is_coupled

WINDOW = "window"  # the surface does not repeat
GROUND = "ground"  # the block of a window does not move far away
LOAD_FOLLOWS = "load follows"  # from a mean gap or an approach
GIVEN_LOAD = "given load"  # or a mean gap: the approach follows
SHEARED = "sheared"  # there is shear stress in the contact
COUPLED = "coupled"  # the shear stress moves the surface of the block
HEATED = "heated"
COUNTERFACE = "counterface"  # the body that carries the surface deforms
# Asked for by [observe] of a scene, whose keys these are. All contacts can compute them.
STIFFNESS, CONDUCTANCE, FLOW = "stiffness", "conductance", "flow"


def facts_of(case: Case) -> frozenset[str]:
    """Returns the facts of a case."""
    window = not case.rough.periodic
    known = {
        WINDOW: window,
        GROUND: window and all(has_ground(body, case.rough.grid) for body in case.bodies),
        LOAD_FOLLOWS: case.prescribed != "pressure",
        GIVEN_LOAD: case.prescribed != "approach",
        SHEARED: case.shear is not None,
        COUPLED: is_coupled(case.shear),
        HEATED: case.heating is not None,
        COUNTERFACE: case.counterface is not None,
    }
    return frozenset(fact for fact, holds in known.items() if holds)
