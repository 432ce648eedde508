"""Results go to a file and come back; no half or damaged file is taken for a whole one."""

import dataclasses

import h5py
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.files import results as storage
from graded_contact.files.results import (
    FIELDS,
    OBSERVABLES,
    Fields,
    Results,
    lost_solves,
    read_results,
    write_results,
)
from graded_contact.files.sealed import SEAL, seal
from graded_contact.files.study import NOT_STARTED, Study, units_of
from graded_contact.roughness.surface import Step


def make_results(shape=(4, 6), dtype=np.float64) -> Results:
    draw = np.random.default_rng(0)
    values = {name: draw.normal(size=(2, 3)).astype(dtype) for name in OBSERVABLES}
    values["mean_gap"][0, 1] = np.nan
    fields = Fields(**{name: draw.normal(size=shape).astype(dtype) for name in FIELDS})
    grid = gc.Grid(shape, np.array([1e-3, 3e-3][: len(shape)], dtype))
    message = np.array([["", "", "It stopped."], ["", NOT_STARTED, "failed: no kernel"]])
    axes = {"pressure": np.array([1e5, 3e5]), "velocity": np.geomspace(1e-3, 1.0, 3)}
    return Results(
        Study(axes, values, message, units_of((*axes, *values))),
        point=np.array([["a", "b", "c"], ["d", "e", "f"]]),
        surface=gc.Surface(
            heights=draw.normal(size=shape).astype(dtype),
            grid=grid,
            history=("Read.", "Filled."),
            measured=draw.uniform(size=shape).astype(dtype),
            steps=(Step("read", 1.1, 0.3, 4.0, 0.2), Step("resampled", 1.0, 0.2, 3.9, 0.0)),
        ),
        fields={(0, 2): fields, (1, 0): fields},
        attributes={"title": "glatt, 50 µm", "seed": 3, "rtol": 1e-6, "scene": "a = 1\n" * 20000},
    )


@pytest.mark.parametrize("shape", [(4, 6), (8,)])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_results_come_back_bit_for_bit(tmp_path, shape, dtype):
    results = make_results(shape, dtype)
    write_results(tmp_path / "a.h5", results)
    again = read_results(tmp_path / "a.h5")
    assert list(again.study.axes) == ["pressure", "velocity"]
    np.testing.assert_array_equal(again.point, results.point)
    np.testing.assert_array_equal(again.message, results.message)
    for name in (*again.study.axes, *OBSERVABLES):
        before, after = results[name], again[name]
        assert before.shape == after.shape
        assert before.dtype == after.dtype
        assert before.tolist() == after.tolist() or before.tobytes() == after.tobytes()
    assert again.fields.keys() == results.fields.keys()
    for key, fields in results.fields.items():
        for name in FIELDS:
            before, after = getattr(fields, name), getattr(again.fields[key], name)
            assert before.tobytes() == after.tobytes()
    heights = np.asarray(results.surface.heights), np.asarray(again.surface.heights)
    assert heights[0].dtype == heights[1].dtype
    assert heights[0].tobytes() == heights[1].tobytes()
    np.testing.assert_array_equal(results.surface.grid.size, again.surface.grid.size)
    np.testing.assert_array_equal(again.surface.measured, results.surface.measured)
    assert again.surface.history == results.surface.history
    assert again.surface.steps == results.surface.steps
    assert again.attributes == results.attributes


def test_caveats_are_sentences_in_the_file_and_follow_from_its_numbers(tmp_path):
    results = make_results()
    write_results(tmp_path / "a.h5", results)
    with h5py.File(tmp_path / "a.h5") as file:
        stored = file.attrs["caveats"].split("\n")
    found = read_results(tmp_path / "a.h5").caveats
    assert stored == [caveat.sentence for caveat in found]
    assert any("The rms slope fell from 0.3 to 0.2" in text for text in stored)
    assert any("of 6 solves" in text for text in stored)
    for before, after in zip(results.caveats, found, strict=True):
        np.testing.assert_array_equal(before.where, after.where)


def test_converged_is_what_has_no_message(tmp_path):
    results = make_results()
    np.testing.assert_array_equal(results.converged, [[True, True, False], [True, False, False]])
    assert not results.complete
    words = [["", "", "not converged"], ["", "not started", "failed"]]
    np.testing.assert_array_equal(results.state, words)


def test_every_dataset_has_units_a_description_and_scales(tmp_path):
    write_results(tmp_path / "a.h5", make_results())
    seen = []

    def check(name, item):
        if isinstance(item, h5py.Dataset):
            seen.append(name)
            assert item.attrs["description"] and (item.dtype.kind == "O" or item.attrs["units"])
            if not item.is_scale:
                assert all(len(dimension.values()) == 1 for dimension in item.dims)

    with h5py.File(tmp_path / "a.h5") as file:
        file.visititems(check)
        assert [scale.name for scale in (file["friction"].dims[0][0], file["friction"].dims[1][0])]
        assert file["friction"].dims[1][0].name == "/velocity"
        assert file["solve_0_2/gap"].dims[0][0].name == "/x"
        assert file["pressure"].attrs["units"] == "Pa"
    assert "solve_1_0/pressure" in seen


