"""The command runs a scene, writes its results, and refuses bad input in one line."""

import csv
import dataclasses
import errno
import json
import os
import re
import shutil
import signal
import stat
import subprocess
import sys
import tomllib
from pathlib import Path

import equinox as eqx
import jax
import numpy as np
import pytest
import xarray
from scene_texts import BARE as SCENE
from typer.testing import CliRunner
from waiting import until

import graded_contact as gc
from graded_contact import cli
from graded_contact.command import new as new_job
from graded_contact.command import run as scene_job
from graded_contact.command import terminal as session
from graded_contact.command.columns import columns_in_table, names_in_table
from graded_contact.command.result_tables import tables_that_fit
from graded_contact.core.display import number
from graded_contact.scenes.plan import build_surface
from graded_contact.scenes.results import kept_solves, read_results, solve_states, surface_of
from graded_contact.scenes.scene_file import parse_scene, read_scene
from graded_contact.scenes.theory import mean_field_at
from graded_contact.studies import interruption
from graded_contact.studies.dataset import write
from graded_contact.studies.store import Store
from graded_contact.surfaces.reading_steps import ReadingStep

# A room lists a function of each of these modules' names.
PLAN = sys.modules["graded_contact.scenes.plan"]
SWEEP = sys.modules["graded_contact.studies.sweep"]

CACHE_FOLDER = session.cache_folder


