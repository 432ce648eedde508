"""The leakage of a seal: results, figures and tables of a scene with [fluid]."""

import numpy as np
import pytest
from scene_texts import BARE

import graded_contact as gc
from graded_contact.command.result_tables import print_table
from graded_contact.core.display import number, with_time
from graded_contact.plot.style import caption
from graded_contact.scenes.plan import plan
from graded_contact.scenes.results import over_seeds, surface_of
from graded_contact.scenes.scene_file import parse_scene
from graded_contact.sliding import gap_flow
from graded_contact.studies.dataset import write_csv

FLUID = "[fluid]\nviscosity = 2e-3\npressure_difference = 1e4\n"
SEAL = BARE.replace("[32, 32]", "[16, 16]\n").replace("size = 1e-3", "size = [1e-3, 5e-4]")
SEAL = SEAL.replace("q_high = 8e4", "q_high = 4e4\nseeds = 2") + FLUID
SEAL = SEAL.replace("pressure = 2e5", "temperature = 293.15\npressure = [2e4, 2e5, 2e7]")
SEAL = SEAL.replace("[0.01, 1.0]", "0.0")


@pytest.fixture(scope="module")
def seal():
    return plan(parse_scene(SEAL)).run()


@pytest.fixture(scope="module")
def creeping():
    """Ten years on a seal whose relaxed modulus is a hundredth of its first."""
    rubber = 'kind = "prony"\nequilibrium = 4e4\nstrengths = [4e6]\ntimes = [1e4]\npoisson = 0.49\n'
    text = SEAL.replace('kind = "tyre_tread"\n', rubber)
    once = '[motion]\nonce = true\nkind = "dwell"\nduration = 1e6\nfirst = 1e2\nnum_times = 8\n'
    text = text.replace("seeds = 2", "").replace("velocity = 0.0", "") + once
    text = text.replace("[2e4, 2e5, 2e7]", "3e4") + "[output]\nframes = 4\n"
    return plan(parse_scene(text)).run()


def test_leakage_is_the_conductance_times_the_pressure_over_the_viscosity(seal):
    for axis, across in (("x", 0.5), ("y", 2.0)):
        expected = seal[f"flow_along_{axis}"] * 1e4 / (12 * 2e-3) * across
        np.testing.assert_allclose(seal[f"leakage_along_{axis}"], expected, rtol=1e-6)
        assert seal[f"leakage_along_{axis}"].attrs["units"] == "m³/s"
    assert seal.leakage_along_x[:, 0].min() > 0 and np.all(seal.leakage_along_x[:, 2] == 0)
    # Of several surfaces it has the mean, as the conductance has.
    means = over_seeds(seal)
    np.testing.assert_allclose(means.leakage_along_x, seal.leakage_along_x.mean("seed"))
    assert "leakage_along_x_seed_error" in means


def test_at_rest_no_figure_and_no_cell_is_of_friction_that_is_rounding(seal, capsys):
    labels = [axes.get_ylabel() for axes in gc.plot.plot_sweep(seal).axes]
    assert labels == ["contact area fraction", "mean gap [m]"]
    print_table(seal)
    printed = capsys.readouterr().out
    assert "At temperature 293.15 K (20 °C):" in printed
    assert "Left out, as 0 within rounding or errors: friction.\n" in printed
    heads, _, *rows = (line.split() for line in printed.split("[MPa]")[1].splitlines())
    assert "[µm]" in heads and [row[0] for row in rows[:3]] == ["0.000e+00"] * 3
    assert "No fluid passes along x at a pressure of 20 MPa or more." in printed


def test_a_fluid_that_would_lift_the_surface_is_a_warning():
    (warning,) = parse_scene(SEAL).assumed
    assert "of 10 kPa is not small beside the load of 20 kPa" in warning
    thin = parse_scene(SEAL.replace("pressure_difference = 1e4", "pressure_difference = 1e3"))
    assert not any("lifts" in sentence for sentence in thin.assumed)


def test_leakage_has_a_total_error_and_no_digits_beyond_it(seal, capsys):
    """The error of the leakage is that of the conductance, in its unit."""
    print_table(seal, all_seeds=True)
    printed = capsys.readouterr().out
    for axis, across in (("x", 0.5), ("y", 2.0)):
        parts = sum(seal[f"flow_along_{axis}_{cause}_error"] for cause in ("solver", "grid"))
        error, leakage = seal[f"leakage_along_{axis}_error"], seal[f"leakage_along_{axis}"]
        np.testing.assert_allclose(error, parts * 1e4 / (12 * 2e-3) * across, rtol=1e-6)
        assert error.attrs["units"] == "m³/s" and float(error.where(leakage > 0).min()) > 0
        for value, wrong in zip(leakage.values.flat, error.values.flat, strict=True):
            words = number(value, ".3e", wrong)
            assert words in printed.split() and words != f"{value:.3e}"


