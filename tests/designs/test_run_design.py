"""A scene designs its block: limits hold, contact meets what was asked for, bad tables are refused.

The command is run once, small; its files and printed table are looked at.
"""

import dataclasses
import json
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.figure import Figure
from scene_texts import DESIGN, FLAT
from typer.testing import CliRunner

import graded_contact as gc
from graded_contact import cli
from graded_contact.command import design as design_job
from graded_contact.command import terminal as session
from graded_contact.command.designed_scene import designed_scene
from graded_contact.core.parameters import paths, with_values
from graded_contact.designs.plan import DesignPlan, plan_design
from graded_contact.designs.problem import (
    design_problem,
)
from graded_contact.designs.results import Candidate, DesignResults
from graded_contact.designs.search import not_in_mean_field
from graded_contact.designs.table import parse_design
from graded_contact.scenes.scene_file import parse_scene
from graded_contact.studies.search import Descent, Design, Tried

STEADY = {"q": 2.5e3, "omega": 250.0}


def design_command(folder, out, text=DESIGN):
    """The command on the scene of this folder, without a cache on the disk."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "cache_folder", lambda: None)
        (folder / "coat.toml").write_text(text)
        return CliRunner().invoke(cli.app, ["design", str(folder / "coat.toml"), "-o", str(out)])


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Folder of results, and what was printed."""
    folder = tmp_path_factory.mktemp("design")
    (folder / "mine").write_text("mine")
    (folder / "out").mkdir()
    (folder / "out" / "coat-design.json").symlink_to(folder / "mine")
    result = design_command(folder, folder / "out")
    assert result.exit_code == 0, result.output
    return folder / "out", result.stdout


@pytest.fixture(scope="module")
def designed(ran):
    """The scene's own stack and the designed one, put together from the written values."""
    own = parse_design(DESIGN).scene.stack
    return own, with_values(own, json.loads((ran[0] / "coat-design.json").read_text()))


def test_the_command_writes_a_table_values_and_a_figure(ran):
    folder, printed = ran
    figures = ["coat-design-history.png", "coat-design.png"]
    names = sorted([*figures, "coat-design.json", "coat-design.txt", "coat-designed.toml"])
    assert sorted(path.name for path in folder.iterdir() if path.is_file()) == names
    assert (folder / "coat-design.points").is_dir()
    assert all(f"wrote {folder / name}" in printed for name in names)
    assert printed.endswith(f"next: graded-contact run {folder / 'coat-designed.toml'}\n")
    assert (folder.parent / "mine").read_text() == "mine"  # a link is replaced, not followed
    text = (folder / "coat-design.txt").read_text(encoding="utf-8")
    assert text in printed
    assert "searched by contact" in text and "NOT converged" not in text
    assert all((folder / name).read_bytes().startswith(b"\x89PNG") for name in figures)


def scene_after(text, folder, **values):
    """The designed scene of a table, and its block at the temperature, without a search."""
    study = parse_design(text, folder)
    at = {path: values[path.rpartition(".")[2]] for path in study.parameters}
    stack = with_values(study.scene.stack, at)
    results = DesignResults(study, None, {"designed": Candidate(stack, None, {})})
    return designed_scene(results, folder / "coat.toml", folder / "out"), stack


def test_a_designed_scene_has_the_designed_block_at_its_temperature(tmp_path):
    """Of a material with a law, in a base too; a table of it that was shared stays for the base."""
    law = "shift = {kind = 'wlf', c1 = 8.0, c2 = 100.0, reference = 290.0}\nerrors = 'e.csv'\n"
    text = FLAT.replace("[[layers]]", f"{law}[[layers]]")
    text = text.replace("[solver]", "temperature = 310.0\n[solver]")
    text = f'title = "mine"\n{text}[output]\nname = "old"\n'
    (tmp_path / "e.csv").write_text("equilibrium\n1e5\n")
    (tmp_path / "out").mkdir()
    for base in ("tread", "coat"):
        own = text.replace('material = "tread"', f'material = "{base}"')
        own = own.replace("[1e-5, 1e-1]", "[1e-9, 1e-1]")
        values = {"thickness": 3e-4, "strengths[0]": 2e7, "times[0]": 1e-5}
        written, stack = scene_after(own, tmp_path, **values)
        found = parse_scene(written, tmp_path / "out")
        assert found.title == "mine" and found.name is None and "[design]" not in written
        assert found.inputs.keys() and "../e.csv" in written
        at_310, wanted = paths(found.stack.at(310.0)), paths(stack)
        assert at_310.keys() == wanted.keys()
        for path, number in wanted.items():
            np.testing.assert_allclose(at_310[path], number, rtol=1e-9, err_msg=path)


PROFILED = FLAT.replace('material = "coat"\n', 'bottom = "tread"\ntop = "coat"\n').replace(
    "2e-4\n", "2e-4\nshape = {kind = 'power_law', exponent = 2.0}\n"
)  # fmt: skip
COUNTERFACE = (
    '[counterface]\nlayers = [{material = "coat", thickness = 1e-4}]\nbase = {kind = "rigid"}\n'
)


