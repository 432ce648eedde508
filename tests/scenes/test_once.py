"""[motion] with `once = true`: what scenes make of it, run, print, write and refuse."""

import os
import re
import signal
from pathlib import Path
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_texts import BARE
from typer.testing import CliRunner
from waiting import until

import graded_contact as gc
from graded_contact.cli import app
from graded_contact.command.result_tables import print_table
from graded_contact.core.escaping import in_html
from graded_contact.designs.table import read_design
from graded_contact.page.document import open_document
from graded_contact.plot.style import caption
from graded_contact.scenes.plan import build_surface, plan
from graded_contact.scenes.results import kept_contact, over_seeds, read_results
from graded_contact.scenes.scene_file import parse_scene, read_scene
from graded_contact.sliding.history_problem import HistoryProblem
from graded_contact.sliding.single_motion import dwell, ramp, start
from graded_contact.studies import interruption
from graded_contact.studies.journal import PointJournal

EXAMPLES = Path(__file__).parents[2] / "examples"
RUBBER = 'kind = "prony"\nequilibrium = 2e6\nstrengths = [4e6]\ntimes = [1e-3]\npoisson = 0.49'
LINE = (
    BARE.replace("[32, 32]", "[16]").replace("q_high = 8e4", "q_high = 4e4")
    .replace('kind = "tyre_tread"', RUBBER).replace("velocity = [0.01, 1.0]\n", "")
)  # fmt: skip
BRAKE = """[motion]
once = true
kind = "ramp"
velocity = 0.1
duration = 2e-3
[[motion.then]]
kind = "start"
before = 0.1
velocity = 0.0
duration = 2e-3
[[motion.then]]
kind = "dwell"
duration = 0.1
num_times = 6
"""
REST = '[motion]\nonce = true\nkind = "dwell"\nduration = 1.0\nnum_times = 6\n'
LOADED = LINE.replace(
    "pressure = 2e5", "pressure = 2e5\nratio_times = [0.0, 3e-3]\npressure_ratio = [1.0, 1.5]"
)
ASKED = "[observe]\nflow = true\n[output]\nframes = 3\n"


def scene_of(text=LOADED + BRAKE + ASKED):
    return parse_scene(text)


@pytest.fixture(scope="module")
def braking():
    scene, said = scene_of(), []
    planned = plan(scene)
    return planned, planned.run(progress=lambda *done: said.append(done)), said


def test_motions_follow_one_another_and_steps_end_where_the_load_turns():
    scene, line = scene_of(), build_surface(scene_of()).grid
    brake = ramp(0.1, 2e-3, line).then(start(0.0, 2e-3, 0.1, line))
    whole = brake.then(dwell(0.1, num_times=6))
    times = np.asarray(scene.motion.times)
    assert np.isin(whole.times, times).all() and 3e-3 in times
    assert scene.num_times == whole.num_times + (3e-3 not in np.asarray(whole.times))
    moved = np.interp(times, whole.times, whole.displacement)
    np.testing.assert_allclose(scene.motion.displacement, moved, atol=1e-15)
    assert scene.step <= 0.5 + 1e-9 and scene.velocity.tolist() == [0.1]
    case = scene.case({"pressure": 2e5, "velocity": 0.1}, build_surface(scene))
    np.testing.assert_allclose(case.pressure, 2e5 * np.interp(times, [0, 3e-3], [1, 1.5]))


@pytest.mark.slow
def test_a_run_is_slide_history(braking):
    planned, results, _ = braking
    scene = planned.scene
    found = gc.sliding.slide_history(
        scene.stack, build_surface(scene), times=scene.motion.times,
        displacement=scene.motion.displacement, fields_at=scene.kept_steps, rtol=scene.rtol,
        pressure=2e5 * np.interp(scene.motion.times, [0, 3e-3], [1, 1.5]),
    )  # fmt: skip
    one = results.isel(pressure=0, velocity=0)
    for name in ("friction", "load", "contact_area", "mean_gap", "work_done", "mean_friction"):
        np.testing.assert_allclose(one[name], found.recorded[name], rtol=1e-9, atol=1e-12)
    fields, _ = kept_contact(results, (0, 0))
    np.testing.assert_allclose(fields["gap"], found.gap, atol=1e-15)
    np.testing.assert_array_equal(fields["field_time"], found.field_times)
    drawn = gc.plot.plot_transient(found).axes[1].lines[0].get_ydata()
    np.testing.assert_allclose(drawn, found.recorded["contact_area"])
    film = gc.plot.plot_film(found, build_surface(scene), times=[0, 2])
    assert [axes.get_title().split(",")[0] for axes in film.axes] == ["2 ms", "104 ms"]


