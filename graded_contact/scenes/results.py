"""Results of a scene: an `xarray.Dataset` with the surface, numbers and fields of the solves.

The results of a scene have, over the axes that it varies, one variable for each number of a solve,
`message` (how the solve ended, empty where it succeeded) and `point` (a name of everything that
decides the numbers). Over `x` and `y` are the `heights` of the surface, of the first seed, and how
much of them was `measured`. Fields of solves that were kept are `contact_pressure`, `gap`,
`displacement` and, where each seed has its own, `contact_heights`: over the axes, `x` and `y` if
all solves were kept, over `x` and `y` if only one was, whose index is the attribute `kept`. Of a
cycle they are also over `time`.
"""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np

from ..core.quantities import OBSERVABLES
from ..core.warnings import CYCLE_RULES, RULES, Caveat, caveats_of, caveats_of_steps
from ..fields.grid import Grid
from ..studies.dataset import FAILED, LOST, NOT_STARTED, mean_and_error, read
from ..surfaces.surface import Step, Surface

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

# Fields of a kept solve: names in a `Sliding` and in the results.
KEPT_FIELDS = {
    "pressure": "contact_pressure",
    "gap": "gap",
    "displacement": "displacement",
    "heights": "contact_heights",
}
SEED_ERROR = "_seed_error"
NEEDED = ("message", "point", "heights", "friction", "contact_area_smooth")


def read_results(path: str | os.PathLike) -> "Dataset":
    """Returns the results that `run_scene`, or the command `run`, gave.

    **Arguments:**

    - `path`: of the HDF5 file.

    **Returns:** an `xarray.Dataset`, bit for bit as it was written; see `run_scene`.

    **Raises:** `FileNotFoundError`; `ValueError` for another file, or a damaged one.
    """
    results = read(path)
    try:
        needed = (*NEEDED, *results["message"].dims)
        _ = [results.variables[name] for name in needed], results.attrs["title"]
        _ = surface_of(results), kept_solves(results), warnings_of(results)
    except Exception as error:  # of many kinds, as what lacks in the file
        raise ValueError(
            f"`path={path}` does not contain the results of a scene, or another version wrote it "
            f"({type(error).__name__}: {error})."
        ) from error
    return results


def state_of(results: "Dataset") -> "DataArray":
    """Returns a word for each solve, over the axes.

    It is empty where the solve succeeded, "not started", "failed" (there is no number) or
    "not converged" (the numbers are partial results).
    """
    message = results["message"]
    words = np.full(message.shape, "not converged", object)
    words[message.values == ""] = ""
    words[message.values == NOT_STARTED] = NOT_STARTED
    words[message.str.startswith(FAILED).values] = "failed"
    return message.copy(data=words.astype(str))


def has_numbers(results: "Dataset") -> "DataArray":
    """Returns for each solve whether it succeeded, or has a friction as a partial result."""
    state, friction = state_of(results), results["friction"]
    found = friction.notnull().any(set(friction.dims) - set(state.dims))
    return (state == "") | (state == "not converged") & found


def warnings_of(results: "Dataset") -> tuple[Caveat, ...]:
    """Returns why numbers are doubtful although solved, and the solves that are concerned."""
    everywhere = np.ones(results["message"].shape, bool)
    rules = CYCLE_RULES if "time" in results.dims else RULES
    of_surface = caveats_of_steps(_steps_of(results), _size_of(results).tolist())
    return (*(Caveat(text, everywhere) for text in of_surface), *caveats_of(results, rules))


def over_seeds(results: "Dataset") -> "Dataset":
    """Returns results without their seeds: means over the surfaces that succeeded.

    `NAME_seed_error` is the standard error of the mean of NAME, NaN for one surface. Errors of
    solvers and shares are the largest of the surfaces, `surfaces` counts them. The `message` is
    empty if all succeeded.
    """
    axes = results["message"].dims
    whole = results[[n for n, v in results.data_vars.items() if {"seed"} <= {*v.dims} <= {*axes}]]
    whole = whole.drop_vars("point", errors="ignore")
    mean, error = mean_and_error(whole)
    solved = results["message"] == ""
    largest = whole.drop_vars("message").where(solved).max("seed", keep_attrs=True)
    found = {}
    for name in mean.data_vars:
        by_mean = name in OBSERVABLES and OBSERVABLES[str(name)].mean_over_seeds
        found[name] = (mean if by_mean else largest)[name]
        if by_mean:
            found[f"{name}{SEED_ERROR}"] = error[name]
    count, state = solved.sum("seed"), state_of(results)
    lost = state.isin(["failed", NOT_STARTED]).all("seed")
    some = [f"{n} of {solved.seed.size} surfaces succeeded." for n in count.values.ravel()]
    part = np.where(lost, results["message"].isel(seed=0), np.reshape(some, count.shape))
    found["message"] = count.copy(data=np.where(count == solved.seed.size, "", part))
    rest = results.drop_dims("seed")
    return rest.assign(found | {"surfaces": count}).transpose(
        *(a for a in axes if a != "seed"), ...
    )


