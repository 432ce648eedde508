"""Scenes that design their block, as the table [design] of a TOML file describes it.

A design takes a scene (`scenes/scene.py`) with one pressure, `direction` 0 and positive velocities.
"""

import dataclasses
import os
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Array

from ..blocks.stack import Stack
from ..core.checks import (
    as_float,
    as_scalar,
    check_poisson,
    check_positive,
    check_values,
    check_whole,
    within,
)
from ..core.display import shown
from ..core.parameters import paths, with_values
from ..core.quantities import TRANSIENT
from ..fields.grid import Grid
from ..mean_field.refinement import Nodes
from ..scenes.scene import Scene
from ..scenes.scene_checks import check_paths, refuse_tables
from ..scenes.scene_doubts import doubts_about, doubts_of, usual_beside
from ..scenes.scene_file import parse_scene
from ..scenes.schema import TableReader, keys_of
from ..scenes.surface_source import RandomSurface, SurfaceFile
from ..scenes.toml import parse_toml, text_of_scene
from ..sliding.case import Case
from ..surfaces.spectrum_table import Spectrum
from ..surfaces.statistics import isotropic_spectrum
from ..surfaces.surface import Surface
from .limits import CRITERIA, Limits
from .objectives import OBJECTIVE, OBJECTIVES, DesignObjective, refined_curve


@shown("scene", "objective", "limits", "parameters", "starts", "verify")
@dataclasses.dataclass(frozen=True, eq=False)
class DesignScene:
    """What to design: a scene and its table [design].

    **Fields:**

    - `scene`: block to begin with, roughness, pressure, velocities.
    - `spectrum`: roughness that the mean field sees: a spectrum, or the modes of a file's surface.
    - `objective`: what is made large or small is the geometric mean over the velocities. A friction
      ratio is the friction at the first of two velocities over that at the second; peak over mean
      is that of the friction in a cycle of [motion].
    - `limits`: what the design keeps.
    - `parameters`: "layers[0].thickness" = [lower, upper], ...: paths as in `with_values`; the
      scene's own value lies between.
    - `starts`: number of searches, from different blocks; by default 8 by mean field, 4 by contact.
    - `seed`: of the blocks to start from.
    - `verify`: number of random surfaces for contact solves.
    """

    scene: Scene
    spectrum: Spectrum | Surface
    objective: DesignObjective
    limits: Limits
    parameters: dict[str, list[float]]
    starts: int | None = None
    seed: int = 0
    verify: int = 0

    def __post_init__(self):
        if self.scene.kind == TRANSIENT:
            raise ValueError("[design] does not take [motion] with `once = true`.")
        self._check_stresses()
        for name in self.criteria:
            if CRITERIA[name].of_a_cycle and self.scene.motion is None:
                raise ValueError(f'"{name}" needs the table [motion].')
        if self.starts is not None:
            check_whole("starts", self.starts, 1)
        check_values("verify", self.verify, "it must not be negative", at_least=0)
        if self.verify and not isinstance(self.scene.surface, RandomSurface):
            raise ValueError('`verify` needs a [surface] of kind "self_affine" or "scans".')

    def _check_stresses(self) -> None:
        """Raises `ValueError` for stresses that the contacts do not have."""
        scene = self.scene
        for name in (name for name in self.criteria if CRITERIA[name].of_stress):
            if scene.motion is not None or not getattr(self.spectrum, "periodic", True):
                raise ValueError(f'"{name}" needs steady sliding on a periodic surface.')
            if scene.strain_per_slope is not None:
                raise ValueError(f'"{name}" does not take `strain_per_slope` in [load].')
            if name == "interface_shear" and not scene.stack.layers:
                raise ValueError('"interface_shear" needs a layer.')

    @property
    def criteria(self) -> tuple[str, ...]:
        """The names of all that objective and limits need of a contact."""
        limited = (limit.criterion for limit in self.limits)
        return tuple(dict.fromkeys((*self.objective.criteria, *limited)))

    @property
    def grid(self) -> Grid:
        """The grid of the surface."""
        rough = self.spectrum if isinstance(self.spectrum, Surface) else self.scene.surface
        assert isinstance(rough, Surface | RandomSurface)  # a file was read
        return rough.grid

    @property
    def seeds(self) -> int:
        """How many surfaces a search by contact has."""
        source = self.scene.surface
        return (source.seeds or 1) if isinstance(source, RandomSurface) else 1

    @cached_property
    def surfaces(self) -> list[Surface]:
        """The surfaces of a search by contact: of each seed of the scene, or of its file."""
        source = self.scene.surface
        if not isinstance(source, RandomSurface):
            return [source.build()]
        return [source.drawn(source.seed + i) for i in range(self.seeds)]

    @property
    def doubts(self) -> Iterator[str]:
        """Why limits, bounds and numbers beside a file may be in a wrong unit, in sentences."""
        usual, limits = usual_beside(self.scene, self.grid), self.limits
        if isinstance(self.scene.surface, SurfaceFile):
            yield from doubts_of(self.scene, self.grid)
        of_unit = {"Pa": "stress", "m": "gap"}
        for criterion, end, value in limits:
            if kind := of_unit.get(CRITERIA[criterion].unit):
                where = f"[design.limits] `{end}_{criterion}`"
                yield from doubts_about(usual, kind, value, where)
        lengths = {"[design] `total_thickness`": limits.total_thickness} | {
            f"[design.parameters] {path}": ends
            for path, ends in self.parameters.items()
            if path.endswith("thickness")
        }
        for where, values in lengths.items():
            if values is not None:
                yield from doubts_about(usual, "thickness", values, where)

    def case_of(self, stack: Stack) -> Case:
        """Returns the case of the mean field of a block, at no velocity yet."""
        scene = self.scene
        rough = self.spectrum
        rough = isotropic_spectrum(rough) if isinstance(rough, Surface) else rough
        return Case(
            stack, rough, velocity=0.0, pressure=as_scalar(scene.pressure[0], "pressure"),
            strain_per_slope=scene.strain_per_slope, counterface=scene.counterface,
        )  # fmt: skip

    @cached_property
    def nodes(self) -> Nodes:
        """The nodes with which the mean field of the scene's own block meets its tolerance.

        A search takes the same nodes for all blocks.
        """
        velocities = as_float(self.scene.velocity)
        return refined_curve(self.case_of(self.scene.stack), velocities)[1]

    @property
    def has_mean_field(self) -> bool:
        """Whether there is a mean field of the scene: no motion, no window, no shear."""
        scene = self.scene
        periodic = getattr(self.spectrum, "periodic", True)
        return scene.motion is None and scene.shear is None and periodic

    @property
    def bounds(self) -> tuple[dict[str, float], dict[str, float]]:
        """Lower and upper bounds of the parameters, by path."""
        lower, upper = ({path: ends[i] for path, ends in self.parameters.items()} for i in (0, 1))
        return lower, upper

    @property
    def start(self) -> dict[str, Array]:
        """The parameters of the scene's own block by path."""
        known = paths(self.scene.stack)
        return {path: known[path] for path in self.parameters}