def test_results_are_over_time_and_keep_the_fields_of_their_frames(braking, tmp_path):
    planned, results, _ = braking
    scene = planned.scene
    times = np.asarray(scene.motion.times)
    assert np.all(results.message == "")
    one = results.isel(pressure=0, velocity=0)
    assert one.friction.dims == ("time",) and one.time.attrs["units"] == "s"
    np.testing.assert_array_equal(one.time, times)
    np.testing.assert_allclose(one["load"], 2e5 * np.interp(times, [0, 3e-3], [1, 1.5]), rtol=1e-9)
    # The work is that of the traction along the way, by trapezoids.
    traction, way = (one[name].values for name in ("traction", "surface_displacement"))
    steps = np.diff(way, prepend=0) * (traction + np.append(0, traction[:-1])) / 2
    np.testing.assert_allclose(one.work_done, np.cumsum(steps), rtol=1e-9)
    kept = list(scene.kept_steps)
    assert kept[-1] == scene.num_times - 1 and len(kept) == 3
    fields, _ = kept_contact(results, (0, 0))
    np.testing.assert_array_equal(fields["field_time"], times[kept])
    pressure = fields["pressure"].mean("x")
    np.testing.assert_allclose(pressure, one["load"].values[kept], rtol=1e-6)
    # Of a profile K along its grooves is the mean of u³ over the open gap.
    flow = one.flow_along_y.values
    assert np.flatnonzero(np.isfinite(flow)).tolist() == kept
    cubes = np.where(fields["pressure"] > 0, 0, fields["gap"]) ** 3
    np.testing.assert_allclose(flow[kept], cubes.mean(axis=1), rtol=1e-9)
    gc.studies.dataset.write(tmp_path / "r.h5", results)
    assert read_results(tmp_path / "r.h5").identical(results)


def test_a_table_over_time_has_sizes_in_their_units_and_at_rest_no_friction(braking, capsys):
    _, results, _ = braking
    print_table(results)
    moving = capsys.readouterr().out
    assert all(head in moving for head in ("friction", "displacement", "[kPa]", "[µm]"))
    assert "Left out" not in moving and "e-06" not in moving
    still = {name: 0 * results[name] for name in ("surface_displacement", "work_done")}
    still |= {
        n: 0.5 * results[f"{n}_error"] for n in ("friction", "mean_friction", "peak_friction")
    }
    print_table(results.assign(still))
    rest = capsys.readouterr().out
    words = ["friction", "work done", "mean friction", "peak friction"]
    left = rest.split("Left out, as 0 within rounding or errors: ")[1].split(".\n")[0].split(", ")
    assert {*left} == {*words} and "displacement" not in rest
    area = results.contact_area_error.isel(pressure=0, velocity=0, time=-1)
    assert f"{float(area):.1e}" in moving and f"{float(area):.1e}" in rest
    print_table(results.assign(still), full=True)
    assert "displacement" in (full := capsys.readouterr().out) and "<" in full
    # A friction above its error stays.
    print_table(results.assign(still | {"friction": 3 * results.friction_error}))
    assert "friction" in capsys.readouterr().out.split("Left out")[0]