@pytest.fixture(autouse=True, scope="module")
def no_compilation_cache_and_coarse_figures():
    """The cache is a setting of the process: other tests must not inherit it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "cache_folder", lambda: None)
        patch.setitem(gc.plot.STYLE, "figure.dpi", 50)
        yield


def command(*arguments):
    return CliRunner().invoke(cli.app, [str(argument) for argument in arguments])


@pytest.fixture
def no_contacts_drawn(monkeypatch):
    monkeypatch.setattr(scene_job, "contacts", lambda *_: ())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    (folder / "small.toml").write_text(SCENE)
    result = command("run", folder / "small.toml", "--output", folder / "out")
    assert result.exit_code == 0, result.output
    (folder / "printed.txt").write_text(result.stdout)
    return folder


def test_a_run_writes_results_and_figures_and_prints_their_paths(folder):
    printed = (folder / "printed.txt").read_text()
    figures = ("contact", "dissipation", "distributions", "sweep")
    names = [*(f"small-{figure}.png" for figure in figures), "small.csv", "small.h5"]
    entries = sorted(path.name for path in (folder / "out").iterdir())
    assert entries == [*names, "small.points"]
    rows = (folder / "out" / "small.csv").read_text().splitlines()
    assert rows[0].startswith("pressure [Pa],velocity [m/s],friction,") and len(rows) == 3
    assert all(f"wrote {folder / 'out' / name}" in printed for name in names)
    picture = (folder / "out" / "small-sweep.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    caption = "(a) friction coefficient against sliding velocity; (b) contact area fraction"
    assert caption in printed and caption.encode() in picture


def test_file_csv_table_and_info_hold_the_same_numbers(folder):
    results = read_results(folder / "out" / "small.h5")
    assert np.all(results.message == "") and results.attrs["scene"] == SCENE
    assert np.all(results.friction_error > 0) and results.friction_error.units == "1"
    with open(folder / "out" / "small.csv", newline="") as file:
        written = list(csv.DictReader(file))
    printed = (folder / "printed.txt").read_text().splitlines()
    rows = [line.split() for line in printed if line.strip()[:1].isdigit()]
    assert [row[0] for row in rows] == ["1.000e-02", "1.000e+00"]
    np.testing.assert_allclose([float(row[2]) for row in rows], results.friction[0], rtol=1e-3)
    info = command("info", folder / "out" / "small.h5")
    assert info.exit_code == 0 and "float64" in info.stdout
    written_errors = [float(row["friction_error"]) for row in written]
    np.testing.assert_array_equal(written_errors, results.friction_error[0])
    for error in results.friction_error.values[0]:
        assert f"{error:.1e}" in "".join(printed) and f"{error:.1e}" in info.stdout


def test_a_report_is_one_page_that_asks_nobody_for_anything(folder, tmp_path):
    results = read_results(folder / "out" / "small.h5").assign_attrs(title="<i>A & B</i>")
    write(tmp_path / "a.h5", results)
    said = command("report", tmp_path / "a.h5")
    assert said.exit_code == 0, said.output
    page = (tmp_path / "a.html").read_text("utf-8")
    assert "<h1>&lt;i&gt;A &amp; B&lt;/i&gt;</h1>" in page and "<i>" not in page
    assert page.count("<img") == page.count("src=") == page.count('src="data:image/png') == 2
    for text in ("[surface]", "1.000e-02", "contact area fraction", results.attrs["version_jax"]):
        assert text in page, text
    assert "<td>solves</td><td>2 of 2 converged</td>" in page and "num_solves" not in page
    error = f"{results.attrs['largest_error']:.3g}"
    assert f"<td>largest relative error of the pressure</td><td>{error}</td>" in page


def test_a_report_tells_a_doubt_once_in_a_folder_that_it_makes(folder, tmp_path):
    results = read_results(folder / "out" / "small.h5").assign_attrs(assumed="dry & clean")
    write(tmp_path / "a.h5", results)
    said = command("report", tmp_path / "a.h5", "-o", tmp_path / "new" / "r.html")
    assert said.exit_code == 0, said.output
    page = (tmp_path / "new" / "r.html").read_text("utf-8")
    assert page.count("dry &amp; clean") == 1
    assert '<p class="doubt">(each solve) dry &amp; clean</p>' in page


def test_caveats_and_the_steps_of_reading_are_printed(folder, tmp_path):
    results = read_results(folder / "out" / "small.h5")
    steps = (ReadingStep("read", 1e-6, 0.2, 4.0, 0.31), ReadingStep("filled", 1e-6, 0.2, 4.0, 0.0))
    write(tmp_path / "a.h5", results.assign_attrs(surface_steps=json.dumps(steps)))
    printed = " ".join(command("info", tmp_path / "a.h5").stdout.split())
    for text in ("read 1 µm 0.2 4 31.0%", "(each solve) 31% of the points were not measured"):
        assert text in printed


def test_a_solve_that_does_not_converge_warns_and_exits_with_1(tmp_path, no_contacts_drawn):
    text = SCENE.replace("newton = false", "newton = false\nmax_steps = 2")
    text += "[output]\nfields='every'\n"
    (tmp_path / "scene.toml").write_text(text)
    result = command("run", tmp_path / "scene.toml", "-o", tmp_path)
    assert result.exit_code == 1
    assert "2 of 2 solves did not converge" in " ".join(result.stderr.split())
    assert "max_steps" in result.stderr and "throw" not in result.stderr
    rows = [line.split() for line in result.stdout.splitlines() if "not converged" in line]
    assert len(rows) == 2 and all(row[2:-2] == ["—"] * 4 for row in rows)
    assert "the friction has an error" not in result.stdout and not list(tmp_path.glob("*.png"))
    results = read_results(tmp_path / "scene.h5")
    assert np.all(results.error > 1e-6) and not kept_solves(results)
    assert results.gap.shape == (1, 2, 32, 32) and results.attrs["num_converged"] == 0


def test_what_is_refused_is_one_message_and_exit_code_2(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace("8e4", "8e9"))
    (tmp_path / "a.h5").write_text("not HDF5")
    for words, expected in (
        (("run", tmp_path / "scene.toml", "-o", tmp_path / "out"), "`q_high=8e+09` is refused"),
        (("run", tmp_path / "none.toml"), "none.toml"),
        (("run", "x.toml", "--workers", 2, "--scheduler", "tcp://x:1"), "only one can solve"),
        (("info", tmp_path / "a.h5"), "a.h5"),
    ):
        result = command(*words)
        assert result.exit_code == 2 and expected in result.stderr
        assert "Traceback" not in result.output


def test_a_dry_run_prints_what_was_read_and_refuses_what_a_run_would(tmp_path):
    (tmp_path / "a.toml").write_text(
        f"{SCENE}[[layers]]\nmaterial = 'tread'\nthickness = 50\n[design]\nwords = 1\n"
    )
    result = command("run", tmp_path / "a.toml", "--dry-run", "-o", tmp_path / "out")
    assert result.exit_code == 0 and not (tmp_path / "out").exists()
    for text in (
        "surface: 1 mm x 1 mm, rms height", "rms slope 0.2", "contact solves 2",
        "Warning: layers[0]: The thickness of 50 m is unusual (usual are ",
        "[design] is not used by this command",
        "layer 1 tread, 50 m base tread, half space", "materials tread tyre tread",
        "surface random, ",
        "velocity [m/s] 0.01, 1",
    ):  # fmt: skip
        assert text in " ".join(result.stdout.split())
    table = "f [Hz],E' [Pa],E'' [Pa]\n" + "".join(f"{f},{1e6 + f},1e5\n" for f in range(1, 9))
    (tmp_path / "dma.csv").write_text(table)
    (tmp_path / "b.toml").write_text(SCENE.replace('"tyre_tread"', '"tabulated"\npath = "dma.csv"'))
    for option in ([], ["--dry-run"]):
        result = command("run", tmp_path / "b.toml", "-o", tmp_path / "out", *option)
        assert result.exit_code == 2 and "velocity" in result.stderr


@pytest.mark.slow
def test_seeds_are_means_with_their_error_and_every_one_if_asked(tmp_path, no_contacts_drawn):
    text = SCENE.replace("hurst = 0.8", "hurst = 0.8\nseeds = 3")
    (tmp_path / "s.toml").write_text(text)
    arguments = ("run", tmp_path / "s.toml", "-o", tmp_path)
    result = command(*arguments, "--map", "velocity=0.02", "--map", "seed=1")
    assert result.exit_code == 0, result.output
    assert "Numbers are means of 3 surfaces." in result.stdout
    results = read_results(tmp_path / "s.h5")
    assert kept_solves(results) == [(1, 0, 0)]
    friction = results.friction.values
    mean, error = friction.mean(0)[0], friction.std(0, ddof=1)[0] / 3**0.5
    worst = results.friction_error.values.max(0)[0]
    for here, spread, wrong in zip(mean, error, worst, strict=True):
        for text in (number(here, "#.4g", wrong), f"{spread:.1e}"):
            assert text in result.stdout
    with open(tmp_path / "s.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["surfaces"] for row in rows] == ["3", "3"]
    np.testing.assert_allclose([float(row["friction"]) for row in rows], mean)
    np.testing.assert_allclose([float(row["friction_seed_error"]) for row in rows], error)
    worst = [float(row["friction_error"]) for row in rows]
    np.testing.assert_allclose(worst, results.friction_error.values.max(0)[0])
    result = command(*arguments, "--all-seeds")
    rows = [line for line in result.stdout.splitlines() if line.strip()[:1].isdigit()]
    assert len(rows) == 1 + 6  # "6 of 6 solves are found"
    assert len((tmp_path / "s.csv").read_text().splitlines()) == 7
    assert kept_solves(read_results(tmp_path / "s.h5")) == [(2, 0, 1)]
    for option, expected in (("speed=1", "'speed' is no axis"), ("seed=a", "`--map seed=a`:"),
                             ("seed", "write NAME=VALUE")):  # fmt: skip
        refused = command(*arguments, "--map", option)
        assert refused.exit_code == 2 and expected in refused.stderr


@pytest.mark.parametrize("wanted, nearest", [(0.01, 0), (0.5, 1), (4.0, 2), (19.0, 2), (0.005, 0)])
def test_a_contact_is_drawn_at_the_nearest_ratio(wanted, nearest, capsys):
    values = np.array([0.01, 1.0, 10.0])
    assert scene_job._on_axis(f"velocity={wanted}", {"velocity": values}) == ("velocity", nearest)
    told = "" if wanted == 0.01 else f"at the nearest value, {values[nearest]:g}, is drawn"
    assert told in capsys.readouterr().out


def test_temperatures_are_near_by_their_difference_and_what_is_near_no_value_is_refused():
    axes = {"temperature": np.array([200.0, 400.0]), "velocity": np.array([0.01, 1.0, 10.0])}
    assert scene_job._on_axis("temperature=290", axes) == ("temperature", 0)  # of ratios the other
    for text in ("velocity=1000", "velocity=0.004", "velocity=0", "velocity=-1", "velocity=nan"):
        with pytest.raises(ValueError, match=f"{text}`: no value .* is near: it has 0.01, 1, 10"):
            scene_job._on_axis(text, axes)


@pytest.fixture
def rerun(folder, tmp_path, no_contacts_drawn):
    """A copy of the run's folder, and what runs the scene there again."""
    shutil.copytree(folder / "out", tmp_path / "out")

    def run(*options, text=SCENE):
        (tmp_path / "small.toml").write_text(text)
        return command("run", tmp_path / "small.toml", "-o", tmp_path / "out", *options)

    return run


