"""Heights in formats that the package reads itself, from files written here byte by byte."""

import io
import zipfile

import numpy as np
import pytest

from graded_contact import read_surface

RNG = np.random.default_rng(5)
SIZE = (4e-6, 3e-6)
HEIGHTS = 1e-8 * np.cumsum(np.cumsum(RNG.normal(size=(40, 30)), 0), 1) / 40  # [m]


def zipped(files):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()


def check(surface, heights=HEIGHTS, size=SIZE, rtol=1e-6):
    """Compares a surface read with `periodic="mirror"` with heights from which a plane is taken."""
    np.testing.assert_allclose(surface.grid.size, 2 * np.array(size[: heights.ndim]), rtol=rtol)
    x = np.meshgrid(*map(np.arange, heights.shape), indexing="ij")
    basis = np.stack([np.ones(heights.size), *map(np.ravel, x)], 1)
    plane = basis @ np.linalg.lstsq(basis, heights.ravel())[0]
    found = np.asarray(surface.heights)[tuple(map(slice, heights.shape))]
    expected = heights - plane.reshape(heights.shape)
    np.testing.assert_allclose(found, expected, atol=10 * rtol * np.std(expected))


def read(folder, content, name="a.dat", **options):
    (folder / name).write_bytes(content)
    return read_surface(folder / name, **{"periodic": "mirror", **options})


# Containers of contact.engineering

META = r"""creation_time: '2021-06-21 15:06:49+00:00'
surfaces:
- category: exp
  description: "Two\
    \ lines: \xB5m\n"
  name: wafer   # a remark
  topographies:
  - creator:
      name: Someone
    datafile:
      original: map.txt
    height_scale: 0.5
    is_periodic: false
    name: 'the map''s'
    size: !!python/tuple
    - 4.0
    - 3.0
    tags: []
    unit: µm
  - datafile: {original: scan.txt}
    height_scale: 1.0
    name: stylus
    size: [4.0]
    unit: um
  - datafile:
      original: own.npz
    height_scale: 0.25
    name: "own \u2013 scale"
    size: [9.0, 9.0]
    unit: um
versions:
  topobank: 0.13.0
"""


def test_a_container_gives_its_measurements_by_name_with_size_and_unit(tmp_path):
    matrix, scan, own = io.StringIO(), io.StringIO(), io.BytesIO()
    np.savetxt(matrix, 2e6 * HEIGHTS.T)
    line = 1e6 * np.stack([1e-7 * np.arange(40), HEIGHTS[:, 3]], 1)
    np.savetxt(scan, line, fmt="%.9g", header="x z")
    np.savez(own, z_nm=1e9 * HEIGHTS, size_um=(4.0, 3.0))
    files = {"map.txt": matrix.getvalue(), "scan.txt": scan.getvalue(), "own.npz": own.getvalue(),
             "LICENSE.txt": "Attribution 4.0"}  # fmt: skip
    content = zipped({**files, "meta.yml": META})
    with pytest.raises(ValueError, match=r"\[\"the map's\", 'stylus', 'own – scale'\]"):
        read(tmp_path, content)
    surface = read(tmp_path, content, channel="the map's")
    check(surface)
    assert any("multiplied by 0.5, as the container says" in note for note in surface.history)
    check(read(tmp_path, content, channel="stylus"), HEIGHTS[:, 3])
    surface = read(tmp_path, content, channel="own.npz")  # the file is another name
    check(surface)
    told = " ".join(surface.history)
    assert "scales its heights by 0.25; the file has its own scale, in 'nm', which is used" in told
    assert "says its size is [9.e-06 9.e-06] m; the file's [4.e-06 3.e-06] m is used" in told
    index = """{"surfaces": [{"name": "w", "topographies": [{"name": "n", "unit": "um",
        "size": [4, 3], "height_scale": 0.5, "datafile": {"original": "map.txt"}}]}]}"""
    check(read(tmp_path, zipped({**files, "index.json": index})))


@pytest.mark.parametrize("meta", ["surfaces: 3\n", "a\n  b: [\n", "surfaces:\n- topographies: 1\n"])
def test_a_container_that_is_not_understood_is_refused_by_name(tmp_path, meta):
    with pytest.raises(ValueError, match=r"its 'meta\.yml' is not understood"):
        read(tmp_path, zipped({"meta.yml": meta, "a.txt": "1 2\n"}))
