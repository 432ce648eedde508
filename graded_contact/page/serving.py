"""Serves a page to each tab of a browser, or to the cell of a notebook."""

import os
import socket
from collections.abc import Collection
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
    return _new_page(None if path is None else Path(path), Path(folder))


def serve(path: Path | None, folder: Path, *, address: str, port: int, show: bool) -> None:
    """Serves pages of a scene until Ctrl-C, see `new_server`."""
    server = new_server(path, folder, address=address, port=port, show=show)
    server.start()
    server.io_loop.start()


def new_server(path: Path | None, folder: Path, *, address: str, port: int, show: bool) -> Any:
    """Returns a server of pages of a scene, which is not started yet.

    **Arguments:**

    - `path`, `folder`: as in `explore`.
    - `address`, `port`: where the server listens.
    - `show`: whether to open a browser.

    **Raises:** as `explore`; `OSError` if the port is taken.
    """
    pn = _panel()
    pn.config.raw_css = [DARK]
    open_document(path)  # refused before the server listens

    def page() -> Any:
        new = _new_page(path, folder)
        pn.state.on_session_destroyed(lambda _: new.session.end())
        return new

    names = dict.fromkeys((address, "localhost", "127.0.0.1", socket.gethostname()))
    hosts = [f"{name}:{port}" for name in names]
    server = pn.serve(
        {"/": page}, address=address, port=port, show=show, title=TITLE, start=False,
        websocket_origin=hosts, websocket_max_message_size=MESSAGE,
    )  # fmt: skip
    _guard(server._tornado, {host.lower() for host in hosts})
    return server


def _guard(application: Any, hosts: Collection[str]) -> None:
    """Lets an application of Tornado refuse what pages of other sites ask.

    They would reach it through the browsers of their visitors: under a name of another site that
    leads to this machine, which the browser sends as `Host`. A WebSocket without `Origin` is
    refused, because each browser sends it.
    """
    from tornado.web import ErrorHandler

    find = application.find_handler

    def find_handler(request: Any, **given: Any) -> Any:
        socket_opens = request.headers.get("Upgrade", "").lower() == "websocket"
        known = request.host.lower() in hosts or f"{request.host.lower()}:80" in hosts
        if known and not (socket_opens and "Origin" not in request.headers):
            return find(request, **given)
        return application.get_handler_delegate(request, ErrorHandler, {"status_code": 403})

    application.find_handler = find_handler


def _new_page(path: Path | None, folder: Path) -> Any:
    from .view import Page

    return Page(open_document(path), folder.absolute())


def _panel() -> Any:
    try:
        import panel
    except ImportError as error:
        raise ImportError(
            'The page needs Panel: `pip install "graded_contact[explore]"`.'
        ) from error
    panel.extension("filedropper", inline=True)  # a notebook needs no network
    return panel
