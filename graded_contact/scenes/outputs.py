"""The tables [observe] and [output]: optional outputs, and the fields to store."""

import dataclasses
from typing import Literal

from ..core.checks import check_type, check_whole
from ..core.display import shown


@shown("asked", unset=False)
@dataclasses.dataclass(frozen=True)
class Observe:
    """Optional outputs, off by default because they take longer.

    **Fields:**

    - `stiffness`: true for the contact stiffness [Pa/m].
    - `conductance`: true for the conductance of the contact between two half spaces, times the sum
      of their resistivities [1/m]. Over the sum of 1/λ it is the thermal conductance.
    - `flow`: true for the conductance of the gap for a thin fluid along x and along y [m³].
    - `tension`, `von_mises`: true for the largest principal stress and the largest von Mises stress
      in the block [Pa], with their depths [m]: at the surface, at a quarter, half and all of each
      layer, and just below it; of the points of the grid, without an error.
    - `interface_shear`: true for the largest shear stress between layers [Pa], with its depth.
    """

    stiffness: bool = False
    conductance: bool = False
    flow: bool = False
    tension: bool = False
    von_mises: bool = False
    interface_shear: bool = False

    def __post_init__(self):
        for name, value in vars(self).items():
            check_type(name, value, bool)

    @property
    def asked(self) -> tuple[str, ...]:
        """The names of the outputs that are true."""
        return tuple(name for name, value in vars(self).items() if value)


@dataclasses.dataclass(frozen=True)
class Output:
    """The fields that are stored beside the numbers.

    **Fields:**

    - `fields`: solves whose fields over the surface are stored: "last", "every" or "none".
    - `frames`: number of times of a transient motion with fields, and with a flow or leakage: after
      equal numbers of steps, with the first and the last.
    """

    fields: Literal["last", "every"] | None = "last"
    frames: int = 8

    def __post_init__(self):
        check_type("fields", self.fields, "last", "every", type(None))
        check_whole("frames", self.frames, 1)
