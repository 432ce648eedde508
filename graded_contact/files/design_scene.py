"""Scenes that design their block, as the table [design] of a TOML file describes it.

The mean field decides, in milliseconds; the contact solver says what the design does on surfaces
that no one has designed for, and polishes it on others. Besides the tables of a scene
(`files/scene.py`), with one pressure, `direction` 0 and positive velocities:

    [design]              `objective` = "maximise_friction" or "minimise_friction" (geometric mean
                          over the velocities), "friction" with `target`, or `ratio` to the friction
                          of the scene's own block (a number, or one per velocity), or
                          "flat_loss_tangent" with `q_from`, `q_to`. Limits: `stiffness` = {q,
                          omega, within}, which keeps |effective_modulus| there within a fraction of
                          the scene's own block, and `total_thickness` of all layers. `starts`,
                          `seed`; `verify` = number of random surfaces for contact solves;
                          `polish` = true for a few steps by the contact solver's gradients on as
                          many others
    [design.parameters]   "layers[0].thickness" = [lower, upper], ...: paths as in
                          `parameters.py`; the scene's own value lies between
"""

import dataclasses
import os
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..core.checks import check_poisson, check_positive, check_values
from ..core.display import shown
from ..core.parameters import with_values
from ..response.stack import Stack
from ..roughness.spectrum import SelfAffine
from ..roughness.surface import Surface
from .paths import existing_file
from .scene import Scene, check_paths, parse_scene
from .surfaces import RandomSurface
from .toml import LARGEST, Section, nearest, parse_toml, short, within

KEYS = (
    "objective", "target", "ratio", "q_from", "q_to", "stiffness", "total_thickness",
    "parameters", "starts", "seed", "verify", "polish",
)  # fmt: skip
# The keys that belong to one objective only.
OBJECTIVES = {
    "maximise_friction": (),
    "minimise_friction": (),
    "friction": ("target", "ratio"),
    "flat_loss_tangent": ("q_from", "q_to"),
}


@shown()
class Stiffness(NamedTuple):
    """Keeps |effective_modulus| at a wave within a fraction.

    **Fields:**

    - `q`: wavenumber [rad/m].
    - `omega`: angular frequency [rad/s].
    - `within`: fraction [1].
    """

    q: float
    omega: float
    within: float


@shown(
    "scene", "objective", "wanted", "relative", "band", "stiffness", "total_thickness", "lower",
    "upper", "starts", "verify", "polish",
)  # fmt: skip
@dataclasses.dataclass(frozen=True, eq=False)
class DesignScene:
    """What to design, as a scene with a table [design] says.

    **Fields:**

    - `scene`: block to begin with, roughness, pressure, velocities.
    - `spectrum`: roughness that the mean field sees: a spectrum, or the modes of a file's surface.
    - `objective`: one of `OBJECTIVES`.
    - `wanted`: friction [1] at each velocity, or None; if `relative`, over the friction before.
    - `band`: wavenumbers [rad/m] between which the loss tangent is to be flat, or None.
    - `stiffness`, `total_thickness` [m]: limits, or None.
    - `lower`, `upper`: bounds of the parameters by path.
    - `starts`, `seed`: of `minimise`.
    - `verify`: number of surfaces for contact solves.
    - `polish`: whether to go on with the contact solver.
    """

    scene: Scene
    spectrum: SelfAffine | Surface
    objective: str
    wanted: Float[np.ndarray, " velocities"] | None
    relative: bool
    band: tuple[float, float] | None
    stiffness: Stiffness | None
    total_thickness: float | None
    lower: dict[str, float]
    upper: dict[str, float]
    starts: int
    seed: int
    verify: int
    polish: bool


def read_design(path: str | os.PathLike) -> DesignScene:
    """Returns the study that a TOML file describes; see the module's text for its keys.

    A missing file raises `FileNotFoundError`; whatever is wrong in it `ValueError`, naming the
    table and the key.
    """
    path = existing_file(path, at_most=LARGEST)
    with within(f"{path}:"):
        return parse_design(path.read_text(encoding="utf-8"), path.parent)


