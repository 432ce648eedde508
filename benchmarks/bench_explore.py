"""From a key to the new picture: how fast the page answers, in a real browser.

    python benchmarks/bench_explore.py [--scene FILE] [--keys 20] [--screenshot FILE]

Serves `graded-contact explore` (without a scene the demo's, 256²) on the loopback address, opens it
in headless Chromium, waits until all is compiled, and moves one slider after the other by one key,
each after the drawing of the last one ended. Times are from the key to the end of the frame in
which the browser draws the changed data.
"""

import contextlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator

import numpy as np
from playwright.sync_api import sync_playwright
from rows import report, run

# The columns of the data show which figures are drawn.
WATCH = """() => {
  window.drawn = {};
  const kind = data => data.image ? "contact" : data.friction ? "derivatives"
    : (data.y && data.y.length > 2) ? "curves" : null;
  for (const doc of Bokeh.documents) for (const model of doc._all_models.values()) {
    if (model.type != "ColumnDataSource") continue;
    model.properties.data.change.connect(() => {
      const name = kind(model.data);
      if (name) requestAnimationFrame(() => {
        const after = new MessageChannel();
        after.port1.onmessage = () => { window.drawn[name] = performance.now() - window.pressed; };
        after.port2.postMessage(null);
      });
    });
  }
  document.addEventListener("keydown", () => {
    window.drawn = {}; window.pressed = performance.now();
  }, true);
}"""
RESTED = re.compile(r"bars \d")  # the words of a page whose work is done
TARGETS = {"curves": 0.2, "contact": 0.3, "derivatives": 1.0}  # s


def free_port() -> int:
    """Returns a free port."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def wait_for(port: int) -> None:
    """Ends when a server listens."""
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)


@contextlib.contextmanager
def served(scene: str | None, **options) -> Iterator[tuple[str, subprocess.Popen]]:
    """The address of a page in a process of its own, and this process; `options` of `Popen`."""
    port = free_port()
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "graded_contact", "explore", *([scene] if scene else [])]
        more = ["--no-browser", "--port", str(port), "-o", folder]
        server = subprocess.Popen([*command, *more], **options)
        try:
            wait_for(port)
            yield f"http://127.0.0.1:{port}/", server
        finally:
            server.terminate()
            server.wait()


@contextlib.contextmanager
def chromium() -> Iterator:
    """A browser."""
    with sync_playwright() as driver:
        path = shutil.which("chromium") or shutil.which("google-chrome")
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


def measure(address: str, keys: int, screenshot: str | None) -> dict[str, list[float]]:
    """Returns the seconds from each key to the pictures."""
    found: dict[str, list[float]] = {name: [] for name in TARGETS}
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(600_000)
        page.goto(address)
        page.get_by_text(RESTED).wait_for()
        page.evaluate(WATCH)
        sliders = page.locator("input[type=range]")
        for i in range(keys + 1):
            sliders.nth(i % sliders.count()).focus()
            page.keyboard.press("ArrowLeft")
            page.wait_for_function("() => window.drawn.derivatives && window.drawn.contact")
            for name, milliseconds in page.evaluate("() => window.drawn").items():
                found[name].append(milliseconds / 1e3)
            time.sleep(0.3)
        if screenshot:
            page.screenshot(path=screenshot)
    return {name: values[1:] for name, values in found.items()}


def explore(scene=None, keys=20, screenshot=None):
    """Seconds of each picture; `--screenshot` is the PNG of the page afterwards."""
    with served(scene) as (address, _):
        found = measure(address, keys, screenshot)
    for name, target in TARGETS.items():
        median, slow = np.percentile(found[name], (50, 90))
        row = {"picture": name, "median [s]": median, "nine of ten within [s]": slow}
        report("bench_explore", row | {"target [s]": target})


if __name__ == "__main__":
    run(__doc__, explore)
