"""Work for the latest wish only: what is asked for meanwhile replaces what was not yet begun."""

import threading
from collections.abc import Callable, Sequence
from typing import Any


class Latest:
    """A thread that does the stages of a job one after the other, and leaves them for a new one.

    **Arguments:**

    - `stages`: seconds to rest before each, in which a new job may come, and what it does with the
      job; what a stage raises it must see to itself.
    """

    def __init__(self, stages: Sequence[tuple[float, Callable[[Any], None]]]):
        self._stages = tuple(stages)
        self._asked, self._job, self._ended = threading.Event(), None, False
        # A compilation that goes on must not keep the program from ending.
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def ask(self, job: Any) -> None:
        """Has a job done, instead of any asked for before."""
        self._job = job
        self._asked.set()

    def end(self) -> None:
        """Ends the thread after the stage that it is at."""
        self._ended = True
        self._asked.set()
        self._job = None

    def _run(self) -> None:
        while True:
            self._asked.wait()
            if self._ended:
                return
            self._asked.clear()
            job = self._job
            for rest, stage in self._stages:
                if self._asked.wait(rest):
                    break
                stage(job)