@pytest.mark.parametrize(
    "text, path, own",
    [
        (FLAT + COUNTERFACE, "layers[0].material.strengths[0]", 2e7),
        (PROFILED, "layers[0].profile.shape.exponent", 3.1),
        (FLAT, "layers[0].material.poisson", 0.45),
    ],
)
def test_a_designed_scene_changes_the_free_number_alone(tmp_path, text, path, own):
    """A counterface keeps its material, a shape its table."""
    head = text.partition("[design]")[0] + text.partition(FLAT)[2]
    lower, upper = own / 10, min(own * 2, own + 1) if own < 1 else 2 * own
    upper = 0.49 if path.endswith("poisson") else upper
    table = FLAT[FLAT.index("[design]") :].partition("[design.parameters]")[0]
    table += f'[design.parameters]\n"{path}" = [{lower}, {upper}]\n'
    written, stack = scene_after(head + table, tmp_path, **{path.rpartition(".")[2]: own})
    found, before = parse_scene(written, tmp_path), parse_scene(head, tmp_path)
    assert repr(found.counterface) == repr(before.counterface)
    now, wanted, first = paths(found.stack), paths(stack), paths(before.stack)
    assert now.keys() == wanted.keys()
    assert {at for at in now if not np.array_equal(now[at], wanted[at])} == set()
    assert path in {at for at in now if not np.array_equal(now[at], first[at])}


def test_limits_hold_for_the_written_stack(designed):
    own, stack = designed
    stiffness = [abs(gc.effective_modulus(s, STEADY["q"], STEADY["omega"])) for s in designed]
    assert abs(stiffness[1] / stiffness[0] - 1) <= 0.01
    assert 5e-5 <= stack.layers[0].thickness <= 4e-4
    # Whatever is no parameter is as it was.
    assert stack.layers[0].material.equilibrium == own.layers[0].material.equilibrium
    np.testing.assert_array_equal(stack.base.material.strengths, own.base.material.strengths)


def test_contact_on_other_surfaces_has_the_required_friction(designed):
    """Surfaces drawn here; a coat's gain scatters much less over them than friction itself."""
    source = parse_design(DESIGN).scene.surface
    surface = gc.random_surface(source.spectrum, source.grid, jax.random.key(77))
    before, after = (
        gc.slide(stack, surface, pressure=3e5, velocity=0.1, rtol=1e-5).friction
        for stack in designed
    )
    np.testing.assert_allclose(after / before, 1.3, rtol=0.02)


def test_a_loss_tangent_is_made_flat_over_a_band():
    steps = []
    results = plan_design(parse_design(FLAT)).run(progress=lambda *step: steps.append(step))
    assert results.method == "response"
    assert steps[-1] == ("design", 2, 2)
    q = np.geomspace(1e3, 1e4, 201)
    before, after = (
        np.ptp(np.log(gc.effective_modulus(c.stack, q, 0.1 * q).imag)
               - np.log(gc.effective_modulus(c.stack, q, 0.1 * q).real))
        for c in results.candidates.values()
    )  # fmt: skip
    assert after < before / 2
    assert f"{np.exp(after):.3g}" in results.report()


def came_to(reached, *, verify=0, text=DESIGN, outside=0.0):
    """Results of a search that converged: friction 0.1 before, times `reached` in the design."""
    study = dataclasses.replace(parse_design(text), verify=verify)
    candidates = {}
    for name, share in (("before", np.ones_like(reached)), ("designed", reached)):
        friction = 0.1 * np.reshape(share, (-1, 1))
        field = SimpleNamespace(
            friction=friction[0], contact_area=friction[0], extrapolated_friction=[outside]
        )
        solved = friction if verify else np.zeros((0, 1))
        contacts = {"friction": solved, "contact_area": solved}
        candidates[name] = Candidate(study.scene.stack, field, contacts)
    history = Tried(np.ones(1), np.ones((1, 1)), np.zeros((1, 0)))
    run = Descent([1.0], 1.0, history, 1, True, True, "")
    design = Design({"a": 1.0}, 1.0, {"a": 0.0}, np.zeros(0), (run,))
    return DesignResults(study, design, candidates)


def test_a_ratio_out_of_reach_is_reported_in_table_file_and_exit_code(tmp_path, monkeypatch):
    results = came_to([4.99], text=DESIGN.replace("ratio = 1.3", "ratio = 16"))
    monkeypatch.setattr(DesignPlan, "run", lambda *_, **__: results)
    monkeypatch.setattr(design_job, "plot_design", lambda _: Figure())
    result = design_command(tmp_path, tmp_path)
    said = "ratio missed at 0.1 m/s: 4.99 of 16, by mean field"
    assert said in result.stdout and said in result.stderr and result.exit_code == 1
    assert said in (tmp_path / "coat-design.txt").read_text()
    assert results.design.converged and "NOT converged" not in result.stdout


