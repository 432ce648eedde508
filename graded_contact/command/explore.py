"""The job `explore`: a page in the browser."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from ..files.paths import check_folder, full_path
from ..page.serving import serve
from .session import refusing


def explore(
    scene_file: Annotated[
        Path | None,
        typer.Argument(metavar="[SCENE.toml]", help="The scene; by default that of `demo`."),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for scenes and data that are kept.")
    ] = Path("explored"),
    address: Annotated[str, typer.Option(help="Where to listen.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port to listen at.")] = 5006,
    browser: Annotated[bool, typer.Option(help="Open a browser.")] = True,
) -> None:
    """Shows a scene as a page of sliders in the browser, until Ctrl-C.

    Nothing is written outside the folder. Whoever reaches the address may use the page.
    """
    with refusing():
        folder = full_path(str(output))
        check_folder(folder)
        serve(scene_file, folder, address=address, port=port, show=browser)
    sys.stdout.flush()
    # A page's thread may be deep in a compilation: Python's own way to end would crash there.
    os._exit(0)