def test_progress_counts_steps_and_an_interrupted_run_goes_on_at_its_step(braking, tmp_path):
    planned, results, whole = braking
    done, count = zip(*whole, strict=True)
    steps = planned.scene.num_times
    assert {*count} == {3 * steps + -(-steps // 2)} and steps in done and done[-1] == count[-1]
    said = []

    def stopped_at(step):
        def say(done, count):
            said.append((done, count))
            if done >= step:
                raise KeyboardInterrupt

        return say

    with pytest.raises(KeyboardInterrupt):  # in the steps of the errors
        planned.run(store=tmp_path, progress=stopped_at(steps + 1))
    again = planned.run(store=tmp_path, progress=stopped_at(count[-1] + 1))
    assert said == whole  # each segment once
    assert again.identical(results)
    assert [path.stem for path in tmp_path.glob("*.point")] == [planned.points.item()]


def test_each_number_of_the_history_is_part_of_the_name_of_its_solve():
    """A stored solve of another motion or load would be a wrong number."""
    texts = [
        LOADED + BRAKE + ASKED, LOADED + BRAKE.replace("0.1\nnum", "0.2\nnum") + ASKED,
        LOADED.replace("1.5]", "1.6]") + BRAKE + ASKED,
    ]  # fmt: skip
    assert len({plan(parse_scene(text)).points.item() for text in texts}) == len(texts)


def test_figures_of_a_history_have_its_times(braking):
    planned, results, _ = braking
    scene = planned.scene
    figure = gc.plot.plot_transient(results)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels[:4] == ["friction", "contact area", "load [kPa]", "mean gap [µm]"]
    assert figure.axes[0].get_xscale() == "log" and figure.axes[0].get_xlabel() == "time [ms]"
    times = figure.axes[0].lines[0].get_xdata()
    np.testing.assert_allclose(times, 1e3 * np.asarray(scene.motion.times), rtol=1e-12)
    # Bands are the total errors, at each time.
    one = results.isel(pressure=0, velocity=0)
    for axes, name in zip(figure.axes[:2], ("friction", "contact_area"), strict=True):
        ends = axes.collections[0].get_paths()[0].vertices[:, 1]
        values, error = one[name].values, one[f"{name}_error"].values
        assert np.all(np.isin([*(values - error), *(values + error)], ends))
    fields, surface = kept_contact(results, (0, 0))
    film = gc.plot.plot_film(fields, surface)
    assert [axes.get_title() for axes in film.axes][-1] == "104 ms, 300 kPa"
    ends = "Mean pressure 210 kPa to 300 kPa, highest speed 100 mm/s."
    assert caption(figure).endswith(ends)
    # A step failed: what was before it is drawn.
    failed = results.assign(friction=results["friction"].where(results["time"] < 3e-3))
    line = gc.plot.plot_transient(failed).axes[0].lines[0].get_xdata()
    assert len(line) == np.sum(np.asarray(scene.motion.times) < 3e-3)
    for draw in (gc.plot.plot_cycle, gc.plot.plot_sweep):
        with pytest.raises(ValueError, match="once"):
            draw(results)


def test_a_command_runs_a_history_and_writes_its_numbers_over_time(braking, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # In the same steps as the other history, so that one program is compiled.
    (tmp_path / "load.csv").write_text("time [ms],pressure [kPa]\n100,200\n103,400\n")
    text = LINE.replace("pressure = 2e5", 'pressure_path = "load.csv"') + BRAKE + ASKED
    (tmp_path / "s.toml").write_text(text)
    if os.name == "posix":  # Ctrl-C after the first steps
        keep, said = PointJournal.keep, []

        def interrupted(*arguments):
            if not said:
                os.kill(os.getpid(), signal.SIGINT)
                until(lambda: said)
            keep(*arguments)

        with monkeypatch.context() as patch:
            patch.setattr(PointJournal, "keep", interrupted)
            patch.setattr(interruption, "_say", said.append)
            told = CliRunner().invoke(app, ["run", "s.toml"])
        assert told.exit_code == 130 and "1 of them begun" in told.output, told.output
    told = CliRunner().invoke(app, ["run", "s.toml"])
    assert told.exit_code == 0, told.output
    for words in ("friction\n", "flow along", "104 ms"):
        assert words.strip() in told.output
    rows = np.genfromtxt(tmp_path / "s-results/s-time.csv", delimiter=",", names=True)
    # Counted from the first time of the table.
    expected = np.interp(rows["time_s"], [0, 3e-3], [2e5, 4e5])
    np.testing.assert_allclose(rows["load_Pa"], expected, rtol=1e-9)
    names = {path.name for path in (tmp_path / "s-results").iterdir()}
    assert names >= {"s.h5", "s.csv", "s-time.csv", "s-history.png", "s-film.png"}
    again = CliRunner().invoke(app, ["run", "s.toml"])
    assert "1 of 1 solves are found" in again.output
    assert ("[load]", "pressure_path") in read_scene(tmp_path / "s.toml").inputs


def test_the_page_shows_the_results_of_a_history(braking, tmp_path):
    pytest.importorskip("panel")
    from graded_contact.page import explore

    planned, results, _ = braking
    gc.studies.dataset.write(tmp_path / "r.h5", results)
    *told, figure, place, film = explore(tmp_path / "r.h5")
    shown = "".join(part.object for part in told)
    texts = (results.attrs["title"], *results.attrs["caveats"].split("\n"))
    assert all(in_html(text) in shown for text in texts)
    assert figure.alt_text == caption(gc.plot.plot_transient(results))
    assert "210 kPa to 300 kPa" in place.object
    kept = 1e3 * np.asarray(planned.scene.motion.times)[list(planned.scene.kept_steps)]
    assert re.findall(r'alt="time \[ms\]: (\S+)"', film.object) == [f"{t:.4g}" for t in kept]
    gc.studies.dataset.write(tmp_path / "r.h5", results.drop_vars("field_time").isel(time=0))
    with pytest.raises(ValueError, match=r"has no \[motion\] with `once = true`"):
        explore(tmp_path / "r.h5")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["braking", "seal", "load_steps"])
def test_an_example_of_what_happens_once_runs(name, monkeypatch):
    scene = read_scene(EXAMPLES / f"{name}.toml")
    text = scene.text.replace("[64, 64]", "[16]").replace("q_high = 5e4", "q_high = 4e4")
    results = plan(parse_scene(text, EXAMPLES)).run()
    assert np.all(results.message == "") and np.isfinite(results.contact_area).all()
    one = results.isel(pressure=0, velocity=0)
    if name == "braking":  # the slip ends and never reverses
        assert np.all(np.diff(one.surface_displacement) >= -1e-15)
        assert abs(one.friction[-1]) < 1e-3 < one.peak_friction
    if name == "seal":
        flow = one.flow_along_y.values[np.isfinite(one.flow_along_y)]
        assert np.all(np.diff(flow) < 0) and one.time[-1] == 3.156e8


ELASTIC = 'kind = "tyre_tread"'
MEASURED = RUBBER + "\nmeasured = {omega = [10.0, 1e3]}"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (LINE + BRAKE.replace("once = true\n", ""), r"^\[motion\] `then` needs `once = true`"),
        (LINE + REST.replace("once = true\n", ""), r'^\[motion\] kind "dwell" needs `once = true`'),
        (LINE + BRAKE.replace("once = true", "once = 1"),
         r"^\[motion\] `once=1` must be True or False"),
        (LINE + BRAKE.replace('kind = "start"\nbefore', 'kind = "start"\nbefor'),
         r"^\[\[motion.then\]\] number 1 has no key `befor`; did you mean `before`"),
        (LINE + BRAKE.replace('kind = "dwell"', 'kind = "sinusoidal"'),
         r"^\[\[motion.then\]\] number 2 `kind` = 'sinusoidal' is not known"),
        (LINE + REST.replace("1.0", "-1.0"), r"^\[motion\] `duration=-1` is refused"),
        (LINE.replace("[load]", "[load]\nvelocity = 1.0") + REST,
         r"^\[load\] `velocity` is refused"),
        (LOADED.replace("[0.0, 3e-3]", "[0.0]") + REST,
         r"^\[load\] `pressure_ratio` has 2 numbers and `ratio_times` 1"),
        (LOADED.replace("ratio_times = [0.0, 3e-3]\n", "") + REST,
         r"^\[load\] `pressure_ratio` has 2 numbers and `ratio_times` 0"),
        (LOADED.replace("3e-3]", "3.0]") + REST,
         r"^\[load\] `ratio_times\[1\]=3` is refused.*end of"),
        (LOADED.replace("[0.0, 3e-3]", "[1e-2, 3e-3]") + REST, r"^\[load\] `ratio_times"),
        (LOADED.replace("1.5]", "0.0]") + REST,
         r"^\[load\] `pressure_ratio\[1\]=0` is refused.*prescribe `mean_gap` in Python"),
        (LOADED.replace("[load]", "[load]\nvelocity = 1.0"),
         r"^\[load\] `ratio_times` needs \[motion\]"),
        (LINE + REST + "[output]\nframes = 0\n", r"^\[output\] `frames=0` is refused"),
        (LINE.replace("[load]", "[load]\ntemperature = 300.0").replace(RUBBER, ELASTIC) + REST
         + "[heating]\nconductivity = 0.2\ndiffusivity = 1e-7\n",
         r"^\[motion\] `once = true` does not take the table \[heating\]"),
        (LINE + REST + "[observe]\nstiffness = true\n", r"^\[observe\] needs steady .* has `flow`"),
        (LINE.replace(RUBBER, MEASURED) + REST, r"^\[motion\] needs moduli from 1 rad/s"),
    ],
)  # fmt: skip
def test_a_wrong_history_is_refused_with_its_key(text, expected):
    with pytest.raises(ValueError, match=expected):
        plan(parse_scene(text))