def test_an_interrupted_write_leaves_the_earlier_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "a.h5"
    write_results(path, make_results())
    before = path.read_bytes()

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(storage, "_write_surface", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_results(path, make_results((8,)))
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.h5"]
    assert path.read_bytes() == before


def test_a_first_write_interrupted_leaves_no_file(tmp_path):
    broken = dataclasses.replace(make_results(), attributes={"scene": object()})
    with pytest.raises(TypeError):
        write_results(tmp_path / "a.h5", broken)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("part", [0.0, 0.01, 0.5, 0.99])
def test_a_truncated_file_is_refused_by_its_path(tmp_path, part):
    path = tmp_path / "a.h5"
    write_results(path, make_results())
    content = path.read_bytes()
    path.write_bytes(content[: int(part * len(content))])
    with pytest.raises(ValueError, match=r"a\.h5.*cannot be read"):
        read_results(path)


def test_a_changed_number_is_refused(tmp_path):
    path = tmp_path / "a.h5"
    write_results(path, make_results())
    with h5py.File(path) as file:
        chunk = file["solve_0_2/gap"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.h5.*cannot be read"):
        read_results(path)


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "a.h5"
    with pytest.raises(FileNotFoundError, match=r"a\.h5"):
        read_results(path)
    path.write_text("friction 0.3")
    with pytest.raises(ValueError, match=r"a\.h5.*cannot be read"):
        read_results(path)
    with h5py.File(path, "w", userblock_size=SEAL) as file:
        file["friction"] = 0.3
    with pytest.raises(ValueError, match="written by another program"):
        read_results(path)
    seal(path)
    with pytest.raises(ValueError, match="does not say"):
        read_results(path)
    with h5py.File(path, "w") as file:
        file.attrs["format"] = storage.FORMAT
    with pytest.raises(ValueError, match=r"a\.h5.*cannot be read"):
        read_results(path)


def test_what_a_file_would_lose_is_what_was_finished_in_it_alone(tmp_path):
    path = tmp_path / "a.h5"
    assert lost_solves(path, np.array([])) == (0, {})
    write_results(path, make_results())
    for names, expected in ((list("abcdf"), 0), (list("abc"), 2), ([], 5)):
        lost, attributes = lost_solves(path, np.array(names))
        assert lost == expected and attributes["title"] == "glatt, 50 µm"


def forged(name, change):
    """Edits a file in the way of the name: whoever does that is told, and nothing is allocated."""
    return pytest.param(change, id=name)


def _dataset(file, name, data=None, **arguments):
    del file[name]
    file.create_dataset(name, data=data, **arguments)


FORGERIES = [
    forged("no friction", lambda f: f.__delitem__("friction")),
    forged("a group", lambda f: (f.__delitem__("friction"), f.create_group("friction"))),
    forged("27 GB", lambda f: _dataset(f, "heights", shape=(60000, 60000), dtype="f8")),
    forged(
        "27 GB in chunks",
        lambda f: _dataset(f, "heights", shape=(60000, 60000), dtype="f8", chunks=(100, 100)),
    ),
    forged(
        "27 GB in a chunk",
        lambda f: _dataset(f, "heights", shape=(60000, 60000), dtype="f8", chunks=(60000, 60000)),
    ),
    forged("no numbers", lambda f: _dataset(f, "friction", data=h5py.Empty("f8"))),
    forged("other shape", lambda f: _dataset(f, "friction", data=np.zeros((3, 2)))),
    forged("whole numbers", lambda f: _dataset(f, "friction", data=np.zeros((2, 3), int))),
    forged("complex", lambda f: _dataset(f, "friction", data=np.zeros((2, 3), complex))),
    forged("texts", lambda f: _dataset(f, "friction", data=[["a"] * 3] * 2)),
    forged("no texts", lambda f: _dataset(f, "message", data=np.zeros((2, 3)))),
    forged("three axes", lambda f: _dataset(f, "heights", data=np.zeros((2, 3, 4)))),
    forged("other fields", lambda f: _dataset(f, "solve_0_2/gap", data=np.zeros((2, 3)))),
    forged("another solve", lambda f: f.move("solve_0_2", "solve_7_7")),
    forged("no index", lambda f: f.move("solve_0_2", "solve_x")),
    forged("an array for a title", lambda f: f.attrs.__setitem__("title", [1.0, 2.0])),
    forged("nothing for a title", lambda f: f.attrs.__setitem__("title", h5py.Empty("f8"))),
    forged("formats", lambda f: f.attrs.__setitem__("format", [storage.FORMAT] * 2)),
    forged("no size", lambda f: f.attrs.__delitem__("surface_size")),
    forged("a text for a size", lambda f: f.attrs.__setitem__("surface_size", "1 m")),
    forged("three sizes", lambda f: f.attrs.__setitem__("surface_size", [1.0, 2.0, 3.0])),
    forged("infinite heights", lambda f: f["heights"].__setitem__(0, np.inf)),
]


@pytest.mark.parametrize("change", FORGERIES)
def test_an_edited_file_is_refused_by_its_path(tmp_path, change, unchecked_types):
    path = tmp_path / "a.h5"
    write_results(path, make_results())
    with h5py.File(path, "a") as file:
        change(file)
    with pytest.raises(ValueError, match=r"a\.h5.*cannot be read.*changed"):
        read_results(path)
    seal(path)  # as if it had been written so
    with pytest.raises(ValueError, match=r"a\.h5.*cannot be read"):
        read_results(path)


def test_a_file_with_any_damage_is_refused_before_hdf5_looks_at_it(tmp_path):
    """HDF5 returned zeros for numbers, or never came back, of files like these."""
    path, draw = tmp_path / "a.h5", np.random.default_rng(0)
    write_results(path, make_results())
    content = path.read_bytes()
    for _ in range(200):
        damaged = bytearray(content)
        damaged[draw.integers(len(content))] ^= 1 << draw.integers(8)
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=r"a\.h5.*cannot be read.*changed"):
            read_results(path)
