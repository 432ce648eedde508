"""What all jobs share: options, precision, the cache of compiled code, refusals, progress."""

import contextlib
import hashlib
import io
import os
import platform
import time
from collections.abc import Callable, Iterator
from datetime import timedelta
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import jax
import typer
from rich import progress as bars
from rich.console import Console

from ..core.compilation import LESS_WORK, keep_small_programs
from ..core.files import check_folder, check_name, full_path
from ..scenes.scene import Scene
from ..studies.dataset import write_whole
from ..studies.interruption import Interruption
from ..studies.store import Store

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SceneFile = Annotated[
    Path, typer.Argument(metavar="SCENE.toml", help="Scene file.", show_default=False)
]
Output = Annotated[
    Path | None, typer.Option("--output", "-o", help="Folder for the results.", show_default=False)
]
Replace = Annotated[
    bool, typer.Option("--replace", help="Replace earlier results, also those of another scene.")
]
DryRun = Annotated[bool, typer.Option(
    "--dry-run", help="Print block, surface, loads and cost, then exit."
)]  # fmt: skip
FigureFormat = Annotated[Literal["png", "pdf", "svg"], typer.Option(
    "--format", help="Format of the figures; pdf and svg are vector graphics."
)]  # fmt: skip

# Otherwise a transform may use one thread or all of them, and its last bits would differ.
ONE_THREAD = "--xla_cpu_multi_thread_eigen=false"


def prepare() -> None:
    """Switches on double precision, and the cache of compiled code if its folder is safe."""
    flags = os.environ.get("XLA_FLAGS", "")
    # A process ends at a flag that its XLA does not know.
    quick = LESS_WORK if jax.__version_info__[:2] == (0, 10) else {}
    values = {n: str(v).lower() if isinstance(v, bool) else v for n, v in quick.items()}
    ours = [ONE_THREAD, *(f"--{name}={value}" for name, value in values.items())]
    missing = (flag for flag in ours if flag.split("=")[0] not in flags)
    os.environ["XLA_FLAGS"] = " ".join([flags, *missing]).strip()
    jax.config.update("jax_enable_x64", True)
    # A folder that the user chose stays.
    if not jax.config.values["jax_compilation_cache_dir"] and (folder := cache_folder()):
        jax.config.update("jax_compilation_cache_dir", str(folder))
    keep_small_programs()


@contextlib.contextmanager
def refusing(spelt: Callable[[str], str] = str) -> Iterator[None]:
    """Prints the message of a refused input, `spelt`, without a traceback; exits with code 2."""
    try:
        yield
    except (ValueError, OSError, ImportError, MemoryError) as error:
        typer.secho(f"Error: {spelt(str(error))}", fg="red", err=True)
        raise typer.Exit(2) from error


def output_of(scene: Scene, scene_file: Path, output: Path | None) -> tuple[Path, str]:
    """Returns the folder for the results of a scene, and the start of the names of its files."""
    folder = output or scene.directory or Path(f"{scene_file.stem}-results")
    return folder, scene.name or scene_file.stem


def checked_place(folder: Path | str, name: str) -> Path:
    """Returns the path `folder`/`name`. Refuses it now if files cannot be written there."""
    check_name(name)
    folder = full_path(str(folder))
    check_folder(folder)
    return folder / name


def end_if_interrupted(interruption: Interruption) -> None:
    """Ends a command that stores its solves with the exit code of a signal, if one has come."""
    if interruption.signal is not None:
        typer.echo("Interrupted: run the same command again to continue.", err=True)
        raise typer.Exit(interruption.exit_code)


@contextlib.contextmanager
def store_in(folder: Path) -> Iterator[Store]:
    """Yields the store in a folder, and prints at the end which of its points were damaged."""
    with Store(folder) as store:
        yield store
        for path in store.damaged:
            typer.echo(f"{path} is damaged: it is computed again", err=True)


@contextlib.contextmanager
def progress(interruption: Interruption) -> Iterator[Callable[[str, int, int], None]]:
    """Yields a function that shows text, done and total in a progress bar on the error stream.

    It is called once before the first step: the bar shows the time left when a step has ended.

    After a signal the function ends the command: it is called between two steps, where it is safe.
    """
    columns = (
        bars.TextColumn("{task.description}"), bars.BarColumn(), bars.MofNCompleteColumn(),
        bars.TimeElapsedColumn(), bars.TextColumn("{task.fields[left]}"),
    )  # fmt: skip
    with bars.Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("starting (a first run also compiles)", total=None, left="")
        begun, before = 0.0, 0

        def advance(text: str, done: int, total: int) -> None:
            nonlocal begun, before
            if bar.tasks[task].total != total:
                # Stored points and compiling do not count for the time left.
                begun, before = time.monotonic(), done
                bar.reset(task, total=total, completed=done, description=text, left="")
            elif done > before:
                seconds = (time.monotonic() - begun) / (done - before) * (total - done)
                bar.update(task, left=f"left {timedelta(seconds=round(seconds))}")
            bar.update(task, description=text, completed=done)
            interruption.check()

        yield advance


def save_figure(figure: "Figure", path: Path, form: str) -> None:
    """Writes a figure, and prints its path."""
    content = io.BytesIO()
    figure.savefig(content, format=form)
    write_whole(path, content.getvalue())
    typer.echo(f"wrote {path}")


def cache_folder() -> Path | None:
    """The user's cache folder for this machine and JAX; None if other users can write to it.

    Its files are executed: only the user may write to it, and only this processor use it.
    """
    home = os.environ.get("XDG_CACHE_HOME")
    with contextlib.suppress(OSError, RuntimeError):
        root = (Path(home) if home else Path.home() / ".cache") / "graded_contact"
        # Compiled code depends on the processor's model and instructions.
        processor = f"{platform.machine()} {platform.processor()}"
        with contextlib.suppress(OSError):
            lines = Path("/proc/cpuinfo").read_text().splitlines()
            kept = {line for line in lines if line.startswith(("model name", "flags", "Features"))}
            processor = "\n".join(sorted(kept))
        key = f"jax {version('jax')}, jaxlib {version('jaxlib')}\n{processor}"
        folder = root / hashlib.sha256(key.encode()).hexdigest()[:16]
        root.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        if os.name == "posix":
            # Neither another owner nor the permission to write for group or others.
            states = (root.stat(), folder.stat())
            if any(at.st_uid != os.getuid() or at.st_mode & 0o022 for at in states):
                return None
        if os.access(folder, os.W_OK):
            return folder
    return None
