"""Scenes: a block, a surface, loads and velocities, as a TOML file describes them.

The keys of a scene are the names of arguments of this package, in SI units, angles in radians; a
`kind` names what takes them. The site lists all of them. Paths are relative to the scene file, or
begin with `~`.
"""

import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..blocks.grading import AbstractGradedSolver
from ..blocks.layering import Layering
from ..blocks.stack import Stack
from ..contacts.nested_solve import DouglasRachford
from ..contacts.solve import RTOL
from ..core.display import shown
from ..core.parameters import with_values
from ..fields.grid import Grid, velocity_along
from ..materials.material import AbstractMaterial
from ..sliding.case import Case
from ..sliding.heating import Heating
from ..sliding.motion import Motion
from ..sliding.numerics import Numerics
from ..sliding.shear import AbstractShear
from ..studies.parameter_covariance import Errors
from ..surfaces.surface import Surface
from .schema import LINEAR, LOGARITHMIC, keys_of
from .surface_source import RandomSurface, Sphere, SurfaceFile

Values = Annotated[Float[np.ndarray, " _"], LOGARITHMIC]


@dataclasses.dataclass(frozen=True)
class Tables:
    """The tables of a scene; those that need others are converted after them.

    **Fields:**

    - `surface`: of the rough counter-body, with a `kind`.
    - `materials`: tables [materials.NAME], each with a `kind`; one may use those above it.
    - `base`: below the layers, with a `kind`.
    - `load`: pressures or approaches, velocities, temperatures.
    - `title`: one line for the reader.
    - `grid`: of a random surface, or of a sphere.
    - `layers`: tables [[layers]], from the loaded surface downwards. A graded one has, instead of
      `material`, the NAMEs `bottom` and `top`.
    - `sweep`: other values for numbers of the block, by paths as in `with_values`:
      "layers[0].thickness" = [1e-5, 1e-4]. A temperature acts on the block with these values.
    - `motion`: back and forth or with stops, in place of steady sliding, with a `kind`.
    - `shear`: stress in the contact, which adds to the friction, with a `kind`.
    - `heating`: how the heat of friction flows; it then softens the block under the contact.
    - `solver`: tolerance and algorithm.
    - `output`: names and fields of the results.
    - `design`: what the command `design` does.
    """

    surface: dict[str, object]
    materials: dict[str, object]
    base: dict[str, object]
    load: dict[str, object]
    title: str = ""
    grid: Grid | None = None
    layers: list[dict] = dataclasses.field(default_factory=list)
    sweep: dict[str, Values] = dataclasses.field(default_factory=dict)
    motion: Motion | None = None
    shear: AbstractShear | None = None
    heating: Heating | None = None
    solver: dict[str, object] = dataclasses.field(default_factory=dict)
    output: dict[str, object] = dataclasses.field(default_factory=dict)
    design: dict[str, object] | None = None


