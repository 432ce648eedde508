"""A dataset keeps its units, and its file is whole or refused."""

import numpy as np
import xarray

from graded_contact.studies.dataset import attach, read_dataset, write


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


def test_a_file_comes_back_bit_for_bit_and_opens_in_xarray(tmp_path):
    data = example()
    write(tmp_path / "a.h5", data)
    assert read_dataset(tmp_path / "a.h5").identical(data)
    assert data.velocity.attrs == {"units": "m/s", "long_name": "sliding velocity"}
    assert data["contact.pressure"].units == "Pa" and data.own.attrs == {"units": "1/m"}
    with xarray.open_dataset(tmp_path / "a.h5", engine="h5netcdf") as opened:
        assert opened.identical(data)
