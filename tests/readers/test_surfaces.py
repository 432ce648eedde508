"""Heights from text, arrays, roads and instruments; what a file does not state is asked for."""

import importlib.util
import io
import struct
from pathlib import Path

import h5py
import numpy as np
import pytest

from graded_contact import read_surface
from graded_contact.readers import NotPlain

DATA = Path(__file__).parents[3] / "shared" / "data"
RNG = np.random.default_rng(5)
NX, NY, STEP = 16, 12, 1e-7
SIZE = (NX * STEP, NY * STEP)
# [m], `[x, y]`, y upwards: the lines of a picture, the topmost first, are `HEIGHTS[:, ::-1].T`.
HEIGHTS = np.round(1e-8 * np.cumsum(np.cumsum(RNG.normal(size=(NX, NY)), 0), 1) / NX, 13)
LINES = HEIGHTS[:, ::-1].T
X, Y = np.meshgrid(STEP * np.arange(NX), STEP * np.arange(NY), indexing="ij")
POINTS = np.stack([X, Y, HEIGHTS], axis=-1).reshape(-1, 3)


def level(heights):
    x = np.meshgrid(*map(np.arange, heights.shape), indexing="ij")
    basis = np.stack([np.ones(heights.size), *map(np.ravel, x)], axis=1)
    known = np.isfinite(heights.ravel())
    plane = np.linalg.lstsq(basis[known], heights.ravel()[known])[0]
    return heights - (basis @ plane).reshape(heights.shape)


def check(path, heights=HEIGHTS, edges=SIZE, rtol=1e-6, **options):
    surface = read_surface(path, periodic="mirror", **options)
    np.testing.assert_allclose(surface.grid.size, 2 * np.array(edges[: heights.ndim]), rtol=rtol)
    found = np.asarray(surface.heights)[tuple(map(slice, heights.shape))]
    known, expected = np.isfinite(heights), level(heights)
    apart = found[known] - expected[known]
    np.testing.assert_allclose(apart, np.mean(apart), atol=10 * rtol * np.nanstd(expected))
    if not np.all(known):
        measured = np.asarray(surface.measured)[tuple(map(slice, heights.shape))]
        np.testing.assert_array_equal(measured > 0, known)


def text(rows, head="", separator=" ", decimal="."):
    lines = [separator.join(f"{x:.9g}" for x in row).replace(".", decimal) for row in rows]
    return head + "\n".join(lines) + "\n"


def write(folder, content, name="a.txt"):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


SCALED = POINTS * [1e6, 1e6, 1e9]  # µm and nm
BOTH = {"unit": "nm", "size": SIZE}
TEXTS = {
    "points": (text(SCALED, "x [um],y [um],z [nm]\n", ","), {}),
    "points in any order": (text(RNG.permutation(SCALED), "X/um;Y/um;Height/nm\n", ";"), {}),
    "points in columns": (
        text(SCALED[:, ::-1], "a,b,c\n", ","),
        {"unit": "um", "columns": {"x": 3, "y": "b", "z": 1}},
    ),
    "matrix": (text(1e9 * LINES), BOTH),
    "decimal commas": (
        text(1e9 * LINES, separator="\t", decimal=","),
        {**BOTH, "layout": {"decimal": ","}},
    ),
    "remarks above": (text(1e9 * LINES, "# in nm\n\n"), {**BOTH, "layout": {"header": 1}}),
}


@pytest.mark.parametrize("name", TEXTS)
def test_text(tmp_path, name):
    content, options = TEXTS[name]
    scale = 1e3 if name == "points in columns" else 1.0  # heights in nm were called µm
    check(write(tmp_path, content), scale * HEIGHTS, **options)


def test_profiles(tmp_path):
    line = HEIGHTS[:, 3]
    points = np.stack([X[:, 0] * 1e3, line * 1e6], axis=1)
    check(write(tmp_path, text(points, "x [mm]\tz [µm]\n", "\t")), line)
    check(write(tmp_path, text(points[::-1], "Distance,z\n", ",")), 1e3 * line, unit="mm")
    check(write(tmp_path, text(points[:, 1:])), line, unit="um", size=SIZE[0])


def test_a_missing_point_of_a_grid_and_marks(tmp_path):
    missing = HEIGHTS.copy()
    missing[3, 4] = missing[9, 9] = np.nan
    kept = np.isfinite(missing).ravel()
    check(write(tmp_path, text(SCALED[kept], "x [um],y [um],z [nm]\n", ",")), missing)
    marked = np.where(np.isnan(missing), -9999, 1e9 * missing)
    check(write(tmp_path, text(marked[:, ::-1].T)), missing, missing=-9999, **BOTH)
    huge = np.where(np.isnan(missing), 1e38, 1e9 * missing)
    check(write(tmp_path, text(huge[:, ::-1].T)), missing, **BOTH)
    rows = np.stack([X * 1e6, Y * 1e6, marked], axis=-1).reshape(-1, 3)
    check(write(tmp_path, text(rows, "x [um],y [um],z [nm]\n", ",")), missing, missing=-9999)
    np.save(tmp_path / "a.npy", missing)
    check(tmp_path / "a.npy", missing, unit="m", size=SIZE)


