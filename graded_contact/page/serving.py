"""Pages for browsers, one for each tab, and the page of a notebook."""

import os
import socket
from pathlib import Path
from typing import Any

from .document import open_document

TITLE = "graded-contact explore"
MESSAGE = 20 * 10**6  # bytes that a browser may send at once


def explore(path: str | os.PathLike | None = None, folder: str | os.PathLike = ".") -> Any:
    """Returns a page of sliders, response, friction, contact and derivatives, for a notebook.

    It computes in a thread of its own; the command `graded-contact explore` shows the same.

    **Arguments:**

    - `path`: of a scene file; None for the embedded scene.
    - `folder`: the only place where anything is written: scenes that are saved, data dropped in.

    **Returns:** a layout of Panel, which a notebook shows as the value of a cell.

    **Raises:** `ImportError` without the extra `explore`; `FileNotFoundError`; `ValueError` for
    what is no scene, or has no motion.
    """
    pn = _panel()
    pn.extension("filedropper")
    page = _new_page(None if path is None else Path(path), Path(folder))
    page.turned()
    return page.view.whole


def serve(path: Path | None, folder: Path, *, address: str, port: int, show: bool) -> None:
    """Serves pages of a scene until Ctrl-C.

    **Arguments:**

    - `path`, `folder`: as in `explore`.
    - `address`, `port`: where to listen.
    - `show`: whether to open a browser.

    **Raises:** as `explore`; `OSError` if the port is taken.
    """
    pn = _panel()
    open_document(path)  # refused before anything listens
    pn.extension("filedropper")

    def page() -> Any:
        found = _new_page(path, folder)
        # Not before the browser has the page: what only asks for it costs nothing.
        pn.state.onload(found.turned)
        pn.state.on_session_destroyed(lambda _: found.end())
        return found.view.whole

    # Pages of other sites must not speak to this server through their visitors' browsers.
    names = dict.fromkeys((address, "localhost", "127.0.0.1", socket.gethostname()))
    pn.serve(
        {"/": page}, address=address, port=port, show=show, title=TITLE,
        websocket_origin=[f"{name}:{port}" for name in names], websocket_max_message_size=MESSAGE,
    )  # fmt: skip


def _new_page(path: Path | None, folder: Path) -> Any:
    from .page import Page

    return Page(open_document(path), folder.absolute())


def _panel() -> Any:
    try:
        import panel
    except ImportError as error:
        raise ImportError(
            'The page needs Panel: `pip install "graded_contact[explore]"`.'
        ) from error
    return panel
