"""From the start of `graded-contact explore` to the first curves, contact, errors and bars.

    python benchmarks/bench_ready.py [--scene FILE] [--repeat 3]

In headless Chromium, without a cache of compiled programs; without a scene the demo's, 256².
Seconds of a core are those of the server since its process began, imports included: other work on
the machine changes them less than the time. They are compared with those of the first call of a
minimal splitting (`contact_first_calls.py`), which this process compiles before.
"""

import os
import re
import tempfile
import time
from pathlib import Path

import jax
import numpy as np
import scipy.linalg  # noqa: F401 (JAX imports it with its first linear solve)

from graded_contact.command.terminal import prepare

# This process compiles as the command does, without its cache.
prepare()
jax.config.update("jax_enable_compilation_cache", False)

from bench_explore import RESTED, chromium, served  # noqa: E402 (its arrays fix the options of XLA)
from contact_first_calls import _minimal  # noqa: E402
from rows import goal, report, run  # noqa: E402

DRAWN = """() => window.Bokeh && Bokeh.documents.some(doc => [...doc._all_models.values()].some(
  model => model.type == "ColumnDataSource" && model.data.x && model.data.x.length > 2))"""
SEEN = {
    "curves": lambda page: page.wait_for_function(DRAWN),
    "contact": lambda page: page.locator(".head b").first.wait_for(),
    "errors": lambda page: page.locator(".head b", has_text=re.compile("± [^—]")).first.wait_for(),
    "bars": lambda page: page.get_by_text(RESTED).wait_for(),
}
MOST = 20  # times a minimal splitting until the contact


def ready(scene=None, repeat=3):
    """Programs and seconds of a server until a page shows what it computes."""
    solve, begun = _minimal(64), time.process_time()
    jax.block_until_ready(solve())
    least = time.process_time() - begun
    runs = [_once(scene) for _ in range(repeat)]
    for seen in SEEN:
        best = min((run[seen] for run in runs), key=lambda row: row["of a core [s]"])
        ratio = best["of a core [s]"] / least
        more = {"a minimal splitting [s]": least, "ratio": ratio}
        report("bench_ready", {"shown": seen} | best | more)
        if seen == "contact":
            goal(f"curves and contact in {MOST} x a minimal splitting", f"{ratio:.1f}")


def _once(scene) -> dict[str, dict[str, float]]:
    """What was spent until each is seen in the browser, in one start of the server."""
    with tempfile.TemporaryDirectory() as empty, chromium() as browser:
        own = {"JAX_COMPILATION_CACHE_DIR": empty, "JAX_LOG_COMPILES": "1"}
        log, page, found = Path(empty) / "log.txt", browser.new_page(), {}
        page.set_default_timeout(1e6)
        begun = time.perf_counter()
        with (
            open(log, "w") as words,
            served(scene, env=os.environ | own, stderr=words) as (address, server),
        ):
            page.goto(address, wait_until="commit")
            for seen, wait in SEEN.items():
                wait(page)
                spent = Path(f"/proc/{server.pid}/stat").read_text().rpartition(")")[2].split()
                compiled = re.findall(r"XLA compilation of .* in ([\d.]+) sec", log.read_text())
                found[seen] = {
                    "programs": len(compiled), "XLA [s]": np.sum(np.array(compiled, float)),
                    "of a core [s]": sum(map(int, spent[11:13])) / os.sysconf("SC_CLK_TCK"),
                    "time [s]": time.perf_counter() - begun,
                }  # fmt: skip
    return found


if __name__ == "__main__":
    run(__doc__, ready)
