"""The command `graded-contact`: it parses, runs a job, prints a table, writes HDF5 and figures.

Exit codes: 0 success; 1 a solve failed or did not converge; 2 the
input was refused; 130 and 143 ended by Ctrl-C or SIGTERM, with the finished solves written.
"""

import os
from importlib.metadata import version
from typing import Annotated

import typer

from . import __version__
from .command.explore import show_page
from .command.fit import fit
from .command.friction_table import table
from .command.new import new
from .command.run import demo, info, run
from .command.spelling import spell_missing_characters
from .command.terminal import prepare
from .core.memory import keep_freed_memory

app = typer.Typer(
    help="Friction and contact area of layered viscoelastic blocks on rough surfaces.",
    no_args_is_help=True,
    context_settings={"color": False} if os.environ.get("NO_COLOR") else {},
    pretty_exceptions_show_locals=False,
)


def _print_version(chosen: bool) -> bool:
    if chosen:
        typer.echo(f"graded-contact {__version__} (jax {version('jax')})")
        raise typer.Exit
    return chosen


@app.callback()
def main(
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print versions."),
    ] = False,
) -> None:
    """Friction and contact area of layered viscoelastic blocks on rough surfaces."""
    prepare()


for job in (demo, new, run, info, table, fit):
    app.command()(job)
app.command("explore")(show_page)


def run_command() -> None:
    """Runs the command in its own process."""
    keep_freed_memory()
    spell_missing_characters()
    app(prog_name="graded-contact")
