"""Around every job: its options, precision, the cache of compiled code, refusals, progress."""

import contextlib
import hashlib
import os
import platform
import stat
from collections.abc import Callable, Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import jax
import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from ..files.sealed import replacing
from ..studies.interruption import Interruption

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Format(StrEnum):
    """Of a file with a figure."""

    PNG = "png"
    PDF = "pdf"
    SVG = "svg"


Output = Annotated[
    Path | None, typer.Option("--output", "-o", help="Folder for the results.", show_default=False)
]
Replace = Annotated[
    bool, typer.Option("--replace", help="Replace a result of another scene of the same name.")
]
DryRun = Annotated[
    bool,
    typer.Option("--dry-run", help="Print what was read and what it will cost, then exit."),
]
Workers = Annotated[
    int | None,
    typer.Option(min=1, help="Processes that solve, instead of as many as pay."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="tcp://...", help="Use the workers of a scheduler that runs."),
]
FigureFormat = Annotated[
    Format, typer.Option("--format", help="Of the figures; pdf and svg are drawn in lines.")
]

# A transform runs on one thread or on all, as chance will have it, with other last bits.
ONE_THREAD = "--xla_cpu_multi_thread_eigen=false"


def prepare() -> None:
    """Switches on double precision, and the cache of compiled code if its folder is safe."""
    flags = os.environ.get("XLA_FLAGS", "")
    if ONE_THREAD.split("=")[0] not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {ONE_THREAD}".strip()
    jax.config.update("jax_enable_x64", True)
    folder = cache_folder()
    if folder is not None:
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


@contextlib.contextmanager
def refusing() -> Iterator[None]:
    """Prints the message of a refused input, without a traceback, and exits with code 2."""
    try:
        yield
    except (ValueError, OSError, ImportError, MemoryError) as error:
        typer.secho(f"Error: {error}", fg="red", err=True)
        raise typer.Exit(2) from error


@contextlib.contextmanager
def progress(interruption: Interruption) -> Iterator[Callable[[str, int, int], None]]:
    """A bar on the error stream, moved by what is being done, and how much of how much is done.

    After a signal, moving it ends the command: between two steps that is safe.
    """

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("left"), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=None)

        def advance(text: str, done: int, total: int) -> None:
            if bar.tasks[task].total != total:
                # What was kept, and compiling, say nothing of the time left.
                bar.reset(task, total=total, completed=done, description=text)
            bar.update(task, description=text, completed=done)
            interruption.check()

        yield advance


def save_figure(figure: "Figure", path: Path, form: str) -> None:
    """Writes a figure, whole or not at all, and says so."""
    with replacing(path) as partial:
        figure.savefig(partial, format=form)
    typer.echo(f"wrote {path}")


def cache_folder() -> Path | None:
    """The user's cache folder for this kind of machine; None if others could write to it.

    What lies in it is executed: it belongs to the user alone, and to one kind of processor.
    """
    home = os.environ.get("XDG_CACHE_HOME")
    with contextlib.suppress(OSError, RuntimeError):
        root = (Path(home) if home else Path.home() / ".cache") / "graded_contact"
        folder = root / hashlib.sha256(_processor().encode()).hexdigest()[:16]
        root.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        states = [path.stat() for path in (root, folder)]
        own = all(state.st_uid == os.getuid() for state in states) if os.name == "posix" else True
        shared = any(stat.S_IMODE(state.st_mode) & 0o022 for state in states)
        if own and (not shared or os.name != "posix") and os.access(folder, os.W_OK):
            return folder
    return None


def _processor() -> str:
    """What decides whether compiled code runs here: the processor's model and instructions."""
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        kept = {line for line in lines if line.startswith(("model name", "flags", "Features"))}
        return "\n".join(sorted(kept))
    return f"{platform.machine()} {platform.processor()}"
