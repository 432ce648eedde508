"""What is installed and released: types, the command, the wheel, the lowest versions it needs."""

import importlib
import inspect
import os
import re
import runpy
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from collections.abc import Iterable
from pathlib import Path

import pytest

import graded_contact as gc

ROOT = Path(__file__).parents[1]

# A gradient of friction, a graded layer by Riccati's equation, and a result written and read.
JOB = """
import warnings
warnings.simplefilter("error")
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
import graded_contact as gc
q0 = 2 * np.pi / 8e-3
spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=q0, q_roll=2 * q0, q_high=8 * q0)
road = gc.random_surface(spectrum, gc.Grid((32, 32), 8e-3), jax.random.key(0))
coat = gc.Layer(gc.Elastic(6.5e6, 0.49), thickness=50e-6)
block = gc.Stack(layers=(coat,), base=gc.HalfSpace(gc.tyre_tread()))
rate = jax.grad(lambda b: gc.slide(b, road, pressure=4e5, velocity=0.1).friction)(block)
assert np.isfinite(rate.layers[0].thickness)
graded = gc.GradedLayer(gc.Blend(gc.Elastic(1e6, 0.4), gc.Elastic(1e7, 0.4)), 1e-3)
riccati, layers = (
    gc.blocks.graded_compliance(
        gc.Stack(layers=(graded,), base=gc.Rigid(), graded_solver=solver), 1e3, 0.0
    ).value
    for solver in (gc.blocks.Riccati(), gc.blocks.Layering())
)
np.testing.assert_allclose(riccati, layers, rtol=1e-6)
warnings.simplefilter("default")  # old versions of other libraries are deprecated somewhere
from graded_contact.cli import app
app(["run", "scene.toml", "--output", "out"], standalone_mode=False)
app(["info", "out/scene.h5"], standalone_mode=False)
"""
SCENE = """
surface = {kind = "self_affine", rms_slope = 0.2, hurst = 0.8, q_roll = 2e4, q_high = 8e4}
grid = {shape = [32, 32], size = 1e-3}
materials = {tread = {kind = "tyre_tread"}}
base = {kind = "half_space", material = "tread"}
load = {pressure = 2e5, velocity = 0.01}
"""


def test_the_module_is_the_command(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["graded-contact", "--version"])
    monkeypatch.setattr("graded_contact.cli.spell_missing_characters", lambda: None)
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


def test_a_name_that_moved_works_and_says_where_it_is():
    with pytest.warns(FutureWarning, match=r"`.*\.motion` is `.*\.sliding` now"):
        assert gc.motion is gc.sliding


@pytest.mark.parametrize(
    "old, now",
    [
        ("contacts.Heating", gc.sliding.Heating),
        ("materials.read_errors", gc.studies.read_errors),
        ("design.loss_tangent", gc.designs.loss_tangent),
    ],
)
def test_a_name_that_changed_its_room_warns_and_is_found(old, now):
    room, _, name = old.replace("design.", "studies.").partition(".")
    with pytest.warns(FutureWarning, match=rf"\.{name}` is `graded_contact\.{name}` now"):
        found = getattr(getattr(gc, room), name)
    assert found is now


def test_an_old_module_is_imported_with_a_warning():
    module = importlib.import_module("graded_contact.motion")
    with pytest.warns(
        FutureWarning, match=r"motion\.sinusoidal` is `graded_contact\.sinusoidal` now"
    ):
        assert module.sinusoidal is gc.sliding.sinusoidal


@pytest.mark.parametrize(
    "room, old, said",
    [
        (gc, "run_scene", r"`graded_contact\.plan\(scene\)\.run"),
        (gc, "fit_creep", 'fit_prony.*kind="creep"'),
        (gc, "checkpointed", "removed: `sweep`"),
        (gc.plot, "plot_outline", "removed: `plot.plot_sliding`"),
        (gc.contacts, "ObservableTarget", "removed: `rtol`"),
        (gc.studies, "friction_between", "removed: read `MeanField.against_cutoff`"),
        (gc.studies, "Run", r"studies\.Descent"),
    ],
)
def test_a_name_that_is_gone_tells_what_to_use(room, old, said):
    error = f"no attribute '{old}'; since 1.0.0 it is .*{said}"
    # `from graded_contact import ...` shows the warning alone.
    with pytest.raises(AttributeError, match=error), pytest.warns(FutureWarning, match=error):
        getattr(room, old)


def test_what_is_declared_is_imported():
    """But jaxlib, whose version goes with that of jax, and the libraries of files under xarray."""
    project = tomllib.loads(text_of("pyproject.toml"))["project"]
    declared = {re.match(r"[\w.-]+", entry)[0] for entry in project["dependencies"]}
    declared -= {"jaxlib", "h5netcdf", "h5py"}
    sources = [path.read_text(encoding="utf-8") for path in (ROOT / "graded_contact").rglob("*.py")]
    imported = {
        name for text in sources for name in re.findall(r"(?m)^\s*(?:import|from) (\w+)", text)
    }
    assert declared <= imported


