"""The progress of a search on one line of a terminal or a notebook."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

EVERY = 0.1  # s between two updates


@contextlib.contextmanager
def shown_on_a_line(
    progress: Callable[[int, float], None] | None, unit: str, total: int
) -> Iterator[Callable[[int, float], None]]:
    """Yields `progress`, or without one a function that shows number and value on one line.

    **Arguments:**

    - `progress`: called with the number of the current start or step, and a value; or None.
    - `unit`, `total`: what is counted, and how many there are.
    """
    write = _writer() if progress is None else None
    if write is None:
        yield progress or (lambda *_: None)
        return
    last, count, least, text = 0.0, 0, float("inf"), ""

    def say(i: int, value: float) -> None:
        nonlocal last, count, least, text
        count, least = count + 1, min(least, value)
        text = f"{unit} {i + 1} of {total}, {count} evaluations"
        text += f", value {value:.6g}, lowest {least:.6g}"
        if time.monotonic() >= last + EVERY:
            last = time.monotonic()
            write(text, "")

    try:
        yield say
    finally:
        write(text, "\n")


def _writer() -> Callable[[str, str], None] | None:
    """What replaces the text of the line, and then ends it; None where nobody looks."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if hasattr(shell, "kernel"):  # of a notebook
        from IPython.display import display

        line: Any = display({"text/plain": ""}, raw=True, display_id=True)
        return lambda text, _: line.update({"text/plain": text}, raw=True)
    if sys.stderr.isatty():
        clear = "\r\x1b[2K"
        return lambda text, end: print(clear + text, end=end, file=sys.stderr, flush=True)
    return None
