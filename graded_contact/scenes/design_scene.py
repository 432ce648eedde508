"""Scenes that design their block, as the table [design] of a TOML file describes it.

The mean field searches, in milliseconds. The contact solver goes on from there if the mean field
does not have what is asked for or is not exact enough, verifies the design on surfaces that the
search has not seen, and polishes it on others. A design takes a scene (`scenes/scene.py`) with one
pressure, `direction` 0 and positive velocities.
"""

import dataclasses
import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from ..core.checks import check_poisson, check_positive, check_values, check_whole, within
from ..core.display import shown
from ..core.files import read_utf8
from ..core.parameters import with_values
from ..fields.grid import Grid
from ..surfaces.spectrum import SelfAffine
from ..surfaces.surface import Surface
from .scene import Scene
from .scene_checks import check_paths, refuse_tables
from .scene_file import parse_scene
from .schema import TableReader
from .surface_source import RandomSurface
from .toml import MOST_BYTES, parse_toml

Objective = Literal[
    "maximise_friction", "minimise_friction", "maximise_contact_area", "minimise_contact_area",
    "maximise_friction_ratio", "minimise_friction_ratio", "maximise_peak_over_mean",
    "minimise_peak_over_mean", "friction", "flat_loss_tangent",
]  # fmt: skip
# What limits are of, with units.
LIMITED = {"friction": "[1]", "contact_area": "[1]", "mean_gap": "[m]", "peak_pressure": "[Pa]"}
# The keys that belong to one objective only.
OBJECTIVES = {"friction": ("target", "ratio"), "flat_loss_tangent": ("q_from", "q_to")}


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


@shown()
@dataclasses.dataclass(frozen=True)
class Limits:
    """Least and largest values that a design may have, at each velocity.

    With several surfaces a limit holds for their mean; with [motion] for the mean over the times,
    but of the pressure for the highest of all times.

    **Fields:**

    - `min_friction`, `max_friction`: friction coefficient [1].
    - `min_contact_area`, `max_contact_area`: fraction of the nominal area in contact [1].
    - `min_mean_gap`, `max_mean_gap`: mean gap [m].
    - `min_peak_pressure`, `max_peak_pressure`: highest contact pressure of the surface [Pa].
    """

    min_friction: float | None = None
    max_friction: float | None = None
    min_contact_area: float | None = None
    max_contact_area: float | None = None
    min_mean_gap: float | None = None
    max_mean_gap: float | None = None
    min_peak_pressure: float | None = None
    max_peak_pressure: float | None = None

    def __post_init__(self):
        for quantity, end, value in self:
            check_positive(f"{end}_{quantity}", value, LIMITED[quantity])
            if quantity == "contact_area":
                check_values(f"{end}_contact_area", value, "a fraction is at most 1", at_most=1)
        for (name, *_, low), (other, *_, high) in itertools.pairwise(self):
            if name == other and low > high:
                raise ValueError(f"`min_{name}` = {low:g} is larger than `max_{name}` = {high:g}.")

    def __iter__(self) -> Iterator[tuple[str, str, float]]:
        """Yields the quantity, "min" or "max", and the value of each limit that is given."""
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is not None:
                end, _, quantity = field.name.partition("_")
                yield quantity, end, value


