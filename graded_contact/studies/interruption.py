"""Ctrl-C and SIGTERM end a long command at a safe place, not in the middle of compiled code.

A `KeyboardInterrupt` raised inside XLA, while it compiles or calls back into Python, ends in a
segmentation fault, at the latest when Python exits. `ctrl_c_later` therefore notes it, and it is
raised between two steps. In a command a separate thread notes the signals, because the main thread
notices nothing while it compiles or solves. A second signal ends the process at once. All finished
results are then on the disk.
"""

import contextlib
import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator

SIGNALS = (signal.SIGINT, signal.SIGTERM)
LATER = "Stopping after this step. Finished steps are kept; Ctrl-C again stops at once.\n"


class Interruption:
    """Which signal has come.

    **Fields:**

    - `signal`: its number, or None.
    """

    signal: int | None = None

    def check(self) -> None:
        """Raises `KeyboardInterrupt` if a signal has come: to be called between two steps."""
        if self.signal is not None:
            raise KeyboardInterrupt

    @property
    def exit_code(self) -> int:
        """The usual one of a process ended by the signal: 130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + (self.signal or 0)


@contextlib.contextmanager
def interruptible() -> Iterator[Interruption]:
    """Gives an `Interruption` that notes SIGINT and SIGTERM; a second signal ends the process.

    It must be entered by the main thread. Signals that the process ignores stay ignored.
    """
    found = Interruption()
    # Python's C handler writes each signal's number here, also while the main thread is in XLA.
    heard, wakeup = socket.socketpair()
    wakeup.setblocking(False)
    # Without a handler in Python, even an empty one, the thread is told nothing.
    previous = {
        number: signal.signal(number, lambda *_: None)
        for number in SIGNALS
        if signal.getsignal(number) != signal.SIG_IGN
    }
    earlier = signal.set_wakeup_fd(wakeup.fileno(), warn_on_full_buffer=False)
    listener = threading.Thread(target=_listen, args=(heard, found), daemon=True)
    listener.start()
    try:
        yield found
    finally:
        signal.set_wakeup_fd(earlier)
        for number, handler in previous.items():
            signal.signal(number, handler)
        wakeup.close()  # the listener then reads nothing, and ends
        listener.join()
        heard.close()


_outer: list[Interruption] = []  # of the blocks of `ctrl_c_later` that this one is in


@contextlib.contextmanager
def ctrl_c_later() -> Iterator[Interruption]:
    """Gives an `Interruption` that notes Ctrl-C inside the block; a second Ctrl-C raises at once.

    Only in the main thread, and only where Ctrl-C would raise: not inside `interruptible`.
    """
    usual, found = signal.default_int_handler, Interruption()
    main = threading.current_thread() is threading.main_thread()
    if not main or _outer or signal.getsignal(signal.SIGINT) is not usual:
        # A Ctrl-C that the outer block has noted must end the inner one.
        yield _outer[-1] if main and _outer else found
        return

    def note(number: int, frame: object) -> None:
        signal.signal(signal.SIGINT, usual)  # for the second one
        found.signal = number
        _say(LATER)

    signal.signal(signal.SIGINT, note)
    _outer.append(found)
    try:
        yield found
    finally:
        _outer.pop()
        signal.signal(signal.SIGINT, usual)


def _listen(heard: socket.socket, found: Interruption) -> None:
    """Notes the first signal and ends the process at the second; returns when the other end is."""
    while received := heard.recv(1):
        if received[0] not in SIGNALS:
            continue
        if found.signal is not None:
            _say("Stopped at once.\n")
            # `sys.exit` would only end this thread.
            os._exit(found.exit_code)
        found.signal = received[0]
        _say(LATER)


def _say(text: str) -> None:
    """Writes to the error stream, past Python's buffer, which the main thread may hold."""
    shown = "\x1b[?25h" if sys.stderr.isatty() else ""  # the cursor, which a progress bar hides
    with contextlib.suppress(OSError):
        os.write(2, f"{shown}\n{text}".encode())
