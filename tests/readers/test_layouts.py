"""Heights in the layouts that people have: counters, units, columns, grids of maps, HDF5.

One map has cells of 6.4 um, an rms height of 0.1 um; every layout must give its size and slope.
"""

import h5py
import numpy as np
import pytest

from graded_contact import read_surface

N, STEP = 32, 0.2  # points, and their distance [um]
SIZE = 6.4e-6
X, Y = np.meshgrid(np.arange(N), np.arange(N), indexing="ij")
# [um], lines of a picture: the first is at its top.
LINES = 0.1 * np.sin(2 * np.pi * (3 * X + 5 * Y) / N + 0.3) + 0.05 * np.cos(2 * np.pi * X * Y / 90)


def level(heights):
    basis = np.stack([np.ones(N * N), X.ravel(), Y.ravel()], 1)
    plane = basis @ np.linalg.lstsq(basis, heights.ravel())[0]
    return heights - plane.reshape(heights.shape)


def check(surface, heights=None, size=SIZE, unit=1e-6):
    """Compares a mirrored surface with heights `[x, y]` in a unit, without their plane."""
    heights = LINES[::-1].T if heights is None else heights
    np.testing.assert_allclose(surface.grid.size, 2 * size, rtol=1e-6)
    found = np.asarray(surface.heights)[:N, :N]
    np.testing.assert_allclose(found, unit * level(heights), atol=2e-5 * unit)


def read(folder, content, name="a.csv", **options):
    content = content.encode() if isinstance(content, str) else content
    (folder / name).write_bytes(content)
    return read_surface(folder / name, **{"periodic": "mirror", "fill": "harmonic", **options})


def refused(folder, content, match, name="a.csv", **options):
    with pytest.raises(ValueError, match=match):
        read(folder, content, name, **options)


def rows(values, separator=",", labels=None):
    """Lines of numbers, each behind its label."""
    texts = [[f"{v:.7g}" for v in row] for row in values]
    if labels is not None:
        texts = [[f"{label:g}", *row] for label, row in zip(labels, texts, strict=True)]
    return "".join(separator.join(row) + "\n" for row in texts)


# Counters


# Units


# Columns


def profile(names, *, index=False, words=False):
    line = np.stack([STEP * np.arange(N), LINES[0]], 1)
    text = rows(line, labels=np.arange(N) if index else None)
    text = text.replace("\n", ",good\n") if words else text
    return f"{names}\n{text}" if names else text


# Grids of maps


# HDF5


def hdf5(folder, fill, **options):
    with h5py.File(folder / "a.h5", "w") as file:
        fill(file)
    return read_surface(folder / "a.h5", **{"periodic": "mirror", **options})


def attributes(node, **values):
    node.attrs.update(values)


def scaled(file):
    data = file.create_dataset("height", data=np.rint(LINES / 1e-6).astype("i4"))
    attributes(data, scale=1e-6, units="um", dx=STEP, dy=STEP, lateral_unit="um")
    file["amplitude"], file["mask"] = LINES + 1, np.ones((N, N), "u1")


def in_groups(file):
    group = file.create_group("scan")
    group["a_quality"] = LINES**2
    data = group.create_dataset("Z", data=np.rint(LINES / 1e-5).astype("i2") + 77)
    attributes(data, scale_factor=1e-11, add_offset=-77e-11, units=b"m", _FillValue=-32768)
    attributes(group, pixel_size_um=STEP)


def beside(file):
    file["topography"], file["pixel_size"] = 1e-6 * LINES, [STEP, STEP]
    attributes(file["topography"], unit="m")
    attributes(file["pixel_size"], units="um")


def named(file):
    file["surface"] = LINES.T
    attributes(file, axes=["y", "x"], unit="um")
    for axis in "xy":
        file[axis] = STEP * np.arange(N)
        attributes(file[axis], units="um")


@pytest.mark.parametrize("fill", [scaled, in_groups, beside, named])
def test_hdf5_is_read_with_the_scaling_that_stands_in_it(tmp_path, fill):
    surface = hdf5(tmp_path, fill)
    check(surface, LINES)
    assert not surface.assumed


# Bytes that nothing tells to be heights


# Jumps between lines


def rough(seed=0, shape=(64, 64), stretch=1.0):
    """A random surface whose spectrum is stretched along x by a factor."""
    rng = np.random.default_rng(seed)
    qx, qy = (np.fft.fftfreq(n) * n for n in shape)
    q = np.hypot(stretch * qx[:, None], qy)
    amplitude = np.where(q > 0, np.maximum(q, 1) ** -1.8, 0)
    heights = np.real(np.fft.ifft2(np.fft.fft2(rng.normal(size=shape)) * amplitude))
    return 1e-7 * heights / np.std(np.diff(heights, axis=1))