def surface_variables(surface: Surface) -> tuple[dict, dict, dict]:
    """Returns variables, coordinates and attributes of a dataset that hold a surface."""
    heights, size = np.asarray(surface.heights), np.asarray(surface.grid.size)
    axes = ("x", "y")[: heights.ndim]
    places = {
        axis: (axis, np.arange(points) * (length / points), {"period": length})
        for axis, points, length in zip(axes, heights.shape, size, strict=True)
    }
    variables = {"heights": (axes, heights)}
    if surface.measured is not None:
        variables["measured"] = (axes, np.asarray(surface.measured))
    attributes = {
        "surface_history": "\n".join(surface.history),
        "surface_steps": json.dumps(surface.steps),
        "surface_periodic": int(surface.periodic),
    }
    return variables, places, attributes


def surface_of(results: "Dataset") -> Surface:
    """Returns the surface of results, that of the first seed."""
    history, values = results.attrs["surface_history"], results["heights"].values
    return Surface(
        heights=jnp.asarray(values),
        grid=Grid(values.shape, jnp.asarray(_size_of(results))),
        history=tuple(history.split("\n")) if history else (),
        measured=jnp.asarray(results["measured"].values) if "measured" in results else None,
        steps=_steps_of(results),
        periodic=bool(results.attrs.get("surface_periodic", True)),
    )


def _size_of(results: "Dataset") -> np.ndarray:
    return np.array([results[axis].attrs["period"] for axis in results["heights"].dims])


def _steps_of(results: "Dataset") -> tuple[Step, ...]:
    return tuple(Step(*step) for step in json.loads(results.attrs["surface_steps"]))


def kept_solves(results: "Dataset") -> list[tuple[int, ...]]:
    """Returns the indices along the axes of the solves with numbers whose fields were kept."""
    if "gap" not in results:
        return []
    found = [tuple(map(int, index)) for index in np.argwhere(has_numbers(results).values)]
    if {*results["message"].dims} <= {*results["gap"].dims}:
        return found
    last = tuple(n - 1 for n in results["message"].shape)  # in files of earlier versions
    kept = results.attrs.get("kept")
    kept = tuple(map(int, kept.split())) if kept else last
    return [kept] if kept in found else []


def contact_at(results: "Dataset", index: tuple[int, ...]) -> tuple["Dataset", Surface]:
    """Returns `pressure`, `gap` and `displacement` of a solve that was kept, and its surface."""
    kept = {new: name for name, new in KEPT_FIELDS.items() if new in results}
    fields = results[[*kept]]
    at = dict(zip(results["message"].dims, index, strict=True))
    fields = fields.isel({axis: i for axis, i in at.items() if axis in fields.dims}, drop=True)
    fields = fields.rename(kept)
    surface = surface_of(results)
    if "heights" in fields:
        heights = fields["heights"].values
        surface = Surface(jnp.asarray(heights), surface.grid, periodic=surface.periodic)
    return fields, surface


def lost_solves(path: str | os.PathLike, point: np.ndarray) -> tuple[int, dict]:
    """Returns how many solves the file at `path` has that are not in `point`, and its attributes.

    A file that has any must not be replaced by one with only the solves of these names. Solves that
    were not started, or whose worker died, do not count; there are none if there is no file.

    **Raises:** as `read_results`.
    """
    if not Path(path).exists():
        return 0, {}
    earlier = read_results(path)
    finished = ~np.isin(earlier["message"], (NOT_STARTED, LOST))
    return int(np.sum(~np.isin(earlier["point"].values[finished], point))), earlier.attrs