COUNTERS = np.block(
    [[np.zeros((1, 1)), np.arange(NX)[None]], [np.arange(NY)[:, None], LINES * 1e9]]
)
LENGTHS = np.round(0.2 / 3 * np.arange(NX), 2)
AMBIGUOUS = {
    "ragged": "1,2,3\n4,5\n6,7,8\n",
    "a word": "1,2,3,4\n1,2,3x,4\n" * 4,
    "decimal commas": text(1e9 * LINES, separator="\t", decimal=","),
    "commas as both": "0,12,1,05,2,71\n0,31,1,99,2,03\n" * 3,
    "two columns": text(POINTS[:, :2] * 1e6),
    "three columns": text(SCALED),
    "counters": text(COUNTERS),
    "an index": text(np.column_stack([np.arange(NY), LINES * 1e9])),
    "lengths above": text(np.vstack([LENGTHS, LINES * 1e9])),
    "names above": text(LINES * 1e9, " ".join("abcdefghijklmnop") + "\n"),
    "another unit above": text(LINES * 1e9, "# z in um\n"),
    "cut": text(LINES * 1e9)[:-9] + "\n",
    "empty": " \n",
    "unequal steps": "x [um],z [um]\n0,1\n1,2\n2,5\n4,1\n5,3\n",
    "one unit": "x [um],z\n0,1\n1,2\n2,5\n3,1\n4,3\n",
    "x alone": "x [um],y [um]\n0,1\n1,2\n2,5\n3,1\n4,3\n",
}


@pytest.mark.parametrize("name", AMBIGUOUS)
def test_texts_that_may_be_read_in_two_ways_are_refused(tmp_path, name):
    options = {} if name == "one unit" else BOTH
    with pytest.raises(ValueError, match="path="):
        read_surface(write(tmp_path, AMBIGUOUS[name]), **options)


def test_the_message_has_the_call(tmp_path):
    np.savez(tmp_path / "a.npz", first=HEIGHTS, second=HEIGHTS)
    with pytest.raises(NotPlain) as error:
        read_surface(tmp_path / "a.npz", size=SIZE)
    assert error.value.options == {"size": list(SIZE), "channel": "..."}
    with pytest.raises(NotPlain) as error:
        read_surface(tmp_path / "a.npz", channel="first")
    assert error.value.options == {"channel": "first", "unit": "...", "size": "..."}
    check(tmp_path / "a.npz", channel="first", size=SIZE, unit="m")


def test_arrays_of_numpy(tmp_path):
    np.save(tmp_path / "a.npy", np.float32(1e9 * HEIGHTS))
    check(tmp_path / "a.npy", **BOTH)
    np.savez(tmp_path / "a.npz", pixel=1e-6, z=1e9 * HEIGHTS)
    check(tmp_path / "a.npz", **BOTH)
    np.save(tmp_path / "b.npy", np.array([{"a": 1}]), allow_pickle=True)
    with pytest.raises(ValueError, match=r"b\.npy"):
        read_surface(tmp_path / "b.npy", **BOTH)


def test_hdf5_by_the_name_of_the_dataset(tmp_path):
    """With texts of any length, packed, as TopoStats writes them."""
    with h5py.File(tmp_path / "a.topostats", "w") as file:
        texts = np.array(["grain", "trace of another length"], dtype=object)
        names = h5py.string_dtype()
        file.create_dataset("names", data=texts, dtype=names, compression="gzip")
        file.create_dataset("image", data=1e9 * HEIGHTS, compression="gzip", shuffle=True)
        file.create_dataset("more/mask", data=np.zeros((NX, NY), np.int32))
        file["pixel_to_nm_scaling"] = 0.1
        file["image_stack"] = np.zeros((3, NX, NY))
    with pytest.raises(NotPlain, match=r"\['image', 'more/mask'\]"):
        read_surface(tmp_path / "a.topostats")
    check(tmp_path / "a.topostats", channel="image", **BOTH)
    with h5py.File(tmp_path / "a.h5", "w") as file:  # of a few bytes
        file.create_dataset("z", shape=(10**6, 10**6), dtype="f4", chunks=(64, 64))
    with pytest.raises(ValueError, match="GB"):
        read_surface(tmp_path / "a.h5", **BOTH)


ROAD = """$CT
a road ! with a comment
$
$ROAD_CRG
REFERENCE_LINE_INCREMENT = 0.5   ! step
* LONG_SECTION_V_INCREMENT = 9
{v}$
$KD_Definition
#:{form}
D:reference line phi,rad
{channels}$
$$$$
"""
ELEVATIONS = np.round(1e6 * HEIGHTS, 7)
ELEVATIONS[2, 0] = ELEVATIONS[5, 10] = np.nan


