"""The page with many users: memory, answers and seconds of one server, in a real browser.

    python benchmarks/bench_page.py [--scene FILE] [--sessions 20] [--moves 200] [--points 1800]

Serves `graded-contact explore` (without a scene the demo's, 256²) without a cache of compiled
programs, and opens its tabs in headless Chromium at once. Three of four then move sliders, each tab
after it answered; the others are idle. The friction of each tab is compared with that of its own
values, solved in this process. Then half of the tabs are closed in the middle of a solve, one of
the others takes a surface of `points`² heights, and all are closed. Memory is the resident set of
the server; seconds are from opening a tab, or from a move, to the end of all its work.
"""

import os
import re
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from bench_explore import RESTED, WATCH, chromium, served
from rows import goal, report, run

from graded_contact.page.document import open_document
from graded_contact.page.model import Model

SECONDS = 900.0  # to wait for a page
FORGOTTEN = 60.0  # s, until the server has dropped the sessions of closed tabs
TOLERANCE = 2e-3  # of friction: both solves have a pressure within 1e-4


def memory(server: subprocess.Popen) -> float:
    """Returns the resident set of a process [MB]."""
    status = Path(f"/proc/{server.pid}/status").read_text()
    return int(re.findall(r"VmRSS:\s+(\d+) kB", status)[0]) / 1e3


def waited(pages: list, begun: dict, done) -> list[float]:
    """Returns the seconds of each page from `begun` until `done(page)`."""
    found: dict = {}
    while len(found) < len(pages):
        for page in pages:
            if page not in found and done(page):
                found[page] = time.perf_counter() - begun[page]
            elif page not in found and time.perf_counter() - begun[page] > SECONDS:
                raise TimeoutError(f"a page did not answer in {SECONDS:g} s")
        time.sleep(0.05)
    return list(found.values())


def rests(page) -> bool:
    """Whether all work of a page is done."""
    return page.get_by_text(RESTED).is_visible() and not page.locator(".loader.spin").is_visible()


def fields(page):
    """The fields of the sliders of a page."""
    return page.locator(".knob input[type=text]")


def friction(page) -> str:
    """The friction with its error, as the page prints it."""
    return page.locator(".head b").first.inner_text()


def move(page, draw) -> None:
    """Moves the pressure or the velocity of a page, as a key does, by less than half the range."""
    slider = page.locator("input[type=range]").nth(int(draw.integers(2)))
    slider.evaluate(
        """(it, step) => {
          it.dispatchEvent(new KeyboardEvent("keydown", {bubbles: true, composed: true}))
          it.value = 100 + (+it.value + 100 + step) % 200
          it.dispatchEvent(new Event("input"))
        }""",
        int(draw.integers(1, 200)),
    )


def drawn(page) -> bool:
    """Whether the bars are drawn for the last move of a page."""
    return page.evaluate("window.drawn.derivatives")


def wrong(pages: list, scene: str | None) -> int:
    """Returns how many pages show another friction than their own values have."""
    model, count = Model(open_document(None if scene is None else Path(scene))), 0
    for page in pages:
        texts = fields(page).evaluate_all("all => all.map(it => it.value)")
        values = [knob.read(text) for knob, text in zip(model.knobs, texts, strict=True)]
        wanted = float(model.contact(values).friction)
        count += abs(float(friction(page).split()[0]) / wanted - 1) > TOLERANCE
    return count


def page(scene=None, sessions=20, moves=200, points=1800):
    """Memory, answers and seconds of a server with many tabs."""
    draw, empty = np.random.default_rng(0), tempfile.mkdtemp()
    options = {"env": os.environ | {"JAX_COMPILATION_CACHE_DIR": empty}, "stderr": subprocess.PIPE}

    def row(stage: str, seconds=(), count=0, answers=0) -> None:
        median, slowest = (np.median(seconds), max(seconds)) if seconds else (0.0, 0.0)
        report("bench_page", {
            "stage": stage, "tabs": len(tabs), "moves": count, "memory [MB]": memory(server),
            "median [s]": median, "slowest [s]": slowest, "wrong": answers,
        })  # fmt: skip

    tabs: list = []
    with served(scene, **options) as (address, server), chromium() as browser:
        row("listening")
        begun = {}
        for _ in range(sessions):
            tabs.append(browser.new_page(viewport={"width": 1280, "height": 800}))
            tabs[-1].set_default_timeout(1e3 * SECONDS)
            begun[tabs[-1]] = time.perf_counter()
            tabs[-1].goto(address, wait_until="commit")
        row("first contact", waited(tabs, begun, lambda page: page.locator(".head b").count()))
        row("first derivatives", waited(tabs, begun, rests))
        for each in tabs:
            each.evaluate(WATCH)
        active, seconds, done = tabs[: -(-3 * sessions // 4)], [], 0
        for count in (moves // 5, moves):  # so that memory which grows with moves is seen
            while done < count:
                turning = active[: count - done]
                for each in turning:
                    begun[each] = time.perf_counter()
                    move(each, draw)
                done += len(turning)
                seconds += waited(turning, begun, drawn)
            row("moved", seconds, count, wrong(tabs, scene))
        for each in tabs[::2]:
            move(each, draw)
            time.sleep(0.1)
            each.close()
        tabs = tabs[1::2]
        time.sleep(FORGOTTEN)
        row("half closed in a solve", answers=wrong(tabs, scene))
        if points:
            heights = Path(empty) / "heights.npy"
            rough = 1e-5 * draw.normal(size=(points // 20, points // 20))
            np.save(heights, np.kron(rough, np.ones((20, 20))).astype(np.float32))
            large = tabs[0]
            large.get_by_text("Data", exact=True).click()
            for name, text in (("unit of its heights", "m"), ("edge length [m]", "8e-3")):
                large.get_by_label(name).fill(text)
                large.get_by_label(name).press("Enter")
            begun[large] = time.perf_counter()
            large.locator("input[type=file]").nth(1).set_input_files(heights)
            large.locator(".title", has_text="on heights.npy").wait_for()
            row("large surface", waited([large], begun, rests))
        for each in tabs:
            each.close()
        tabs = []
        time.sleep(FORGOTTEN)
        row("all closed")
    assert server.stderr is not None
    words = server.stderr.read().decode()
    goal("no traceback in the terminal", f"{words.count('Traceback')} tracebacks")
    print(words[-4000:])


if __name__ == "__main__":
    run(__doc__, page)