@pytest.mark.slow
def test_an_indenter_rests_and_slides_as_in_python():
    """On a window, whose path a scene knows before its solves."""
    text = re.sub(r"(?s)self_affine.*q_high = 4e4", 'sphere"\nradius = 1e-2', LINE)
    scene = parse_scene(text + BRAKE)
    results, motion = plan(scene).run(), scene.motion
    found = gc.slide_history(
        scene.stack, build_surface(scene), times=motion.times, displacement=motion.displacement,
        pressure=2e5,
    )  # fmt: skip
    for name in ("friction", "contact_area", "mean_gap"):
        np.testing.assert_allclose(results[name][0, 0], getattr(found, name), rtol=1e-3, atol=1e-9)


def test_both_bodies_of_a_scene_take_part_in_what_happens_once():
    counter = '[counter.base]\nkind = "half_space"\nmaterial = "tread"\n'
    own = '[block_surface]\nkind = "self_affine"\nrms_slope = 0.1\nhurst = 0.8\n'
    own += "q_roll = 1e4\nq_high = 4e4\n"
    rigid, both = scene_of(LINE + REST), scene_of(LINE + REST + counter + own)
    case = both.case({"pressure": 2e5, "velocity": 0.0}, build_surface(both))
    np.testing.assert_array_equal(case.counter.base.material.times, [1e-3])
    np.testing.assert_array_equal(case.block_surface.heights, both.block_surface.build().heights)
    assert plan(rigid).points != plan(both).points


