"""Results of a scene: an `xarray.Dataset` with the surface, numbers and fields of the solves.

The results of a scene have, over the axes that it varies, one variable for each number of a solve,
`message` (how the solve ended, empty where it succeeded) and `point` (a name of everything that
decides the numbers). Over `x` and `y` are the `heights` of the surface, of the first seed, and how
much of them was `measured`. Fields of solves that were kept are `contact_pressure`, `gap`,
`displacement` and, where each seed has its own, `contact_heights`: over the axes, `x` and `y` if
all solves were kept, over `x` and `y` if only one was, whose index is the attribute `kept`. Of a
cycle they are also over `time`, of what happens once over `field_time`.
"""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from ..contacts.solution import FAILURES, RESULTS
from ..core.quantities import CYCLE, STEADY, TRANSIENT, mean_over_seeds
from ..core.warnings import ResultWarning
from ..fields.grid import Grid
from ..sliding import result
from ..sliding.errors.parts import NO_FRICTION
from ..studies.dataset import FAILED, LOST, NOT_STARTED, read_dataset
from ..surfaces.reading_steps import ReadingStep
from ..surfaces.surface import Surface

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

# Fields of a kept solve: names in a `Sliding` and in the results, where `pressure` is an axis and
# `heights` are those of the first seed.
KEPT_FIELDS = {
    "pressure": "contact_pressure", "gap": "gap", "displacement": "displacement",
    "heights": "contact_heights",
}  # fmt: skip
TIME = {"units": "s", "long_name": "time"}  # of what happens once
FLOWS = ("flow_along_x", "flow_along_y")  # over time, of what happens once
LEAKAGE = ("leakage_along_x", "leakage_along_y")  # with [fluid], over the same as the flows
DEPTH = "_depth"  # of a stress, at which it acts
SEED_ERROR = "_seed_error"
NO_NUMBERS = tuple(RESULTS[end] for end in FAILURES)  # messages of solves without numbers
# Messages of solves whose numbers are in the file, but not printed.
PARTIAL = tuple(
    RESULTS[end]
    for end in (
        RESULTS.max_steps_reached, RESULTS.rounding, RESULTS.unresolved, RESULTS.not_settled,
        RESULTS.too_hot,
    )
)  # fmt: skip
# What the numbers of a file mean: its attribute `format` counts the changes. Each entry says what
# was different before. Files without the attribute are of the first two formats.
FORMATS = {
    2: "± were errors of the solver alone, not total errors, and areas were counts of points",
}
FORMAT = max(FORMATS)


def read_results(path: str | os.PathLike) -> "Dataset":
    """Returns the results that `Plan.run`, or the command `run`, gave.

    **Arguments:**

    - `path`: of the HDF5 file.

    **Returns:** an `xarray.Dataset`, bit for bit as it was written; see `Plan.run`.

    **Raises:** `FileNotFoundError`; `ValueError` for another file, a damaged one, one that another
    program is changing, and one of a later format.
    """
    if Path(path).suffix == ".toml":
        raise ValueError(
            f"`path={path}` is a scene, which has no numbers yet: run `graded-contact run {path}` "
            "and give its results, a file that ends in .h5."
        )
    results, older = read_dataset(path), ""
    try:
        older = older_meaning(results)
        needed = ("message", "point", "heights", "friction", "contact_area")
        _ = [results.variables[name] for name in (*needed, *results["message"].dims)]
        _ = surface_of(results), kept_solves(results), warnings_of(results)
        _ = [str(results.attrs[name]) for name in ("title", "scene")]
    except Exception as error:  # of many kinds, as what lacks in the file
        raise ValueError(
            f"`path={path}` does not contain the results of a scene, or another version wrote it "
            f"({type(error).__name__}: {error})" + f"; it is {older}" * bool(older) + "."
        ) from error
    if (number := format_of(results)) > FORMAT:
        raise ValueError(
            f"`path={path}` has results of format {number}, this version knows formats up to "
            f"{FORMAT}: read it by the version that wrote it, or a later one."
        )
    return results


def format_of(results: "Dataset") -> int:
    """Returns the number of the format of results, see `FORMATS`."""
    if "format" in results.attrs:
        return int(results.attrs["format"])
    # The second format was in use before the number was written.
    return 2 if any(str(name).endswith("_error") for name in results) else 1


def older_meaning(results: "Dataset") -> str:
    """Returns what the numbers of results mean in another way than today; usually nothing."""
    found = "; ".join(was for number, was in FORMATS.items() if number > format_of(results))
    return f"of an older format, in which {found}" if found else ""


def solve_states(results: "Dataset") -> "DataArray":
    """Returns a word for each solve, over the axes.

    It is empty where the solve succeeded, "not started", "failed" (there is no number) or
    "not converged" (the numbers are partial results).
    """
    message = results["message"]
    words = np.full(message.shape, "not converged", object)
    words[message.values == ""] = ""
    words[message.values == NOT_STARTED] = NOT_STARTED
    words[(message.str.startswith(FAILED) | message.isin(NO_NUMBERS)).values] = "failed"
    return message.copy(data=words.astype(str))


def has_numbers(results: "Dataset") -> "DataArray":
    """Returns for each solve whether its numbers are printed and drawn; partial results are not."""
    state, friction = solve_states(results), results["friction"]
    # Of a cycle one time with a friction is enough.
    found = friction.notnull().any(set(friction.dims) - set(state.dims))
    told = (state == "not converged") & ~results["message"].isin(PARTIAL)
    return (state == "") | told & found