@shown(
    "title", "stack", "surface", "sweep", "temperature", "pressure", "velocity", "motion", "shear",
    "heating",
)  # fmt: skip
@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """What to compute: block, surface and loads of a scene file.

    Its fields are keys of the tables [load], [solver] and [output], see `KEYS`.

    **Fields:**

    - `text`: the TOML text.
    - `title`: one line for the reader.
    - `stack`: the block of the file; `block` returns that of a point.
    - `surface`: where the surface comes from; `build_surface` makes it.
    - `sweep`: other values for numbers of the stack, by their paths.
    - `pressure`: mean pressures [Pa], an axis; none with an approach.
    - `approach`: of a body on a window since its first touch [m], an axis in place of the pressure.
    - `velocity`: sliding velocities [m/s], an axis. With a motion these are its highest speeds, and
      each changes its period; if missing, the motion has the period of its table.
    - `temperature`: of the block [K], one or an axis; None leaves the materials unchanged. With
      heating it is the bulk temperature.
    - `pressure_ratio`: with a motion, pressures over `pressure` [1] at equally spaced times of the
      period, linear in between; if missing, the load is constant.
    - `motion`, `shear`, `heating`: the tables of these names, or None.
    - `strain_per_slope`: of a block that softens, strain amplitude over rms slope [1], see `slide`;
      if missing, each material has its own amplitude.
    - `direction`: of the velocity from the x axis [rad]. (In Python two numbers are one velocity,
      (vx, vy).)
    - `extrapolate`: true allows friction from frequencies at which a material was not measured.
    - `solver`: algorithm of the contact.
    - `rtol`: relative error of the contact pressure [1]; the default gives friction to 1e-4.
    - `graded_solver`: the solver of graded layers.
    - `name`: begins the names of the files of results.
    - `directory`: folder of the results, relative to the scene.
    - `fields`: solves whose fields over the surface are stored.
    - `errors`: of materials: name, material of the stack, and errors of its numbers.
    - `inputs`: the files that the scene names, by table and key.
    - `notes`: what was understood of its tables of moduli, one sentence each.
    """

    text: str
    title: str
    stack: Stack
    surface: RandomSurface | SurfaceFile | Sphere
    sweep: dict[str, Values]
    pressure: Values
    velocity: Values
    approach: Values | None = None
    temperature: Annotated[Float[np.ndarray, "*temperatures"], LINEAR] | None = None
    direction: float = 0.0
    extrapolate: bool = False
    pressure_ratio: list[float] | None = None
    strain_per_slope: float | None = None
    motion: Motion | None = None
    shear: AbstractShear | None = None
    heating: Heating | None = None
    solver: DouglasRachford
    rtol: float = RTOL
    graded_solver: AbstractGradedSolver = Layering()  # noqa: RUF009 (immutable)
    name: str | None = None
    directory: Path | None = None
    fields: Literal["last", "every", "none"] = "last"
    errors: tuple[tuple[str, AbstractMaterial, Errors], ...]
    inputs: dict[tuple[str, str], Path]
    notes: tuple[str, ...] = ()

    @property
    def axes(self) -> dict[str, np.ndarray]:
        """What is varied, by name, in the order of the results' axes."""
        found = dict(self.sweep)
        if self.temperature is not None and self.temperature.ndim:
            found["temperature"] = self.temperature
        if isinstance(self.surface, RandomSurface) and self.surface.seeds is not None:
            found["seed"] = self.surface.seed + np.arange(self.surface.seeds)
        load = "pressure" if self.approach is None else "approach"
        return {**found, load: getattr(self, load), "velocity": self.velocity}

    @property
    def num_solves(self) -> int:
        """How many combinations there are of what is varied."""
        return math.prod(len(values) for values in self.axes.values())

    @property
    def num_times(self) -> int:
        """How many times a solve has: 1 under steady sliding."""
        return 1 if self.motion is None else len(self.motion.displacement)

    def period_at(self, velocity: Any) -> Any:
        """Returns the period of the motion [s] at a highest speed [m/s]."""
        assert self.motion is not None
        own = self.motion.highest_speed
        return self.motion.period * jnp.where(own > 0, own / jnp.where(own > 0, velocity, 1), 1)

    @property
    def numerics(self) -> Numerics:
        """How its contacts are computed; a solve that fails says so in its result."""
        return Numerics(
            rtol=self.rtol, solver=self.solver, graded_solver=self.graded_solver, throw=False
        )

    def case(self, point: Mapping[str, Any], surface: Surface) -> Case:
        """Returns the case at a point, given by its numbers on the axes; JAX may trace them."""
        given: dict[str, Any] = {
            "stack": self.block(point), "surface": surface, "shear": self.shear,
            "temperature": point.get("temperature", self.temperature), "heating": self.heating,
            "strain_per_slope": self.strain_per_slope,
            **{name: point[name] for name in ("pressure", "approach") if name in point},
        }  # fmt: skip
        if self.motion is None:
            return Case(velocity=velocity_along(point["velocity"], self.direction), **given)
        along, moved = np.ravel(velocity_along(1.0, self.direction)), self.motion.displacement
        if self.pressure_ratio is not None:
            times = np.arange(self.num_times) / self.num_times
            known = np.arange(len(self.pressure_ratio)) / len(self.pressure_ratio)
            ratio = np.interp(times, known, self.pressure_ratio, period=1.0)
            given["pressure"] = given["pressure"] * ratio
        moved = moved if len(along) == 1 else moved[:, None] * along
        period = self.period_at(point["velocity"])
        return Case(displacement=moved, period=period, **given)

    def block(self, point: Mapping[str, Any]) -> Stack:
        """Returns the stack at a point, given by its numbers on the axes; JAX may trace them."""
        values = {path: point[path] for path in self.sweep}
        stack = with_values(self.stack, values) if values else self.stack
        temperature = point.get("temperature", self.temperature)
        return stack if temperature is None else stack.at(temperature)

    def blocks(self) -> Iterator[tuple[dict[str, float], Stack]]:
        """Yields the stacks that differ, each with its numbers of [sweep] and its temperature."""
        axes = {name: at for name, at in self.axes.items() if name in (*self.sweep, "temperature")}
        for numbers in itertools.product(*axes.values()):
            point = dict(zip(axes, numbers, strict=True))
            yield point, self.block(point)


# The keys of tables that are fields of a scene.
KEYS = {
    place: tuple(
        key._replace(default=None) if key.name in ("pressure", "velocity") else key
        for key in keys_of(Scene)
        if key.name in names
    )
    for place, names in {
        "[load]": (
            *("pressure", "approach", "velocity", "temperature", "direction", "extrapolate"),
            *("pressure_ratio", "strain_per_slope"),
        ),
        "[solver]": ("rtol", "graded_solver"),
        "[output]": ("name", "directory", "fields"),
    }.items()
}
