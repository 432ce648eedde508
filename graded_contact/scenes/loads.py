"""The tables [load], [sweep] and [motion]: axes of a scene, its motion, and loads over time."""

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import ArrayLike, Float

from ..core.checks import as_float, check_ascending, check_positive, check_values
from ..fields.frequency import velocity_along
from ..fields.grid import Grid
from ..readers.series import read_over_time
from ..sliding import Motion
from .builder import Builder, check_table, in_table, tables_of
from .kinds import CYCLES, TRANSIENTS

AXES = ("temperature", "direction", "pressure", "approach", "velocity")  # of [load], in this order
LINEAR = ("temperature", "direction")
OVER_TIME = ("pressure_ratio", "ratio_times", "pressure_path")
OPTIONS = ("strain_per_slope",)  # of a case
_CLOSE = 1e-6  # times that differ by this part of them are equal


class LoadOverTime(NamedTuple):
    """Ratios of the load to `pressure`, linear in between; of a cycle they repeat.

    **Fields:**

    - `times`: t [s], of a cycle t over the period [1], shape `(n,)`.
    - `ratios`: of the load to the pressure of the scene [1], shape `(n,)`.
    """

    times: Float[Array, " n"]
    ratios: Float[Array, " n"]

    def at(self, motion: Motion) -> np.ndarray:
        """Returns the ratios at the times of a motion."""
        if motion.times is not None:
            return np.asarray(np.interp(motion.times, self.times, self.ratios))
        times = np.arange(motion.num_times) / motion.num_times
        return np.interp(times, self.times, self.ratios, period=1.0)


def axis_of(place: str, name: str, value: Any) -> Float[np.ndarray, " values"]:
    """Returns the values of a number, a list, or {from, to, points}.

    They are equally spaced, of pressures, velocities and numbers of bodies in the logarithm.
    """
    with in_table(place):
        if isinstance(value, dict):
            check_table(f"{place}.{name}", value, ("from", "to", "points"))
            if len(value) < 3:
                raise ValueError(f"`{name}` must be a number, a list or {{from, to, points}}.")
            spaced = np.linspace if name in LINEAR else np.geomspace
            value = spaced(value["from"], value["to"], value["points"])
        if isinstance(value, bool | str) or np.size(value) == 0:
            raise ValueError(f"`{name}={value!r}` must be a number or a list of numbers.")
        values = np.atleast_1d(np.asarray(value, float))
        check_values(name, values, "it must be finite")
        if name == "pressure":
            check_positive(name, values, "[Pa]")
        if name == "direction":
            turn = 2 * np.pi
            allowed = "an angle [rad] must lie between -2π and 2π"
            check_values(name, values, allowed, at_least=-turn, at_most=turn)
    return values


def load_axes(load: dict[str, Any]) -> dict[str, Float[np.ndarray, " values"]]:
    """Returns the axes of the table [load]."""
    check_table("load", load, (*AXES, *OVER_TIME, *OPTIONS))
    given = [n for n in ("pressure", "approach", "pressure_path") if n in load]
    if len(given) != 1:
        got = " and ".join(f"`{name}`" for name in given) or "none of them"
        raise ValueError(f"[load] needs `pressure`, `approach` or `pressure_path`, not {got}.")
    return {name: axis_of("load", name, load[name]) for name in AXES if name in load}


def load_over_time(
    builder: Builder, load: dict[str, Any], motion: Motion | None
) -> tuple[LoadOverTime | None, float | None]:
    """Returns how the load of a motion varies, and its highest pressure [Pa] if that is in a file.

    A file is a table "time [s], pressure [Pa]".
    """
    ratios, times, path = (load.get(name) for name in OVER_TIME)
    if path is None and ratios is None and times is None:
        return None, None
    with in_table("load"):
        if motion is None or "approach" in load:
            raise ValueError("a load over time needs a [motion] and a pressure.")
        if path is not None:
            if motion.repeats:
                raise ValueError("`pressure_path` is for [[motion]]: a cycle has `pressure_ratio`.")
            path = builder.entry("load", "pressure_path", path)
            times, pressures = read_over_time(path, "pressures")
            check_positive("pressure", pressures, "[Pa]")
            check_ascending(1, time=as_float(times))
            highest = float(np.max(pressures))
            return LoadOverTime(as_float(times - times[0]), as_float(pressures / highest)), highest
        ratios = as_float(ratios, "pressure_ratio")
        check_positive("pressure_ratio", ratios, "[1]")
        if motion.repeats:
            if times is not None:
                raise ValueError("`ratio_times` is for [[motion]]: a cycle has equal times.")
            times = np.arange(ratios.size) / ratios.size
        times = as_float(times, "ratio_times")
        check_ascending(1, ratio_times=times, pressure_ratio=ratios)
        check_values("ratio_times", times, "a time [s] is 0 or positive", at_least=0)
        return LoadOverTime(times, ratios), None


def motion_of(builder: Builder, table: Any, line: Grid) -> Motion | None:
    """Returns a cycle for a table [motion], and a transient motion for a list [[motion]].

    `line` are points along the motion, whose spacing decides the number of times.
    """
    if table is None:
        return None
    if not isinstance(table, list):
        return builder.build_kind("motion", table, CYCLES, grid=line)
    parts = [
        builder.build_kind(place, part, TRANSIENTS, grid=line)
        for place, part in tables_of("motion", table).items()
    ]
    return functools.reduce(Motion.then, parts)


def line_along(grid: Grid, directions: ArrayLike) -> Grid:
    """Returns points along x on which a step is as long as on the turned path on a grid.

    Of several directions [rad] it is the one in which a path crosses most points.
    """
    crossed = []
    for angle in np.ravel(directions):
        along = np.abs(np.ravel(velocity_along(1.0, float(angle))))[: grid.ndim]
        crossed.append(np.sum(along / np.asarray(grid.spacing)[: len(along)]))
    return Grid(grid.shape[:1], grid.shape[0] / max(crossed))


def with_corners(motion: Motion, load: LoadOverTime) -> Motion:
    """Returns a motion whose steps also end where the load changes its rate."""
    own, moved = np.asarray(motion.times), np.asarray(motion.displacement)
    times = np.asarray(load.times)
    if times[-1] > own[-1] * (1 + _CLOSE):
        raise ValueError("[load] `ratio_times` must end before the motion does.")
    near = np.any(np.isclose(times[:, None], own, rtol=_CLOSE, atol=0), axis=1)
    whole = np.sort(np.concatenate([own, times[~near & (times > 0)]]))
    return Motion(np.interp(whole, np.append(0, own), np.append(0, moved)), times=whole)


def turned(displacement: Float[Array, " nt"], direction: ArrayLike) -> Float[Array, "nt ..."]:
    """Returns a path along x in another direction [rad]; unchanged along x."""
    along = jnp.atleast_1d(velocity_along(1.0, direction))
    return displacement if len(along) == 1 else displacement[:, None] * along