def without_friction(results: "Dataset") -> "DataArray":
    """Returns for each solve of steady sliding whether its friction is rounding or not known."""
    return ~(abs(results["friction"]) > NO_FRICTION * results.get("slope_in_contact", 1.0))


def warnings_of(results: "Dataset") -> tuple[ResultWarning, ...]:
    """Returns why numbers are doubtful although solved, and the solves that are concerned."""
    known = has_numbers(results)
    # Warnings of the surface, and of what was assumed of files, concern every solve.
    assumed = filter(None, results.attrs.get("assumed", "").split("\n"))
    of_surface = surface_of(results).warnings if "surface_history" in results.attrs else ()
    of_files = (ResultWarning(text, known.values) for text in (*of_surface, *assumed))
    told = {
        name: variable.where(known).values
        for name, variable in results.data_vars.items()
        if variable.dtype.kind == "f" and {*known.dims} <= {*variable.dims} <= {*known.dims, "time"}
    }
    if (kind := kind_of_results(results)) != TRANSIENT:
        return *of_files, *result.warnings_of(lambda name: told.get(name, 0.0), kind)
    # What is doubtful at one time makes its solve doubtful.
    over_time = {n: v if v.ndim > known.ndim else v[..., None] for n, v in told.items()}
    found = result.warnings_of(lambda name: over_time.get(name, np.zeros(1)), kind)
    return *of_files, *(c._replace(where=c.where.any(axis=-1)) for c in found)


def kind_of_results(results: "Dataset") -> str:
    """Returns of which contacts results are, one of `KINDS`."""
    if "time" not in results.dims:
        return STEADY
    # Over a period time has no unit.
    return TRANSIENT if results["time"].attrs.get("units") == TIME["units"] else CYCLE


def is_of_each(warning: ResultWarning, results: "Dataset") -> bool:
    """Returns whether a warning is true of each of several solves with numbers."""
    known = has_numbers(results).values
    return bool(np.sum(known) > 1 and np.all(warning.where[known]))


def over_seeds(results: "Dataset") -> "Dataset":
    """Returns results without their seeds: means over the surfaces that succeeded.

    `NAME_seed_error` is the standard error of the mean of NAME, NaN for one surface. Errors of
    solvers and shares are the largest of the surfaces, `surfaces` counts them. The `message` is
    empty if all succeeded.
    """
    axes, solved = results["message"].dims, results["message"] == ""
    found: dict[str, Any] = {}
    for name, variable in results.data_vars.items():
        if name in ("message", "point") or not {"seed"} <= {*variable.dims} <= {*axes, "time"}:
            continue
        values = variable.where(solved)
        if mean_over_seeds(str(name)):
            found[str(name)] = values.mean("seed", keep_attrs=True)
            spread = values.std("seed", ddof=1, keep_attrs=True)
            found[f"{name}{SEED_ERROR}"] = spread / values.count("seed") ** 0.5
        else:  # a mean of errors or of shares would hide the one surface that is doubtful
            found[str(name)] = values.max("seed", keep_attrs=True)
    count, state = solved.sum("seed"), solve_states(results)
    lost = state.isin(["failed", NOT_STARTED]).all("seed")
    some = [f"{n} of {solved.seed.size} surfaces succeeded." for n in count.values.ravel()]
    part = np.where(lost, results["message"].isel(seed=0), np.reshape(some, count.shape))
    found["message"] = count.copy(data=np.where(count == solved.seed.size, "", part))
    rest = results.drop_dims("seed")
    return rest.assign(found | {"surfaces": count}).transpose(
        *(a for a in axes if a != "seed"), ...
    )


def surface_of(results: "Dataset") -> Surface:
    """Returns the surface of results, that of the first seed."""
    history, heights = results.attrs["surface_history"], results["heights"]
    assumed = results.attrs.get("surface_assumed", "")  # older files have none
    size = np.array([results[axis].attrs["period"] for axis in heights.dims])
    return Surface(
        heights=jnp.asarray(heights.values),
        grid=Grid(heights.shape, jnp.asarray(size)),
        history=tuple(filter(None, history.split("\n"))),
        measured=jnp.asarray(results["measured"].values) if "measured" in results else None,
        steps=tuple(ReadingStep(*step) for step in json.loads(results.attrs["surface_steps"])),
        periodic=bool(results.attrs.get("surface_periodic", True)),
        assumed=tuple(filter(None, assumed.split("\n"))),
    )


def kept_solves(results: "Dataset") -> list[tuple[int, ...]]:
    """Returns the indices along the axes of the solves with numbers whose fields were kept."""
    if "gap" not in results:
        return []
    found = [tuple(map(int, index)) for index in np.argwhere(has_numbers(results).values)]
    if {*results["message"].dims} <= {*results["gap"].dims}:  # the fields of all were kept
        return found
    kept = tuple(map(int, results.attrs["kept"].split()))
    return [kept] if kept in found else []


def kept_contact(results: "Dataset", index: tuple[int, ...]) -> tuple["Dataset", Surface]:
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


def lost_solves(path: str | os.PathLike, point: np.ndarray) -> tuple[int, "Dataset | None"]:
    """Returns how many solves the file at `path` has that are not in `point`, and its results.

    A file that has any must not be replaced by one with only the solves of these names. Solves that
    were not started, or whose worker died, do not count; there are none if there is no file.

    **Raises:** as `read_results`.
    """
    if not Path(path).exists():
        return 0, None
    earlier = read_results(path)
    # What was not started or lost its worker has no numbers to lose.
    finished = ~np.isin(earlier["message"], (NOT_STARTED, LOST))
    return int(np.sum(~np.isin(earlier["point"].values[finished], point))), earlier
