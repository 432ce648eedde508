"""A dataset keeps its units, and its file is whole or refused."""

import os

import h5py
import numpy as np
import pytest
import xarray

from graded_contact.studies.dataset import attach, read_dataset, write, write_whole


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


def test_damage_is_refused(tmp_path):
    path = tmp_path / "a.h5"
    write(path, example())
    content, draw = path.read_bytes(), np.random.default_rng(0)
    for _ in range(100):
        damaged = bytearray(content)
        damaged[draw.integers(len(content))] ^= 1 << draw.integers(8)
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="is damaged"):
            read_dataset(path)
    for length in (0, 1, 512, len(content) - 1):
        path.write_bytes(content[:length])
        with pytest.raises(ValueError, match="is damaged"):
            read_dataset(path)
    with pytest.raises(FileNotFoundError):
        read_dataset(tmp_path / "b.h5")


def test_a_file_that_another_program_opens_for_writing_keeps_its_data(tmp_path):
    """HDF5 marks it as open and counts the seal, also if nothing is written."""
    path, data = tmp_path / "a.h5", example()
    write(path, data)
    written = path.read_bytes()
    for mode in ("r+", "a"):
        with h5py.File(path, mode) as file:
            assert file["friction"].shape == (2, 9) and path.read_bytes() != written
            assert read_dataset(path).identical(data)
        assert path.read_bytes() != written and read_dataset(path).identical(data)


@pytest.mark.skipif(os.name != "posix", reason="Windows lets nobody read a file that is written")
def test_a_file_that_another_program_is_changing_is_open_not_damaged(tmp_path):
    path = tmp_path / "a.h5"
    write(path, example())
    with h5py.File(path, "r+") as file:
        file["friction"][0, 0] = 3.0
        file.flush()
        with pytest.raises(ValueError, match=r"a\.h5` is open in another program: close it"):
            read_dataset(path)
    with pytest.raises(ValueError, match="is damaged"):
        read_dataset(path)


@pytest.mark.skipif(os.name != "posix", reason="the limit on the size of files is that of POSIX")
def test_an_earlier_file_stays_if_the_new_one_is_too_large(tmp_path):
    import resource

    path = tmp_path / "a.toml"
    write_whole(path, "µ = 1\n")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(OSError, match=r"a\.toml` cannot be written: File too large"):
            write_whole(path, bytes(2000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == "µ = 1\n".encode() and os.listdir(tmp_path) == ["a.toml"]


def test_a_link_is_replaced_and_its_target_stays(tmp_path):
    target, link = tmp_path / "target", tmp_path / ("n" * 250 + ".csv")
    target.write_text("mine")
    link.symlink_to(target)
    write_whole(link, b"a\r\n")
    assert target.read_text() == "mine" and not link.is_symlink()
    assert link.read_bytes() == b"a\r\n"