def test_tables_of_moduli_and_loads_are_refused_by_name(tmp_path):
    np.savetxt(tmp_path / "m.csv", np.array([[1, 1e6, 1e5], [1e4, 2e6, 2e5]]), delimiter=",")
    table = (
        'kind = "tabulated"\npath = "m.csv"\ndeformation = "tension"\ncolumns = {frequency = 1, '
        'storage = 2, loss = 3}\nunits = {frequency = "rad/s", modulus = "Pa"}'
    )
    scene = parse_scene(LINE.replace(RUBBER, table) + REST, tmp_path)
    with pytest.raises(ValueError, match="fit_prony"):
        plan(scene)
    (tmp_path / "load.csv").write_text("t [s],p [Pa]\n0,1e5\n1,-1e5\n")
    text = LINE.replace("pressure = 2e5", 'pressure_path = "load.csv"')
    with pytest.raises(
        ValueError, match=r"^\[load\] `pressure_path`: `pressure\[1\]=-100000`.*`mean_gap`"
    ):
        parse_scene(text + REST, tmp_path)
    with pytest.raises(ValueError, match=r"^\[load\] has `pressure_path` and `pressure`: remove"):
        parse_scene(text.replace("[load]", "[load]\npressure = 1e5") + REST, tmp_path)
    (tmp_path / "load.csv").write_text("t [s],p [N]\n0,1e5\n1,1e5\n")
    with pytest.raises(ValueError, match=r"its pressures are in 'N', as the heading states, but"):
        parse_scene(text + REST, tmp_path)


def test_the_page_and_designs_refuse_a_history_by_name(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(LINE + REST)
    with pytest.raises(ValueError, match=r"once = true`: .*graded-contact run`, and open the file"):
        open_document(path)
    path.write_text(LINE + BRAKE + '[design]\nobjective = "minimise_peak_over_mean"\n'
        + "[design.parameters]\n"
        + '"base.material.equilibrium" = [1e6, 3e6]\n')  # fmt: skip
    with pytest.raises(ValueError, match=re.escape("[design] does not take [motion] with `once")):
        read_design(path)


def test_a_rest_that_is_rounded_has_no_direction():
    """A turn of the path leaves steps of rounding, in which shear would have its full size."""
    rest = start(0.0, 2e-3, 0.1, num_times=4).then(dwell(0.1, num_times=6))

    @jax.jit
    def ways(angle):
        moved = rest.displacement[:, None] * jnp.stack([jnp.cos(angle), jnp.sin(angle)])
        noise = 1 + jnp.finfo(moved.dtype).eps * (-1.0) ** jnp.arange(10)[:, None]
        problem = SimpleNamespace(moved=moved * noise, times=rest.times)
        return HistoryProblem.steps.fget(problem)[1]

    assert np.all(ways(0.5)[4:] == 0) and np.all(ways(0.5)[:4] > 0)


@pytest.mark.slow
def test_friction_of_a_turned_brake_ends_with_its_slip():
    """With shear, several surfaces and directions; means of surfaces are over time, too."""
    flat = LOADED.replace("[16]", "[8, 8]").replace("q_roll = 2e4", "q_roll = 1e4")
    flat = flat.replace("q_high = 4e4", "q_high = 2e4\nseeds = 2").replace(
        "[load]", "[load]\ndirection = 0.5"
    )
    shear = '[shear]\nkind = "constant"\nstress = 1e5\n'
    results = plan(parse_scene(flat + BRAKE + shear)).run()
    means = over_seeds(results).isel(pressure=0, velocity=0)
    assert means.friction.dims == ("time",) and abs(means.friction[-1]) < 0.05 < means.friction[5]
    np.testing.assert_allclose(means.friction, results.friction.mean("seed")[0, 0], rtol=1e-12)
