"""What is installed and released: types, the command, the wheel, the lowest versions it needs."""

import inspect
import os
import runpy
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

import graded_contact as gc

ROOT = Path(__file__).parents[1]

# A gradient of friction, a graded layer by Riccati's equation, and a result written and read.
SCENE = """
surface = {kind = "self_affine", rms_slope = 0.2, hurst = 0.8, q_roll = 2e4, q_high = 8e4}
grid = {shape = [32, 32], size = 1e-3}
materials = {tread = {kind = "tyre_tread"}}
base = {kind = "half_space", material = "tread"}
load = {pressure = 2e5, velocity = 0.01}
"""


def test_the_module_is_the_command(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["graded-contact", "--version"])
    with pytest.raises(SystemExit) as end:
        runpy.run_module("graded_contact", run_name="__main__")
    assert end.value.code == 0 and capsys.readouterr().out.startswith("graded-contact ")


LAZY = """
import sys
import graded_contact as gc
late = {"h5py", "matplotlib", "pandas", "xarray", "scipy.linalg", "scipy.optimize"}
assert not late & set(sys.modules)
assert gc.plot.COLOURS and gc.read_results and "matplotlib" not in sys.modules
assert set(dir(gc)) == {*gc.__all__, '__version__'} and len(gc.__all__) <= 60
"""


def test_every_name_is_there_and_files_and_figures_cost_nothing_until_used():
    subprocess.run([sys.executable, "-c", LAZY], check=True)
    assert all(hasattr(gc, name) for name in gc.__all__)
    with pytest.raises(AttributeError, match="no attribute 'plots'"):
        gc.plots  # noqa: B018


NAMES = [getattr(gc, name) for name in gc.__all__ if name not in ("plot", "shapes")]
ROOMS = [room for room in NAMES if inspect.ismodule(room)]
NAMED = [
    *((gc, name) for name in gc.__all__),
    *((room, name) for room in ROOMS for name in getattr(room, "__all__", ())),
]


@pytest.mark.parametrize("module, name", NAMED, ids=lambda entry: getattr(entry, "__name__", entry))
def test_a_public_name_says_what_it_takes_and_returns(module, name):
    """By name, or "as in" another function."""
    found = getattr(module, name)
    text = inspect.getdoc(found) or ""
    assert text
    if inspect.isfunction(found):
        assert "**Returns:**" in text
        parameters = inspect.signature(found).parameters
        assert not parameters or "as in" in text or "as `" in text or "**Arguments:**" in text
        unnamed = [key for key in parameters if f"`{key}`" not in text]
        assert not unnamed or " as in `" in text or "as `" in text


def run(folder: Path, *words) -> str:
    """What a program printed, which sees nothing of this checkout but what `words` name."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        list(map(str, words)), capture_output=True, text=True, cwd=folder, env=environment
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


def fresh_environment(folder: Path) -> Path:
    """The folder of programs of a new environment."""
    venv.create(folder, with_pip=True)
    return folder / ("Scripts" if os.name == "nt" else "bin")


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Folder of the sdist, and of the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("dist")
    run(folder, sys.executable, "-m", "build", "--outdir", folder, ROOT)
    return folder


def members(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.slow
def test_the_wheel_holds_the_package_alone_and_is_that_of_the_checkout(built, tmp_path):
    (wheel,) = built.glob("*.whl")
    content, about = members(wheel), f"graded_contact-{gc.__version__}.dist-info/"
    sources = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "graded_contact").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert "graded_contact/py.typed" in sources
    assert {name for name in content if not name.startswith(about)} == sources
    assert content[f"{about}licenses/LICENSE"] == (ROOT / "LICENSE").read_bytes()
    run(tmp_path, sys.executable, "-m", "build", "--wheel", "--outdir", tmp_path, ROOT)
    (direct,) = tmp_path.glob("*.whl")
    assert members(direct) == content
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    kept = {"tests/test_package.py", "docs/conf.py", "README.md", "CHANGELOG.md", "CONTRIBUTING.md"}
    assert kept | {"LICENSE", "CITATION.cff", "pyproject.toml"} | sources <= names


@pytest.mark.slow
def test_the_wheel_runs_the_demo_from_a_clean_folder(built, tmp_path):
    programs = fresh_environment(tmp_path / "clean")
    (wheel,) = built.glob("*.whl")
    run(tmp_path, programs / "python", "-m", "pip", "install", "--quiet", wheel)
    where = "import graded_contact; print(graded_contact.__file__)"
    assert str(tmp_path) in run(tmp_path, programs / "python", "-c", where)
    run(tmp_path, programs / "graded-contact", "demo")
    written = {path.name for path in (tmp_path / "graded-contact-demo").iterdir()}
    assert {"demo.h5", "demo.csv", "demo-contact.png", "demo-sweep.png"} <= written


# A row of the comparison with other programs, at a size that takes seconds; kept out of `results/`.
PEERS = """
import sys
from pathlib import Path
sys.path.insert(0, "benchmarks")
import rows
rows.RESULTS = Path(sys.argv.pop())
from contact_peers import elastic
sys.argv[1:] = "elastic --sizes 32 --targets 1e-3 --loads 0.1 --repeat 1 --tries 1".split()
rows.run("", elastic)
"""
# What is done in the checkout with the extras' lower bounds; `{}` is a folder to write to.
