"""Heights in formats that the package reads itself, from files written here byte by byte."""

import io
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from graded_contact import read_surface
from graded_contact.readers.instruments.digital_surf import read_digital_surf
from graded_contact.readers.registry import File

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
    np.savetxt(matrix, 2e6 * HEIGHTS.T[::-1])
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


# Digital Surf

STEP = 1e-12  # [m], of the numbers that the file keeps


def digital_surf(raw, *, packed=0, units=("µm", "µm", "nm"), inversion=0, least=0, special=0):
    """A file of whole numbers, a row for each line along x; `packed` is a number of streams."""
    num_y, num_x = raw.shape
    head = bytearray(512)
    head[:12] = b"DSCOMPRESSED" if packed else b"DIGITAL SURF"

    def put(at, form, *values):
        struct.pack_into("<" + form, head, at, *values)

    put(14, "H", 1), put(86, "H", special), put(98, "H", 8 * raw.itemsize), put(100, "i", least)
    put(108, "3i", num_x, num_y, num_x * num_y), put(120, "3f", 0.1, 0.1, 1e-3)
    for place, text in enumerate((*"xyz", *units, *units)):
        head[132 + 16 * place : 148 + 16 * place] = text.encode("latin-1").ljust(16)
    put(276, "3f", 1, 1, 1), put(290, "H", inversion), put(334, "2H", 5, 3)
    data = raw.astype(raw.dtype.newbyteorder("<")).tobytes()
    if packed:
        parts = [data[i : i + len(data) // packed + 1]
                 for i in range(0, len(data), len(data) // packed + 1)]  # fmt: skip
        streams = [zlib.compress(part) for part in parts]
        sizes = [n for pair in zip(parts, streams, strict=True) for n in map(len, pair)]
        data = struct.pack(f"<I{len(sizes)}I", len(parts), *sizes) + b"".join(streams)
    return bytes(head) + b"hello" + b"..." + data


RAW = np.round(HEIGHTS.T[::-1] / STEP).astype("i4")


@pytest.mark.parametrize("packed", [0, 1, 3])
def test_maps_of_mountains_are_read_packed_too(tmp_path, packed):
    kept = STEP * RAW[::-1].T
    check(read(tmp_path, digital_surf(RAW, packed=packed)), kept)
    upside = digital_surf(np.ascontiguousarray(-RAW[::-1]), packed=packed, inversion=3)
    check(read(tmp_path, upside), kept)
    line = np.ascontiguousarray(RAW[:1])
    check(read(tmp_path, digital_surf(line, packed=packed)), kept[:, -1])


def test_maps_of_mountains_agree_with_surface_topography():
    """Where no unit differs, and for missing points and each inversion."""
    library = pytest.importorskip("SurfaceTopography")
    raw = np.ascontiguousarray(RAW // 2)
    raw[3, 4] = raw.min() - 2
    for inversion in range(4):
        options = {"units": 3 * ("nm",), "special": 1, "least": int(raw[3, 4]) + 2}
        content = digital_surf(raw, inversion=inversion, **options)
        theirs = library.open_topography(io.BytesIO(content)).topography()
        ours = read_digital_surf(File(Path("a.sur"), content, len(content)))
        shown = np.ma.filled(theirs.heights(), np.nan).T  # they draw it by `imshow`
        np.testing.assert_allclose(shown, ours.heights.T[::-1])
        np.testing.assert_allclose(theirs.physical_sizes, 1e9 * ours.size)


# X3P with heights as text, and Gwyddion without units

X3P = """<?xml version="1.0" encoding="UTF-8"?>
<p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2"><Record1>
<Revision>ISO5436 - 2000</Revision><FeatureType>SUR</FeatureType><Axes>
<CX><AxisType>I</AxisType><DataType>D</DataType><Increment>1e-7</Increment></CX>
<CY><AxisType>I</AxisType><DataType>D</DataType><Increment>1e-7</Increment></CY>
<CZ><AxisType>A</AxisType><DataType>D</DataType></CZ></Axes></Record1><Record3>
<MatrixDimension><SizeX>{}</SizeX><SizeY>{}</SizeY><SizeZ>1</SizeZ></MatrixDimension>
<DataList>{}</DataList></Record3></p:ISO5436_2>"""


def x3p(heights):
    """`heights` of shape (nx, ny) or (nx,); x runs first, and NaN is an empty tag."""
    lines = heights.T[::-1] if heights.ndim == 2 else heights
    data = ["<Datum/>" if np.isnan(h) else f"<Datum>{h:.9e}</Datum>" for h in lines.ravel()]
    return X3P.format(len(heights), heights.size // len(heights), "\n".join(data))


def test_heights_in_the_xml_of_an_x3p_are_read(tmp_path):
    check(read(tmp_path, zipped({"main.xml": x3p(HEIGHTS)})))
    check(read(tmp_path, zipped({"a/main.xml": x3p(HEIGHTS)})))
    check(read(tmp_path, zipped({"main.xml": x3p(HEIGHTS[:, 2])})), HEIGHTS[:, 2])
    scaled = x3p(1e9 * HEIGHTS).replace(
        "<CZ><AxisType>A", "<CZ><Increment>1e-9</Increment><AxisType>I"
    )
    check(read(tmp_path, zipped({"main.xml": scaled})))
    holed = np.where(RNG.random(HEIGHTS.shape) < 0.02, np.nan, HEIGHTS)
    surface = read(tmp_path, zipped({"main.xml": x3p(holed)}))
    assert any(f"Filled {np.sum(np.isnan(holed))} missing" in note for note in surface.history)
    for old, new, message in [
        ("<SizeX>40", "<SizeX>41", "it has 1200 heights for 41 x 30 x 1 points"),
        ("<?xml version", "<!DOCTYPE a><?xml version", "declares a type of document"),
        ("MatrixDimension", "ListDimension", "its points are a list, not a matrix"),
        ("</DataList>", "", "no complete list of heights"),
        ("<Axes>", "<a/>" * 300_000 + "<Axes>", "has more than 1e\\+06 bytes beside the heights"),
        ("<Datum>", "<Datum>1;2;", "its points have more than a height"),
    ]:
        with pytest.raises(ValueError, match=message):
            read(tmp_path, zipped({"main.xml": x3p(HEIGHTS).replace(old, new)}))


# Channels of an instrument, and marks of missing points


def jpk(*channels):
    """A TIFF of a thumbnail and channels: name, whether a retrace, and heights [m] (nx, ny)."""
    tifffile = pytest.importorskip("tifffile")
    stream = io.BytesIO()
    common = {"photometric": "minisblack", "metadata": None, "software": False}
    with tifffile.TiffWriter(stream, byteorder="<") as file:
        edges = [(0x8042 + i, "d", 1, edge, True) for i, edge in enumerate(SIZE)]
        start = (0x8003, "s", 0, "2020-01-01", True)
        file.write(np.zeros((2, 2), "i4"), extratags=[start, *edges], **common)
        for name, retrace, heights in channels:
            texts = {0x8050: name, 0x8052: name, 0x8081: "nominal", 0x8090: "nominal",
                     0x80A2: "m", 0x80A3: "LinearScaling"}  # fmt: skip
            tags = [(code, "s", 0, text, True) for code, text in texts.items()]
            tags += [(0x8051, "I", 1, retrace, True), (0x8080, "I", 1, 1, True)]
            tags += [(0x80A4, "d", 1, STEP, True), (0x80A5, "d", 1, 0.0, True)]
            raw = np.round(heights.T / STEP).astype("i4")  # the first line is at the bottom
            file.write(np.ascontiguousarray(raw), extratags=tags, **common)
    return stream.getvalue()


def test_the_measured_trace_is_read_of_a_jpk_and_the_others_are_named(tmp_path):
    pytest.importorskip("SurfaceTopography")
    height, measured = HEIGHTS[::-1], HEIGHTS
    content = jpk(("Height", 0, height), ("Height (measured)", 0, measured),
                  ("Height (measured)", 1, -measured), ("Height", 1, -height))  # fmt: skip
    surface = read(tmp_path, content)
    check(surface, rtol=2e-4)
    assert "from channel 'Height (measured)' of a.dat" in surface.history[0]
    others = "'Height', 'Height (measured, retrace)', 'Height (retrace)'; `channel` chooses"
    assert others in surface.history[1]
    check(read(tmp_path, content, channel="Height (retrace)"), -height, rtol=2e-4)
    check(read(tmp_path, jpk(("Height", 1, height), ("Height", 0, measured))), rtol=2e-4)


def tmd(lines):
    """A file of GelSight and TrueMap, in millimetres: the lines of a picture."""
    head = b"Binary TrueMap Data File v2.0\r\n\0" + b"Created by TrueMap v6\r\n\0"
    sizes = struct.pack("<2I4f", *lines.shape[::-1], 4e-3, 3e-3, 0.0, 0.0)
    return head + sizes + (1e3 * lines).astype("<f4").tobytes()
