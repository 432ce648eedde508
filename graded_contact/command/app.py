"""The command `graded-contact`: it parses, runs a job, prints a table, writes HDF5 and figures.

Exit codes: 0 success; 1 a solve failed or did not converge; 2 the input was refused; 130 ended by
Ctrl-C.
"""

import contextlib
import hashlib
import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import jax
import typer

from ..core.compilation import LESS_WORK, keep_small_programs
from ..core.memory import keep_freed_memory
from .fit import fit
from .run import demo, info, refusing, run

# Otherwise a transform may use one thread or all of them, and its last bits would differ.
ONE_THREAD = {"xla_cpu_multi_thread_eigen": False}

app = typer.Typer(
    help="Friction and contact area of layered viscoelastic blocks on rough surfaces.",
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
)


def open_page(
    scene_file: Annotated[
        Path | None, typer.Argument(metavar="[SCENE.toml]", help="Scene file (default: the demo).")
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for saved scenes.")
    ] = Path(),
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the server.")] = 5006,
    browser: Annotated[bool, typer.Option(help="Open a browser.")] = True,
) -> None:
    """Shows a scene as a page of sliders in the browser, until Ctrl-C."""
    from ..page import serve

    with refusing():
        serve(scene_file, output, port, browser)


def _print_version(chosen: bool) -> bool:
    if chosen:
        typer.echo(f"graded-contact {version('graded_contact')} (jax {version('jax')})")
        raise typer.Exit
    return chosen


@app.callback()
def prepare(
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print versions."),
    ] = False,
) -> None:
    """Switches on double precision and the cache of compiled code, before a job begins."""
    options = ONE_THREAD | (LESS_WORK if jax.__version_info__[:2] == (0, 10) else {})
    given = os.environ.get("XLA_FLAGS", "")
    words = {n: str(v).lower() if isinstance(v, bool) else v for n, v in options.items()}
    flags = [f"--{name}={word}" for name, word in words.items() if name not in given]
    os.environ["XLA_FLAGS"] = " ".join([given, *flags]).strip()
    jax.config.update("jax_enable_x64", True)
    if not jax.config.values["jax_compilation_cache_dir"]:
        jax.config.update("jax_compilation_cache_dir", str(cache_folder()))
    keep_small_programs()


def cache_folder() -> Path:
    """Returns the user's folder of compiled code, which depends on the processor."""
    processor = f"{platform.machine()} {platform.processor()}"
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        chosen = {line for line in lines if line.startswith(("model name", "flags", "Features"))}
        processor = "\n".join(sorted(chosen))
    name = hashlib.sha256(f"jax {version('jax')} {processor}".encode()).hexdigest()[:16]
    root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root) / "graded_contact" / name


for job in (demo, run, info, fit):
    app.command()(job)
app.command("explore")(open_page)


def run_command() -> None:
    """Runs the command in its own process."""
    keep_freed_memory()
    try:
        app(prog_name="graded-contact", standalone_mode=True)
    except KeyboardInterrupt:
        # Compiled code may run in a thread: the normal exit of Python would wait for it, or crash.
        os._exit(130)