def read_design(path: str | os.PathLike) -> DesignScene:
    """Returns the design scene that a TOML file describes; `docs/scene_keys.md` lists its keys.

    A missing file raises `FileNotFoundError`; every error in it raises `ValueError`, naming the
    table and the key.

    **Arguments:**

    - `path`: of the TOML file.

    **Returns:** the scene and what to design.
    """
    text = text_of_scene(path)
    with within(f"{path}:"):
        return parse_design(text, Path(path).parent)


def parse_design(text: str, folder: str | os.PathLike = ".") -> DesignScene:
    """Returns the design scene that a TOML text describes; its paths are relative to `folder`."""
    scene, table = parse_scene(text, folder), parse_toml(text).get("design")
    if table is None:
        raise ValueError("The scene lacks the table [design].")
    refuse_tables(scene, "[design]", "law", "heating", "block_surface")
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
    source, (stack, counterface) = scene.surface, scene.bodies({})
    spectrum = source.spectrum if isinstance(source, RandomSurface) else source.build()
    scene = dataclasses.replace(scene, stack=stack, counterface=counterface, temperature=None)
    reader = TableReader(Path(folder))
    own_keys = {name: keys_of(make, "name", "scene") for name, make in OBJECTIVES.items()}
    keys = (
        [OBJECTIVE], keys_of(Limits),
        keys_of(DesignScene, "scene", "spectrum", "objective", "limits"),
    )  # fmt: skip
    if OBJECTIVE.name not in table:  # it may be misspelt
        known = {key.name: key for each in own_keys.values() for key in each}
        reader.arguments("[design]", table, *keys, list(known.values()))
    name = reader.value("[design]", OBJECTIVE, table[OBJECTIVE.name])
    _, limits, rest, own = reader.arguments("[design]", table, *keys, own_keys[name])
    with within("[design]"):
        objective = OBJECTIVES[name](name, scene, **own)
        study = DesignScene(scene, spectrum, objective, Limits(**limits), **rest)
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
            own_value = study.start[path]
            lower, upper = np.asarray(ends, own_value.dtype)
            # A block may come from a file, with rounded digits.
            if not np.isclose(np.clip(own_value, lower, upper), own_value, rtol=1e-9, atol=0):
                raise ValueError(
                    f"{path!r} = {ends} leaves out the block's own value {own_value:g}, at which "
                    "the search begins."
                )
        with_values(stack, study.bounds[0])  # refuses what the block's constructors do
    return study