@shown(
    "scene", "objective", "goal", "relative", "band", "limits", "stiffness", "total_thickness",
    "lower", "upper", "starts", "verify", "polish",
)  # fmt: skip
@dataclasses.dataclass(frozen=True, eq=False)
class DesignScene:
    """What to design: a scene and its table [design].

    **Fields:**

    - `scene`: block to begin with, roughness, pressure, velocities.
    - `spectrum`: roughness that the mean field sees: a spectrum, or the modes of a file's surface.
    - `objective`: what is made large or small is the geometric mean over the velocities. A friction
      ratio is the friction at the first of two velocities over that at the second; peak over mean
      is that of the friction in a cycle of [motion].
    - `parameters`: "layers[0].thickness" = [lower, upper], ...: paths as in `with_values`; the
      scene's own value lies between.
    - `target`: of "friction": friction [1], one number or one for each velocity.
    - `ratio`: of "friction", instead of `target`: to the friction of the scene's own block [1].
    - `q_from`, `q_to`: of "flat_loss_tangent": wavenumbers between which it is flat [rad/m].
    - `limits`: on friction, contact area, mean gap and peak pressure.
    - `stiffness`: keeps |effective_modulus| at a wave within a fraction of the scene's own block;
      a material that softens has its own amplitude there.
    - `total_thickness`: at most, of all layers [m].
    - `starts`: number of searches, from different blocks; by default 8 by mean field, 4 by contact.
    - `seed`: of the blocks to start from.
    - `verify`: number of random surfaces for contact solves.
    - `polish`: true for a few steps by the contact solver's gradients, on as many other surfaces.
    """

    scene: Scene
    spectrum: SelfAffine | Surface
    objective: Objective
    parameters: dict[str, list[float]]
    target: list[float] | None = None
    ratio: list[float] | None = None
    q_from: float | None = None
    q_to: float | None = None
    limits: Limits | None = None
    stiffness: Stiffness | None = None
    total_thickness: float | None = None
    starts: int | None = None
    seed: int = 0
    verify: int = 0
    polish: bool = False

    def __post_init__(self):
        for objective, keys in OBJECTIVES.items():
            for key in keys:
                if getattr(self, key) is not None and self.objective != objective:
                    raise ValueError(f'`{key}` belongs to the objective "{objective}".')
        if self.objective == "friction":
            if (self.target is None) == (self.ratio is None):
                both = "has `target` and `ratio`" if self.target else "lacks `target` or `ratio`"
                raise ValueError(f'the objective "friction" {both}: give one of them.')
            key = "target" if self.ratio is None else "ratio"
            goal, count = np.array(getattr(self, key)), len(self.scene.velocity)
            if len(goal) not in (1, count):
                raise ValueError(
                    f"`{key}` has {len(goal)} numbers; one, or one for each of the {count} "
                    "velocities, is needed."
                )
            check_positive(key, goal, "[1]")
        if self.quantity == "friction_ratio" and len(self.scene.velocity) != 2:
            raise ValueError(
                f'the objective "{self.objective}" needs two velocities in [load], not '
                f"{len(self.scene.velocity)}."
            )
        if self.quantity == "peak_over_mean" and self.scene.motion is None:
            raise ValueError(f'the objective "{self.objective}" needs the table [motion].')
        if self.objective == "flat_loss_tangent" and (
            self.band is None or not 0 < self.band[0] < self.band[1] < np.inf
        ):
            raise ValueError(
                f"`q_from` = {self.q_from}, `q_to` = {self.q_to} must be positive [rad/m] and in "
                "this order."
            )
        if self.total_thickness is not None:
            check_positive("total_thickness", self.total_thickness, "[m]")
        if self.starts is not None:
            check_whole("starts", self.starts, 1)
        check_values("verify", self.verify, "it must not be negative", at_least=0)
        if self.verify and not isinstance(self.scene.surface, RandomSurface):
            raise ValueError('`verify` needs a [surface] of kind "self_affine".')
        # A loss tangent is of the block alone: contact cannot polish it.
        if self.polish and (self.verify < 1 or self.objective == "flat_loss_tangent"):
            raise ValueError("`polish` needs `verify` surfaces and an objective of friction.")

    @property
    def grid(self) -> Grid:
        """The grid of the surface."""
        rough = self.spectrum if isinstance(self.spectrum, Surface) else self.scene.surface
        assert isinstance(rough, Surface | RandomSurface)  # a file was read
        return rough.grid

    @property
    def quantity(self) -> str:
        """What is made large or small, or meets a goal."""
        return self.objective.removeprefix("maximise_").removeprefix("minimise_")

    @property
    def quantities(self) -> tuple[str, ...]:
        """The names of all that objective and limits need of a contact."""
        own = "friction" if self.quantity == "friction_ratio" else self.quantity
        names = {} if self.quantity == "flat_loss_tangent" else {own: None}
        return tuple(names | {quantity: None for quantity, *_ in self.limits or ()})

    @property
    def goal(self) -> Float[np.ndarray, " velocities"] | None:
        """Friction [1] at each velocity, or if `relative`, over the friction before; or None."""
        goal = self.target or self.ratio
        return None if goal is None else np.broadcast_to(goal, len(self.scene.velocity))

    @property
    def relative(self) -> bool:
        """Whether `goal` is a ratio."""
        return self.ratio is not None

    @property
    def band(self) -> tuple[float, float] | None:
        """Wavenumbers [rad/m] between which the loss tangent is to be flat, or None."""
        if self.q_from is None or self.q_to is None:
            return None
        return self.q_from, self.q_to

    @property
    def lower(self) -> dict[str, float]:
        """Lower bounds of the parameters by path."""
        return {path: ends[0] for path, ends in self.parameters.items()}

    @property
    def upper(self) -> dict[str, float]:
        """Upper bounds of the parameters by path."""
        return {path: ends[1] for path, ends in self.parameters.items()}


