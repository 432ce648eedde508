"""Code of pages, notebooks and examples: names exist, files are read, claims are stored rows."""

import ast
import csv
import functools
import inspect
import json
import re
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.scenes import parse_scene

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("docs/*.md"), ROOT / "README.md"])
SCRIPTS = sorted([*ROOT.glob("notebooks/*.ipynb"), *ROOT.glob("examples/**/*.py")])


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".py":
        return [text]
    if page.suffix == ".ipynb":
        cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
        return ["".join(cell["source"]).replace("%matplotlib", "#") for cell in cells]
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def called(node: ast.AST) -> object:
    """What `gc.name.name` stands for, or None for anything else."""
    if isinstance(node, ast.Name):
        return gc if node.id == "gc" else None
    owner = called(node.value) if isinstance(node, ast.Attribute) else None
    return None if owner is None else getattr(owner, node.attr)


@pytest.mark.parametrize("page", PAGES + SCRIPTS, ids=lambda page: page.stem)
def test_what_a_page_calls_exists_and_takes_its_arguments(page):
    for path in re.findall(r"`gc((?:\.\w+)+)", page.read_text(encoding="utf-8")):
        functools.reduce(getattr, path[1:].split("."), gc)
    for block in blocks(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.Attribute):
                called(node)
            if isinstance(node, ast.Call) and (function := called(node.func)) is not None:
                given = [keyword.arg for keyword in node.keywords if keyword.arg]
                inspect.signature(function).bind_partial(*node.args, **dict.fromkeys(given))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_whole_scenes_of_a_page_are_read(page):
    for text in blocks(page, "toml"):
        if "[surface]" in text and "[base]" in text and "path" not in text:
            scene = parse_scene(text)
            scene.case(scene.last)


def write_files(folder: Path) -> None:
    """Writes the files that the pages on measured data read."""
    tread, omega = gc.tyre_tread(), np.geomspace(1, 100, 8)
    rows = [
        (kelvin - 273.15, w / (2 * np.pi), moduli.real / 1e6, moduli.imag / 1e6)
        for kelvin in (283.15, 293.15, 303.15)
        for w, moduli in zip(
            omega, np.asarray(tread.at(kelvin).complex_modulus(omega)), strict=True
        )
    ]
    lines = [",".join(map(str, row)) for row in rows]
    (folder / "tread.csv").write_text("\n".join(["T [°C],f [Hz],E' [MPa],E'' [MPa]", *lines]))
    times = np.geomspace(0.1, 10, 6)
    columns = [(times, 1e-6 * (2 - np.exp(-times / tau))) for tau in (1.0, 3.0, 9.0)]
    creep = np.concatenate(columns).T
    names = ",".join(["t", "J"] * 3)
    np.savetxt(folder / "creep.csv", creep, delimiter=",", header=f"a\n{names}", comments="")
    (folder / "sweep.json").write_text(json.dumps({"Results": {"Processed": {"Rows": [{"f": 1}]}}}))
    (folder / "logarithms.csv").write_text("f,E1,E2\n0,1,0.2\n1,1.1,0.3\n")
    (folder / "terms.mpl").write_text("TBDATA,1,0.2,0.1\nTBDATA,3,0.3,1.0\n")
    heights = np.random.default_rng(0).normal(size=(64, 64))
    np.savetxt(folder / "road.txt", heights)
    np.savetxt(folder / "line.txt", np.column_stack([np.geomspace(1e-3, 2e-3, 64), heights[0]]))
    numbered = np.column_stack([np.arange(64), heights])
    names = ",".join(map(str, range(65)))
    np.savetxt(folder / "pandas.csv", numbered, delimiter=",", header=names, comments="")
    with h5py.File(folder / "scan.h5", "w") as file:
        file["image"] = heights
        file["image"].attrs.update(scale=1e-6, size=6.4e-6)


@pytest.mark.parametrize("name", ["dma", "topography"])
def test_code_on_measured_files_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # Fits have tests of their own.
    fitted = SimpleNamespace(material=gc.tyre_tread(), exported=gc.tyre_tread)
    monkeypatch.setattr(gc, "master_curve", lambda isotherms: fitted)
    write_files(tmp_path)
    found: dict = {}
    for block in blocks(ROOT / "docs" / f"{name}.md", "python"):
        exec(block, found)
    if name == "dma":
        np.testing.assert_allclose(found["ratios"], [0.2, 0.3])
    else:
        assert found["part"].grid.shape == (40, 40)


def stored(benchmark: str, column: str, **where: str) -> list[float]:
    """Returns a column of the stored rows of a benchmark."""
    path = ROOT / f"benchmarks/results/bench_{benchmark}.csv"
    with open(path, newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if where.items() <= row.items()]
    return [float(row[column]) for row in rows]


def test_pages_claim_what_is_stored():
    peers = {
        load: stored("contact-elastic", "over our time", solver="tamaas", **{"p/E*": load})
        for load in ("0.01", "0.1", "0.3")
    }
    partial, full = peers["0.01"] + peers["0.1"], peers["0.3"]
    gradients = stored("contact-gradient", "gradient over friction")
    claims = (
        f"{1e15 * stored('response-hard', 'error: worst', stacks='all')[0]:.1f}·10⁻¹⁵",
        f"{min(partial):.0f} to {max(partial):.0f} times faster than by Tamaas",
        f"full contact {min(full):.0f} to {max(full):.0f})",
        f"at most {max(gradients):.2f} solves",
    )
    for page in ("README.md", "docs/index.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        assert not [claim for claim in claims if claim not in text], page
    text = (ROOT / "docs/performance.md").read_text(encoding="utf-8")
    (peak,), (whole,) = (stored("contact-largest", f"peak {of}[GB]") for of in ("", "with it "))
    assert f"{peak:.0f} GB ({whole:.0f} GB with the error" in text.replace("\n", " ")
    for call in ("slide", "gradient"):
        assert f"{stored('contact-first', 'time [s]', call=call)[0]:.0f} s for" in text, call
