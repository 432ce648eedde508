"""Results as tables on the screen."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from ..core.display import with_unit
from ..core.quantities import AXES, OBSERVABLES
from ..plot.words import title_of
from ..scenes.results import SEED_ERROR, over_seeds, solve_states, warnings_of
from ..scenes.scene import Scene
from ..studies.uncertainty import Sensitivity
from ..surfaces.statistics import statistics
from ..surfaces.surface import Surface

if TYPE_CHECKING:
    from xarray import Dataset

# Text about solves that did not succeed, by their state.
STATES = {
    "not converged": "did not converge; their numbers are partial results",
    "failed": "failed",
    "not started": "were not started",
}


def print_table(results: "Dataset", all_seeds: bool = False) -> None:
    """Prints one line for each solve, then the reasons of solves that did not converge.

    Of several random surfaces a line has the mean and its standard error, unless `all_seeds`.
    """
    every, warnings = results, list(warnings_of(results))
    error = "friction_standard_error"
    if "seed" in every["message"].dims and not all_seeds:
        results, error = over_seeds(every), SEED_ERROR
        seeds = every["message"].dims.index("seed")
        warnings = [caveat._replace(where=caveat.where.any(seeds)) for caveat in warnings]
        typer.echo(f"Numbers are means of {every.sizes['seed']} surfaces ± standard error.")
    axes = results["message"].dims
    others, given = axes[:-2], axes[-2]  # the last two are pressure or approach, and velocity
    load_head, load_unit = ("pressure\n[MPa]", 1e6) if given == "pressure" else ("approach\n[m]", 1)
    # Heads and formats of the columns, of quantities with one number for each solve.
    columns = {name: entry.column for name, entry in OBSERVABLES.items() if entry.column}
    columns["friction_standard_error"] = ("± materials", ".1e")  # of means over seeds
    names = [name for name in columns if name in results and results[name].dims == axes]
    unused = {"unmeasured_friction"} if "measured" not in results else set()
    if "shear_friction" in results and not np.any(results["shear_friction"]):
        unused |= {"hysteresis_friction", "shear_friction"}
    main = "mean_friction" if "mean_friction" in results else "friction"
    means = (main, "contact_area_smooth")  # the line is as wide as for one surface
    errors = {main: error} if results is every else {n: n + error for n in means}
    errors = {name: other for name, other in errors.items() if other in results}
    names = [name for name in names if name not in unused | set(errors.values())]
    speed = "highest\nspeed" if "time" in results.dims else "velocity"
    heads = [f"{speed}\n[m/s]", load_head]
    for name in map(str, others):
        unit = results[name].attrs.get("units", "1")
        head = name if name in AXES else title_of(name, results.attrs["scene"])
        heads.append(head.replace(" ", "\n", 1) + (f" [{unit}]" if unit != "1" else ""))
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for head in (*heads, *(columns[name][0] for name in names), ""):
        table.add_column(Text(head), justify="right", no_wrap=True)
    states = solve_states(results).values
    values = {name: results[name].values for name in (*names, *errors.values())}
    for index in np.ndindex(states.shape):
        *at, load, speed = (results[a].values[i] for a, i in zip(axes, index, strict=True))
        cells = {name: format(values[name][index], columns[name][1]) for name in names}
        for pair in errors.items():
            cells[pair[0]] = with_error(*(float(values[name][index]) for name in pair))
        mark = f"[bold red]{state}[/] " if (state := states[index]) else ""
        doubts = ",".join(str(n) for n, c in enumerate(warnings, start=1) if c.where[index])
        mark += f"[yellow]({doubts})[/]" if doubts else ""
        numbers = (f"{speed:.3e}", f"{load / load_unit:.4g}", *(f"{number:.5g}" for number in at))
        table.add_row(*numbers, *cells.values(), mark)
    console = Console()
    # A narrower screen wraps the lines; it must not cut the numbers.
    console.width = max(console.width, 180 + 24 * len(others))
    console.print(table)
    for number, caveat in enumerate(warnings, start=1):
        console.print(f"[bold yellow]({number})[/] {escape(caveat.sentence)}", soft_wrap=True)
    warning, states = Console(stderr=True), solve_states(every).values
    for state, text in STATES.items():
        chosen = states == state
        if np.any(chosen):
            warning.print(f"[bold red]Warning:[/] {chosen.sum()} of {chosen.size} solves {text}.")
            for message in sorted(set(every["message"].values[chosen]) - {state}):
                warning.print(message, markup=False)


def print_decisive(decided: Mapping[tuple[str, float], Sensitivity]) -> None:
    """Prints which moduli of materials decide the friction, if this is known."""
    for (name, speed), found in decided.items():
        low, high = found.decisive()
        if np.isfinite(low):
            typer.echo(
                f"{name}: 90 % of the friction at {speed:.3g} m/s comes from its moduli between "
                f"{low:.2g} and {high:.2g} rad/s (mean field)"
            )


def with_error(value: float, error: float) -> str:
    """Returns a number with its standard error, to two digits of that: "0.512 ± 0.0081"."""
    if not (np.isfinite(error) and error > 1e-6):
        return f"{value:#.4g} ± {error:.2g}"
    digits = max(0, 1 - int(np.floor(np.log10(error))))
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def print_read(scene: Scene, surface: Surface | None) -> None:
    """Prints how the files of a scene were read, and the warnings about its surface."""
    for sentence in filter(None, (scene.title, *scene.notes)):
        typer.echo(sentence)
    if surface is not None:
        for sentence in surface.history:
            typer.echo(f"surface: {sentence}")
        print_steps(surface)
        for sentence in surface.caveats:
            typer.secho(f"Caveat: {sentence}", fg="yellow")


def print_steps(surface: Surface) -> None:
    """Prints size and roughness, and the roughness after every step of reading, one line each."""
    size = " x ".join(with_unit(float(edge), "m") for edge in np.asarray(surface.grid.size))
    found = statistics(surface)
    height = with_unit(float(found.rms_height), "m")
    typer.echo(f"surface: {size}, rms height {height}, rms slope {float(found.rms_slope):.3g}")
    if surface.steps:
        heads = f"{'rms height':>16}{'rms slope':>12}{'peak/rms':>10}{'missing':>9}"
        typer.echo(f"{'surface, after the step':24}{heads}")
    for name, rms_height, rms_slope, peak, missing in surface.steps:
        numbers = f"{rms_slope:12.4g}{peak:10.3g}{missing:9.1%}"
        typer.echo(f"{name:24}{with_unit(rms_height, 'm'):>16}{numbers}")
