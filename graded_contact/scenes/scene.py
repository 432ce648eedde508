"""Scenes: a block, a surface, loads and velocities, as a TOML file describes them.

The keys of a scene are the names of arguments of this package, in SI units, angles in radians; a
`kind` names what takes them. Paths are relative to the scene file, or begin with `~`.
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

from ..blocks.stack import Stack
from ..contacts.law import AbstractLaw, HardWall
from ..contacts.solve import RTOL
from ..contacts.solver.nested_solve import DouglasRachford
from ..core.checks import within
from ..core.display import shown, with_time
from ..core.parameters import with_values
from ..core.quantities import CYCLE, STEADY, TRANSIENT
from ..fields.frequency import velocity_along
from ..materials.material import AbstractMaterial
from ..sliding.bodies import TwoBodies, in_both
from ..sliding.case import FLOW, Case, Heating
from ..sliding.interior.heat_source import as_depths
from ..sliding.interior.stress import STRESSES
from ..sliding.motion.motion import Motion
from ..sliding.numbers.gap_flow import Fluid
from ..sliding.numerics import Numerics
from ..sliding.shear import AbstractShear
from ..studies.parameter_covariance import Errors
from ..surfaces.surface import Surface
from .described import in_words
from .schema import LINEAR, LOGARITHMIC
from .surface_source import RandomSurface, Sphere, SurfaceFile
from .toml import parse_toml

Axis = Annotated[Float[np.ndarray, " _"], LOGARITHMIC]
ONE_OR_AXIS = ("temperature", "direction")  # fields of a scene that may be varied


@dataclasses.dataclass(frozen=True)
class Observe:
    """Numbers of each contact that take more time, for those who ask.

    **Fields:**

    - `stiffness`: true for the contact stiffness [Pa/m], by which the mean pressure rises as the
      mean gap closes.
    - `conductance`: true for the conductance of the contact between two half spaces, times the sum
      of their resistivities [1/m]. Over the sum of 1/λ it is the thermal conductance.
    - `flow`: true for the conductance of the gap for a thin fluid along x and along y [m³]. Times
      the gradient of the fluid's pressure, over 12 times its viscosity, it is the leakage per
      width.
    - `tension`, `von_mises`: true for the largest principal stress and the largest von Mises stress
      in the block [Pa], with their depths [m]; of the points of the grid, without an error.
    - `interface_shear`: true for the largest shear stress between layers [Pa], with its depth.
    - `stress_depths`: where tension and von Mises stress are computed [m]; by default the surface,
      and in each layer a quarter, half and all of its thickness, and just below it.
    """

    stiffness: bool = False
    conductance: bool = False
    flow: bool = False
    tension: bool = False
    von_mises: bool = False
    interface_shear: bool = False
    stress_depths: list[float] | None = None

    def __post_init__(self):
        if self.stress_depths is not None:
            with within("`stress_depths`:"):
                as_depths(self.stress_depths)
            if not (self.tension or self.von_mises):
                raise ValueError("`stress_depths` needs `tension` or `von_mises`.")

    @property
    def asked(self) -> tuple[str, ...]:
        """The names of those that are true."""
        return tuple(name for name, asked in vars(self).items() if asked is True)

    @property
    def stresses(self) -> tuple[str, ...]:
        """The names of the stresses that are asked for."""
        return tuple(name for name in self.asked if name in STRESSES)


@shown(
    "title", "contents", "sweep", "temperature", "pressure",
    "approach", "velocity", "direction", "pressure_ratio", "ratio_times", "strain_per_slope",
    "tables", "sampling", "observed", unset=False,
)  # fmt: skip
@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """What to compute: block, surface and loads of a scene file.

    Its fields are keys of the tables [load], [solver] and [output], see `KEYS`.

    **Fields:**

    - `text`: the TOML text.
    - `title`: one line for the reader.
    - `stack`: the block of the file; `bodies` returns that of a point.
    - `surface`: where the surface comes from; `plan` makes it.
    - `sweep`: other values for numbers of the stack by their paths, and of the counterface by
      "counterface.layers[0].thickness".
    - `pressure`: mean pressures [Pa], an axis; none with an approach.
    - `approach`: of a body on a window since its first touch [m], an axis in place of the pressure.
    - `velocity`: sliding velocities [m/s], an axis. With a motion these are its highest speeds, and
      each changes its period; if missing, the motion has the period of its table. A motion with
      `once = true` gives its velocity.
    - `temperature`: of the block [K], one or an axis; None leaves the materials unchanged. With
      heating it is the bulk temperature.
    - `pressure_ratio`: with a motion, pressures over `pressure` [1] at equally spaced times of the
      period, linear in between; if missing, the load is constant. With `once = true` they are the
      pressures at `ratio_times`.
    - `ratio_times`: of the pressures of a motion with `once = true` [s]; the load is linear in
      between and constant before the first and after the last. Steps of the motion also end there.
    - `pressure_path`: a table, text or Excel, in place of `pressure` and its ratios: time and
      pressure, with units in the headings ("time [h]", "pressure [kPa]"), counted from its first
      time.
    - `motion`, `law`, `shear`, `heating`: the tables of these names, or None.
    - `counterface`: the body that carries the surface, or None if it is rigid.
    - `block_surface`: where the block's own surface comes from, or None.
    - `fluid`: whose leakage through the gap is a result, or None.
    - `observe`: the table of this name.
    - `step`: of a motion, its largest step from one time to the next, in spacings of the grid.
    - `strain_per_slope`: of a block that softens, strain amplitude over rms slope [1], see `slide`;
      if missing, each material has its own amplitude.
    - `direction`: of the velocity from the x axis [rad], one or an axis. (In Python two numbers are
      one velocity, (vx, vy).)
    - `solver`: algorithm of the contact.
    - `rtol`: requested relative error of the contact pressure [1].
    - `name`: begins the names of the files of results.
    - `directory`: folder of the results, relative to the scene.
    - `fields`: solves whose fields over the surface are stored.
    - `frames`: of a motion with `once = true`, the number of its times at which a solve has fields,
      and a flow or leakage: after equal numbers of steps, with the first and the last.
    - `materials`: names of the materials by their paths in the block, such as "base.material".
    - `errors`: of materials: name, material of the stack, and errors of its numbers.
    - `inputs`: the files that the scene names, by table and key.
    - `notes`: what was understood of its tables of moduli, one sentence each.
    - `assumed`: those of them that neither a file nor the scene states: warnings of the results.
    """

    text: str
    title: str
    stack: Stack
    surface: RandomSurface | SurfaceFile | Sphere
    sweep: dict[str, Axis]
    pressure: Axis
    velocity: Axis
    approach: Axis | None = None
    temperature: Annotated[Float[np.ndarray, "*temperatures"], LINEAR] | None = None
    direction: Annotated[Any, LINEAR] = 0.0  # a float, or an array as an axis
    pressure_ratio: list[float] | None = None
    strain_per_slope: float | None = None
    ratio_times: list[float] | None = None
    pressure_path: Path | None = None
    motion: Motion | None = None
    step: float | None = None
    law: AbstractLaw | None = None
    shear: AbstractShear | None = None
    counterface: Stack | None = None
    block_surface: RandomSurface | SurfaceFile | None = None
    heating: Heating | None = None
    fluid: Fluid | None = None
    observe: Observe = Observe()
    solver: DouglasRachford
    rtol: float = RTOL
    name: str | None = None
    directory: Path | None = None
    fields: Literal["last", "every", "none"] = "last"
    frames: int = 8
    materials: dict[str, str]
    errors: tuple[tuple[str, AbstractMaterial, Errors], ...]
    inputs: dict[tuple[str, str], Path]
    notes: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()

    @property
    def axes(self) -> dict[str, np.ndarray]:
        """What is varied, by name, in the order of the results' axes."""
        found = dict(self.sweep)
        found |= {name: at for name in ONE_OR_AXIS if np.ndim(at := getattr(self, name))}
        if isinstance(self.surface, RandomSurface) and self.surface.seeds is not None:
            found["seed"] = self.surface.seed + np.arange(self.surface.seeds)
        load = "pressure" if self.approach is None else "approach"
        return {**found, load: getattr(self, load), "velocity": self.velocity}

    @property
    def contents(self) -> dict[str, Any]:
        """What its tables make, in words."""
        return in_words(parse_toml(self.text))

    @property
    def tables(self) -> dict[str, Any]:
        """Those of its tables that hold one thing, as they are written."""
        written = parse_toml(self.text)
        names = ("motion", "law", "shear", "heating", "fluid")
        return {name: written[name] for name in names if name in written}

    @property
    def contact_law(self) -> AbstractLaw:
        """That of [law], or a hard wall."""
        return self.law or HardWall()

    @property
    def num_solves(self) -> int:
        """How many combinations there are of what is varied."""
        return math.prod(len(values) for values in self.axes.values())

    @property
    def asked(self) -> tuple[str, ...]:
        """What [observe] and [fluid] ask for."""
        return *self.observe.asked, *([FLOW] if self.fluid is not None else [])

    @property
    def observed(self) -> str:
        """What [observe] asks for, in words."""
        return ", ".join(self.observe.asked)

    @property
    def kind(self) -> str:
        """Of its contacts, one of `KINDS`."""
        if self.motion is None:
            return STEADY
        return CYCLE if self.motion.times is None else TRANSIENT

    @property
    def num_times(self) -> int:
        """How many times a solve has: 1 under steady sliding."""
        return 1 if self.motion is None else self.motion.num_times

    @property
    def kept_steps(self) -> tuple[int, ...]:
        """Numbers of the steps of what happens once at which a solve has fields."""
        count = min(self.frames, self.num_times)
        # Counted back from the last: one frame is the last step.
        last = self.num_times - 1
        return tuple(last - (last * i) // max(count - 1, 1) for i in reversed(range(count)))

    @property
    def sampling(self) -> str | None:
        """How many times a motion has, and how fine they are, in words."""
        if self.motion is None or self.step is None:
            return None
        text = f"{self.num_times} times, a largest step of {self.step:.2g} spacings"
        if self.motion is not None and self.motion.times is not None:
            text += f", {with_time(float(self.motion.times[-1]))} in all"
        return text

    def period_at(self, velocity: Any) -> Any:
        """Returns the period of the motion [s] at a highest speed [m/s]."""
        assert self.motion.times is None
        # The same path at another speed takes another period; at rest the period stays.
        own = self.motion.highest_speed
        return self.motion.period * jnp.where(own > 0, own / jnp.where(own > 0, velocity, 1), 1)

    @property
    def numerics(self) -> Numerics:
        """How its contacts are computed; a solve that fails says so in its result."""
        return Numerics(rtol=self.rtol, solver=self.solver, throw=False)

    def case(self, point: Mapping[str, Any], surface: Surface) -> Case:
        """Returns the case at a point, given by its numbers on the axes; JAX may trace them."""
        given: dict[str, Any] = {
            **self.bodies(point)._asdict(), "surface": surface, "shear": self.shear,
            "temperature": self._at(point, "temperature"), "heating": self.heating,
            "strain_per_slope": self._at(point, "strain_per_slope"), "law": self.contact_law,
            **{name: point[name] for name in ("pressure", "approach") if name in point},
        }  # fmt: skip
        direction = self._at(point, "direction")
        if self.motion is None:
            return Case(velocity=velocity_along(point["velocity"], direction), **given)
        # The motion is a path along x; the direction turns it.
        along, moved = jnp.atleast_1d(velocity_along(1.0, direction)), self.motion.displacement
        moved = moved if len(along) == 1 else moved[:, None] * along
        if self.block_surface is not None:
            given["block_surface"] = self.block_surface.build()
        if self.motion is not None and self.motion.times is not None:
            times = np.asarray(self.motion.times)
            if self.pressure_ratio is not None and self.ratio_times is not None:
                ratio = np.interp(times, self.ratio_times, self.pressure_ratio)
                given["pressure"] = given["pressure"] * ratio
            return Case(displacement=moved, times=times, **given)
        if self.pressure_ratio is not None:
            # The load is linear between its times, and periodic as the motion.
            times = np.arange(self.num_times) / self.num_times
            known = np.arange(len(self.pressure_ratio)) / len(self.pressure_ratio)
            ratio = np.interp(times, known, self.pressure_ratio, period=1.0)
            given["pressure"] = given["pressure"] * ratio
        return Case(displacement=moved, period=self.period_at(point["velocity"]), **given)

    def bodies(self, point: Mapping[str, Any]) -> TwoBodies:
        """Returns both bodies at a point, given by its numbers on the axes; JAX may trace them."""
        bodies = TwoBodies(self.stack, self.counterface)
        bodies = with_values(bodies, {in_both(path): point[path] for path in self.sweep})
        temperature = self._at(point, "temperature")
        return bodies if temperature is None else bodies.at(temperature)

    def _at(self, point: Mapping[str, Any], name: str) -> Any:
        """A number at a point: of its axis, or that of the scene."""
        return point.get(name, getattr(self, name))

    def all_bodies(self) -> Iterator[tuple[dict[str, float], TwoBodies]]:
        """Yields the bodies that differ, each with their numbers of [sweep] and temperature."""
        axes = {name: at for name, at in self.axes.items() if name in (*self.sweep, "temperature")}
        for numbers in itertools.product(*axes.values()):
            point = dict(zip(axes, numbers, strict=True))
            yield point, self.bodies(point)
