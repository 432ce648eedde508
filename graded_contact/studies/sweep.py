"""A function at every point of named axes.

    function ──> jaxpr ──> name of a point ──> stored? ──> solved here or by workers ──> Dataset

JAX traces the function once. The text of the trace (https://docs.jax.dev/en/latest/jaxpr.html),
the arrays that it closes over and the numbers of a point name the file of its results. These
arrays are arguments of the compiled code, so that functions which differ in them alone share it.
"""

import contextlib
import functools
import itertools
import os
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, jaxpr_as_fun

from ..contacts.solution import RESULTS
from ..core.compilation import WITH_LOOPS, jit
from ..core.quantities import quantity_of
from ..sliding.number import with_observables
from .points import Point, bytes_of, code_of, digest, patiently, read_point, write_point

if TYPE_CHECKING:
    from xarray import Dataset

NOT_STARTED, FAILED = "not started", "failed: "
DIED = f"{FAILED}its worker died"  # no fault of the point's: it is solved again
Numbers = dict[str, np.generic]  # of a point, by the names of the axes
_MOST_COMPILED = 8  # programs that stay for later sweeps in this process
_COMPILED: dict[str, Callable] = {}
_OPTIONS = ("jax_enable_x64", "jax_compilation_cache_dir")  # that workers share
_compiling = threading.Lock()


def sweep(
    function: Callable[[dict[str, Any]], Any],
    axes: Mapping[str, Any],
    *,
    last: Collection[str] = (),
    store: str | os.PathLike | None = None,
    workers: int | None = None,
    client: Any = None,
    progress: bool = False,
) -> "Dataset":
    """Returns the results of a function at every combination of the axes.

    A point that fails has NaN and its reason as `message`; a point whose solver did not converge
    has its numbers and the message of the solver. With a `store` the results of each point are on
    the disk when it ends, and the same call solves only the points that are missing. If the
    function or an array in it changes, all points are solved again. Ctrl-C returns the results so
    far.

    **Arguments:**

    - `function`: called as function(point), with a dict of scalars by the names of the axes; JAX
      traces it. It returns arrays in any nesting, such as a `Sliding`. Their names are their paths,
      "contact.pressure"; a complex array becomes two, "name.real" and "name.imag".
    - `axes`: coordinates by the name of the axis; whole numbers stay whole, as seeds must.
    - `last`: names of results that only the last point keeps, such as fields.
    - `store`: a folder, with a file for each point; it is made. Other sweeps may share it.
    - `workers`: number of worker processes on this machine (the extra `cluster`). A script with
      workers needs `if __name__ == "__main__":`.
    - `client`: in place of `workers`, a client of `dask.distributed`.
    - `progress`: whether to show a bar.

    **Returns:** a dataset over the axes in their order. A result that is an array has the further
    dimensions `<name>_0`, `<name>_1`, ... `message` is empty where a point succeeded.

    **Raises:** `ValueError` for axes without numbers, and for results with the name of an axis;
    JAX's errors for a function that it cannot trace.
    """
    if workers is not None and (client is not None or workers < 1):
        raise ValueError("`workers` must be at least 1, and not be given beside `client`.")
    axes = {name: _coordinates(name, at) for name, at in axes.items()}
    rows = itertools.product(*axes.values())
    points: list[Numbers] = [dict(zip(axes, row, strict=True)) for row in rows]

    def work(stop: threading.Event) -> "Dataset":
        program = trace(function, points[0])
        like = program.like[0]
        if clash := {*like} & {*axes, "message"}:
            raise ValueError(f"`function` must not return {min(clash)!r}, the name of an axis.")
        files: list[Path | None] = [None] * len(points)
        if store is not None:
            name = digest(program.code, *map(bytes_of, program.closed.consts))
            files = [Path(store, f"{digest(name, _text_of(point))}.npz") for point in points]
        kept = [like.keys() - {*last}] * (len(points) - 1) + [like.keys()]
        found = [file and read_point(file, names) for file, names in zip(files, kept, strict=True)]
        left = {i: point for i, point in enumerate(points) if found[i] is None}
        if not left:
            return _dataset(axes, like, found, last)
        if client is None and workers is None:
            solve = solver(program)
            engine: Any = ((i, solve(point)) for i, point in left.items())
        else:
            engine = on_workers(workers, client, function, left)
        with (
            contextlib.closing(engine),
            _bar(progress, len(points) - len(left), len(points)) as advance,
        ):
            for i, point in engine:
                point = {name: at for name, at in point.items() if name in {*kept[i], "message"}}
                found[i] = point
                if (file := files[i]) is not None and point["message"] != DIED:
                    write_point(file, point)
                advance()
                if stop.is_set():
                    break
        return _dataset(axes, like, found, last)

    return patiently(work)


