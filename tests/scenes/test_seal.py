"""The leakage of a seal: results, figures and tables of a scene with [fluid]."""

import numpy as np
import pytest
from scene_texts import BARE

import graded_contact as gc
from graded_contact.command.result_tables import print_table
from graded_contact.core.display import with_time
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
