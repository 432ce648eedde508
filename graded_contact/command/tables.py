"""Results of a scene as a table on the screen, with a row for each solve."""

from typing import TYPE_CHECKING

import numpy as np

from ..core.display import UNKNOWN, unit_of, with_error
from ..core.quantities import CYCLE, STEADY, TRANSIENT, in_brackets
from ..plot.sweeps import SEED_ERROR, common_numbers, over_seeds
from ..sliding.number import warnings_of
from ..sliding.result import KINDS

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

WIDTH = 80  # letters of a line
MAIN = (
    "friction",
    "mean_friction",
    "peak_friction",
    "time_to_peak",
    "contact_area",
    "mean_gap",
    "mean_pressure",
    "approach",
    "contact_stiffness",
    "specific_conductance",
    "flow_along_x",
    "flow_along_y",
    "leakage_along_x",
    "leakage_along_y",
    "tension",
    "von_mises",
    "interface_shear",
)
INSTEAD = {"flow_along_x": "leakage_along_x", "flow_along_y": "leakage_along_y"}


def print_results(results: "Dataset", full: bool = False) -> None:
    """Prints a row for each solve, then warnings, and why solves failed.

    Over seeds a row has means ± their standard errors. Numbers of a transient motion belong
    to its end. A solve that did not converge has no numbers here.
    """
    shown, heading = results, common_numbers(results)
    if "time" in results.dims:
        shown = results.isel(time=-1)
    if "seed" in results.dims:
        shown = over_seeds(shown)
        heading += f"\nMeans of {results.sizes['seed']} surfaces ± standard error."
    if heading:
        print(heading.strip())
    table = results_table(shown, full)
    print(table.to_string(line_width=WIDTH, index=table.columns.name is not None))
    for sentence in warnings_in(results):
        print(f"Warning: {sentence}")
    message = results["message"].values
    for text in sorted({*message.flat} - {""}):
        print(f"{np.sum(message == text)} of {message.size} solves: {text}")


def results_table(results: "Dataset", full: bool) -> "DataFrame":
    """Returns the table of solves: the index are the axes, each number has its error."""
    import pandas

    axes = results["message"].dims
    varied = [str(axis) for axis in axes if results.sizes[axis] > 1]
    names = [
        str(name)
        for name, number in results.data_vars.items()
        if number.dims == axes and number.dtype.kind == "f"
    ]
    names = [name for name in names if not name.endswith(("_error", SEED_ERROR))]
    if not full:
        names = [name for name in MAIN if name in names and INSTEAD.get(name) not in names]
    table = pandas.DataFrame(dict(result_column(results, name) for name in names))
    heads = [result_column(results, axis) for axis in varied]
    widths = [max(map(len, (head, *cells))) for head, cells in heads]
    rows = zip(*((head, *cells) for head, cells in heads), strict=True)
    lines = ["  ".join(text.rjust(n) for text, n in zip(row, widths, strict=True)) for row in rows]
    if varied:
        table.columns.name, *table.index = lines
    return table


def result_column(results: "Dataset", name: str) -> tuple[str, list[str]]:
    """Returns the head of a column, and a number with its error for each solve.

    Units suit the size of the largest number.
    """
    message = results["message"]
    solved = message == "" if name in results.data_vars else message == message
    number = results[name].where(solved).transpose(*message.dims)
    known = [n for n in (f"{name}{SEED_ERROR}", f"{name}_error") if n in results]
    errors = results[known[0]] if known else number * np.nan
    unit, factor = number.attrs.get("units", results[name].attrs.get("units", "")), 1.0
    if unit in ("m", "Pa"):
        unit, factor = unit_of(unit, float(abs(number).max()))
    cells = [
        _cell(factor * value, factor * error)
        for value, error in zip(number.values.flat, errors.values.flat, strict=True)
    ]
    return name.replace("_", " ") + in_brackets(unit), cells


def _cell(value: float, error: float) -> str:
    if np.isnan(value):
        return UNKNOWN
    return f"{value:.4g}" if np.isnan(error) else with_error(value, error)


def warnings_in(results: "Dataset") -> list[str]:
    """Returns the warnings about surfaces, and about numbers of solves that succeeded."""
    solved = results["message"] == ""
    zero = np.zeros(results["message"].shape)
    kind = STEADY if "time" not in results.dims else CYCLE
    kind = TRANSIENT if "field_time" in results.dims else kind
    known = lambda name: results[name].where(solved).values if name in results else zero  # noqa: E731
    of_surfaces = [*filter(None, results.attrs["warnings"].split("\n"))]
    return [*of_surfaces, *warnings_of(KINDS[kind], known)]