def road(form, v="LONG_SECTION_V_INCREMENT = 0.25\n", heights=ELEVATIONS):
    """An OpenCRG file of heights, with a channel of headings before them."""
    named = "".join(f"D:long section {j + 1},m\n" for j in range(heights.shape[1]))
    header = ROAD.format(form=form, v=v, channels=named).encode()
    rows = np.concatenate([np.full((len(heights), 1), 0.01), heights], axis=1)
    double = form[1] == "D"
    if form[2] == "B":
        values = rows.ravel()
        values = np.concatenate([values, np.full(-len(values) % (10 if double else 20), np.nan)])
        return header + values.astype(">f8" if double else ">f4").tobytes()
    width, each = (20, 4) if double else (10, 8)
    lines = []
    for row in rows:
        cells = [f"{v:{width}.7f}" if np.isfinite(v) else "*missing*".rjust(width) for v in row]
        lines += ["".join(cells[i : i + each]) for i in range(0, len(cells), each)]
    return header + "\n".join(lines).encode() + b"\n"


@pytest.mark.parametrize("form", ["LRFI", "LDFI", "KRBI", "KDBI"])
def test_roads(tmp_path, form):
    path = write(tmp_path, road(form), "a.crg")
    check(path, ELEVATIONS, (NX * 0.5, NY * 0.25), rtol=1e-5)


DAMAGED = [
    (b"LONG_SECTION_V_INCREMENT = 0.25", b""),
    (b"#:LRFI", b"#:XYZ"),
    (b"long section 3,m", b"long section 3,V"),
    (b"$$$$", b"$"),
    (b"* LONG", b"REFERENCE_LINE_START_U = 0\nREFERENCE_LINE_END_U = 30\n* LONG"),
    (b"D:long section 4,m\n", b""),
]


@pytest.mark.parametrize("old, new", DAMAGED)
def test_damaged_roads_are_refused_by_name(tmp_path, old, new):
    assert old in road("LRFI")
    with pytest.raises(ValueError, match=r"a\.crg"):
        read_surface(write(tmp_path, road("LRFI").replace(old, new), "a.crg"))


def test_damaged_files_are_refused_by_name(tmp_path):
    stream = io.BytesIO()
    np.savez_compressed(stream, heights=HEIGHTS)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("z", data=RNG.normal(size=(64, 64)), compression="gzip")
    packed = (tmp_path / "a.h5").read_bytes()
    for name, content in [
        ("a.npz", stream.getvalue()[:-300]),
        ("b.npz", stream.getvalue()[:200] + bytes(40) + stream.getvalue()[240:]),
        ("a.npy", b"\x93NUMPY\1\0" + bytes(20)),
        ("a.h5", packed[: len(packed) // 2]),
        ("b.h5", packed[:5000] + bytes(99) + packed[5099:]),
        ("a.sur", b"DIGITAL SURF" + bytes(900)),
        ("a.dat", RNG.bytes(4000)),
    ]:
        with pytest.raises((ValueError, ImportError), match=name):
            read_surface(write(tmp_path, content, name), **BOTH)
    with pytest.raises(FileNotFoundError):
        read_surface(tmp_path / "c.npy")
    with pytest.raises(ValueError, match="folder"):
        read_surface(tmp_path)


with_library = pytest.mark.skipif(
    importlib.util.find_spec("SurfaceTopography") is None, reason="the extra io is not installed"
)


@with_library
def test_instruments_have_the_first_line_at_the_top(tmp_path):
    """A file of GelSight and TrueMap, in millimetres: the lines of a picture."""
    head = b"Binary TrueMap Data File v2.0\r\n\0" + b"Created by TrueMap v6\r\n\0"
    sizes = struct.pack("<2I4f", NX, NY, 1e3 * SIZE[0], 1e3 * SIZE[1], 0.0, 0.0)
    content = head + sizes + (1e3 * LINES).astype("<f4").tobytes()
    check(write(tmp_path, content, "a.tmd"), rtol=1e-5)


MEASURED = [
    ("bcrf-1.bcrf", {}, (960, 600), 2.424e-8),
    ("di-5.di", {}, (512, 512), 1.426e-9),
    ("matrix-2.txt", {}, (650, 650), 2.741e-7),
    ("matrix-3.txt", {}, (256, 256), 3.203e-8),
    ("sur-2.sur", {}, (563, 484), 1.670e-8),
    ("hfm-1.hfm", {}, (9600,), 3.419e-7),
    ("mi-1.mi", {"channel": "Topography"}, (256, 256), 3.284e-9),
    (
        "belgian_block_open.npz",
        {"channel": "heights", "size": (5.0, 3.08), "unit": "m"},
        (500, 308),
        2.22e-2,
    ),
]


@with_library
@pytest.mark.skipif(not DATA.exists(), reason="the measured files lie beside the repository")
@pytest.mark.parametrize("name, options, shape, rms", MEASURED)
def test_measured_surfaces(name, options, shape, rms):
    surface = read_surface(DATA / "surfaces" / name, **options)
    assert surface.heights.shape == shape
    np.testing.assert_allclose(np.std(surface.heights), rms, rtol=2e-3)
    if options:
        with pytest.raises(NotPlain):
            read_surface(DATA / "surfaces" / name)
