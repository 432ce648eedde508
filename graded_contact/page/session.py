"""The session of a page: its scene, the values of the sliders, and the order of the computation.

For each change the session computes the curves first, then the contact, its errors, and the
derivatives. A new change replaces an earlier one between these stages. Everything is computed in
threads, one stage of a page at a time; all else runs on the event loop. One thread reads the scenes
of all pages and computes what compiles: tabs that open together wait for one compilation, not for
one each.
"""

import asyncio
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import panel as pn
import param

from ..contacts.solution import RESULTS
from ..core.display import with_unit
from ..core.memory import return_freed_memory
from .document import Document, save_document, with_file
from .downloads import ShownPoint
from .model import Model

# Seconds to rest before each stage: no errors and no derivatives while a slider moves.
STAGES = {"curves": 0.0, "contact": 0.0, "errors": 0.1, "derivatives": 0.25}
SHOWN_AS = {"derivatives": "bars"}
EXPECTED = (ValueError, OSError, ImportError, MemoryError)  # errors of the package for bad input
_COMPILE_THREAD = ThreadPoolExecutor(1, "compiling")

Change = Callable[[Document], Document]
T = TypeVar("T")


class _Closed(Exception):
    """The page was closed."""


class Session(param.Parameterized):
    """What a page shows, as parameters; they change under the lock of the page's document.

    **Arguments:**

    - `document`: the scene.
    - `folder`: the only folder into which the session writes.
    """

    model: Any = param.Parameter(doc="The `Model` of the scene; None until it is read.")
    curves: Any = param.Parameter(doc="The last curves.")
    pinned: Any = param.Parameter(doc="The point to compare with, `ShownPoint`, or None.")
    shown: Any = param.Parameter(doc="The last point with a contact, `ShownPoint`.")
    refused = param.String(
        doc="Why texts in fields of sliders are not used, while they stay there."
    )
    message = param.String(doc="What else the user must know.")
    error = param.Boolean(doc="Whether the message reports an error.")
    status = param.String("Reading the scene.")
    busy = param.Boolean(True)

    def __init__(self, document: Document, folder: Path):
        super().__init__()
        self.folder = folder
        self._changes: list[Change] = [lambda _: document]
        self._newest: Any = None  # the model that is soon shown, and values of its knobs
        self._values: tuple[float, ...] = ()
        # `_turn` makes stages of one page follow each other; `_call` tells which is the newest.
        self._call, self._turn, self._ended = 0, asyncio.Lock(), False
        self._seconds: dict[str, float] = {}
        self._saved: set[str] = set()

    # Actions of the user.

    def set_value(self, model: Model, index: int, value: float) -> None:
        """Changes the value of one knob [SI], if `model` is still the newest."""
        if model is self._newest:
            self._values = (*self._values[:index], value, *self._values[index + 1 :])
            pn.state.execute(self.update)

    def change(self, change: Change) -> None:
        """Changes the tables of the scene."""
        self._changes.append(change)
        pn.state.execute(self.update)

    def take_file(
        self, name: str, data: bytes | str, change: Callable[[Document, Path], Document]
    ) -> None:
        """Changes the scene by a file of the user, see `with_file`."""
        data = data.encode() if isinstance(data, str) else data
        self.change(partial(with_file, folder=self.folder, name=name, data=data, change=change))

    def save(self, name: str) -> None:
        """Saves the scene at its present values; replaces only scenes of this session."""
        try:
            document = self._newest.changed(self._values)
            path = save_document(document, self.folder, name, name in self._saved)
        except (ValueError, OSError) as error:
            self.show_message(str(error))
            return
        self._saved.add(name)
        text = f"Saved as {path}: `graded-contact run` and `explore` open it."
        self.show_message(text, error=False)

    def end(self) -> None:
        """Stops after the stage that is being computed, when the tab of the page is closed."""
        self._ended = True

    def show_message(self, text: str, error: bool = True) -> None:
        """Shows a message."""
        self.show(message=text, error=error)

    # The computation.

    async def update(self) -> None:
        """Computes what the sliders ask for; a later call replaces this one between two stages."""
        self._call += 1
        call = self._call
        self.show_message("")
        async with self._turn:
            while self._changes:
                await self._read(self._changes.pop(0))
        model, values = self._newest, self._values  # a later change makes another call
        found: list[Any] = []  # of the stages, in their order
        for stage, rest in STAGES.items():
            await asyncio.sleep(rest)
            async with self._turn:  # the call may have waited here while a newer one came
                stale = self._ended or call != self._call or model is None
                if stale or not await self._compute(call, stage, model, values, found):
                    return
        await asyncio.to_thread(return_freed_memory)

    async def _read(self, change: Change) -> None:
        """Changes the scene, and builds its model."""
        self.show(status="Reading the scene.", busy=True)
        old, values = self._newest, self._values
        build = lambda: Model(change(old and old.changed(values)))  # noqa: E731
        try:
            model = await self._in_thread(_COMPILE_THREAD, build)
        except _Closed:
            return
        except Exception as error:
            self._fail("the scene", error)
            return
        self._newest, self._values, self._seconds = model, model.values, {}
        self.show(model=model, message="")  # an earlier change may have failed meanwhile

    async def _compute(
        self, call: int, stage: str, model: Any, values: tuple[float, ...], found: list[Any]
    ) -> bool:
        """Computes one stage, adds it to `found` and shows it; returns whether that succeeded."""
        first = stage not in self._seconds
        if first:
            text = f"Preparing the {SHOWN_AS.get(stage, stage)}: the first time takes seconds"
            self.show(status=f"{text} to a minute, later moves less than a second.", busy=True)
        started = time.perf_counter()
        compute = partial(getattr(model, stage), values)
        try:
            found.append(await self._in_thread(_COMPILE_THREAD if first else None, compute))
        except _Closed:
            return False
        except Exception as error:
            if call == self._call:
                self._fail(stage, error)
            return False
        self._seconds[stage] = time.perf_counter() - started
        if stage == "curves":
            self.show(curves=found[0])
            return True
        self.show(shown=ShownPoint(model, values, *found), **self._timing())
        result = found[1].result
        if stage == "contact" and result != RESULTS.successful:
            self.show_message(RESULTS[result])
        return True

    async def _in_thread(self, threads: ThreadPoolExecutor | None, work: Callable[[], T]) -> T:
        """Returns what `work` returns; raises `_Closed` if the page is closed before its turn."""

        def run() -> T:
            if self._ended:
                raise _Closed
            return work()

        return await asyncio.get_running_loop().run_in_executor(threads, run)

    def _fail(self, stage: str, error: Exception) -> None:
        """Shows the error that ended a stage. Unexpected errors are logged."""
        text = str(error).strip() or type(error).__name__
        if not isinstance(error, EXPECTED):
            logging.getLogger(__name__).error(stage, exc_info=error)
            text = f"{stage}: {text.splitlines()[0]}"
        self.show(message=text, error=True, **self._timing())

    def _timing(self) -> dict[str, Any]:
        spent = self._seconds
        parts = (f"{SHOWN_AS.get(name, name)} {with_unit(one, 's')}" for name, one in spent.items())
        total = f"Computed in {with_unit(sum(spent.values()), 's')} ({', '.join(parts)})."
        return {"status": total if spent else "", "busy": False}

    def show(self, **values: Any) -> None:
        """Changes parameters, under the lock of the page's document."""

        def show() -> None:
            with pn.io.hold():
                self.param.update(**values)
            values.clear()  # Bokeh keeps this function in a circle, which Python finds late

        if not self._ended:
            pn.state.execute(show, schedule=True)