def _text_of(point: Numbers) -> str:
    return repr({name: (str(value.dtype), value.item()) for name, value in point.items()})


def _coordinates(name: str, values: Any) -> np.ndarray:
    at = np.atleast_1d(np.asarray(values))
    if at.ndim != 1 or not at.size or at.dtype.kind not in "iuf" or not np.all(np.isfinite(at)):
        raise ValueError(f"`axes[{name!r}]` must be finite numbers along one dimension.")
    return at


def _dataset(
    axes: Mapping[str, np.ndarray],
    like: Mapping[str, jax.ShapeDtypeStruct],
    found: list[Point | None],
    last: Collection[str],
) -> "Dataset":
    """The results over the axes, with their units; NaN for missing points."""
    import xarray

    shape = tuple(map(len, axes.values()))
    points = [{"message": np.asarray(NOT_STARTED)} if at is None else at for at in found]
    data: dict[str, Any] = {}
    for name, one in like.items():
        missing = np.full(one.shape, np.nan, np.result_type(one.dtype, 0.0))
        inner = [f"{name}_{i}" for i in range(one.ndim)]
        if name in last:
            data[name] = inner, points[-1].get(name, missing)
        else:
            whole = np.stack([point.get(name, missing) for point in points])
            data[name] = (*axes, *inner), whole.reshape((*shape, *one.shape))
    data["message"] = tuple(axes), np.reshape([str(p["message"]) for p in points], shape)
    results = xarray.Dataset(data, dict(axes))
    for name, variable in results.variables.items():
        if quantity := quantity_of(str(name)):
            variable.attrs = {"units": quantity.unit, "long_name": quantity.meaning}
    return results


class Program(NamedTuple):
    """A traced function of a point.

    **Fields:**

    - `closed`: the jaxpr, and the arrays that the function closes over.
    - `like`: shapes of the results: arrays by name, and a member of `RESULTS`.
    - `code`: a digest of all but these arrays.
    """

    closed: ClosedJaxpr
    like: tuple[dict[str, jax.ShapeDtypeStruct], Any]
    code: str


def trace(function: Callable[[dict[str, Any]], Any], point: Numbers) -> Program:
    """Returns the program of a function; of the point only names and dtypes matter."""
    closed, like = jax.make_jaxpr(lambda point: _named(function(point)), return_shape=True)(point)
    return Program(closed, like, digest(code_of(closed), repr([*like[0]])))


def _named(found: Any) -> tuple[dict[str, jax.Array], Any]:
    """The arrays of a nesting by their paths, and the last of its solves that did not succeed."""
    arrays, end = {}, RESULTS.successful
    is_result = lambda leaf: isinstance(leaf, RESULTS)  # noqa: E731
    for path, leaf in jax.tree_util.tree_leaves_with_path(with_observables(found), is_result):
        name = jax.tree_util.keystr(path, simple=True, separator=".") or "value"
        if is_result(leaf):
            end = RESULTS.where(leaf == RESULTS.successful, end, leaf)
        elif jnp.iscomplexobj(leaf):
            arrays |= {f"{name}.real": jnp.real(leaf), f"{name}.imag": jnp.imag(leaf)}
        else:
            arrays[name] = jnp.asarray(leaf)
    return arrays, end


