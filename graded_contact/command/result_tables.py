"""Results as tables on the screen."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import typer
from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from ..core.display import UNKNOWN, with_time, with_unit
from ..core.quantities import (
    AXES,
    TRANSIENT,
    in_brackets,
)
from ..core.warnings import ResultWarning
from ..designs.results import NO_ERROR
from ..plot.sweeps import place_of, title_of
from ..scenes.results import (
    FLOWS,
    has_numbers,
    is_of_each,
    kind_of_results,
    over_seeds,
    solve_states,
    surface_of,
    warnings_of,
)
from ..scenes.scene import Scene
from ..sliding.half_grid import grid_estimate
from ..studies.uncertainty import Sensitivity
from ..surfaces.statistics import statistics
from ..surfaces.surface import Surface
from .columns import MAIN, OF_STRESS, OVER_TIME, columns_in_table, names_in_table, rounding_in

if TYPE_CHECKING:
    from xarray import Dataset

# Text about solves that did not succeed, by their state.
STATES = {
    "not converged": "did not converge; the file has their partial results",
    "failed": "failed",
    "not started": "were not started",
}


def print_table(results: "Dataset", all_seeds: bool = False, full: bool = False) -> None:
    """Prints one line for each solve, then why numbers are in doubt, and why solves failed."""
    print_rows(results, all_seeds, full)
    console = Console()
    for mark, warning in marked_warnings(results):
        text = f"[bold yellow]({mark})[/] {escape(warning.sentence)}"
        console.print(text, soft_wrap=True)
    print_notes(results, full)


def marked_warnings(results: "Dataset") -> list[tuple[str, ResultWarning]]:
    """Returns the doubts of results, each with the number by which solves name it."""
    # What holds for each of several solves is said once, below the table.
    return [
        ("each solve" if is_of_each(warning, results) else str(n), warning)
        for n, warning in enumerate(warnings_of(results), start=1)
    ]


def print_rows(results: "Dataset", all_seeds: bool, full: bool) -> None:
    """Prints one line for each solve.

    Of several random surfaces a line has the mean and its standard error, unless `all_seeds`. Only
    `full` tables have all numbers.
    """
    every, numbered = results, marked_warnings(results)
    if "seed" in every["message"].dims and not all_seeds:
        results = over_seeds(every)
        seeds = every["message"].dims.index("seed")
        numbered = [(mark, c._replace(where=c.where.any(seeds))) for mark, c in numbered]
        typer.echo(
            f"Numbers are means of {every.sizes['seed']} surfaces. The standard error of the mean "
            'is "± over surfaces", the largest error of a surface "±".'
        )
    axes, columns = (
        results["message"].dims,
        columns_in_table(results, names_in_table(results, full), full),
    )
    shown = has_numbers(results).values
    heads = (*_heads(results), *(column.head for column in columns.values()), "state")
    states = solve_states(results).values
    load_unit = 1e6 if axes[-2] == "pressure" else 1
    rows = []
    for index in np.ndindex(states.shape):
        *at, load, speed = (results[a].values[i] for a, i in zip(axes, index, strict=True))
        cells = [
            column.cell(name, index) if shown[index] else UNKNOWN
            for name, column in columns.items()
        ]
        doubts = [mark for mark, c in numbered if c.where[index]]
        mark = f"[bold red]{states[index]}[/] " if states[index] else "" if doubts else "solved"
        which = ",".join(filter(str.isdigit, doubts))
        mark += f"[yellow]doubtful{f' ({which})' * bool(which)}[/]" * bool(doubts)
        numbers = (f"{speed:.3e}", f"{load / load_unit:.4g}", *(f"{number:.5g}" for number in at))
        rows.append([*numbers, *cells, mark])
    if fixed := place_of(results):
        typer.echo(f"At {fixed}:")
    _print_columns([*heads], rows, len(axes))


def _print_columns(heads: list[str], rows: list[list[str]], shared: int) -> None:
    """Prints a table, on a screen in parts that fit; their first columns are the `shared` ones."""
    console, parts = Console(), [[*range(len(heads))]]
    if console.is_terminal:
        texts = [heads, *([Text.from_markup(text).plain for text in row] for row in rows)]
        parts = tables_that_fit(texts, shared, console.width)
    else:  # a file has one line for each solve
        console.width = max(console.width, 24 * (len(heads) + 1))
    for part in parts:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
        for i in part:
            table.add_column(Text(heads[i]), justify="right", no_wrap=True)
        for row in rows:
            table.add_row(*(row[i] for i in part))
        console.print(table)


def print_notes(results: "Dataset", full: bool) -> None:
    """Prints what follows the solves: numbers over time, errors by the grid, why solves failed."""
    if kind_of_results(results) == TRANSIENT:
        _print_times(results, full)
    if any(name in results for name in OF_STRESS):
        typer.echo(NO_ERROR)
    if full:
        surface = surface_of(results)
        words = grid_estimate(surface.heights, surface.grid, not surface.periodic)
        Console().print(f"Errors by the grid are {words}.", soft_wrap=True)
    if not full and (left := rounding_in(results)):
        words = ", ".join(name.replace("_", " ") for name in left if name in (*MAIN, *OVER_TIME))
        typer.echo(f"Left out, as 0 within rounding or errors: {words}.")
    _print_closed(results)
    _print_failures(results)


def _print_times(results: "Dataset", full: bool) -> None:
    """Prints numbers over time of the last solve that has some: at the times of its fields."""
    solved = np.argwhere(has_numbers(results).values)
    if not len(solved):
        return
    axes = results["message"].dims
    at = results.isel(dict(zip(axes, solved[-1], strict=True)))
    times, moved = at["time"].values, at["surface_displacement"].values
    columns = columns_in_table(at, [name for name in OVER_TIME if name in at], full)
    moves, rows = ["displacement"] if full or np.any(moved) else [], []
    for i in np.flatnonzero(np.isin(times, at["field_time"].values) | full):
        cells = [column.cell(name, (int(i),)) for name, column in columns.items()]
        rows.append([with_time(times[i]), *(with_unit(moved[i], "m") for _ in moves), *cells])
    if len(solved) > 1:
        typer.echo(f"Over time, {place_of(at)}:")
    _print_columns(["time", *moves, *(column.head for column in columns.values())], rows, 1)


def tables_that_fit(texts: list[list[str]], shared: int, room: int) -> list[list[int]]:
    """Returns the columns of each of some tables that are at most as wide as the screen.

    The first columns, which say what is solved, are in each table; an error stays beside its
    number.

    **Arguments:**

    - `texts`: heads, then rows.
    - `shared`: number of the columns that each table has.
    - `room`: width of the screen [characters].
    """
    widths = [
        3 + max(cell_len(line) for text in column for line in text.split("\n"))
        for column in zip(*texts, strict=True)
    ]
    together: list[list[int]] = []
    for i in range(shared, len(widths)):
        together += [[]] * (not texts[0][i].startswith("±"))
        together[-1] = [*together[-1], i]
    parts, used = [[*range(shared)]], sum(widths[:shared])
    for group in together:
        wide = sum(widths[i] for i in group)
        if used + wide > room and len(parts[-1]) > shared:
            parts, used = [*parts, [*range(shared)]], sum(widths[:shared])
        parts[-1] += group
        used += wide
    return parts


def _heads(results: "Dataset") -> Iterator[str]:
    """The heads of the axes; the last two axes, pressure or approach and velocity, come first."""
    *others, load, _ = results["message"].dims
    yield "highest\nspeed\n[m/s]" if "time" in results.dims else "velocity\n[m/s]"
    yield "pressure\n[MPa]" if load == "pressure" else "approach\n[m]"
    for name in map(str, others):
        unit = results[name].attrs.get("units", "1")
        head = name if name in AXES else title_of(name)
        yield head.replace(" ", "\n", 1) + in_brackets(unit)


def _print_closed(results: "Dataset") -> None:
    """Prints from which load, or time, on the gap lets no fluid pass, in any of the solves."""
    for axis, name in zip(("x", "y"), FLOWS, strict=True):
        if name not in results:
            continue
        # With its error: half the grid may be open.
        flow = results[name] + results.get(f"{name}_error", 0.0)
        along = "time" if "time" in flow.dims else "pressure"
        others = [dim for dim in flow.dims if dim != along]
        at, passes = results[along].values, (flow > 0).any(others).values
        closed = at[(flow == 0).all(others).values]
        closed = closed[closed > np.max(at[passes], initial=-np.inf)]
        if closed.size and along == "time":
            typer.echo(f"No fluid passes along {axis} from {with_time(float(closed.min()))} on.")
        elif closed.size:
            least = with_unit(float(closed.min()), "Pa")
            typer.echo(f"No fluid passes along {axis} at a pressure of {least} or more.")


def _print_failures(results: "Dataset") -> None:
    """Prints how many solves did not succeed, and why, on the error stream."""
    console, states = Console(stderr=True), solve_states(results).values
    for state, text in STATES.items():
        chosen = states == state
        if np.any(chosen):
            console.print(f"[bold red]Warning:[/] {chosen.sum()} of {chosen.size} solves {text}.")
            for message in sorted(set(results["message"].values[chosen]) - {state}):
                console.print(message, markup=False)


def print_doubts(results: "Dataset") -> None:
    """Prints how many solves are doubtful, if any is, on the error stream."""
    if warnings := warnings_of(results):
        where = np.any([warning.where for warning in warnings], axis=0)
        text = f"Warning: {np.sum(where)} of {where.size} solves are doubtful; see below the table."
        typer.secho(text, fg="yellow", err=True)


def print_decisive(decided: Mapping[tuple[str, float], Sensitivity]) -> None:
    """Prints which moduli of materials decide the friction, if this is known."""
    for (name, speed), found in decided.items():
        low, high = found.decisive()
        if np.isfinite(low):
            typer.echo(
                f"{name}: 90 % of the friction at {speed:.3g} m/s comes from its moduli between "
                f"{low:.2g} and {high:.2g} rad/s (mean field)"
            )


def print_read(scene: Scene, surface: Surface | None) -> None:
    """Prints how the files of a scene were read."""
    told = (note for note in scene.notes if note not in scene.assumed)
    for sentence in told:
        typer.echo(sentence)
    if surface is not None:
        print_surface(surface)


def print_warnings(sentences: Iterable[str]) -> None:
    """Prints why numbers are in doubt."""
    for sentence in sentences:
        typer.secho(f"Warning: {sentence}", fg="yellow")


def print_surface(surface: Surface) -> None:
    """Prints the changes of a surface, and its roughness after each."""
    for sentence in surface.history:
        typer.echo(f"surface: {sentence}")
    print_steps(surface)


def print_steps(surface: Surface) -> None:
    """Prints size and roughness, and the roughness after every step of reading, one line each."""
    typer.echo(f"surface: {size_of(surface)}")
    if surface.steps:
        heads = f"{'rms height':>16}{'rms slope':>12}{'peak/rms':>10}{'missing':>9}"
        typer.echo(f"{'surface, after the step':24}{heads}")
    for name, rms_height, rms_slope, peak, missing in surface.steps:
        numbers = f"{rms_slope:12.4g}{peak:10.3g}{missing:9.1%}"
        typer.echo(f"{name:24}{with_unit(rms_height, 'm'):>16}{numbers}")


def size_of(surface: Surface) -> str:
    """Returns size and roughness of a surface in words."""
    size = " x ".join(with_unit(float(edge), "m") for edge in np.asarray(surface.grid.size))
    found = statistics(surface)
    height = with_unit(float(found.rms_height), "m")
    return f"{size}, rms height {height}, rms slope {float(found.rms_slope):.3g}"
