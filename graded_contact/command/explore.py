"""The job `explore`: a page in the browser."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from ..core.files import check_folder, full_path
from ..page.serving import serve
from .terminal import refusing


def show_page(
    scene_file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[SCENE.toml]",
            help="Scene file, or results of what happens once (default: the scene of `demo`).",
        ),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for saved scenes and dropped files.")
    ] = Path("explored"),
    address: Annotated[str, typer.Option(help="Address of the server.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the server.")] = 5006,
    host_name: Annotated[
        list[str] | None,
        typer.Option(help="Another name of the server: that of a reverse proxy.", metavar="NAME"),
    ] = None,
    prefix: Annotated[
        str, typer.Option(help="Path of the page behind a reverse proxy.", metavar="/PATH")
    ] = "",
    browser: Annotated[bool, typer.Option(help="Open a browser.")] = True,
) -> None:
    """Shows a scene as a page of sliders in the browser, until Ctrl-C.

    Of what happens once the page shows the results (NAME.h5): numbers and the contact over time.

    The page writes into the folder only. Everybody who can reach the address can use the page.
    """
    with refusing():
        folder = full_path(str(output))
        check_folder(folder)
        serve(
            scene_file, folder, address=address, port=port, show=browser,
            host_names=host_name or [], prefix=prefix,
        )  # fmt: skip
    sys.stdout.flush()
    # A thread may be compiling: the normal exit of Python would wait for it, or crash.
    os._exit(0)
