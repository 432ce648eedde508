"""The command runs a scene, writes its results, and refuses bad input in one line."""

import os
import re
import shutil
import signal
import sys
import tomllib

import jax
import numpy as np
import pytest
from scene_texts import BARE as SCENE
from typer.testing import CliRunner
from waiting import until

import graded_contact as gc
from graded_contact import cli
from graded_contact.command import run as scene_job
from graded_contact.command import terminal as session
from graded_contact.scenes.plan import build_surface
from graded_contact.scenes.results import kept_solves, read_results, solve_states
from graded_contact.scenes.scene_file import parse_scene, read_scene
from graded_contact.scenes.theory import mean_field_at
from graded_contact.studies import interruption
from graded_contact.studies.store import Store

# A room lists a function of each of these modules' names.
PLAN = sys.modules["graded_contact.scenes.plan"]
SWEEP = sys.modules["graded_contact.studies.old_sweep"]


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


# The command, which waits before it writes its sixth solve until its input ends.


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


# One process for two commands. It starts JAX once, and ends with 0 if they end as they should.


LAW, TABLE = ("wlf", 0.0, ("--law", "wlf:0")), ("tabulated", 4.0, ())


def road_file(path):
    road = gc.random_surface(
        gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=6.3e3, q_roll=1.3e4, q_high=2.6e4),
        gc.Grid((16, 16), 1e-3), jax.random.key(0),
    )  # fmt: skip
    np.savetxt(path, 1e6 * np.asarray(road.heights).T)
    return path


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
