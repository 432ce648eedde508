"""A function at many points of named axes, each point kept at once."""

import contextlib
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from ..core.checks import Numbers, as_float, check_values, short
from ..core.memory import SMALL, available_memory, in_gigabytes
from ..files.dataset import package_versions
from ..files.study import FAILED, LOST, NOT_STARTED, Study, units_of
from .chunk import Work, bytes_of
from .engine import check_engine, solved
from .program import Program, identity, trace
from .store import Point, Store, fingerprint


def sweep(
    function: Callable[[dict[str, Any]], Any],
    axes: Mapping[str, Numbers] | Sequence[Mapping[str, Any]],
    *,
    store: str | os.PathLike | Store | None = None,
    workers: int | Literal["auto"] | None = None,
    scheduler: str | None = None,
    client: Any = None,
    units: Mapping[str, str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Study:
    """Returns what a function gives at every point of a grid, or of a list.

    Points are solved in this process by one compiled program, unless workers are asked for; the
    bits are the same. A point that fails is kept with its reason, one whose solver did not converge
    with its message and its numbers, and the rest goes on. With a `store` every finished point is
    on the disk at once, and a rerun computes what is missing there, and what only the machine
    failed at (its worker died); another function, which is told
    by its program, is another study. Ctrl-C returns what there is, with "not started" for the rest.

    Functions that differ only in numbers that they close over (heights, a thickness) share the
    compiled code in JAX's compilation cache (`jax_compilation_cache_dir`), unless they call back
    into Python. Each point starts afresh: a start from its neighbour saves 2 to 12 % of the FFT
    pairs, and would make its bits depend on what was solved before.

    **Arguments:**

    - `function`: called as function(point), point being a dict of scalars by the axes' names,
      traced by JAX. It returns arrays in any nesting, such as a `Sliding`: their names are the
      paths to them, "friction"; complex ones come as two, "name.real" and "name.imag".
    - `axes`: coordinates of each axis by its name, of one dimension: every combination is a point.
      Or a list of points, each a dict of the same names.
    - `store`: a folder, which is made, or a `Store`.
    - `workers`: how many processes on this machine solve; or "auto": this process begins, and is
      relieved by one worker per core if that saves time. A script that has them needs
      `if __name__ == "__main__":`. Instead of these
    - `scheduler`: address of a scheduler of `dask.distributed` that runs, "tcp://...", or
    - `client`: of `dask.distributed`.
    - `units`: of axes and quantities, by name, beside those that are known here.
    - `progress`: called with the number of finished points and of all points, each second or solve.

    **Returns:** a `Study`.

    **Raises:** `ValueError` for axes without points, with equal or not finite ones, or on
    which nothing depends, for names that no axis has, or for a result that is more than the memory
    holds; `BlockingIOError` if another process writes to the store; `OSError` if it cannot be
    written; `TimeoutError` if the scheduler does not answer or has no worker, `ConnectionError` if
    it ends; what JAX raises for a function that it cannot trace.
    """
    check_engine(workers, scheduler, client)
    coordinates, columns = _points(axes)
    count, shape = len(next(iter(columns.values()))), tuple(map(len, coordinates.values()))
    program = trace(function, {name: column[0] for name, column in columns.items()})
    _check_results(program, columns, count)
    with contextlib.ExitStack() as opened:
        if isinstance(store, str | os.PathLike):
            store = opened.enter_context(Store(store))
        points = solve_points(
            program, columns, [] if store is None else _names(program, columns), store=store,
            workers=workers, scheduler=scheduler, client=client, progress=progress,
        )  # fmt: skip
    values = {name: _together(name, one, points, shape) for name, one in program.like[0].items()}
    ends = [NOT_STARTED if point is None else point.message for point in points]
    if list(columns) != list(coordinates):
        values = {**columns, **values}
    of = units_of((*coordinates, *values), units or {})
    return Study(coordinates, values, np.array(ends).reshape(shape), of)


def solve_points(
    function: Callable[[dict[str, Any]], Any] | Program,
    columns: dict[str, np.ndarray],
    names: Sequence[str] = (),
    *,
    store: Store | None = None,
    workers: int | Literal["auto"] | None = None,
    scheduler: str | None = None,
    client: Any = None,
    keep: Sequence[Collection[str]] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Point | None]:
    """Returns what a function gives at each point, None where Ctrl-C came first.

    **Arguments:**

    - `function`: as in `sweep`, or its program.
    - `columns`: one number per point by the names that the function knows.
    - `names`: of the points in the store, each by all that decides its numbers.
    - `store`: keeps each point as it ends; those that it has are not computed again.
    - `workers`, `scheduler`, `client`, `progress`: as in `sweep`.
    - `keep`: names of what to keep of each point, None: all. A point of the store that lacks any of
      them is computed again.

    **Raises:** `OSError` if the store cannot be written.
    """
    check_engine(workers, scheduler, client)
    count = len(next(iter(columns.values())))
    points: list[Point | None] = [None] * count
    if store is not None:
        points = [store.read(name) for name in names]
    missing = [i for i in range(count) if not _is_whole(points[i], keep[i] if keep else ())]
    for i in missing:
        points[i] = None
    if progress is not None and len(missing) < count:
        progress(count - len(missing), count)
    if not missing:
        return points
    if not isinstance(function, Program):
        function = trace(function, {name: column[0] for name, column in columns.items()})
    versions = package_versions()
    ended = solved(function, Work(columns, keep, missing), workers, scheduler, client)
    with contextlib.suppress(KeyboardInterrupt), contextlib.closing(ended):
        for part, values, messages in ended:
            for i, found, message in zip(part, values, messages, strict=True):
                inputs = {name: column[i] for name, column in columns.items()}
                point = points[i] = Point(found, message, inputs | versions)
                if store is not None and message != LOST:
                    store.write(names[i], point)
            if progress is not None:
                progress(count - points.count(None), count)
    return points


def _is_whole(point: Point | None, wanted: Collection[str]) -> bool:
    """Whether a point from the store has all that is wanted, or failed."""
    return point is not None and (
        point.message.startswith(FAILED) or point.values.keys() >= set(wanted)
    )


def _points(axes: Any) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Coordinates of the axes, and one number per point for each name."""
    if isinstance(axes, Mapping):
        coordinates = {name: _axis(name, at) for name, at in axes.items()}
        if not coordinates:
            raise ValueError("`axes={}` has no points: give at least one axis.")
        grid = np.meshgrid(*coordinates.values(), indexing="ij")
        return coordinates, {name: at.ravel() for name, at in zip(coordinates, grid, strict=True)}
    if isinstance(axes, str) or not isinstance(axes, Sequence) or not axes:
        raise ValueError(f"`axes={short(axes)}` must be a dict of axes or a list of points.")
    for i, point in enumerate(axes):
        if not isinstance(point, Mapping) or not point or point.keys() != axes[0].keys():
            raise ValueError(
                f"`axes[{i}]={short(point)}` must be a dict with the names of the first point, "
                f"{short(axes[0])}."
            )
    columns = {name: _numbers(name, [point[name] for point in axes]) for name in axes[0]}
    each = np.stack(list(columns.values()), axis=1)
    if len(np.unique(each, axis=0)) < len(each):
        raise ValueError("`axes` lists a point twice.")
    return {"point": np.arange(len(axes))}, columns


def _axis(name: str, values: Any) -> np.ndarray:
    at = _numbers(name, values)
    if len(np.unique(at)) < len(at):
        raise ValueError(f"`{name}={short(values)}` holds a value twice.")
    return at


def _numbers(name: Any, values: Any) -> np.ndarray:
    """One number per point: floating-point, or whole as seeds are."""
    if not isinstance(name, str) or not name or "/" in name or name in ("message", "point"):
        raise ValueError(
            f"`axes` has the name {name!r}: a text without a slash is needed, other than "
            '"message" and "point".'
        )
    whole = np.asarray(values).dtype.kind in "iu"
    at = np.asarray(values) if whole else np.asarray(as_float(values, name))
    if at.ndim != 1 or not at.size:
        raise ValueError(
            f"`{name}` has shape {at.shape}: one axis with a point at least is needed."
        )
    check_values(name, at, "the numbers of an axis are finite")
    return at


def _check_results(program: Program, columns: dict[str, Any], count: int) -> None:
    """Refuses no results, those with the name of an axis or beyond memory, and axes that nothing
    depends on, before anything is computed."""
    if not program.like[0]:
        raise ValueError("`function` returns no numbers: a study of it has nothing to keep.")
    idle = [name for name in program.unused if len(np.unique(columns[name])) > 1]
    if idle:
        raise ValueError(
            f"`axes` has {idle[0]!r}, on which nothing that `function` returns depends: leave the "
            "axis out, or use it."
        )
    twice = [name for name in program.like[0] if name in (*columns, "point", "message")]
    if twice:
        raise ValueError(
            f"`function` returns {twice[0]!r}, which is the name of an axis or of what a study "
            "adds: give it another."
        )
    one = bytes_of(program)
    free = available_memory() if one * count > SMALL else None
    if free is not None and one * count > free:
        raise ValueError(
            f"`axes` is refused: {count} points with {in_gigabytes(one)} each are more than the "
            f"{in_gigabytes(free)} of memory that are free. {int(free // one)} would fit; or let "
            "`function` return less."
        )


def _names(program: Program, columns: dict[str, np.ndarray]) -> list[str]:
    """A name for each point by all that decides its numbers."""
    versions = package_versions()
    decisive = {key: versions[key] for key in ("version_graded_contact", "version_jax")}
    name = identity(program)
    values = zip(*columns.values(), strict=True)
    return [fingerprint(decisive, name, list(columns), [*map(np.asarray, v)]) for v in values]


def _together(name, like, points, shape) -> np.ndarray:
    """One array of a quantity at all points, NaN where there is none."""
    found = [None if point is None else point.values.get(name) for point in points]
    dtype = np.result_type(like.dtype, 0.0) if any(one is None for one in found) else like.dtype
    whole = np.full((len(points), *like.shape), np.nan if dtype.kind == "f" else 0, dtype)
    for i, one in enumerate(found):
        if one is not None:
            whole[i] = one
    return whole.reshape(*shape, *like.shape)
