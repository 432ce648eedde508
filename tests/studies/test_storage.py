"""Results go to a file and come back; no half or damaged file is taken for a whole one."""

import dataclasses

import h5py
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.studies import storage
from graded_contact.studies.storage import (
    AXES,
    FIELDS,
    OBSERVABLES,
    Fields,
    Results,
    read_results,
    write_results,
)
from graded_contact.surface import Step


def make_results(shape=(4, 6), dtype=np.float64) -> Results:
    draw = np.random.default_rng(0)
    values = {name: draw.normal(size=(2, 3)).astype(dtype) for name in OBSERVABLES}
    values["mean_gap"][0, 1] = np.nan
    fields = Fields(**{name: draw.normal(size=shape).astype(dtype) for name in FIELDS})
    grid = gc.Grid(shape, np.array([1e-3, 3e-3][: len(shape)], dtype))
    return Results(
        pressure=np.array([1e5, 3e5]),
        velocity=np.geomspace(1e-3, 1.0, 3),
        **values,
        message=np.array([["", "", "It stopped."], ["", "", ""]]),
        surface=gc.Surface(
            heights=draw.normal(size=shape).astype(dtype),
            grid=grid,
            history=("Read.", "Filled."),
            measured=draw.uniform(size=shape).astype(dtype),
            steps=(Step("read", 1.1, 0.3, 4.0), Step("resampled", 1.0, 0.2, 3.9)),
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
    for name in (*AXES, *OBSERVABLES, "message"):
        before, after = getattr(results, name), getattr(again, name)
        assert before.shape == after.shape
        assert name == "message" or before.dtype == after.dtype
        assert before.tolist() == after.tolist() or before.tobytes() == after.tobytes()
    assert again.fields.keys() == results.fields.keys()
    for key, fields in results.fields.items():
        for name in FIELDS:
            assert getattr(fields, name).tobytes() == getattr(again.fields[key], name).tobytes()
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
    assert any("Resampling lowered the rms slope from 0.3 to 0.2" in text for text in stored)
    assert any("of 6 solves" in text or "in 6 solves" in text for text in stored)
    for before, after in zip(results.caveats, found, strict=True):
        np.testing.assert_array_equal(before.where, after.where)


def test_converged_is_what_has_no_message(tmp_path):
    results = make_results()
    np.testing.assert_array_equal(results.converged, [[True, True, False], [True, True, True]])
    assert not results.complete


def test_every_dataset_has_units_a_description_and_scales(tmp_path):
    write_results(tmp_path / "a.h5", make_results())
    seen = []

    def check(name, item):
        if isinstance(item, h5py.Dataset):
            seen.append(name)
            assert item.attrs["units"] and item.attrs["description"]
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
    with h5py.File(path, "w") as file:
        file["friction"] = 0.3
    with pytest.raises(ValueError, match="does not say"):
        read_results(path)
    with h5py.File(path, "w") as file:
        file.attrs["format"] = storage.FORMAT
    with pytest.raises(ValueError, match=r"a\.h5.*cannot be read"):
        read_results(path)
