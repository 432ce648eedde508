"""A dataset keeps its units, and its file is whole or refused."""

import numpy as np
import pytest
import xarray

from graded_contact.studies.dataset import attach, mean_and_error, read, write


def example():
    values = np.random.default_rng(0).normal(size=(2, 9))
    message = np.full((2, 9), "", object)
    message[1, 5] = "failed: µ"
    return attach(
        xarray.Dataset(
            {
                "friction": (("velocity", "seed"), values),
                "contact.pressure": (("velocity", "seed", "k"), np.ones((2, 9, 3), np.float32)),
                "own": (("velocity", "seed"), values > 0),
                "message": (("velocity", "seed"), message),
            },
            {"velocity": [0.1, 1.0], "seed": np.arange(9)},
            {"scene": "a = 1\n" * 2000, "num_solves": 18},
        ),
        {"own": "1/m"},
    )


def test_mean_and_standard_error_leave_out_what_failed():
    data = example()
    mean, error = mean_and_error(data)
    for row, used in enumerate([data.friction[0], np.delete(data.friction.values[1], 5)]):
        np.testing.assert_allclose(mean.friction[row], np.mean(used), rtol=1e-13)
        expected = np.std(used, ddof=1) / np.sqrt(len(used))
        np.testing.assert_allclose(error.friction[row], expected, rtol=1e-13)


def test_a_file_comes_back_bit_for_bit_and_opens_in_xarray(tmp_path):
    data = example()
    write(tmp_path / "a.h5", data)
    assert read(tmp_path / "a.h5").identical(data)
    assert data.velocity.attrs == {"units": "m/s", "long_name": "sliding velocity"}
    assert data["contact.pressure"].units == "Pa" and data.own.attrs == {"units": "1/m"}
    with xarray.open_dataset(tmp_path / "a.h5", engine="h5netcdf") as opened:
        assert opened.identical(data)


def test_damage_is_refused(tmp_path):
    path = tmp_path / "a.h5"
    write(path, example())
    content, draw = path.read_bytes(), np.random.default_rng(0)
    for _ in range(100):
        damaged = bytearray(content)
        damaged[draw.integers(len(content))] ^= 1 << draw.integers(8)
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="is damaged"):
            read(path)
    for length in (0, 1, 512, len(content) - 1):
        path.write_bytes(content[:length])
        with pytest.raises(ValueError, match="is damaged"):
            read(path)
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "b.h5")