def solver(program: Program) -> Callable[[Numbers], Point]:
    """Returns the function that solves one point; a point that fails has its reason only."""
    if program.code not in _COMPILED:
        if len(_COMPILED) == _MOST_COMPILED:  # the oldest goes
            del _COMPILED[next(iter(_COMPILED))]
        jaxpr = program.closed.jaxpr
        lifted = jaxpr.replace(constvars=[], invars=[*jaxpr.constvars, *jaxpr.invars])
        closed = ClosedJaxpr(lifted, [])
        # Surfaces count, closed over or drawn by the function.
        made = (variable.aval for equation in jaxpr.eqns for variable in equation.outvars)
        large = any(getattr(aval, "size", 0) > WITH_LOOPS for aval in (*closed.in_avals, *made))
        small = 0 if large else WITH_LOOPS
        _COMPILED[program.code] = jit(jaxpr_as_fun(closed), small=small)
    run, arrays = _COMPILED[program.code], jax.device_put(program.closed.consts)

    def solve(point: Numbers) -> Point:
        try:
            numbers = map(jnp.asarray, jax.tree.leaves(point))
            found = jax.tree.map(np.asarray, run(*arrays, *numbers))
        except RuntimeError as error:  # `eqx.error_if` raises through XLA
            if "RESOURCE_EXHAUSTED" in str(error):  # no fault of the point's
                raise
            return {"message": np.asarray(FAILED + str(error).strip())}
        values, end = jax.tree.unflatten(jax.tree.structure(program.like), found)
        message = "" if end == RESULTS.successful else RESULTS[end]
        return values | {"message": np.asarray(message)}

    return solve


def on_workers(
    workers: int | None, client: Any, function: Callable, points: Mapping[int, Numbers]
) -> Iterator[tuple[int, Point]]:
    """Yields the results of points as workers of dask end them, in any order.

    The function goes to each worker once, by cloudpickle, and is compiled there once. dask replaces
    a worker that dies, and solves its points again, up to three times.
    """
    try:
        import cloudpickle
        from distributed import KilledWorker, as_completed
    except ImportError as error:
        raise ImportError("Workers need `pip install 'graded_contact[cluster]'`.") from error

    with contextlib.ExitStack() as stack:
        client = client or stack.enter_context(_local_workers(workers))
        options = {name: getattr(jax.config, name) for name in _OPTIONS}
        # Packed twice: unpacking the function may start XLA, which must wait for the options.
        code = cloudpickle.dumps((function, next(iter(points.values()))))
        # By a task: dask repeats it if all workers that have its result have died.
        packed = client.submit(bytes, cloudpickle.dumps((options, code)), pure=False)
        futures = {
            client.submit(_solve_there, packed, at, pure=False): i for i, at in points.items()
        }
        try:
            for future in as_completed([*futures], loop=client.loop):
                try:
                    yield futures[future], future.result()
                except KilledWorker:
                    yield futures[future], {"message": np.asarray(DIED)}
                future.release()
        finally:
            client.cancel([*futures])


@contextlib.contextmanager
def _local_workers(workers: int | None) -> Iterator[Any]:
    from distributed import Client, LocalCluster

    # Ctrl-C reaches all processes of a terminal; only this one handles it.
    deaf = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            memory_limit=0,
            silence_logs=50,
            dashboard_address="127.0.0.1:0",
            preload=[deaf],
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


def _solve_there(packed: bytes, point: Numbers) -> Point:
    with _compiling:  # a worker may have several threads
        solve = _unpacked(packed)
    return solve(point)


@functools.lru_cache(maxsize=2)
def _unpacked(packed: bytes) -> Callable[[Numbers], Point]:
    import cloudpickle

    options, code = cloudpickle.loads(packed)
    for option, value in options.items():
        jax.config.update(option, value)
    return solver(trace(*cloudpickle.loads(code)))


@contextlib.contextmanager
def _bar(shown: bool, done: int, total: int) -> Iterator[Callable[[], None]]:
    """Gives the function to call after each point."""
    if not shown:
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as bar:
        task = bar.add_task("compiling", completed=done, total=total)
        yield lambda: bar.update(task, advance=1, description="solving")