def interrupt_after(monkeypatch, count):
    """A signal comes while the solve of this count is written, and is noted."""
    write, calls, said = Store.write, [], []

    def with_signal(*arguments):
        calls.append(None)
        if len(calls) == count:
            os.kill(os.getpid(), signal.SIGINT)
            until(lambda: said)
        write(*arguments)

    monkeypatch.setattr(Store, "write", with_signal)
    monkeypatch.setattr(interruption, "_say", said.append)


def test_a_rerun_finds_all_solves(rerun, folder, tmp_path, monkeypatch):
    monkeypatch.setattr(SWEEP, "runner", None)
    result = rerun()
    assert result.exit_code == 0, result.output
    assert f"2 of 2 solves are found in {tmp_path / 'out' / 'small.points'}" in result.stdout
    before, after = (read_results(at / "out" / "small.h5") for at in (folder, tmp_path))
    assert before.friction.identical(after.friction)


@pytest.mark.skipif(os.name != "posix", reason="signals are those of POSIX")
def test_an_interrupted_run_names_what_was_not_started_and_goes_on(
    rerun, folder, tmp_path, monkeypatch
):
    shutil.rmtree(tmp_path / "out")
    interrupt_after(monkeypatch, 1)
    result = rerun()
    assert result.exit_code == 130, result.output
    assert "1 of 2 solves were not started" in result.stderr and "converge" not in result.output
    assert "run the same command again" in result.stderr
    told = command("info", tmp_path / "out" / "small.h5")
    for text in (result.stdout, told.stdout):
        assert text.count("not started") == 1
    states = solve_states(read_results(tmp_path / "out" / "small.h5")).values
    assert states.tolist() == [["", "not started"]]
    result = rerun()
    assert result.exit_code == 0 and "1 of 2 solves are found" in result.stdout
    before, after = (read_results(at / "out" / "small.h5") for at in (folder, tmp_path))
    assert before.friction.identical(after.friction)


@pytest.mark.skipif(os.name != "posix", reason="signals are those of POSIX")
def test_an_interrupted_rerun_leaves_the_fuller_result(rerun, tmp_path, monkeypatch):
    shutil.rmtree(tmp_path / "out" / "small.points")
    before = (tmp_path / "out" / "small.h5").read_bytes()
    interrupt_after(monkeypatch, 1)
    result = rerun()
    assert result.exit_code == 130
    assert "holds 1 solves that were not done again: it is not changed" in result.stdout
    assert (tmp_path / "out" / "small.h5").read_bytes() == before


@pytest.mark.slow
def test_a_result_of_another_scene_is_replaced_only_if_asked(rerun, tmp_path, monkeypatch):
    other = SCENE.replace("2e5", "3e5").replace("a small one", "another one")
    path = tmp_path / "out" / "small.h5"
    before = path.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(SWEEP, "runner", None)
        result = rerun(text=other)
    assert result.exit_code == 2 and path.read_bytes() == before
    text = result.stderr
    assert "contains 2 solves of 'a small one' that this scene does not have" in text
    assert "(file: `pressure = 2e5`, scene: `pressure = 3e5`)" in text and "--replace" in text
    result = rerun("--replace", text=other)
    assert result.exit_code == 0 and read_results(path).pressure == 3e5
    assert rerun("--replace").exit_code == 0 and read_results(path).pressure == 2e5
    result = rerun(text=SCENE.replace("[0.01, 1.0]", "[1.0, 0.01, 0.1]"))
    assert result.exit_code == 0 and read_results(path).friction.shape == (1, 3)


def test_what_is_no_result_is_replaced_only_if_asked(rerun, tmp_path):
    path = tmp_path / "out" / "small.h5"
    path.write_text("my notes")
    result = rerun()
    assert result.exit_code == 2 and "--replace" in result.stderr
    assert path.read_text() == "my notes"
    assert np.all(rerun("--replace").exit_code == 0 and read_results(path).message == "")


def test_a_damaged_point_is_named_and_computed_again(rerun, tmp_path):
    point = next((tmp_path / "out" / "small.points").glob("*.point"))
    point.write_bytes(point.read_bytes()[:700])
    result = rerun()
    assert result.exit_code == 0
    assert f"{point} is damaged: it is computed again" in result.stderr


@pytest.mark.slow
def test_a_kernel_that_fails_is_one_message(rerun, tmp_path, monkeypatch):
    solve = PLAN.solve

    def failing(case, numerics):
        pressure = eqx.error_if(case.pressure, case.pressure > 0, "no such kernel")
        return solve(dataclasses.replace(case, pressure=pressure), numerics)

    shutil.rmtree(tmp_path / "out")
    monkeypatch.setattr(PLAN, "solve", failing)
    result = rerun()
    assert result.exit_code == 1
    assert "2 of 2 solves failed" in result.stderr and "Traceback" not in result.output
    assert result.stderr.count("failed: no such kernel") == 1
    assert "No solve succeeded: no figure is drawn." in result.stdout
    assert not list((tmp_path / "out").glob("*.png"))
    told = command("info", tmp_path / "out" / "small.h5")
    assert told.stdout.count("failed") == 2 and told.exit_code == 0


def test_solves_that_failed_have_neither_numbers_nor_figures(rerun, tmp_path, monkeypatch):
    solve = PLAN.solve

    def not_finite(case, numerics):
        rough = eqx.tree_at(lambda s: s.heights, case.surface, np.nan * case.surface.heights)
        return solve(dataclasses.replace(case, surface=rough), numerics)

    shutil.rmtree(tmp_path / "out")
    monkeypatch.setattr(PLAN, "solve", not_finite)
    result = rerun()
    assert result.exit_code == 1 and "log-scaled" not in result.output
    assert "No solve succeeded: no figure is drawn." in result.stdout
    assert not list((tmp_path / "out").glob("*.png"))
    for told in (result, command("info", tmp_path / "out" / "small.h5")):
        rows = [line.split() for line in told.stdout.splitlines() if line.endswith("failed ")]
        assert [{*row[2:]} for row in rows] == [{"—", "failed"}] * 2  # behind velocity and pressure
        assert "do not touch" not in told.stdout and "each solve" not in told.stdout
    rows = [*csv.DictReader((tmp_path / "out" / "small.csv").read_text().splitlines())]
    axes = ("velocity [m/s]", "pressure [Pa]", "message")
    assert {row[name] for row in rows for name in row if name not in axes} == {"nan"}
    assert all(row["message"].startswith("The solve failed") for row in rows)