def parse_design(text: str, folder: str | os.PathLike = ".") -> DesignScene:
    """Returns the study that a TOML text describes; its paths are relative to `folder`."""
    scene, document = parse_scene(text, folder), parse_toml(text)
    if "design" not in document:
        raise ValueError("The scene lacks the table [design].")
    with within("[design]"):
        check_positive("velocity", scene.velocity, "[m/s]")
        if len(scene.pressure) > 1 or scene.direction != 0:
            raise ValueError("needs one `pressure`, and `direction` = 0, in [load].")
        if len(scene.axes) > 2:
            raise ValueError(f"takes one {' and one '.join(map(repr, [*scene.axes][:-2]))}.")
    scene = dataclasses.replace(scene, stack=scene.block({}), temperature=None)
    table = Section("[design]", document["design"], KEYS)
    lower, upper = _bounds(table, scene.stack)
    verify, polish = table.whole("verify", 0), table.get("polish", False)
    if verify and not isinstance(scene.surface, RandomSurface):
        raise ValueError('[design] `verify` needs a [surface] of kind "self_affine".')
    if not isinstance(polish, bool):
        raise ValueError(f"[design] `polish` = {short(polish)} must be true or false.")
    objective = _objective(table)
    if polish and (verify < 1 or objective == "flat_loss_tangent"):
        raise ValueError("[design] `polish` needs `verify` surfaces and an objective of friction.")
    with within(table.place):
        check_values("verify", verify, "it must not be negative", at_least=0)
    source = scene.surface
    return DesignScene(
        scene=scene,
        spectrum=source.spectrum if isinstance(source, RandomSurface) else source.build(),
        objective=objective,
        wanted=_wanted(table, len(scene.velocity)) if objective == "friction" else None,
        relative="ratio" in document["design"],
        band=_band(table) if objective == "flat_loss_tangent" else None,
        stiffness=_stiffness(table),
        total_thickness=_positive(table, "total_thickness", "[m]"),
        lower=lower,
        upper=upper,
        starts=table.whole("starts", 8),
        seed=table.whole("seed", 0),
        verify=verify,
        polish=polish,
    )


def _bounds(table: Section, stack: Stack) -> tuple[dict[str, float], dict[str, float]]:
    content = table.get("parameters")
    lower, upper = {}, {}
    if not isinstance(content, dict) or not content:
        raise ValueError(
            '[design.parameters] must hold parameters, such as "layers[0].thickness" = [1e-5, '
            f"1e-3], got {short(content)}."
        )
    parameters = Section("[design.parameters]", content, content)
    with within(parameters.place):
        check_paths(content, stack)
        for path in content:
            ends = parameters.numbers(path)
            if len(ends) != 2 or not 0 < ends[0] <= ends[1] < np.inf:
                raise ValueError(
                    f"{path!r} = {short(content[path])} must be [lower, upper], positive and in "
                    "this order."
                )
            lower[path], upper[path] = ends
            if path.endswith("poisson"):
                check_poisson(path, ends[1])
        with_values(stack, lower)  # refuses what the block's constructors do
    return lower, upper


def _objective(table: Section) -> str:
    objective = table.text("objective")
    if objective not in OBJECTIVES:
        raise ValueError(
            f"[design] `objective` = {objective!r} is not known; {nearest(objective, OBJECTIVES)}"
        )
    for other, keys in OBJECTIVES.items():
        for key in keys:
            if key in table.content and other != objective:
                raise ValueError(f'[design] `{key}` belongs to the objective "{other}".')
    return objective


def _wanted(table: Section, num_velocities: int) -> Float[np.ndarray, " velocities"]:
    if ("target" in table.content) == ("ratio" in table.content):
        raise ValueError('[design] "friction" takes either `target` or `ratio`.')
    key = "target" if "target" in table.content else "ratio"
    wanted = np.array(table.numbers(key))
    if len(wanted) not in (1, num_velocities):
        raise ValueError(
            f"[design] `{key}` has {len(wanted)} numbers; one, or one for each of the "
            f"{num_velocities} velocities, is needed."
        )
    with within(table.place):
        check_positive(key, wanted, "[1]")
    return np.broadcast_to(wanted, num_velocities)


def _positive(table: Section, key: str, unit: str) -> float | None:
    value: Any = table.number(key, None)
    if value is not None:
        with within(table.place):
            check_positive(key, value, unit)
    return value


def _band(table: Section) -> tuple[float, float]:
    band = table.number("q_from"), table.number("q_to")
    if not 0 < band[0] < band[1]:
        raise ValueError(
            f"[design] `q_from` = {band[0]:g}, `q_to` = {band[1]:g} must be positive [rad/m] and "
            "in this order."
        )
    return band


def _stiffness(table: Section) -> Stiffness | None:
    if "stiffness" not in table.content:
        return None
    inner = Section("[design] `stiffness`", table.get("stiffness"), Stiffness._fields)
    found = Stiffness(*(inner.number(key) for key in Stiffness._fields))
    with within(inner.place):
        check_positive("q", found.q, "[rad/m]")
        check_values("omega", found.omega, "a frequency [rad/s] is not negative", at_least=0)
        check_positive("within", found.within, "[1]")
    return found
