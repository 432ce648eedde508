"""Results of a scene go to a file and come back; what is in them follows from the dataset alone."""

import h5py
import numpy as np
import pytest
import xarray

import graded_contact as gc
from graded_contact.core.quantities import numbers_of
from graded_contact.scenes.collect import surface_variables
from graded_contact.scenes.results import (
    FORMAT,
    KEPT_FIELDS,
    kept_contact,
    kept_solves,
    lost_solves,
    older_meaning,
    over_seeds,
    read_results,
    solve_states,
    surface_of,
    warnings_of,
)
from graded_contact.studies.dataset import LOST, NOT_STARTED, SEAL, attach, write, write_sealed
from graded_contact.surfaces.reading_steps import ReadingStep


def make_results(shape=(4, 6), dtype=np.float64, keep="every"):
    draw = np.random.default_rng(0)
    axes = {"pressure": np.array([1e5, 3e5]), "velocity": np.geomspace(1e-3, 1.0, 3)}
    surface = gc.Surface(
        heights=draw.normal(size=shape).astype(dtype),
        grid=gc.Grid(shape, np.array([1e-3, 3e-3][: len(shape)], dtype)),
        history=("Read.", "Filled."),
        measured=draw.uniform(size=shape).astype(dtype),
        steps=(
            ReadingStep("read", 1.1, 0.3, 4.0, 0.2),
            ReadingStep("resampled", 1.0, 0.2, 3.9, 0.0),
        ),
    )
    variables, places, attributes = surface_variables(surface)
    variables |= {
        n: ((*axes,), draw.normal(size=(2, 3)).astype(dtype)) for n in numbers_of("steady")
    }
    variables["mean_gap"][1][0, 1] = np.nan
    message = [["", "", "It stopped."], ["", NOT_STARTED, "failed: no kernel"]]
    variables["message"] = (*axes,), np.array(message)
    variables["point"] = (*axes,), np.array([["a", "b", "c"], ["d", "e", "f"]])
    over = (*axes, *places) if keep == "every" else (*places,)
    size = (2, 3, *shape) if keep == "every" else shape
    variables |= {n: (over, draw.normal(size=size).astype(dtype)) for n in KEPT_FIELDS.values()}
    attributes |= {
        "title": "glatt, 50 µm",
        "seed": 3,
        "kept": "1 2",
        "rtol": 1e-6,
        "scene": "a = 1\n" * 20000,
    }
    return attach(xarray.Dataset(variables, axes | places, attributes))


@pytest.mark.parametrize("shape, dtype", [((4, 6), np.float64), ((8,), np.float32)])
def test_results_come_back_bit_for_bit(tmp_path, shape, dtype):
    results = make_results(shape, dtype)
    write(tmp_path / "a.h5", results)
    again = read_results(tmp_path / "a.h5")
    assert again.identical(results) and again.gap.dtype == again.friction.dtype == dtype
    before, after = surface_of(results), surface_of(again)
    assert before.heights.dtype == after.heights.dtype == dtype
    np.testing.assert_array_equal(before.grid.size, after.grid.size)
    assert after.history == ("Read.", "Filled.") and after.steps[1].name == "resampled"
    assert after.steps == before.steps


def test_warnings_follow_from_the_numbers(tmp_path):
    results = make_results()
    write(tmp_path / "a.h5", results)
    found = warnings_of(read_results(tmp_path / "a.h5"))
    sentences = [caveat.sentence for caveat in found]
    assert any("The rms slope fell from 0.3 to 0.2" in text for text in sentences)
    assert any("of 6 solves" in text for text in sentences)
    (unmeasured,) = (c.where for c in found if "friction arises on points" in c.sentence)
    solved = np.isin(solve_states(results), ["", "not converged"])
    np.testing.assert_array_equal(unmeasured, (results.unmeasured_friction > 0.1).values & solved)


def test_a_number_with_the_name_of_a_method_of_datasets_is_the_number():
    results = make_results()
    apart = results.assign(load=((*results.message.dims, "time"), np.zeros((2, 3, 4))))
    (caveat,) = (c for c in warnings_of(apart) if "never touch" in c.sentence)
    np.testing.assert_array_equal(caveat.where, solve_states(results).isin(["", "not converged"]))
    touching = apart.assign(load=apart["load"] + np.eye(4)[0])
    assert not any("never touch" in c.sentence for c in warnings_of(touching))


def test_each_solve_has_a_state():
    words = [["", "", "not converged"], ["", "not started", "failed"]]
    np.testing.assert_array_equal(solve_states(make_results()), words)


def test_seeds_are_joined_without_those_that_failed():
    values, message = np.random.default_rng(0).normal(size=(2, 9)), np.full((2, 9), "", object)
    message[1, 5] = "failed: µ"
    axes = ("velocity", "seed")
    data = {"friction": (axes, values), "error": (axes, values), "message": (axes, message)}
    found = over_seeds(xarray.Dataset(data, {"velocity": [0.1, 1.0], "seed": np.arange(9)}))
    for row, used in enumerate([values[0], np.delete(values[1], 5)]):
        np.testing.assert_allclose(found.friction[row], np.mean(used), rtol=1e-13)
        expected = np.std(used, ddof=1) / np.sqrt(len(used))
        np.testing.assert_allclose(found.friction_seed_error[row], expected, rtol=1e-13)
        assert found.error[row] == np.max(used)
    assert found.message.values.tolist() == ["", "8 of 9 surfaces succeeded."]