def full_disk(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_is_one_message_and_stored_solves_stay(rerun, tmp_path, monkeypatch):
    more = SCENE.replace("[0.01, 1.0]", "[0.01, 1.0, 0.1]")
    for target in ((Path, "write_bytes"), (scene_job, "write")):
        with monkeypatch.context() as patch:
            patch.setattr(*target, full_disk)
            result = rerun(text=more)
        assert result.exit_code == 2 and "Traceback" not in result.output
        assert "No space left on device" in result.stderr
        assert np.all(read_results(tmp_path / "out" / "small.h5").message == "")
    result = rerun(text=more)
    assert result.exit_code == 0 and "3 of 3 solves are found" in result.stdout


def in_a_file(folder):
    folder.write_text("")
    return folder / "out"


@pytest.mark.parametrize(
    "folder, name, expected",
    [
        (in_a_file, "small", "Nothing can be written to the folder"),
        (lambda folder: folder / "out", "x" * 200, "it has 200 bytes; at most 180 are allowed"),
    ],
)
def test_an_output_is_checked_before_anything_is_computed(
    tmp_path, monkeypatch, folder, name, expected
):
    monkeypatch.setattr(scene_job, "plan", None)
    (tmp_path / f"{name}.toml").write_text(SCENE)
    result = command("run", tmp_path / f"{name}.toml", "-o", folder(tmp_path / "place"))
    assert result.exit_code == 2 and expected in result.stderr, result.output
    assert "Traceback" not in result.output and not (tmp_path / "place").is_dir()


# The command, which waits before it writes its sixth solve until its input ends.
HELD = """
import sys
from graded_contact import cli
from graded_contact.studies.store import Store
write, calls = Store.write, []
def held(*arguments):
    calls.append(None)
    if len(calls) == 6:
        print("held", flush=True)
        sys.stdin.read()
    write(*arguments)
Store.write = held
cli.run_command()
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals are those of POSIX")
def test_a_run_that_is_killed_again_and_again_ends_as_if_it_had_not_been(tmp_path):
    scene, folder = tmp_path / "small.toml", tmp_path / "out" / "small.points"
    scene.write_text(SCENE.replace("[0.01, 1.0]", "{from = 0.01, to = 1.0, points = 24}"))

    def words(output):
        return "run", scene, "-o", tmp_path / output

    for sent, code in ((signal.SIGKILL, -9), (signal.SIGINT, 130), (signal.SIGTERM, 143)):
        before = {path: path.read_bytes() for path in folder.glob("*.point")}
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        with subprocess.Popen(
            [sys.executable, "-c", HELD, *words("out")], text=True, **pipes
        ) as process:
            assert "held\n" in process.stdout
            process.send_signal(sent)
            noted = any("Stopping after this step" in line for line in process.stderr)
            assert noted or sent == signal.SIGKILL
            process.stdin.close()
            assert "Traceback" not in process.stderr.read()
        assert process.returncode == code
        assert len(list(folder.glob("*.point"))) >= len(before) + 5
        assert all(path.read_bytes() == content for path, content in before.items())
    for output in ("out", "whole"):
        command_line = [sys.executable, "-m", "graded_contact", *words(output)]
        subprocess.run(command_line, stdout=subprocess.DEVNULL, check=True)
    one, other = (read_results(tmp_path / at / "small.h5") for at in ("out", "whole"))
    assert one.identical(other) and np.all(one.message == "") and kept_solves(one) == [(0, 23)]
    assert list(tmp_path.rglob(".*.partial")) == []


def test_results_are_compared_in_a_figure(folder, tmp_path):
    first, second = folder / "out" / "small.h5", tmp_path / "b.h5"
    write(second, read_results(first))
    result = command("compare", first, second, "-o", tmp_path / "lines", "--format", "pdf")
    assert result.exit_code == 0 and (tmp_path / "lines.pdf").read_bytes().startswith(b"%PDF")
    named = ("--label", "bare", "--label", "coated", "--format", "svg")
    result = command("compare", first, second, "-o", tmp_path / "named", *named)
    assert result.exit_code == 0, result.output
    (tmp_path / "m.csv").write_text("v [mm/s],mu\n10,0.3\n")
    measured = ("--measured", tmp_path / "m.csv", "-o", tmp_path / "m", "--format", "svg")
    result = command("compare", first, *measured)
    assert result.exit_code == 0 and "m.csv" in (tmp_path / "m.svg").read_text(), result.output
    for words, expected in (
        ((first, second, "--label", "one"), "`--label` is given 1 times for 2 results"),
        ((first,), "needs two results or more"),
        ((first, tmp_path / "none.h5"), "none.h5` does not exist"),
        (
            (first, "base.toml"),
            "`path=base.toml` is a scene, which has no numbers yet: run",
        ),
        ((first, second, "-o", tmp_path / "a.xyz"), "is refused: figures are"),
    ):
        result = command("compare", *words)
        assert result.exit_code == 2 and expected in " ".join(result.stderr.split())


def test_a_result_of_an_older_version_is_named_and_not_mixed_with_todays(rerun, folder, tmp_path):
    results = read_results(folder / "out" / "small.h5")
    parts = [n for n in results if str(n).endswith(("_solver_error", "_grid_error"))]
    older = results.drop_vars(parts).assign(point=results.point + "0")
    older.attrs.pop("format")
    path = tmp_path / "out" / "small.h5"
    write(path, older)
    before = path.read_bytes()
    meant = "± were errors of the solver alone, not total errors, and areas were counts of points"
    compared = ("compare", folder / "out" / "small.h5", path, "-o", tmp_path / "a")
    for result in (command("info", path), command(*compared), refused := rerun()):
        assert meant in " ".join(result.stderr.split())
    assert refused.exit_code == 2 and "--replace" in refused.stderr
    assert path.read_bytes() == before


@pytest.mark.parametrize("scene", [None, "a = [", "a = 1"])
def test_results_without_a_scene_are_refused_by_compare(folder, tmp_path, scene):
    first, second = folder / "out" / "small.h5", tmp_path / "b.h5"
    results = read_results(first).assign_attrs(scene=scene or "")
    if scene is None:
        results.attrs.pop("scene")
    write(second, results)
    result = command("compare", first, second, "-o", tmp_path / "a")
    assert result.exit_code == 2 and "b.h5` " in result.stderr and "scene" in result.stderr


def moduli_file(path, temperatures, off=0.0):
    """Isotherms of a tyre tread, 2 % of noise; a column of temperature if there are several.

    Every other one is measured this many kelvin `off`, so that shifts follow no law.
    """
    draw, lines = np.random.default_rng(0), []
    for i, celsius in enumerate(temperatures):
        hertz = np.geomspace(0.1, 100, 10) if len(temperatures) > 1 else np.geomspace(1e-2, 1e4, 40)
        kelvin = celsius + 273.15 + off * (-1) ** i
        values = np.asarray(gc.tyre_tread().at(kelvin).modulus(2 * np.pi * hertz)) / 1e6
        noise = np.exp(0.02 * draw.standard_normal((2, len(hertz))))
        rows = zip(hertz, values.real * noise[0], values.imag * noise[1], strict=True)
        start = f"{celsius}," if len(temperatures) > 1 else ""
        lines += [start + ",".join(map(repr, map(float, row))) for row in rows]
    head = "T [°C]," if len(temperatures) > 1 else ""
    path.write_text("\n".join([head + "f [Hz],E' [MPa],E'' [MPa]", *lines]))
    return path


def test_a_fit_prints_its_report_and_a_table_that_a_scene_takes(tmp_path):
    path = moduli_file(tmp_path / "1 tread.csv", [20.0])
    result = command("fit", path, "-o", tmp_path / "out", "--poisson", "0.49", "--kind", "tension")
    assert result.exit_code == 0, result.output
    for text in ("Read 40 rows", "rms log error", "Kramers-Kronig", "BIC"):
        assert text in result.stdout
    assert f"TOPOGRAPHY '{path}' --poisson=0.49 --kind=tension " in result.stdout.replace("\n", " ")
    endings = ("-errors.csv", ".inp", ".mac", ".png", ".toml")
    names = [f"material_1_tread{ending}" for ending in endings]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    assert all(f"wrote {tmp_path / 'out' / name}" in result.stdout for name in names)
    table = (tmp_path / "out" / names[-1]).read_text()
    assert table in result.stdout
    material = tomllib.loads(table)["materials"]["material_1_tread"]
    assert material["kind"] == "prony" and material["poisson"] == 0.49
    assert len(material["strengths"]) == len(material["times"]) > 3
    scene = SCENE.replace('[materials.tread]\nkind = "tyre_tread"', table)
    scene = scene.replace('material = "tread"', 'material = "material_1_tread"')
    assert parse_scene(scene).stack.base.material.poisson == 0.49


def test_fit_reads_a_table_that_may_be_e_of_t_as_the_series_that_the_user_says_it_is(tmp_path):
    path = tmp_path / "series.csv"
    path.write_text("Relaxationszeit [s];Modul [MPa]\n0.001;4\n0.1;2\n10;1\n")
    words = ("fit", path, "-o", tmp_path, "--kind", "tension", "--equilibrium", 3e6)
    result = command(*words)
    assert "`--kind series` reads a series" in " ".join(result.output.split())
    command(*words, "--kind", "series")
    table = tomllib.loads((tmp_path / "series.toml").read_text())["materials"]["series"]
    assert (table["equilibrium"], table["strengths"]) == (3e6, [4e6, 2e6, 1e6])
    path.write_text("f [Hz],E' [MPa],E'' [MPa]\n1,4,1\n10,5,1\n")
    result = command(*words, "--kind", "series")
    assert "`--kind series` is refused" in " ".join(result.output.split())


def test_fit_converts_a_prony_series_and_says_what_it_assumed(tmp_path):
    """Into the numbers of the file, whatever `--kind` says; a deck states no units."""
    path = tmp_path / "series.csv"
    path.write_text("tau [s],E_i [MPa]\n1e-3,4\n1e-1,2\n10,1\ninf,3\n")
    result = command("fit", path, "-o", tmp_path, "--kind", "relaxation", "--poisson", 0.49)
    assert result.exit_code == 0, result.output
    assert "nothing is fitted" in result.stdout and "Warning" not in result.stdout
    table = tomllib.loads((tmp_path / "series.toml").read_text())["materials"]["series"]
    assert table == {
        "kind": "prony", "equilibrium": 3e6, "strengths": [4e6, 2e6, 1e6],
        "times": [1e-3, 0.1, 10.0], "poisson": 0.49,
    }  # fmt: skip
    assert not (tmp_path / "series-errors.csv").exists()
    deck = (tmp_path / "series.inp").read_text()
    path.write_text("\n".join(line for line in deck.splitlines() if line[:2] != "**"))
    result = command("fit", path, "-o", tmp_path)
    assert result.exit_code == 0, result.output
    caveat = "The modulus is assumed to be in Pa, as the deck states no unit"
    assert (
        f"Warning: {caveat}; otherwise pass it, for instance `--unit modulus=MPa`" in result.stdout
    )
    again = tomllib.loads((tmp_path / "series.toml").read_text())["materials"]["series"]
    np.testing.assert_allclose(again["strengths"], table["strengths"], rtol=1e-12)
    assert again["assumed"][0].startswith(caveat)
    assert f"** Warning: {caveat}" in (tmp_path / "series.inp").read_text()
    scene = SCENE.replace(
        '[materials.tread]\nkind = "tyre_tread"', (tmp_path / "series.toml").read_text()
    )
    scene = parse_scene(scene.replace('material = "tread"', 'material = "series"'))
    assert scene.assumed[0].startswith(f"series: {caveat}")
    path.write_text("tau_i [s],g_i\n1e-3,0.4\n1e-1,0.2\n")
    asked = command("fit", path, "-o", tmp_path)
    assert asked.exit_code == 2 and "pass the instantaneous one as `--glassy" in asked.stderr
    given = command("fit", path, "-o", tmp_path, "--glassy", 1e7)
    assert "E_eq = 4e+06 Pa, and 2 branches" in given.stdout, given.output


def test_a_fit_to_moduli_that_may_be_of_shear_has_a_caveat(tmp_path):
    path = moduli_file(tmp_path / "tread.csv", [20.0])
    path.write_text(
        path.read_text()
        .replace("E'", "storage modulus")
        .replace("storage modulus'", "loss modulus")
    )
    result = command("fit", path, "-o", tmp_path)
    assert result.exit_code == 0, result.output
    assert result.stdout.count("Warning: The moduli are assumed to be Young's (tension)") == 2
    assert "read the file with `--kind shear`" in result.stdout
    text = (tmp_path / "tread.toml").read_text()
    assert 'assumed = ["The moduli are assumed' in text and "deformation" not in text
    assert "These are options of `graded-contact fit` and `new`." in text


@pytest.mark.filterwarnings("ignore:Error writing persistent compilation cache")
def test_an_earlier_fit_stays_if_the_disk_is_full(tmp_path, monkeypatch):
    path = moduli_file(tmp_path / "tread.csv", [20.0])
    (tmp_path / "tread.toml").write_text("earlier")
    monkeypatch.setattr(Path, "write_bytes", full_disk)
    result = command("fit", path, "-o", tmp_path)
    assert result.exit_code == 2 and "No space left on device" in result.stderr
    assert (tmp_path / "tread.toml").read_text() == "earlier"


# One process for two commands. It starts JAX once, and ends with 0 if they end as they should.
COMMANDS = """
import sys
from graded_contact.cli import run_command
codes = []
for words in {jobs}:
    sys.argv = ["graded-contact", *words]
    try:
        run_command()
    except SystemExit as end:
        codes.append(end.code)
sys.exit(codes != [0, 2])
"""


@pytest.mark.parametrize(
    "line",
    [
        "LC_ALL=C PYTHONUTF8=0 PYTHONCOERCECLOCALE=0",
        pytest.param("PYTHONIOENCODING=cp1252", marks=pytest.mark.slow),
    ],
)
def test_what_an_output_cannot_show_is_spelt(folder, tmp_path, line):
    own = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    own |= dict(entry.split("=") for entry in line.split())
    own["PYTHONPATH"] = str(Path(gc.__file__).parents[1])
    (tmp_path / "bad.toml").write_text(SCENE.replace("pressure =", "'Δω' ="), encoding="utf-8")
    jobs = [["info", str(folder / "out" / "small.h5")], ["run", str(tmp_path / "bad.toml")]]
    code = [sys.executable, "-c", COMMANDS.format(jobs=jobs)]
    done = subprocess.run(code, capture_output=True, env=own)
    assert done.returncode == 0 and b"Traceback" not in done.stderr
    table = done.stdout
    assert b"`Deltaomega`" in done.stderr
    assert ("±".encode("cp1252") in table) == ("cp1252" in line)
    assert (b"+/-" in table) == table.isascii() == ("LC_ALL" in line)


LAW, TABLE = ("wlf", 0.0, ("--law", "wlf:0")), ("tabulated", 4.0, ())


def fitted_isotherms(folder, off, options):
    """The file of isotherms, and a scene with what `fit` made of it pasted in."""
    path = moduli_file(folder / "tread.csv", [-20.0, -5.0, 10.0, 25.0], off)
    fitted = command("fit", path, "-o", folder, "--terms", 4, "--poisson", 0.49, *options)
    assert fitted.exit_code == 0, fitted.output
    card = (folder / "tread.toml").read_text() + 'errors = "tread-errors.csv"\n'
    scene = SCENE.replace('[materials.tread]\nkind = "tyre_tread"\n', card)
    scene = scene.replace("[0.01, 1.0]", "[1e-3, 1e-2]\ntemperature = [275.0, 290.0]")
    return path, scene.replace("[32, 32]", "[16, 16]").replace("8e4", "4e4")


def road_file(path):
    road = gc.random_surface(
        gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=6.3e3, q_roll=1.3e4, q_high=2.6e4),
        gc.Grid((16, 16), 1e-3), jax.random.key(0),
    )  # fmt: skip
    np.savetxt(path, 1e6 * np.asarray(road.heights).T)
    return path


@pytest.mark.slow
def test_new_takes_the_options_of_fit_and_temperatures(tmp_path):
    """A liquid is refused after its fit, before there is a scene."""
    moduli = moduli_file(tmp_path / "tread.csv", [-20.0, -5.0, 10.0, 25.0])
    words = ("new", road_file(tmp_path / "road.txt"), moduli, "--terms", 4, "--size", 1e-3,
             "--height-unit", "um", "-o", tmp_path / "out")  # fmt: skip
    heights = np.loadtxt(tmp_path / "road.txt")
    heights[3, 3] = 1e3  # a spike
    np.savetxt(tmp_path / "road.txt", heights)
    melt = command(*words, "--equilibrium", 0)
    road_file(tmp_path / "road.txt")
    assert "Warning: The highest point is" in melt.stdout
    assert melt.exit_code == 2 and "[materials.tread] is a liquid" in melt.stderr
    assert "(`--equilibrium` of `fit` and `new`)" in melt.stderr
    assert (tmp_path / "out" / "tread.toml").exists()
    assert not (tmp_path / "out" / "scene.toml").exists()
    options = ("--equilibrium", 3e6, "--law", "arrhenius:0.2:0.05", "--robust")
    result = command(*words, *options, "--temperatures", 280, "--temperatures", 270)
    assert result.exit_code == 0, result.output
    assert "--robust leaves out no row" in result.stdout and "Arrhenius with Q" in result.stdout
    scene = read_scene(tmp_path / "out" / "scene.toml")
    assert float(scene.stack.base.material.equilibrium) == 3e6
    np.testing.assert_array_equal(scene.temperature, [280.0, 270.0])
    refused = command(*words, "--replace", "--sheet", "x")
    assert refused.exit_code == 2 and "no `--sheet x`" in refused.stderr


@pytest.mark.slow
def test_the_comments_of_a_new_scene_are_what_a_run_finds(tmp_path, monkeypatch):
    """Moduli of half a decade: the road excites other frequencies, too."""
    lines = ["f [Hz],E' [MPa],E'' [MPa]"]
    for hertz in np.geomspace(1, 3, 6):
        value = complex(gc.tyre_tread().modulus(2 * np.pi * hertz)) / 1e6
        lines.append(f"{hertz},{value.real},{value.imag}")
    (tmp_path / "few.csv").write_text("\n".join(lines))
    result = command("new", road_file(tmp_path / "road.txt"), tmp_path / "few.csv", "--terms", 1,
                     "--size", 1e-3, "--height-unit", "um", "-o", tmp_path)  # fmt: skip
    assert result.exit_code == 0, result.output
    path = tmp_path / "scene.toml"
    text = path.read_text(encoding="utf-8")
    share = re.search(r"extrapolate = true  # up to (\d+%) of the friction", text)[1]
    assert "at measured frequencies" not in text
    monkeypatch.chdir(tmp_path)
    assert command("run", path, "--dry-run").exit_code == 0
    path.write_text(re.sub("extrapolate = true.*", "", text), encoding="utf-8")
    refused = command("run", path, "--dry-run")
    assert refused.exit_code == 2 and f"up to {share} of the friction" in refused.stderr


def test_temperatures_of_a_new_scene_are_those_of_a_law():
    tread = gc.tyre_tread()
    with pytest.raises(ValueError, match="`temperatures=20` is refused"):
        new_job._check_temperatures(tread, [290.0, 20.0])
    with pytest.raises(ValueError, match="`temperatures=290` is refused: one isotherm"):
        new_job._check_temperatures(dataclasses.replace(tread, shift=None), [290.0])


@pytest.mark.slow
def test_two_files_make_a_scene_that_runs(tmp_path, monkeypatch):
    (tmp_path / "data").mkdir()
    road_file(tmp_path / "data" / "road.txt")
    moduli = moduli_file(tmp_path / "tread.csv", [-20.0, -5.0, 10.0, 25.0])
    words = ("new", tmp_path / "data" / "road.txt", moduli, "--terms", 4, "-o", tmp_path / "out")
    bare = command(*words)
    assert bare.exit_code == 2 and "--size METRES" in bare.stderr
    words = (*words, "--size", 1e-3, "--height-unit", "um")
    result = command(*words)
    path = tmp_path / "out" / "scene.toml"
    assert result.exit_code == 0, result.output
    assert f"next: graded-contact run {path}" in result.stdout.replace("\n", " ")
    scene = read_scene(path)
    assert scene.surface.arguments["shape"] == (32, 32) and scene.errors
    assert len(scene.temperature) > 1 and "(10 °C)" in path.read_text()
    assert 10 <= scene.velocity[-1] / scene.velocity[0] <= 1000
    area = mean_field_at(scene, build_surface(scene), (1, 0, 3)).contact_area
    said = re.search(r"contact on (\d+)% to (\d+)% of the area, at measured", path.read_text())
    low, high = said.groups()
    assert 0.03 < int(low) / 100 - 0.005 <= area <= int(high) / 100 + 0.005 < 0.3
    monkeypatch.chdir(tmp_path)
    dry = command("run", path, "--dry-run")  # refuses friction that was not measured
    assert dry.exit_code == 0, dry.output
    text = " ".join(dry.stdout.split())
    for part in ("base HalfSpace material Prony equilibrium [Pa]", "temperature [K] 253.15"):
        assert part in text
    again = command(*words)
    assert again.exit_code == 2 and "scene.toml exists" in again.stderr


@pytest.mark.slow
@pytest.mark.parametrize("kind, off, options", [LAW, TABLE])
def test_errors_of_isotherms_reach_table_csv_and_figures(tmp_path, kind, off, options):
    """Isotherms, fit, pasted table, run: against `propagate` of a master curve in Python."""
    path, text = fitted_isotherms(tmp_path, off, options)
    (tmp_path / "told.toml").write_text(text)
    ran = command("run", tmp_path / "told.toml", "-o", tmp_path / "out")
    assert ran.exit_code == 0, ran.output
    assert "90 % of the friction at" in ran.stdout
    results = read_results(tmp_path / "out" / "told.h5")
    measured = gc.read_moduli(path, poisson=0.49)
    shifts = {"shift_std": 0.0} if kind == "wlf" else {}
    curve = gc.master_curve(measured.isotherms(), terms=4, poisson=0.49, **shifts)

    def friction(rubber):
        block = gc.Stack(base=gc.HalfSpace(rubber.at(275.0)))
        return gc.slide(block, surface_of(results), pressure=2e5, velocity=1e-2).friction

    by_hand = gc.propagate(friction, curve)
    assert by_hand.standard_error > 1e-3 * by_hand.value
    errors = results.friction_standard_error
    np.testing.assert_allclose(errors[0, 0, 1], by_hand.standard_error, rtol=1e-3)
    assert np.all(errors > 0)
    rows = [line.split(",") for line in (tmp_path / "out" / "told.csv").read_text().splitlines()]
    written = [float(row[rows[0].index("friction_standard_error")]) for row in rows[1:]]
    np.testing.assert_allclose(written, errors.values.ravel())
    assert all(f"{error:.1e}" in ran.stdout for error in errors.values.ravel())
    for key in ("sensitivity", "sweep", "master"):
        assert (tmp_path / "out" / f"told-{key}.png").exists()


@pytest.mark.slow
def test_wild_values_are_named_and_left_out_only_if_asked(tmp_path):
    path = moduli_file(tmp_path / "tread.csv", [20.0])
    lines = path.read_text().splitlines()
    frequency, _, loss = lines[18].split(",")
    lines[18] = f"{frequency},1.5e13,{loss}"  # in MPa
    path.write_text("\n".join(lines))
    plain = command("fit", path, "-o", tmp_path / "a", "--terms", 6)
    assert plain.exit_code == 0
    assert "Warning: no smooth positive spectrum explains the values below" in plain.stderr
    said = r"line 19 \(.* rad/s\): storage modulus 1.5e\+19 Pa, 1e\+12 times"
    assert re.search(said, plain.stderr)
    robust = command("fit", path, "-o", tmp_path / "b", "--terms", 6, "--robust")
    assert robust.exit_code == 0 and "Warning: no smooth" not in robust.stderr
    assert "Left out, because no smooth positive spectrum explains" in robust.stdout
    assert "line 19 (" in robust.stdout


@pytest.mark.slow
def test_a_fit_takes_several_files_and_the_options_that_messages_name(tmp_path):
    paths = [
        moduli_file(tmp_path / f"{celsius:g}.csv", [celsius]) for celsius in (-20.0, -5.0, 10.0)
    ]
    bare = command("fit", *paths, "-o", tmp_path)
    assert bare.exit_code == 2
    assert "pass `--temperature KELVIN` [K]" in bare.stderr
    kelvin = [f"--temperature={celsius + 273.15}" for celsius in (-20.0, -5.0, 10.0)]
    options = ("--terms", 5, "--law", "wlf:0", "--equilibrium", 5e6)
    result = command("fit", *paths, *kelvin, *options, "-o", tmp_path)
    assert result.exit_code == 0, result.output
    assert "Together 3 isotherm(s), 253.15 to 283.15 K, of 120 points." in result.stdout
    table = tomllib.loads((tmp_path / "material__20.toml").read_text())["materials"]["material__20"]
    assert table["equilibrium"] == 5e6 and len(table["times"]) == 5
    refused = command("fit", paths[0], "--sheet", "x", "-o", tmp_path)
    assert refused.exit_code == 2 and "no `--sheet x`" in refused.stderr


@pytest.mark.parametrize(
    "text, arguments, expected",
    [
        ("nothing here", (), "bad.csv"),
        ("never read", ("--kind", "sheer"), "`--kind sheer` is not known; did you mean `shear`"),
        ("f [Hz],E' [Pa],E'' [Pa],T\n1,2e6,1e5,20\n2,2e6,1e5,20\n", (), "--unit temperature=K"),
        ("never read", ("--unit", "modulus=N"), "`--unit modulus=N` is refused: use one of"),
        ("never read", ("--law", "wlf:x"), "`--law wlf:x` is refused: write LAW[:STD[:STD]]"),
        ("f [Hz],E' [Pa],E'' [Pa]\n1,2e6,9e5\n2,1e3,9e5\n3,1e9,2\n4,1e2,3e9\n", (),
         "and a given `--equilibrium`. In Python `weights=(1, 0)` leaves the loss out"),
        ("f [Hz],E' [Pa],E'' [Pa]\n1,2e6,1e5\n", ("--unit", "MPa"), "write QUANTITY=UNIT"),
        ("never read", ("--law", "wlv"), "`--law wlv` is not known; did you mean `wlf`"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_fitted_is_refused_in_one_message(
    tmp_path, text, arguments, expected
):
    (tmp_path / "bad.csv").write_text(text)
    result = command("fit", tmp_path / "bad.csv", "-o", tmp_path / "out", *arguments)
    assert result.exit_code == 2
    text = " ".join(result.stderr.split())
    assert expected in text and "Traceback" not in result.output
    assert not (tmp_path / "out").exists()


def test_the_embedded_scene_runs_at_the_required_resolution(tmp_path, monkeypatch):
    ran = []
    monkeypatch.setattr(scene_job, "run_scene_into", lambda *arguments: ran.append(arguments))
    for arguments in (("demo",), ("demo", "--resolution", 512, "--output", tmp_path)):
        assert command(*arguments).exit_code == 0
    (first, folder, name, *_), (second, other, finer, *_) = ran
    assert (first.surface.grid.shape, second.surface.grid.shape) == ((256, 256), (512, 512))
    assert (str(folder), other) == ("graded-contact-demo", tmp_path)
    assert (name, finer) == ("demo", "demo-512")  # neither replaces the other
    assert first.surface.spectrum.q_high == second.surface.spectrum.q_high


@pytest.mark.skipif(os.name != "posix", reason="permissions are those of POSIX")
def test_the_cache_of_compiled_code_belongs_to_the_user_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = CACHE_FOLDER()
    assert folder is not None and folder.parent == tmp_path / "graded_contact"
    assert all(stat.S_IMODE(at.stat().st_mode) == 0o700 for at in (folder, folder.parent))
    with monkeypatch.context() as patch:  # another JAX has another folder
        patch.setattr(session, "version", lambda name: f"{name} 99")
        assert CACHE_FOLDER() not in (None, folder)
    folder.chmod(0o777)
    assert CACHE_FOLDER() is None
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/nowhere")
    assert CACHE_FOLDER() is None


THREADS = """
from graded_contact.command.terminal import prepare
prepare()
import jax, numpy as np
field = np.random.default_rng(0).normal(size=(512, 512))
alone = {"xla_cpu_multi_thread_eigen": False}
one, two = (jax.jit(jax.numpy.fft.rfftn, compiler_options=o)(field) for o in (alone, {}))
print(np.array_equal(one, two))
"""


def test_transforms_of_the_command_have_the_bits_of_one_thread():
    """On more threads the lines left over by vectors are others, and so are their last bits."""
    flags = os.environ | {"XLA_FLAGS": "--xla_backend_optimization_level=0"}
    code = [sys.executable, "-c", THREADS]
    found = subprocess.run(code, env=flags, capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "True"


def test_a_table_has_parts_of_friction_that_are_lost_somewhere():
    """With coupling the slopes may push forwards: hysteresis is no part of the friction."""
    parts = ["hysteresis_friction", "shear_friction", "block_friction", "interface_friction"]
    axes = {"pressure": [1e5], "velocity": [0.1]}
    table = xarray.Dataset({name: (list(axes), [[0.5]]) for name in ("message", *parts)}, axes)
    for told, shown in ((table, parts[2:]), (table.drop_vars(parts[2:]), parts[:2])):
        assert [*columns_in_table(told, names_in_table(told, True), True)] == shown


def test_a_wide_table_is_several_that_fit_and_errors_stay_beside_their_numbers():
    texts = [
        ["v\n[m/s]", "friction", "±", "area", "±", "state"],
        ["0.1", "0.5", "1e-3", "0.2", "0.1", ""],
    ]
    # Each column takes three characters more than its widest line.
    assert tables_that_fit(texts, 1, 47) == [[0, 1, 2, 3, 4, 5]]
    assert tables_that_fit(texts, 1, 46) == [[0, 1, 2, 3, 4], [0, 5]]
    assert tables_that_fit(texts, 1, 30) == [[0, 1, 2], [0, 3, 4, 5]]
    assert tables_that_fit(texts, 1, 10) == [[0, 1, 2], [0, 3, 4], [0, 5]]  # no narrower
