"""Serves a page to each tab of a browser, or to the cell of a notebook."""

import os
import socket
from pathlib import Path
from typing import Any

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

    - `path`: of a scene file; None for the scene of the demo.
    - `folder`: the page writes saved scenes and dropped files into this folder only.

    **Returns:** a layout of Panel, which a notebook shows as the value of a cell.

    **Raises:** `ImportError` without the extra `explore`; `FileNotFoundError`; `ValueError` for
    a file without a scene, or without motion.
    """
    _panel()
    from .view import Page

    return Page(open_document(None if path is None else Path(path)), Path(folder).absolute())


def serve(path: Path | None, folder: Path, *, address: str, port: int, show: bool) -> None:
    """Serves pages of a scene until Ctrl-C.

    **Arguments:**

    - `path`, `folder`: as in `explore`.
    - `address`, `port`: where the server listens.
    - `show`: whether to open a browser.

    **Raises:** as `explore`; `OSError` if the port is taken.
    """
    server = new_server(path, folder, address=address, port=port, show=show)
    server.start()
    server.io_loop.start()


def new_server(path: Path | None, folder: Path, *, address: str, port: int, show: bool) -> Any:
    """Returns the server of `serve`, before it starts."""
    pn = _panel()
    from bokeh.settings import settings
    from tornado.routing import Rule
    from tornado.web import ErrorHandler

    from .foreign import Foreign
    from .view import Page

    pn.config.raw_css = [DARK]
    open_document(path)  # refused before the server listens

    def page() -> Any:
        new = Page(open_document(path), folder.absolute())
        pn.state.on_session_destroyed(lambda _: new.session.end())
        return new

    settings.allowed_ws_origin = ["*"]  # `Foreign` decides, also about what Bokeh does not ask
    server = pn.serve(
        {"/": page}, address=address, port=port, show=show, title=TITLE, start=False,
        location=False, websocket_max_message_size=MESSAGE,
    )  # fmt: skip
    foreign = Foreign({address, "localhost", socket.gethostname()})
    # Before all other rules, those of WebSockets too.
    server._tornado.add_handlers(".*", [Rule(foreign, ErrorHandler, {"status_code": 403})])
    return server


def _panel() -> Any:
    try:
        import panel
    except ImportError as error:
        raise ImportError(
            'The page needs Panel: `pip install "graded_contact[explore]"`.'
        ) from error
    panel.extension("filedropper", inline=True)  # a notebook needs no network
    return panel
