"""By what a block is judged, and the limits that a design keeps."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import Stack
from ..core.checks import check_positive, check_values, within
from ..core.derivative import largest
from ..core.display import shown, unit_of
from ..core.quantities import CYCLE
from ..response.compliance import effective_modulus
from ..sliding.interior.heat_source import as_depths
from ..sliding.interior.stress import STRESSES

Criteria = Mapping[str, Float[Array, " velocities"]]  # criteria of a block, by name


class Criterion(NamedTuple):
    """A number of a block at a velocity: objectives, limits and the report take it by its name.

    **Fields:**

    - `words`, `unit`: what it is.
    - `label`: its name in a table, without its unit.
    - `of_contact`: gives it from a `Sliding` or a `CyclicSliding`, its block, and the depths of
      `Limits`; of a stress, with the depth at which it acts.
    - `in_mean_field`: whether a `MeanField` has it, by the same name.
    - `at_most`: no block has more.
    - `of_a_cycle`: whether only a motion in time has it.
    - `of_stress`: whether it is a stress in the block, which steady sliding has.
    """

    words: str
    label: str
    unit: str
    of_contact: Callable[..., Any]
    in_mean_field: bool = False
    at_most: float = np.inf
    of_a_cycle: bool = False
    of_stress: bool = False

    def shown_in(self, size: float) -> tuple[str, float]:
        """The unit in which numbers up to `size` are printed, such as MPa, and its reciprocal."""
        return ("1", 1.0) if self.unit == "1" else unit_of(self.unit, size)


# Of a cycle the mean over the times, or the highest pressure of all times.
CRITERIA = {
    "friction": Criterion(
        "friction coefficient", "friction", "1",
        lambda found, *_: found.mean_friction if found.kind == CYCLE else found.friction,
        in_mean_field=True,
    ),
    "contact_area": Criterion(
        "fraction of the nominal area in contact", "contact area", "1",
        lambda found, *_: jnp.mean(found.contact_area), in_mean_field=True, at_most=1,
    ),
    "mean_gap": Criterion(
        "mean gap", "mean gap", "m", lambda found, *_: jnp.mean(found.mean_gap)
    ),
    "peak_pressure": Criterion(
        "highest contact pressure of the surface", "peak pressure", "Pa",
        lambda found, *_: largest(found.pressure),
    ),
    "peak_over_mean": Criterion(
        "peak over mean friction of a cycle", "peak over mean", "1",
        lambda found, *_: found.peak_friction / found.mean_friction, of_a_cycle=True,
    ),
    "tension": Criterion(
        "largest principal stress in the block", "tension", "Pa",
        STRESSES["tension"], of_stress=True,
    ),
    "von_mises": Criterion(
        "largest von Mises stress in the block", "von Mises stress", "Pa",
        STRESSES["von_mises"], of_stress=True,
    ),
    "interface_shear": Criterion(
        "largest shear stress between layers", "interface shear", "Pa",
        STRESSES["interface_shear"], of_stress=True,
    ),
}  # fmt: skip
BY_MEAN_FIELD = tuple(name for name, criterion in CRITERIA.items() if criterion.in_mean_field)
# The keys of [design.limits].
LIMIT_KEYS = {f"{end}_{name}": (name, end) for name in CRITERIA for end in ("min", "max")}
THICKNESS, MODULUS = "all layers [m]", "|effective modulus| [Pa]"


class CriterionLimit(NamedTuple):
    """The least ("min") or the largest ("max") value of a criterion, at each velocity."""

    criterion: str
    end: str
    value: float

    @property
    def words(self) -> str:
        """Whether it is the least or the largest, and its number with its unit."""
        unit, factor = CRITERIA[self.criterion].shown_in(self.value)
        number = f"{factor * self.value:g} {unit}".removesuffix(" 1")
        return f"{'at most' if self.end == 'max' else 'at least'} {number}"

    def margins(self, values: Any) -> Any:
        """Returns how far values are inside, relative to the limit; negative beyond it."""
        room = values / self.value - 1
        return -room if self.end == "max" else room


@shown()
@dataclasses.dataclass(frozen=True)
class Stiffness:
    """Keeps |effective_modulus| at a wave within a fraction of that of the scene's own block.

    **Fields:**

    - `q`: wavenumber [rad/m].
    - `omega`: angular frequency [rad/s].
    - `within`: fraction [1].
    """

    q: float
    omega: float
    within: float

    def __post_init__(self):
        check_positive("q", self.q, "[rad/m]")
        check_values("omega", self.omega, "a frequency [rad/s] is not negative", at_least=0)
        check_positive("within", self.within, "[1]")


@shown("of_criteria", "stiffness", "total_thickness", "stress_depths", unset=False)
@dataclasses.dataclass(frozen=True)
class Limits:
    """All limits of a design.

    **Fields:**

    - `limits`: least and largest values, each at every velocity. With several surfaces they hold
      for the mean over these; with [motion] for the mean over the times, but of the pressure for
      the highest of all times.
    - `stiffness`: keeps |effective_modulus| at a wave within a fraction of the scene's own block;
      a material that softens has its own amplitude there.
    - `total_thickness`: at most, of all layers [m].
    - `stress_depths`: where tension and von Mises stress are limited [m]; by default the surface,
      and in each layer a quarter, half and all of its thickness, and just below it.
    """

    limits: dict[Annotated[str, *LIMIT_KEYS], float] = dataclasses.field(default_factory=dict)
    stiffness: Stiffness | None = None
    total_thickness: float | None = None
    stress_depths: list[float] | None = None

    def __post_init__(self):
        if self.stress_depths is not None:
            with within("`stress_depths`:"):
                as_depths(self.stress_depths)
        with within("[design.limits]"):
            for criterion, end, value in self:
                about, name = CRITERIA[criterion], f"{end}_{criterion}"
                check_positive(name, value, f"[{about.unit}]")
                check_values(name, value, about.words, at_most=about.at_most)
            for low, high in pairwise(self):
                if low.criterion == high.criterion and low.value > high.value:
                    ends = (f"`{end}_{name}` = {value:g}" for name, end, value in (low, high))
                    raise ValueError(" is larger than ".join(ends))
        if self.total_thickness is not None:
            check_positive("total_thickness", self.total_thickness, "[m]")

    @property
    def of_criteria(self) -> dict[str, str]:
        """The limits of criteria in words."""
        return {
            CRITERIA[name].label: " and ".join(limit.words for limit in self if limit[0] == name)
            for name in dict.fromkeys(limit.criterion for limit in self)
        }

    def __iter__(self) -> Iterator[CriterionLimit]:
        """Yields the limits of criteria, in one order for all files."""
        given = (name for name in LIMIT_KEYS if name in self.limits)
        yield from (CriterionLimit(*LIMIT_KEYS[name], self.limits[name]) for name in given)

    def margins(self, found: Criteria, velocities: np.ndarray) -> dict[str, Float[Array, ""]]:
        """Returns the margin of each limit whose criterion is in `found`, relative, by its name."""
        margins = {}
        for limit in self:
            name = f"{CRITERIA[limit.criterion].label} of {limit.words}"
            for i, v in enumerate(velocities if limit.criterion in found else ()):
                at = f" at {v:g} m/s" if len(velocities) > 1 else ""
                margins[name + at] = limit.margins(found[limit.criterion][i])
        return margins

    def of_block(self, stack: Stack) -> dict[str, Float[Array, ""]]:
        """Returns what is limited of a block alone, by name."""
        found, wave = {}, self.stiffness
        if self.total_thickness is not None:
            layers = (layer.thickness for layer in stack.layers)
            found[THICKNESS] = sum(layers, start=jnp.zeros(()))
        if wave is not None:
            found[MODULUS] = jnp.abs(effective_modulus(stack, wave.q, wave.omega))
        return found

    def block_margins(self, own: Stack, stack: Stack) -> dict[str, Float[Array, ""]]:
        """Returns the margins of a stack, relative to the block of the scene, `own`, by name."""
        margins, found, most = {}, self.of_block(stack), self.total_thickness
        if self.stiffness is not None:
            # Two one-sided limits, relative as `minimise` wants them.
            change, within = found[MODULUS] / self.of_block(own)[MODULUS] - 1, self.stiffness.within
            percent = f"by at most {100 * within:.3g} %"
            margins[f"stiffness higher {percent}"] = within - change
            margins[f"stiffness lower {percent}"] = within + change
        if most is not None:
            margins[f"total thickness of at most {most:g} m"] = 1 - found[THICKNESS] / most
        return margins