ROOMS = [getattr(gc, name) for name in gc.ROOMS if name != "plot"]
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


def test_the_version_is_stated_once():
    cited = re.search(r"^version: (.+)$", text_of("CITATION.cff"), flags=re.MULTILINE)[1]
    # The newest section with a date: one above it is not released yet.
    changed = re.search(r"^## (\S+) \((\d.+)\)$", text_of("CHANGELOG.md"), flags=re.MULTILINE)
    assert gc.__version__ == cited == changed[1]
    assert f"date-released: {changed[2]}\n" in text_of("CITATION.cff")


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


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
import bench_contact
sys.argv[1:] = "elastic --sizes 32 --targets 1e-3 --loads 0.1 --repeat 1 --tries 1".split()
bench_contact.main()
"""
TOOLS = ("pytest", "pytest-xdist", "hypothesis", "mpmath", "beartype")
TESTS = ("-m", "pytest", "-n", "0", "-p", "no:cacheprovider", "-W", "ignore::DeprecationWarning")
# What is done in the checkout with the extras' lower bounds; `{}` is a folder to write to.
LOWEST = {
    "cluster explore": [
        ("-c", JOB),
        (*TESTS, "tests/page/test_knobs.py", "tests/studies/test_sweep.py"),
        (*TESTS, "tests/fields/test_grid.py"),
    ],
    "io": [(*TESTS, "tests/readers/test_topography.py", "tests/readers/test_moduli.py")],
    "fast-cpu": [(*TESTS, "tests/fields/test_fft.py")],
    "test": [
        (*TESTS, "tests/page/test_browser.py", "tests/materials/test_material.py"),
        (*TESTS, "tests/test_notebooks.py"),
        ("-m", "build", "--wheel", "--outdir", "{}"),
    ],
    "bench": [("-c", PEERS, "{}")],
    "docs": [("-m", "sphinx", "-q", "-W", "-n", "docs", "{}/site")],
    "dev": [
        ("-m", "ruff", "check", "."),
        ("-m", "ruff", "format", "--check", "."),
        ("-m", "pre_commit", "validate-config", ".pre-commit-config.yaml"),
        ("-m", "nbstripout", "--verify", "--keep-id", "notebooks/01_quickstart.ipynb"),
    ],
}


def test_the_lower_bounds_of_every_extra_are_tried():
    extras = tomllib.loads(text_of("pyproject.toml"))["project"]["optional-dependencies"]
    assert sorted(extras) == sorted(" ".join(LOWEST).split())


def lower_bounds(entries: Iterable[str]) -> dict[str, str]:
    """By name, the last counts: an extra may ask for more than the package."""
    lowest = {entry.partition(">=")[0]: entry.replace(">=", "==") for entry in entries}
    assert all("==" in entry for entry in lowest.values())
    return lowest


@pytest.mark.slow
def test_the_command_runs_with_the_lowest_versions_of_its_own_libraries(tmp_path):
    """Those that parse and print, in front of all else that is installed here."""
    project = tomllib.loads(text_of("pyproject.toml"))["project"]
    lowest = lower_bounds(project["dependencies"])
    words = ["-m", "pip", "install", "-q", "--retries", "1", "--target", tmp_path / "lowest"]
    words = [sys.executable, *words, lowest["typer"], lowest["rich"]]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode and "connection broken" in done.stderr:
        pytest.skip("no registry of packages can be reached")
    assert done.returncode == 0, done.stderr
    (tmp_path / "scene.toml").write_text(SCENE)
    paths = os.pathsep.join(map(str, (tmp_path / "lowest", ROOT)))
    environment = os.environ | {"PYTHONPATH": paths, "XDG_CACHE_HOME": str(tmp_path)}
    jobs = ["--version"], ["run", "scene.toml", "-o", "out"], ["info", "out/scene.h5"]
    program = f"from graded_contact.cli import app\nfor words in {jobs}:\n"
    program += "    app(words, standalone_mode=False)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True,
        cwd=tmp_path, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert "graded-contact " in done.stdout and "wrote " in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("extras", LOWEST)
def test_the_lowest_versions_that_are_declared_do_what_they_are_for(extras, tmp_path):
    """Every dependency of the package and of these extras at its lower bound."""
    project = tomllib.loads(text_of("pyproject.toml"))["project"]
    added = (project["optional-dependencies"][extra] for extra in extras.split())
    entries = [*project["dependencies"], *(entry for extra in added for entry in extra)]
    lowest = lower_bounds(entries)
    tools = [name for name in TOOLS if name not in lowest]
    python = fresh_environment(tmp_path / "lowest") / "python"
    run(tmp_path, python, "-m", "pip", "install", "--quiet", *lowest.values(), *tools, ROOT)
    run(tmp_path, python, "-m", "pip", "check")
    (tmp_path / "scene.toml").write_text(SCENE)
    for words in LOWEST[extras]:
        folder = tmp_path if words[:2] == ("-c", JOB) else ROOT
        run(folder, python, *(word.replace("{}", str(tmp_path)) for word in words))
