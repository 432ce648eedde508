"""A page: what people ask of it, and the order in which that is done.

For each change the cheap figures come first, then the contact; derivatives when the sliders rest.
Each page, that is each tab of a browser, has a scene, sliders and a thread of its own.
"""

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import panel as pn

from ..contact.solution import RESULTS
from .document import Document
from .latest import Latest
from .model import Curves, Model
from .shown import Shown
from .tools import Change, Tools
from .view import View

_COMPILING = threading.Lock()
REST = 0.25  # s without a change, before derivatives
# What the package raises for what it refuses.
REFUSALS = (ValueError, OSError, ImportError, MemoryError)


class Job(NamedTuple):
    """A model and where its sliders stand; no model at first."""

    model: Model | None
    values: tuple[float, ...] = ()


class Page:
    """A scene with sliders; `view.whole` is what Panel shows, in a browser or a notebook.

    Nothing is computed before the first call of `turned`.

    **Arguments:**

    - `document`: the scene.
    - `folder`: the only place where anything is written.
    """

    def __init__(self, document: Document, folder: Path):
        self._served: Any = pn.state.curdoc  # None in a notebook
        self._ended = False
        self._model: Model | None = None
        self._changes: list[Change] = [lambda _: document]
        self._results: dict[str, Any] = {}
        self._kept: Curves | None = None
        self._seconds: dict[str, float] = {}
        self._tools = Tools(folder, self.change, self._tell)
        self.view = View(self._tools, self)
        self._shown: Model | None = None
        stages = (("curves", 0.0), ("contact", 0.0), ("derivatives", REST))
        work = [(rest, partial(self._do, name)) for name, rest in stages]
        self._latest = Latest([(0.0, self._open), *work])

    def end(self) -> None:
        """Ends the thread of the page, when its tab is closed."""
        self._ended = True
        self._latest.end()

    # What people do.

    def turned(self) -> None:
        """Has everything done for where the sliders stand."""
        self.view.refuse("")
        self._ask()

    def _ask(self) -> None:
        sliders = self.view.sliders
        self._latest.ask(Job(self._shown, sliders.values if sliders else ()))

    def change(self, change: Change) -> None:
        """Has the scene's tables changed."""
        self._changes.append(change)
        self._ask()

    def pinned(self, wanted: bool) -> None:
        """Keeps the curves for comparison, also with another scene, or drops them."""
        curves = self._results.get("curves")
        self._kept = curves if wanted else None
        if curves:
            self.view.show_curves(curves, self._kept)

    def save(self, name: str) -> None:
        """Saves the scene where its sliders stand."""
        if self._shown and self.view.sliders:
            self._tools.save(self._shown.turned(self.view.sliders.values), name)

    def take(self, kind: str) -> bytes:
        """Returns what is shown as the bytes of a file: csv, h5 or pdf."""
        job: Job = self._results["job"]
        assert job.model is not None
        shown = Shown(
            job.model.turned(job.values), job.model.knobs, self._results["curves"],
            self._results["contact"], np.asarray(job.model.surface.grid.size),
            self._results.get("derivatives"),
        )  # fmt: skip
        return {"csv": lambda: shown.csv().encode(), "h5": shown.hdf5, "pdf": shown.pdf}[kind]()

    def _tell(self, text: str, refused: bool) -> None:
        self._later(partial(self.view.refuse if refused else self.view.tell, text))

    # What is done, in the page's thread.

    def _open(self, job: Job) -> None:
        """Changes the scene as was asked, and builds what it describes."""
        while self._changes:
            change = self._changes.pop(0)
            self._later(partial(self.view.state, "reading the scene", True))
            model = self._model
            document: Any = model and model.document
            if model and job.model is model:
                document = model.turned(job.values)
            try:
                self._model = model = Model(change(document))
            except Exception as error:
                self._fail("the scene", error)
                self._later(self._tell_seconds)
                continue
            self._seconds = {}
            self._later(partial(self._show_model, model))

    def _do(self, name: str, job: Job) -> None:
        """Computes one part of the page, and has it shown."""
        model = self._model
        if model is None:
            return
        if job.model is not model:
            job = Job(model, model.values)
        first = name not in self._seconds
        if first:
            self._later(partial(self.view.state, f"compiling: {name}", True))
        started = time.perf_counter()
        try:
            # What one page compiles another need not.
            with _COMPILING if first else contextlib.nullcontext():
                found = getattr(model, name)(job.values)
        except Exception as error:
            self._fail(name, error)
            return
        self._seconds[name] = time.perf_counter() - started
        self._later(partial(self._show, name, job, found))

    def _fail(self, stage: str, error: Exception) -> None:
        """Shows the error that ended a stage; the thread goes on. Unexpected ones are logged."""
        text = str(error).strip() or type(error).__name__
        if not isinstance(error, REFUSALS):
            logging.getLogger(__name__).error(stage, exc_info=error)
            text = f"{stage}: {text.splitlines()[0]}"
        self._tell(text, True)

    # What is shown, under the lock of the document.

    def _later(self, show: Callable[[], None]) -> None:
        if self._ended:
            return
        if self._served is not None and self._served.session_context:
            self._served.add_next_tick_callback(partial(self._held, show))
        else:
            show()
            pn.io.push_notebook(self.view.whole)

    def _held(self, show: Callable[[], None]) -> None:
        with pn.io.hold(self._served):
            show()

    def _show_model(self, model: Model) -> None:
        self._shown = model
        self._results = {}
        self.view.show_model(model)

    def _show(self, name: str, job: Job, found: Any) -> None:
        model = job.model
        if model is None or model is not self._shown:
            return
        if name == "curves":
            self._results = {"curves": found, "job": job}
            self.view.show_curves(found, self._kept)
            self.view.fade()
            return
        self._results[name] = found
        if name == "contact":
            self.view.show_contact(model, job.values, found)
            if found.sliding.result != RESULTS.successful:
                self.view.refuse(RESULTS[found.sliding.result])
        else:
            self.view.show_derivatives(found)
        self._tell_seconds()

    def _tell_seconds(self) -> None:
        parts = (f"{name} {1e3 * seconds:.0f}" for name, seconds in self._seconds.items())
        self.view.state(", ".join(parts) + " ms", False)
