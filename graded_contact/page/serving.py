"""Serves a page to each tab of a browser, or to the cell of a notebook."""

import asyncio
import errno
import logging
import os
import re
import socket
import weakref
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ..core.files import is_hdf5
from ..core.memory import return_freed_memory
from .document import open_document

TITLE = "graded-contact explore"
# A browser set to dark shows the page, its figures too, with light and dark exchanged.
DARK = "@media (prefers-color-scheme: dark) {html {filter: invert(0.9) hue-rotate(180deg)}}"
MESSAGE = 20 * 10**6  # bytes of one message of a browser


def explore(path: str | os.PathLike | None = None, folder: str | os.PathLike = ".") -> Any:
    """Returns a page of sliders, response, friction, contact and derivatives, for a notebook.

    It computes in a thread once it is shown. The command `graded-contact explore` shows the same
    page.

    **Arguments:**

    - `path`: of a scene file, or of the results of a scene with [motion] `once = true` (HDF5); None
      for the scene of the demo.
    - `folder`: the page writes saved scenes and dropped files into this folder only.

    **Returns:** a layout of Panel, which a notebook shows as the value of a cell.

    **Raises:** `ImportError` without the extra `explore`; `FileNotFoundError`; `ValueError` for
    a file without a scene, or without motion.
    """
    _panel()
    return _opened(None if path is None else Path(path), Path(folder).absolute())()


def _opened(path: Path | None, folder: Path) -> Callable[[], Any]:
    """What makes a page of a scene, or of results; what has no page is refused now."""
    if path is not None and is_hdf5(path):
        from .reader import read_transient, transient_page

        return partial(transient_page, read_transient(path))
    from .view import Page

    open_document(path)
    return lambda: Page(open_document(path), folder)


def serve(path: Path | None, folder: Path, **where: Any) -> None:
    """Serves pages of a scene until Ctrl-C; arguments and errors are those of `new_server`."""
    server = new_server(path, folder, **where)
    server.start()
    server.io_loop.start()


def new_server(
    path: Path | None, folder: Path, *, address: str, port: int, show: bool,
    host_names: Sequence[str] = (), prefix: str = "",
) -> Any:  # fmt: skip
    """Returns a server of pages of a scene, before it starts.

    **Arguments:**

    - `path`, `folder`: as in `explore`.
    - `address`, `port`: where the server listens.
    - `show`: whether to open a browser.
    - `host_names`: other names of the server, such as that of a reverse proxy.
    - `prefix`: path of the page on the server, such as "/lab".

    **Raises:** as `explore`; `ValueError` for a bad name or path; `OSError` if the port is taken.
    """
    for name in host_names:
        if not re.fullmatch(r"[\w.-]+", name):
            reason = "it needs a bare name, such as lab.example.org, without scheme and port"
            raise ValueError(f"`host_name={name}` is refused: {reason}.")
    if not re.fullmatch(r"(/[\w.~@%+-]+)*/?", prefix):
        raise ValueError(f"`prefix={prefix}` is refused: it needs a path, such as /lab/page.")
    pn = _panel()
    from bokeh.settings import settings
    from tornado.routing import Rule
    from tornado.web import ErrorHandler

    from .foreign import Foreign, Framing

    pn.config.raw_css = [DARK]
    make = _opened(path, folder.absolute())  # refused before the server listens

    def page() -> Any:
        new = make()
        if hasattr(new, "session"):
            pn.state.on_session_destroyed(lambda _: new.session.end())
        # Once the page is collected, what it had is returned.
        weakref.finalize(new, server.io_loop.add_callback, return_freed_memory).atexit = False
        return new

    settings.allowed_ws_origin = ["*"]  # `Foreign` decides, also about what Bokeh does not ask
    try:
        server = pn.serve(
            {"/": page}, address=address, port=port, show=show, title=TITLE, start=False,
            location=False, websocket_max_message_size=MESSAGE, prefix=prefix.rstrip("/"),
        )  # fmt: skip
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        text = f"`port={port}` is refused: another program listens there. Give another `--port`."
        raise OSError(text) from error
    # That a tab is closed while it is written to is nothing to report.
    logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)
    server.io_loop.asyncio_loop.set_exception_handler(_log_error)
    server._tornado.transforms.append(Framing)
    foreign = Foreign({address, "localhost", socket.gethostname(), *host_names})
    # Before all other rules, those of WebSockets too.
    server._tornado.add_handlers(".*", [Rule(foreign, ErrorHandler, {"status_code": 403})])
    return server


def _log_error(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Reports an error that nobody awaits, unless a tab was closed while it was written to."""
    from tornado.websocket import WebSocketClosedError

    if not isinstance(context.get("exception"), WebSocketClosedError):
        loop.default_exception_handler(context)


def _panel() -> Any:
    try:
        import panel
    except ImportError as error:
        raise ImportError(
            'The page needs Panel: `pip install "graded_contact[explore]"`.'
        ) from error
    panel.extension("filedropper", inline=True)  # a notebook needs no network
    return panel