# On a profile, which compiles and solves faster.
LINE = (
    DESIGN[: DESIGN.index("[design]")].replace("[32, 32]", "[32]")
    + """
[design]
objective = "maximise_friction"
starts = 1
limits = {min_contact_area = 0.3, min_mean_gap = 1e-6}
[design.parameters]
"layers[0].thickness" = [5e-5, 1e-3]
"layers[0].material.strengths[0]" = [1e6, 1e8]
"""
)


@pytest.mark.slow
def test_a_limit_that_the_mean_field_does_not_know_is_kept_by_contact():
    """Over two surfaces: by `slide` the mean of their areas is on its limit."""
    study = parse_design(LINE.replace("[grid]", "seeds = 2\n[grid]"))
    results = plan_design(study).run()
    assert (results.method, results.reason) == ("contact", "the mean field has no mean gap")
    assert "contact area of at least 0.3 is active" in results.design.active
    before, designed = results.candidates.values()
    source, names = study.scene.surface, ("friction", "contact_area", "mean_gap")
    found = [
        gc.slide(designed.stack, source.drawn(seed), pressure=3e5, velocity=0.1, rtol=1e-5)
        for seed in (0, 1)
    ]
    friction, area, gap = (np.mean([getattr(f, name) for f in found]) for name in names)
    np.testing.assert_allclose(-results.design.value, friction, rtol=1e-4)
    np.testing.assert_allclose(area, 0.3, rtol=2e-3)
    assert friction > before.contacts["friction"][0, 0] and gap > 1e-6
    assert "contact area at 0.1 m/s, contact" in results.report() and not results.missed()


@pytest.mark.slow
def test_a_cycle_is_judged_by_its_own_numbers():
    """Those of `slide_cycle`: peak over mean friction, and means over the times."""
    motion = '[motion]\nkind = "sinusoidal"\nstroke = 2e-4\nfrequency = 20.0\nnum_times = 16\n'
    text = LINE.replace("maximise_friction", "minimise_peak_over_mean")
    text = text.replace("[design]\n", f"{motion}[design]\n").replace("velocity = 0.1\n", "")
    study = parse_design(text)
    scene, values = study.scene, study.start
    objective, _ = design_problem(study, {}, study.surfaces)
    value, margins = objective(values)
    cycle = gc.sliding.slide_cycle(
        scene.stack, study.surfaces[0], displacement=scene.motion.displacement,
        period=scene.motion.period, pressure=3e5, rtol=1e-5,
    )  # fmt: skip
    np.testing.assert_allclose(value, cycle.peak_friction / cycle.mean_friction, rtol=1e-4)
    area, gap = margins["contact area of at least 0.3"], margins["mean gap of at least 1e-06"]
    np.testing.assert_allclose(0.3 * (1 + area), np.mean(cycle.contact_area), rtol=1e-4)
    np.testing.assert_allclose(1e-6 * (1 + gap), np.mean(cycle.mean_gap), rtol=1e-4)
    plan_design(study)
    assert not_in_mean_field(study) == "the mean field has no motion in time"


@pytest.mark.slow
def test_no_block_of_a_grid_beats_the_design_of_the_command(tmp_path):
    """Brute force, by `slide` alone: 144 blocks, two surfaces each."""
    text = LINE.replace("[32]", "[32, 32]").replace("[grid]", "seeds = 2\n[grid]")
    text = text.replace("min_contact_area = 0.3, min_mean_gap = 1e-6", "min_contact_area = 0.1")
    text = text.replace("starts = 1\n", "").replace("rms_slope = 0.1", "rms_slope = 0.2")
    result = design_command(tmp_path, tmp_path, text.replace("pressure = 3e5", "pressure = 2e5"))
    assert result.exit_code == 0, result.output
    assert "searched by contact, because the mean field is " in result.stdout
    assert "contact area of at least 0.1 is active" in result.stdout
    study = parse_design(text)
    own, source = study.scene.stack, study.scene.surface
    roads = [source.drawn(seed) for seed in (0, 1)]

    def of(values):
        stack = with_values(own, values)
        found = [gc.slide(stack, road, pressure=2e5, velocity=0.1, rtol=1e-5) for road in roads]
        return [sum(getattr(f, name) for f in found) / 2 for name in ("friction", "contact_area")]

    ends = [np.geomspace(*study.parameters[path], 12) for path in study.start]
    blocks = dict(zip(study.start, map(np.ravel, np.meshgrid(*ends)), strict=True))
    every = gc.jit(lambda blocks: jax.lax.map(of, blocks))
    friction, area = every(jax.tree.map(jnp.asarray, blocks))
    written = with_values(own, json.loads((tmp_path / "coat-design.json").read_text()))
    best, share = of({path: paths(written)[path] for path in study.start})
    assert share >= 0.1 * (1 - 1e-4) and best >= np.max(np.where(area >= 0.1, friction, 0))
    assert np.max(friction) > 1.01 * best  # the limit costs friction
