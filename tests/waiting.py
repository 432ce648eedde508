"""Waits for a state; the limit is for what hangs, never for what is slow."""

import time
from collections.abc import Callable

SECONDS = 900  # a busy machine compiles for minutes


def until(state: Callable[[], object]) -> None:
    end = time.monotonic() + SECONDS
    while not state():
        assert time.monotonic() < end, "the state has not come"
        time.sleep(0.01)
