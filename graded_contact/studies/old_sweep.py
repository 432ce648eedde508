"""A function at many points of named axes; each result is stored when it ends."""

import contextlib
import importlib.util
import os
import time
from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import jax
import numpy as np

from ..core.checks import Numbers, as_float, check_values, short
from ..core.memory import SMALL, available_memory, in_gigabytes
from ..sliding.transient.run import followed
from .dataset import FAILED, LOST, NOT_STARTED, attach
from .interruption import Interruption, ctrl_c_later
from .journal import PointJournal, forget
from .program import Program, Task, runner, trace
from .store import Point, Store, open_store, together
from .workers import check_workers, connected, num_cores, on_workers, pays

if TYPE_CHECKING:
    from xarray import Dataset

Workers = int | Literal["auto"] | None


def sweep(
    function: Callable[[dict[str, Any]], Any],
    axes: Mapping[str, Numbers] | Sequence[Mapping[str, Any]],
    *,
    store: str | os.PathLike | Store | None = None,
    workers: Workers = None,
    client: Any = None,
    units: Mapping[str, str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> "Dataset":
    """Returns the results of a function at every point of a grid, or of a list.

    One compiled function solves all points. A point that fails has its reason and NaN; a point
    whose solver did not converge has the message of the solver and its numbers. With a `store`
    each result is on the disk when its point ends; the same call then solves only the points that
    are missing or damaged (with a warning), and those whose worker died. If the function or a
    number in it changes, all points are solved again. Ctrl-C returns the results so far.

    Each point is solved by itself: a start from its neighbour saves 2 to 12 % of the FFT pairs, but
    the bits would depend on the points solved before. The same call on the same machine gives the
    same bits. Workers give the same bits if they have as many cores as this process and the same
    `XLA_FLAGS`; otherwise last digits may differ.

    **Arguments:**

    - `function`: called as function(point), with a dict of scalars by the names of the axes; JAX
      traces it. It returns arrays in any nesting, such as a `Sliding`. Their names are their paths,
      "friction"; a complex array becomes two, "name.real" and "name.imag".
    - `axes`: coordinates by the name of the axis, each of one dimension: every combination is a
      point. Or a list of points, each a dict with the same names.
    - `store`: a folder, which is made, or a `Store`.
    - `workers`: number of worker processes on this machine; "auto": one per core, from the moment
      that they save time. A script with workers needs `if __name__ == "__main__":`.
    - `client`: in place of `workers`, a client of `dask.distributed`, or the address of a
      scheduler, "tcp://host:8786".
    - `units`: of axes and results by name, in addition to those that the package knows.
    - `progress`: called with the number of finished points and of all points: when the program is
      compiled, and after each point.

    **Returns:** a dataset over the axes in their order, or over `point` for a list. `message` is
    empty where a point succeeded; otherwise "not started", "failed: ..." or the solver's message.
    A result that is an array has the further dimensions `<name>_0`, `<name>_1`, ...

    **Raises:** `ValueError` for axes without points, with equal or not finite coordinates, or on
    which no result depends, for names that no axis has, or for results larger than the memory;
    `BlockingIOError` if another process writes to the store; `OSError` if the store cannot be
    written, or if no scheduler or worker answers; `ConnectionError` if the scheduler ends; what JAX
    raises for a function that it cannot trace.
    """
    import xarray

    coordinates, columns = _points(axes)
    shape = tuple(map(len, coordinates.values()))
    with ctrl_c_later() as later:
        # Only names and dtypes of the first point matter: one program solves all points.
        program = trace(function, {name: column[0] for name, column in columns.items()})
        later.check()
        _check_results(program, columns, int(np.prod(shape)))
        names = [] if store is None else program.names_of(columns)
        with open_store(store) as points_of:
            engine = {"workers": workers, "client": client, "progress": progress}
            points = solve_points(program, columns, names, store=points_of, **engine)
    # Arrays of one point become arrays over all axes, and NaN stands for what is missing.
    ends = [NOT_STARTED if point is None else point.message for point in points]
    data: dict[str, Any] = {}
    for name, like in program.like[0].items():
        dimensions = (*coordinates, *(f"{name}_{i}" for i in range(like.ndim)))
        data[name] = dimensions, together(name, like, points).reshape(*shape, *like.shape)
    data["message"] = tuple(coordinates), np.reshape(ends, shape)
    if list(columns) != list(coordinates):  # of a list of points, whose one axis is `point`
        coordinates |= {name: ("point", column) for name, column in columns.items()}
    return attach(xarray.Dataset(data, coordinates), units or {})


def solve_points(
    program: Program, columns: dict[str, np.ndarray], names: Sequence[str] = (), *,
    store: Store | None = None, workers: Workers = None, client: Any = None,
    keep: Sequence[Collection[str]] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Point | None]:  # fmt: skip
    """Returns the result of a program at each point, None where Ctrl-C came first.

    **Arguments:**

    - `program`: of a function as in `sweep`.
    - `columns`: one number per point by the names that the function reads.
    - `names`: of the points in the store, see `Program.names_of`.
    - `store`: points that it holds are not solved again.
    - `workers`, `client`, `progress`: as in `sweep`.
    - `keep`: names of the results of each point that are needed, None: all. A point of the store
      that lacks any of them is solved again.

    **Raises:** as `sweep`.
    """
    check_workers(workers, client)
    count = len(next(iter(columns.values())))
    points: list[Point | None] = [None] * count
    tasks: dict[int, Task] = {}
    # A stored point that lacks a result is damaged; with `keep` it was stored without its fields.
    whole = () if keep else program.like[0]
    for i in range(count):
        needed = keep[i] if keep else None
        point = None if store is None else store.read(names[i], whole)
        has_all = point is not None and point.values.keys() >= {*(needed or ())}
        if point is not None and (has_all or point.message.startswith(FAILED)):
            points[i] = point
        else:
            tasks[i] = {name: column[i] for name, column in columns.items()}, needed
    stored, steps = count - len(tasks), program.steps or 1

    def say(done: int, of_next: int = 0) -> None:
        if progress is not None:
            progress((stored + done) * steps + of_next, count * steps)

    if not tasks:
        say(0)
        return points
    with (
        ctrl_c_later() as later,
        contextlib.suppress(KeyboardInterrupt),
        # Closing ends workers and cancels their tasks at once, also after Ctrl-C.
        contextlib.closing(
            _solved(program, tasks, workers, client, later, say, store, names)
        ) as solved,
    ):
        for done, (i, point) in enumerate(solved, start=1):
            points[i] = point
            if store is not None and point.message != LOST:  # a lost point is tried again
                store.write(names[i], point)
                forget(store, names[i])
            say(done)
    return points


def _solved(
    program: Program, tasks: dict[int, Task], workers: Workers, client: Any, later: Interruption,
    say: Callable[[int, int], None], store: Store | None, names: Sequence[str],
) -> Generator[tuple[int, Point]]:  # fmt: skip
    """Yields points as they end: in this process, on workers, or first here and then there.

    `say` is called with the points and steps done: first when the program is compiled.
    """

    def after_steps(done: int, steps: int) -> None:
        say(done, steps)
        later.check()

    left = dict(tasks)
    if client is None and workers in (None, "auto"):
        can_start = workers == "auto" and importlib.util.find_spec("distributed")
        # Processes on one GPU would compete for its memory.
        can_start = can_start and jax.default_backend() == "cpu"
        start = time.perf_counter()
        solve = runner(program)
        later.check()
        compiling = time.perf_counter() - start
        if not program.steps:  # of which the first point compiles the segments
            say(0, 0)
        for done, (i, task) in enumerate(tasks.items()):
            start = time.perf_counter()
            name = names[i] if names else ""
            with followed(PointJournal(store, name, partial(after_steps, done))):
                point = solve(task)
            yield i, point
            later.check()  # the point is kept
            del left[i]
            seconds = time.perf_counter() - start
            if program.steps and not done:
                compiling = seconds
            elif can_start and pays(len(left) * seconds, compiling):
                break
    else:
        say(0, 0)
    if left:
        count = num_cores() if workers == "auto" else workers
        with connected(count, client) as client:
            for found in on_workers(client, program, left):
                yield found
                later.check()


def _points(axes: Any) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Coordinates of the axes, and one number per point for each name."""
    if isinstance(axes, Mapping) and axes:
        coordinates = {name: _numbers(name, at) for name, at in axes.items()}
        columns = columns_of(coordinates)
    elif isinstance(axes, list | tuple) and axes:
        for i, point in enumerate(axes):
            if not isinstance(point, Mapping) or not point or point.keys() != axes[0].keys():
                text = f"`axes[{i}]={short(point)}` must be a dict with the names of the first"
                raise ValueError(f"{text} point, {short(axes[0])}.")
        columns = {name: _numbers(name, [point[name] for point in axes]) for name in axes[0]}
        coordinates = {"point": np.arange(len(axes))}
    else:
        raise ValueError(
            f"`axes={short(axes)}` must be a dict of axes or a list of points, one at least."
        )
    # A store names a point by its numbers: equal points would share a file.
    if len(np.unique(np.stack([*columns.values()]), axis=1).T) < len(next(iter(columns.values()))):
        raise ValueError(f"`axes={short(axes)}` contains a point twice.")
    return coordinates, columns


def columns_of(axes: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Returns one number per point of a grid for each axis; the last axis varies fastest."""
    grid = np.meshgrid(*axes.values(), indexing="ij")
    return {name: at.ravel() for name, at in zip(axes, grid, strict=True)}


def _numbers(name: Any, values: Any) -> np.ndarray:
    """One number per point: floating-point, or whole as seeds are."""
    if not isinstance(name, str) or not name or "/" in name or name in ("message", "point"):
        raise ValueError(
            f"`axes` has the name {name!r}: a text without a slash is needed, other than "
            '"message" and "point".'
        )
    # Whole numbers stay whole: a float is no seed.
    whole = np.asarray(values).dtype.kind in "iu"
    at = np.asarray(values) if whole else np.asarray(as_float(values, name))
    if at.ndim != 1 or not at.size:
        raise ValueError(f"`{name}` has shape {at.shape}: one axis with points is needed.")
    check_values(name, at, "the numbers of an axis are finite")
    return at


def _check_results(program: Program, columns: dict[str, Any], count: int) -> None:
    """Refuses what no study can hold, before anything is computed."""
    results = program.like[0]
    if not results:
        raise ValueError("`function` returns no numbers.")
    # An unused axis is mostly a misspelt name in the function.
    idle = [name for name in program.unused if len(np.unique(columns[name])) > 1]
    if idle:
        raise ValueError(
            f"`axes` has {idle[0]!r}, on which no result of `function` depends: leave the axis "
            "out, or use it."
        )
    twice = [name for name in results if name in (*columns, "point", "message")]
    if twice:
        raise ValueError(f"`function` returns {twice[0]!r}, the name of an axis: use another name.")
    one = sum(like.size * like.dtype.itemsize for like in results.values())
    free = available_memory() if one * count > SMALL else None
    if free is not None and one * count > free:
        raise ValueError(
            f"`axes` is refused: {count} points take {in_gigabytes(one)} each, and "
            f"{in_gigabytes(free)} of memory are free. {int(free // one)} points would fit."
        )