def read_design(path: str | os.PathLike) -> DesignScene:
    """Returns the design scene that a TOML file describes; the site lists its keys.

    A missing file raises `FileNotFoundError`; every error in it raises `ValueError`, naming the
    table and the key.
    """
    text = read_utf8(path, MOST_BYTES)
    with within(f"{path}:"):
        return parse_design(text, Path(path).parent)


def parse_design(text: str, folder: str | os.PathLike = ".") -> DesignScene:
    """Returns the design scene that a TOML text describes; its paths are relative to `folder`."""
    scene, table = parse_scene(text, folder), parse_toml(text).get("design")
    if table is None:
        raise ValueError("The scene lacks the table [design].")
    refuse_tables(scene, "[design]", "law", "shear", "heating")
    if table.get("objective") == "flat_loss_tangent":
        refuse_tables(scene, '[design] with the objective "flat_loss_tangent"', "motion")
    if scene.strain_per_slope is not None and table.get("objective") == "flat_loss_tangent":
        raise ValueError(
            '[design] with the objective "flat_loss_tangent" does not take the key '
            "`strain_per_slope` of [load]: a loss tangent is that of the materials' own amplitudes."
        )
    with within("[design]"):
        check_positive("velocity", scene.velocity, "[m/s]")
        if len(scene.pressure) > 1 or np.any(scene.direction):
            raise ValueError("needs one `pressure`, and `direction` = 0, in [load].")
        for name in scene.axes.keys() - {"seed", "pressure", "velocity"}:
            raise ValueError(f"needs one {name!r}, no axis of several.")
    misplaced = [name for name in table if name.startswith(("min_", "max_"))]
    if misplaced:
        raise ValueError(f"[design] has no key `{misplaced[0]}`: limits stand in [design.limits].")
    # The parameters are those of the block at the scene's temperature.
    source, stack = scene.surface, scene.block({})
    spectrum = source.spectrum if isinstance(source, RandomSurface) else source.build()
    scene = dataclasses.replace(scene, stack=stack, temperature=None)
    study = TableReader(Path(folder)).build(
        "[design]", table, DesignScene, scene=scene, spectrum=spectrum
    )
    with within("[design.parameters]"):
        if not study.parameters:
            raise ValueError('needs parameters, such as "layers[0].thickness" = [1e-5, 1e-3].')
        check_paths(study.parameters, stack)
        for path, ends in study.parameters.items():
            if len(ends) != 2 or not 0 < ends[0] <= ends[1] < np.inf:
                raise ValueError(
                    f"{path!r} = {ends} must be [lower, upper], positive and in this order."
                )
            if path.endswith("poisson"):
                check_poisson(path, ends[1])
        with_values(stack, study.lower)  # refuses what the block's constructors do
    return study