def test_a_figure_of_leakage_is_against_the_load_and_marks_closed_gaps(seal):
    figure = gc.plot.plot_leakage(seal)
    fluid = "Fluid with η = 0.002 Pa s, Δp = 10 kPa over the cell of 1 mm × 500 µm."
    assert fluid in caption(figure) and caption(figure).endswith("temperature 293.15 K (20 °C).")
    for axes, name in zip(figure.axes, ("leakage_along_x", "leakage_along_y"), strict=True):
        assert axes.get_yscale() == "log" and axes.get_xlabel() == "mean pressure [Pa]"
        lines = {line.get_marker(): line for line in axes.lines if len(line.get_xdata())}
        closed = seal.pressure[(seal[name] == 0).all(["seed", "velocity"])]
        np.testing.assert_allclose(lines["v"].get_xdata(), closed)
        mean = seal[name].mean("seed").values[:, 0]
        (curve,) = (one for one in lines.values() if one.get_linestyle() == "-")
        np.testing.assert_allclose(curve.get_ydata(), np.where(mean > 0, mean, np.nan))
    with pytest.raises(ValueError, match=r"have no leakage: the scene needs the table \[fluid\]"):
        gc.plot.plot_leakage(seal.drop_vars(["flow_along_x"]))


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("viscosity = 2e-3", "viscosity = 0", r"\[fluid\] `viscosity=0` is refused"),
        ("viscosity = 2e-3", "viskosity = 2e-3", "did you mean `viscosity`"),
        ("[16, 16]\n", "[16]\n", "needs a surface in two dimensions"),
        ("[fluid]", '[motion]\nkind = "sinusoidal"\nstroke = 1e-4\nfrequency = 1.0\n[fluid]',
         r"\[fluid\] needs a periodic surface, under steady sliding or .* `once = true`"),
    ],
)  # fmt: skip
def test_a_fluid_that_has_no_leakage_is_refused(old, new, message):
    assert old in SEAL
    text = SEAL.replace(old, new)
    text = text.replace("[1e-3, 5e-4]", "1e-3") if "[16]" in new else text
    with pytest.raises(ValueError, match=message):
        plan(parse_scene(text))


@pytest.mark.slow
def test_a_seal_leaks_less_as_its_rubber_creeps_and_what_passes_is_that_of_the_gap_of_the_step(
    creeping, capsys, tmp_path
):
    one = creeping.isel(pressure=0, velocity=0)
    stored = np.isin(one.time, one.field_time)
    assert stored[[0, -1]].all() and stored.sum() == 4
    for axis, name in enumerate(("leakage_along_x", "leakage_along_y")):
        leakage = one[name].values
        assert one[name].dims == ("time",) and np.array_equal(np.isfinite(leakage), stored)
        gaps = zip(one["gap"].values, one["contact_pressure"].values, strict=True)
        # On one cell, twice as long as wide: Q = K Δp/(12 η) times width over length.
        of_gap = [
            gap_flow(gap, surface_of(creeping).grid, contact=pressure > 0).conductance[axis]
            for gap, pressure in gaps
        ]
        expected = np.array(of_gap) * 1e4 / (12 * 2e-3) * (0.5, 2.0)[axis]
        np.testing.assert_allclose(leakage[stored], expected, rtol=1e-9)
        assert np.all(np.diff(expected) <= 0) and expected[-1] == 0 < expected[1] < expected[0]
    assert np.all(one.leakage_along_x_error.values[stored][:2] > 0)
    print_table(creeping)
    printed = capsys.readouterr().out
    # Not from the first time of K = 0 on along y: half the grid is open there.
    for axis, since in (("x", 2), ("y", 3)):
        errors = one[f"leakage_along_{axis}_error"].values[stored]
        assert np.all(errors[since:] == 0) and np.all(errors[:since] > 0)
        when = with_time(float(one.field_time[since]))
        assert f"No fluid passes along {axis} from {when} on." in printed
    figure = gc.plot.plot_transient(creeping)
    assert figure.axes[-1].get_yscale() == "log"
    assert "leakage along y [m³/s]" in [axes.get_ylabel() for axes in figure.axes]
    write_csv(tmp_path / "t.csv", creeping, "time")
    rows = np.genfromtxt(tmp_path / "t.csv", delimiter=",", names=True)
    np.testing.assert_allclose(rows["leakage_along_x_m³s"], one.leakage_along_x)