def test_fields_are_those_of_the_stored_solves():
    every, last = make_results(), make_results(keep="last")
    assert kept_solves(every) == [(0, 0), (0, 1), (0, 2), (1, 0)] and kept_solves(last) == []
    last["message"][1, 2] = ""
    assert kept_solves(last) == [(1, 2)]
    for results, index, at in ((every, (0, 2), (0, 2)), (last, (1, 2), ())):
        fields, surface = kept_contact(results, index)
        np.testing.assert_array_equal(fields.pressure, results.contact_pressure.values[at])
        np.testing.assert_array_equal(surface.heights, results.contact_heights.values[at])
        assert not {"velocity", "pressure"} & {*fields.coords}
    assert kept_solves(last.drop_vars([*KEPT_FIELDS.values()])) == []


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "a.h5"
    with pytest.raises(FileNotFoundError, match=r"a\.h5"):
        read_results(path)
    path.write_bytes(b"friction 0.3")
    with pytest.raises(
        ValueError, match=r"a\.h5.*was changed since .* is damaged, or another program"
    ):
        read_results(path)
    for content in (b"words", b"\x89HDF\r\n\x1a\n"):
        write_sealed(path, content)
        with pytest.raises(ValueError, match=r"a\.h5`"):
            read_results(path)


@pytest.mark.parametrize("lacking", ["surface_history", "period", "friction", "heights", "scene"])
def test_a_file_without_what_results_have_is_refused(tmp_path, lacking):
    results = make_results()
    for attributes in (results.attrs, results.x.attrs):
        attributes.pop(lacking, None)
    write(tmp_path / "a.h5", results.drop_vars(lacking, errors="ignore"))
    with pytest.raises(ValueError, match=r"a\.h5` does not contain the results of a scene"):
        read_results(tmp_path / "a.h5")


def test_results_that_refer_to_another_file_are_refused(tmp_path):
    write(tmp_path / "a.h5", make_results())
    (tmp_path / "b.h5").write_bytes((tmp_path / "a.h5").read_bytes()[SEAL:])
    with h5py.File(tmp_path / "b.h5", "a") as file:
        file["other"] = h5py.ExternalLink("/etc/passwd", "x")
    write_sealed(tmp_path / "a.h5", (tmp_path / "b.h5").read_bytes())
    with pytest.raises(ValueError, match=r"a\.h5` is refused: its link 'other' refers to another"):
        read_results(tmp_path / "a.h5")


def test_what_a_file_would_lose_is_what_was_finished_in_it_alone(tmp_path):
    path = tmp_path / "a.h5"
    assert lost_solves(path, np.array([])) == (0, None)
    results = make_results()
    write(path, results)
    for names, expected in ((list("abcdf"), 0), (list("abc"), 2), ([], 5)):
        lost, earlier = lost_solves(path, np.array(names))
        assert lost == expected and earlier.identical(results)
    write(path, results.assign(message=results.message.where(results.message == "", LOST)))
    assert lost_solves(path, np.array([]))[0] == 3


def test_results_of_an_older_format_say_what_their_numbers_meant(tmp_path):
    """Total errors and areas with edges between the points came together."""
    results = make_results()
    assert older_meaning(results) == ""  # without a number, but with errors by the solver
    parts = [name for name in results if str(name).endswith(("_solver_error", "_grid_error"))]
    meant = "± were errors of the solver alone, not total errors, and areas were counts of points"
    assert meant in older_meaning(results.drop_vars(parts))
    assert older_meaning(results.drop_vars(parts).assign_attrs(format=FORMAT)) == ""
    write(tmp_path / "a.h5", results.drop_vars(parts))
    assert meant in older_meaning(read_results(tmp_path / "a.h5"))
    write(tmp_path / "a.h5", results.assign_attrs(format=FORMAT + 1))
    with pytest.raises(ValueError, match=rf"of format {FORMAT + 1}, this version knows .*{FORMAT}"):
        read_results(tmp_path / "a.h5")


@pytest.mark.filterwarnings("error")
def test_warnings_of_libraries_for_a_forged_file_are_a_refusal(tmp_path):
    """h5netcdf warns of a variable whose fill value is none of its enumeration."""
    with h5py.File(tmp_path / "b.h5", "w") as file:
        kind = h5py.enum_dtype({"a": 1, "b": 2}, np.int8)
        file.create_dataset("z", data=np.ones(3, np.int8), dtype=kind)
        file["x"] = np.arange(3.0)
        file["x"].make_scale()
        file["z"].dims[0].attach_scale(file["x"])
    write_sealed(tmp_path / "a.h5", (tmp_path / "b.h5").read_bytes())
    with pytest.raises(ValueError, match=r"a\.h5` does not contain"):
        read_results(tmp_path / "a.h5")
