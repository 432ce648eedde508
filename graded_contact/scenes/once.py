"""What happens once in a scene: motions of [motion] with `once = true`, and loads over time.

[motion] once, kind, ...  ──>  Motion, then those of [[motion.then]], one after the other
[load] pressure_path      ──>  pressure, pressure_ratio, ratio_times
"""

import functools
import inspect
from typing import Any

import numpy as np

from ..contacts.inputs import PARTED
from ..core.checks import as_float, check_increasing, check_positive, check_values, within
from ..fields.grid import Grid
from ..readers.recorded_motion import read_over_time
from ..sliding.motion.motion import Motion
from .block import KIND_MAKERS, Block
from .schema import Key, kind_of

ONCE, THEN = Key("once", bool, False), Key("then", list[dict], None)
LIFTED = f"{PARTED} in Python"  # no scene has a gap
_CLOSE = 1e-6  # times that differ by this part of them are one


def motion_of(block: Block, table: dict[str, Any], grid: Grid) -> Motion:
    """Returns the motion of the table [motion]: one that repeats, or happens once.

    **Arguments:**

    - `block`: reads its file, and takes the notes.
    - `table`: its keys.
    - `grid`: a line of points along the motion.
    """
    names = (ONCE.name, THEN.name)
    first = {key: value for key, value in table.items() if key not in names}
    once, later = (
        block.reader.value("[motion]", key, table.get(key.name, default))
        for key, default in ((ONCE, False), (THEN, []))
    )
    single = KIND_MAKERS["transient"] | {"recorded": block.recorded_transient}
    if not once:
        if later:
            raise ValueError("[motion] `then` needs `once = true`.")
        kind = first.get("kind")
        periodic = KIND_MAKERS[Motion] | {"recorded": block.recorded}
        if kind in single and kind not in periodic:
            raise ValueError(f'[motion] kind "{kind}" needs `once = true`.')
        return block.reader.build_kind("[motion]", first, periodic, grid=grid)
    parts = []
    for i, part in enumerate([first, *later]):
        place = f"[[motion.then]] number {i}" if i else "[motion]"
        kind, entries = kind_of(place, part, single)
        make = single[kind]
        given = {"grid": grid} if "grid" in inspect.signature(make).parameters else {}
        parts.append(block.reader.build(place, entries, make, **given))
    return functools.reduce(Motion.then, parts)


def read_load(block: Block, load: dict[str, Any]) -> None:
    """Replaces `pressure_path` in [load] by the numbers of its table."""
    path = load.pop("pressure_path", None)
    if path is None:
        return
    for name in ("pressure", "approach", "pressure_ratio", "ratio_times"):
        if name in load:
            raise ValueError(f"[load] has `pressure_path` and `{name}`: remove one of the two.")
    with within("[load] `pressure_path`:"):
        times, pressures, log = read_over_time(path, "pressures")
        check_positive("pressure", pressures, f"[Pa]{LIFTED}")
    block.take(log, "load")
    highest = np.max(pressures)
    load["pressure"] = np.array([highest])
    load["pressure_ratio"] = (pressures / highest).tolist()
    load["ratio_times"] = (times - times[0]).tolist()


def with_corners(motion: Motion, load: dict[str, Any]) -> Motion:
    """Returns a motion whose steps also end where the load of [load] changes its rate."""
    if "pressure_ratio" not in load and "ratio_times" not in load:
        return motion
    ratios, times = (np.array(load.get(n, [])) for n in ("pressure_ratio", "ratio_times"))
    own, moved = np.asarray(motion.times), np.asarray(motion.displacement)
    with within("[load]"):
        if len(ratios) != len(times):
            raise ValueError(
                f"`pressure_ratio` has {len(ratios)} numbers and `ratio_times` {len(times)}: with "
                "[motion] `once = true` each ratio needs its time [s]."
            )
        allowed = "a time [s] lies between 0 and the end of [motion]"
        check_values("ratio_times", times, allowed, at_least=0, at_most=own[-1] * (1 + _CLOSE))
        check_increasing("ratio_times", as_float(times))
    near = np.any(np.isclose(times[:, None], own, rtol=_CLOSE, atol=0), axis=1)
    whole = np.sort(np.concatenate([own, times[~near & (times > 0)]]))
    return Motion(np.interp(whole, np.append(0, own), np.append(0, moved)), times=whole)
