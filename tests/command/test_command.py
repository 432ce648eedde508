"""The command runs a scene, writes its results, continues, and refuses bad input in one line."""

import importlib
import shutil
import signal
import threading
from importlib.metadata import version

import numpy as np
import pytest
from scene_texts import BARE
from typer.testing import CliRunner

import graded_contact as gc
from graded_contact.command import app as command_app
from graded_contact.scenes import read_results

sweeps = importlib.import_module("graded_contact.studies.sweep")  # `studies.sweep` is a function
SPEEDS = [0.01, 0.02, 0.04, 0.08, 0.16, 0.32]
SCENE = BARE.replace("[32, 32]", "[16]").replace("8e4", "4e4")


@pytest.fixture(autouse=True, scope="module")
def no_compilation_cache_and_coarse_figures():
    """The cache is a setting of the process: other tests must not inherit it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command_app, "cache_folder", lambda: "")
        patch.setitem(gc.plot.STYLE, "figure.dpi", 50)
        yield


def command(*arguments):
    return CliRunner().invoke(command_app.app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder, the run there that Ctrl-C ended, times of what it wrote, and the next run."""
    folder = tmp_path_factory.mktemp("run")
    points, write = folder / "out" / "small.points", sweeps.write_point

    def run(text):
        (folder / "small.toml").write_text(text)
        result = command("run", folder / "small.toml", "--output", folder / "out")
        return result, {path: path.stat().st_mtime_ns for path in points.glob("*.npz")}

    def interrupted(*given):
        write(*given)
        if len(list(points.glob("*.npz"))) == 1:
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweeps, "write_point", interrupted)
        stopped = run(SCENE.replace("[0.01, 1.0]", f"{SPEEDS}"))
    return folder, stopped, run(SCENE.replace("[0.01, 1.0]", f"{[*SPEEDS, 1.0]}"))


@pytest.fixture(scope="module")
def folder(runs):
    folder, _, (result, _) = runs
    assert result.exit_code == 0, result.output
    (folder / "printed.txt").write_text(result.stdout)
    return folder


def test_ctrl_c_ends_a_run_that_the_same_command_continues_with_what_is_added(runs):
    _, (stopped, before), (_, after) = runs
    assert stopped.exit_code == 130 and "same command" in stopped.stderr, stopped.output
    assert 1 <= len(before) < 6 < len(after) == 7 and before.items() <= after.items()


def test_a_run_writes_results_and_figures_and_prints_a_table(folder):
    printed = (folder / "printed.txt").read_text()
    names = ["small-contact.png", "small-sweep.png", "small.csv", "small.h5", "small.points"]
    assert sorted(path.name for path in (folder / "out").iterdir()) == names
    assert all(f"wrote {folder / 'out' / name}" in printed for name in names[:-1])
    rows = (folder / "out" / "small.csv").read_text().splitlines()
    assert rows[0].startswith("pressure [Pa],velocity [m/s],") and len(rows) == 8
    assert (folder / "out" / "small-sweep.png").read_bytes().startswith(b"\x89PNG")
    results = read_results(folder / "out" / "small.h5")
    lines = printed.splitlines()
    (head,) = (i for i, line in enumerate(lines) if line.startswith("velocity [m/s]"))
    for line, friction in zip(lines[head + 1 :], results.friction.values[0], strict=False):
        _, shown, sign, error, *_ = line.split()
        assert sign == "±" and abs(float(shown) - friction) < float(error)
    assert max(map(len, lines[head - 1 : head + 3])) <= 80
    told = command("info", folder / "out" / "small.h5").stdout
    assert lines[head] in told and version("graded_contact") in told


@pytest.fixture
def again(folder, tmp_path):
    """A copy of the run's folder, and what runs a scene there."""
    shutil.copytree(folder / "out", tmp_path / "out")

    def run(text=SCENE, *options):
        (tmp_path / "small.toml").write_text(text)
        return command("run", tmp_path / "small.toml", "-o", tmp_path / "out", *options)

    return run


def test_results_of_another_scene_are_not_replaced(again, tmp_path):
    result = again(SCENE.replace("hurst = 0.8", "hurst = 0.7"))
    assert result.exit_code == 2 and "[surface]" in result.stderr
    assert np.all(read_results(tmp_path / "out" / "small.h5").message == "")


def test_a_solve_that_does_not_converge_has_no_numbers_in_the_table(folder, tmp_path, monkeypatch):
    results = read_results(folder / "out" / "small.h5")
    stopped = np.full(results.message.shape, "The contact solver reached `max_steps`.")
    results["message"] = results.message.dims, stopped
    monkeypatch.setattr("graded_contact.command.run.run_scene", lambda *_, **__: results)
    result = command("run", folder / "small.toml", "-o", tmp_path)
    assert result.exit_code == 1
    assert "7 of 7 solves: " in result.stdout and "max_steps" in result.stdout
    rows = [line.split() for line in result.stdout.splitlines() if "—" in line]
    assert [float(row[0]) for row in rows] == [*SPEEDS, 1.0]
    assert all({*row[1:]} == {"—"} for row in rows)
    assert not list(tmp_path.glob("*.png")) and (tmp_path / "small.h5").exists()


@pytest.mark.parametrize(
    "words, expected",
    [
        (("run", "{}/scene.toml", "-o", "{}/out"), "[surface] `q_high=8e+09`"),
        (("run", "{}/scene.toml", "--dry-run"), "[surface] `q_high=8e+09`"),
        (("run", "{}/none.toml"), "none.toml"),
        (("info", "{}/a.h5"), "a.h5"),
        (("fit", "{}/none.csv"), "none.csv"),
    ],
)
def test_what_is_refused_is_one_message_and_exit_code_2(words, expected, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace("4e4", "8e9"))
    (tmp_path / "a.h5").write_text("not HDF5")
    result = command(*(word.format(tmp_path) for word in words))
    assert result.exit_code == 2 and expected in result.stderr.replace("\n", "")
    assert result.stderr.startswith("Error: ") and "Traceback" not in result.output


def test_a_dry_run_prints_the_scene_and_solves_nothing(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    result = command("run", tmp_path / "scene.toml", "--dry-run")
    assert result.exit_code == 0 and "HalfSpace" in result.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]
