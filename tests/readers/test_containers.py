"""Heights in bundles of arrays, workbooks and zips, and limits on what these unpack to."""

import codecs
import cProfile
import hashlib
import io
import os
import struct
import sys
import tempfile
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from test_instrument_exports import workbook

from graded_contact import read_moduli, read_surface
from graded_contact.core import files
from graded_contact.readers import cells

SIZE = (4e-3, 3e-3)
RNG = np.random.default_rng(0)
SECRET = RNG.normal(size=(24, 24))
HEIGHTS = 1e-5 * np.cumsum(np.cumsum(RNG.normal(size=(40, 30)), 0), 1) / 40


def mirrored(path, **options):
    """The heights as read, without the plane that reading subtracts."""
    surface = read_surface(path, periodic="mirror", **options)
    np.testing.assert_allclose(surface.grid.size, 2 * np.array(SIZE), rtol=1e-12)
    return np.asarray(surface.heights)[:40, :30]


@pytest.fixture
def expected(tmp_path):
    np.save(tmp_path / "plain.npy", HEIGHTS)
    return mirrored(tmp_path / "plain.npy", unit="m", size=SIZE)


def same(found, expected):
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.std(expected))


@pytest.mark.parametrize(
    "arrays",
    [
        {"heights": HEIGHTS, "unit": "m", "size": SIZE},
        {"heights": 1e6 * HEIGHTS, "unit": "um", "size": SIZE},
        {"z_nm": 1e9 * HEIGHTS, "pixel_size_um": 100.0},
        {"z": HEIGHTS, "Unit": "m", "size": HEIGHTS.shape, "spacing": 1e-4},  # a number of points
        {"z": HEIGHTS, "unit": "m", "size": SIZE, "about": np.array({"by": "me"}, dtype=object)},
    ],
)  # fmt: skip
def test_unit_and_size_in_a_bundle_are_used(tmp_path, expected, arrays):
    np.savez(tmp_path / "a.npz", **arrays)
    same(mirrored(tmp_path / "a.npz"), expected)


def test_arguments_override_a_bundle_and_two_readings_are_refused(tmp_path, expected):
    np.savez(tmp_path / "a.npz", z=HEIGHTS, unit="mm", size=(1.0, 2.0))
    same(mirrored(tmp_path / "a.npz", unit="m", size=SIZE), expected)
    np.savez(tmp_path / "c.npz", z=HEIGHTS, unit="m", size=SIZE, pixel_size_um=200.0)
    with pytest.raises(ValueError, match="'size' and 'pixel_size_um' contradict each other; pass"):
        read_surface(tmp_path / "c.npz")
    # Slopes are usual both with an edge of 5 m and of 5 mm.
    np.savez(tmp_path / "b.npz", z=1e5 * HEIGHTS, unit="mm", size=5.0)
    with pytest.raises(ValueError, match=r"its 'size' may be in 'm' or in 'mm'; pass `size` \[m\]"):
        read_surface(tmp_path / "b.npz")


def test_a_scratch_workbook_of_heights_is_read(tmp_path, expected):
    path, table = tmp_path / "a.xlsx", (1e6 * HEIGHTS.T[::-1]).tolist()
    workbook(path, {"Sheet1": table, "Sheet2": [], "notes": [["measured on Monday"]]})
    same(mirrored(path, unit="um", size=SIZE), expected)
    workbook(path, {"a": [[], [None, "Height in µm"], *([None, *row] for row in table)]})
    same(mirrored(path, size=SIZE), expected)
    (tmp_path / "a.zip").write_bytes(zipped({"a.xlsx": path.read_bytes()}))
    same(mirrored(tmp_path / "a.zip", size=SIZE), expected)
    workbook(path, {"one": table, "two": table})
    with pytest.raises(ValueError, match=r"several sheets.*pass `channel`, one of \['one', 'two'"):
        read_surface(path, unit="um", size=SIZE)
    same(mirrored(path, unit="um", size=SIZE, channel="two"), expected)


MAIN = """<?xml version="1.0" encoding="UTF-8"?>
<p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2"><Record1>
<Revision>ISO5436 - 2000</Revision><FeatureType>SUR</FeatureType><Axes>
<CX><AxisType>I</AxisType><DataType>D</DataType><Increment>1e-4</Increment><Offset>0</Offset></CX>
<CY><AxisType>I</AxisType><DataType>D</DataType><Increment>1e-4</Increment><Offset>0</Offset></CY>
<CZ><AxisType>A</AxisType><DataType>D</DataType></CZ></Axes></Record1><Record3>
<MatrixDimension><SizeX>40</SizeX><SizeY>30</SizeY><SizeZ>1</SizeZ></MatrixDimension>
<DataLink><PointDataLink>bindata/data.bin</PointDataLink>
<MD5ChecksumPointData>{}</MD5ChecksumPointData></DataLink></Record3>
<Record4><ChecksumFile>md5checksum.hex</ChecksumFile></Record4></p:ISO5436_2>"""


def zipped(files):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()


def x3p(folder=""):
    data = HEIGHTS.T[::-1].astype("<f8").tobytes()
    main = MAIN.format(hashlib.md5(data).hexdigest())
    checksum = hashlib.md5(main.encode()).hexdigest()
    return zipped({
        f"{folder}main.xml": main, f"{folder}bindata/data.bin": data,
        f"{folder}md5checksum.hex": f"{checksum} *main.xml",
    })  # fmt: skip


def test_an_x3p_is_read_also_in_a_zip_of_which_several_files_need_a_choice(tmp_path, expected):
    pytest.importorskip("SurfaceTopography")
    path = tmp_path / "a.zip"
    nested = zipped({"a/b/scan.x3p": x3p("scan/"), "__MACOSX/a/._scan.x3p": b"junk"})
    for content in (x3p(), nested):
        path.write_bytes(content)
        same(mirrored(path), expected)
    path.write_bytes(zipped({"a.x3p": x3p(), "b.x3p": x3p("b/")}))
    with pytest.raises(ValueError, match=r"pass `channel`, one of \['a.x3p', 'b.x3p'\]"):
        read_surface(path)
    same(mirrored(path, channel="b.x3p"), expected)


def test_a_name_in_a_zip_opens_no_file_of_the_machine(tmp_path):
    """The name of a workbook in a zip is chosen by anybody; the workbook itself is read."""
    secret, book = tmp_path / "secret.txt", tmp_path / "book.xlsx"
    np.savetxt(secret, HEIGHTS)
    workbook(book, {"a": [*map(list, 2 * HEIGHTS)]})
    (tmp_path / "drop.zip").write_bytes(zipped({str(secret): book.read_bytes()}))
    read = {"size": SIZE, "unit": "m", "periodic": "mirror"}
    found = read_surface(tmp_path / "drop.zip", **read)
    np.testing.assert_allclose(found.heights, read_surface(book, **read).heights)


def test_a_damaged_x3p_and_a_zip_in_itself_are_refused(tmp_path):
    pytest.importorskip("SurfaceTopography")
    damaged = x3p().replace(b"bindata/data.bin", b"bindata/none.bin")
    (tmp_path / "a.x3p").write_bytes(damaged)
    with pytest.raises(ValueError, match=r"a\.x3p"):
        read_surface(tmp_path / "a.x3p")
    nested = zipped({"end.txt": b"words"})
    for _ in range(9):
        nested = zipped({"inner.zip": nested})
    nested += bytes(2 * (20 + int(len(nested) ** 0.5)) ** 2 - len(nested))  # a tile of heights?
    (tmp_path / "deep.zip").write_bytes(nested)
    with pytest.raises(ValueError, match="too many zips in one another"):
        read_surface(tmp_path / "deep.zip")


# Small files of a large cost, and files that refer to others


def bomb_npz(path):
    np.savez_compressed(path, np.zeros((8000, 8000), "i1"))


def bomb_zip_of_text(path):
    path.write_bytes(zipped({"a.dat": b"1 2 3 4\n" * 2_000_000}))


def bomb_zips_in_a_zip(path):
    path.write_bytes(zipped({"a.zip": zipped({"a.dat": b"1 2 3 4\n" * 2_000_000})}))


def bomb_many_files(path):
    path.write_bytes(b"PK\3\4" + b"PK\1\2" * 60_000)


def bomb_other_method(path):
    """The size that an entry states limits what "deflate" unpacks, but not what bzip2 does."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("a.dat", bytes(1000))


def bomb_hdf5(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("z", (16000, 16000), "f8", chunks=(1000, 1000), compression="gzip")


def bomb_mat(path):
    savemat(path, {"z": np.zeros((2600, 2600))}, do_compression=True)


def bomb_row(path):
    sheet(path, b'<row r="2000000000"><c><v>1</v></c></row>')


def bomb_rows(path):
    sheet(path, b"<row><c><v>1</v></c></row>" * 500_000)


def sheet(path, rows, head=lambda head: head):
    """A workbook with these rows."""
    workbook(path, {"a": [[1.0]]})
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    name = "xl/worksheets/sheet1.xml"
    start = head(files[name].partition(b"<sheetData>")[0])
    files[name] = start + b"<sheetData>" + rows + b"</sheetData></worksheet>"
    path.write_bytes(zipped(files))


def understated(content, stated):
    """A zip whose first entry states a smaller size, with a checksum of so many bytes."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entry = archive.infolist()[0]
        start = zlib.crc32(archive.read(entry)[:stated])
    forged = bytearray(content)
    for mark, at in ((b"PK\1\2", 16), (b"PK\3\4", 14)):
        place = content.index(mark) + at  # of the checksum; the sizes follow
        struct.pack_into("<I", forged, place, start)
        struct.pack_into("<I", forged, place + 8, stated)
    return bytes(forged)


def forged_zip(path):
    path.write_bytes(understated(zipped({"a.dat": b"1 2 3 4\n" * 20_000_000}), 8000))


def forged_npz(path):
    np.savez_compressed(path, z=np.zeros((4000, 4000)))
    path.write_bytes(understated(path.read_bytes(), 8000))


def forged_workbook(path):
    workbook(path, {"a": [[1.0]]})
    content = path.read_bytes()
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    large = {"xl/worksheets/sheet1.xml": files.pop("xl/worksheets/sheet1.xml") + bytes(10**8)}
    path.write_bytes(understated(zipped(large | files), 500))


def forged_hdf5(path):
    """A chunk of 16 numbers that unpacks to 100 MB."""
    with h5py.File(path, "w") as file:
        made = file.create_dataset("z", (4, 4), "f8", chunks=(4, 4), compression="gzip")
        made.id.write_direct_chunk((0, 0), zlib.compress(bytes(10**8)))


def forged_texts(path):
    """30,000 texts of a megabyte each, of which the file has one."""
    with h5py.File(path, "w") as file:
        made = file.create_dataset("words", (2,), h5py.string_dtype(), chunks=(2,))
        made[0] = "x" * 2**19
        made[1] = "y" * 2**19
        entry = made.id.read_direct_chunk((0,))[1][:16]  # length, and where the text lies
        packed = zlib.compress(30_000 * entry)
        kind = h5py.string_dtype()
        many = file.create_dataset("z", (30_000,), kind, chunks=(30_000,), compression="gzip")
        many.id.write_direct_chunk((0,), packed)


def bomb_mat_of_a_small_window(path):
    """A stream of zlib may begin with other bytes than the usual ones."""
    savemat(path, {"z": np.zeros((4, 4))}, do_compression=True)
    head = path.read_bytes()[:128]
    packer = zlib.compressobj(9, zlib.DEFLATED, 10)
    stream = packer.compress(bytes(10**8)) + packer.flush()
    path.write_bytes(head + struct.pack("<II", 15, len(stream)) + stream)


BOMBS = {
    "a.npz": bomb_npz, "a.zip": bomb_zip_of_text, "b.zip": bomb_zips_in_a_zip,
    "c.zip": bomb_many_files, "d.zip": bomb_other_method, "a.h5": bomb_hdf5, "a.mat": bomb_mat,
    "a.xlsx": bomb_row, "b.xlsx": bomb_rows, "e.zip": forged_zip, "e.npz": forged_npz,
    "e.xlsx": forged_workbook, "e.h5": forged_hdf5, "f.h5": forged_texts,
    "b.mat": bomb_mat_of_a_small_window,
}  # fmt: skip


@pytest.fixture
def unpacked(monkeypatch):
    """The bytes that zlib unpacks in Python's own code."""
    sizes, real = [], zlib.decompressobj

    class Counting:
        def __init__(self, *args):
            self.stream = real(*args)

        def __getattr__(self, name):
            return getattr(self.stream, name)

        def decompress(self, *args):
            part = self.stream.decompress(*args)
            sizes.append(len(part))
            return part

    monkeypatch.setattr(zlib, "decompressobj", Counting)
    return sizes


@pytest.mark.parametrize("name", BOMBS)
def test_a_small_file_of_a_large_cost_is_refused_at_once(tmp_path, monkeypatch, name, unpacked):
    """By the calls, the bytes unpacked and the bytes of memory that the refusal takes."""
    pytest.importorskip("SurfaceTopography")
    monkeypatch.setattr(cells, "MOST_ROWS", 1000)
    path = tmp_path / name
    BOMBS[name](path)
    assert path.stat().st_size < 1.2e6
    reads = [lambda: read_surface(path, unit="m", size=1e-3)]
    reads += [lambda: read_moduli(path)] * name.endswith("xlsx")
    refused = rf"{name}` is refused: (its?|an?) "
    for read in reads:
        unpacked.clear()
        tracemalloc.start()
        try:
            with cProfile.Profile() as calls, pytest.raises(ValueError, match=refused):
                read()
            assert tracemalloc.get_traced_memory()[1] < 1e8
            assert sum(entry.callcount for entry in calls.getstats()) < 1e6
            assert sum(unpacked) < 1.5 * files.UNPACKED
        finally:
            tracemalloc.stop()


def test_what_is_hardly_packed_may_be_large(tmp_path, monkeypatch):
    monkeypatch.setattr(files.may_unpack, "__defaults__", (1e3,))
    heights = np.round(1e9 * HEIGHTS).astype("i2")
    np.savez_compressed(tmp_path / "a.npz", z=heights)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("z", data=heights, compression="gzip")
    for name in ("a.npz", "a.h5"):
        read_surface(tmp_path / name, unit="nm", size=SIZE)


@pytest.mark.parametrize("kind", ["external", "virtual", "link"])
def test_hdf5_that_refers_to_another_file_is_refused(tmp_path, kind):
    """HDF5 would return the bytes of that file as heights."""
    pytest.importorskip("SurfaceTopography")
    refer(tmp_path, kind, tmp_path / "a.h5")
    with pytest.raises(ValueError, match=r"a\.h5` is refused: its .*'g/z' refers to another file"):
        read_surface(tmp_path / "a.h5", unit="m", size=1e-3)
    whole = (tmp_path / "a.h5").read_bytes()
    (tmp_path / "a.zip").write_bytes(zipped({"a.h5": whole}))
    with pytest.raises(ValueError, match="refers to another file"):
        read_surface(tmp_path / "a.zip", unit="m", size=1e-3)


def refer(folder, kind, path, **options):
    """Writes HDF5 of which a dataset or a link is in the file "secret" of the folder."""
    secret = folder / "secret"
    with h5py.File(secret, "w") as file:
        file["z"] = SECRET
    with h5py.File(path, "w", **options) as file:
        if kind == "external":
            start = secret.read_bytes().index(SECRET.tobytes())
            file.create_dataset(
                "g/z", SECRET.shape, "f8", external=[(secret, start, SECRET.nbytes)]
            )
        elif kind == "link":
            file["g/z"] = h5py.ExternalLink(secret, "z")
        else:
            layout = h5py.VirtualLayout(SECRET.shape, "f8")
            layout[:] = h5py.VirtualSource(secret, "z", SECRET.shape)
            file.create_virtual_dataset("g/z", layout)


def odd_hdf5(draw, folder, path):
    """Writes HDF5 of groups, datasets and links; whether any of them is to the secret."""
    told = draw.integers(2) == 0
    if told:
        refer(folder, ("external", "virtual", "link")[draw.integers(3)], path)
    options = {"userblock_size": int(draw.choice([0, 512, 4096]))} if not told else {}
    with h5py.File(path, "a" if told else "w", **options) as file:
        for i in range(draw.integers(0 if told else 1, 5)):
            shape = tuple(int(n) for n in draw.integers(1, 40, size=draw.integers(1, 4)))
            packed = {"compression": "gzip"} if draw.integers(2) else {}
            place = f"{'/'.join('g' * draw.integers(1, 4))}/{i}"
            file.create_dataset(place, data=draw.normal(size=shape), **packed)
            if draw.integers(3) == 0:
                file[f"soft{i}"] = h5py.SoftLink(draw.choice(["/g/z", "/nowhere", f"/soft{i}"]))
            if draw.integers(3) == 0:
                file[f"hard{i}"] = file["g" if draw.integers(2) else place]
    return told


def check_hdf5_cases(cases, folder):
    """Reads odd HDF5: what refers to the secret is refused, and Python opens no other file."""
    opened = []

    def hook(event, given):
        if watching and event == "open" and isinstance(given[0], str | bytes | os.PathLike):
            opened.append(os.fsdecode(given[0]))

    watching = False
    odd = folder / "odd.h5"
    sys.addaudithook(hook)
    for case in cases:
        draw = np.random.default_rng([20261, case])
        told = odd_hdf5(draw, folder, odd)
        opened.clear()
        watching = True
        try:
            read_surface(odd, unit="m", size=1e-3, channel=0, periodic="mirror")
            assert not told, case
        except ValueError as error:
            assert not told or "refers to another file" in str(error), (case, error)
        finally:
            watching = False
        assert {*opened} <= {str(odd)}, (case, opened)


def test_odd_hdf5_opens_no_other_file(tmp_path):
    """`python tests/readers/test_containers.py 2000` reads 2,000 of them."""
    pytest.importorskip("SurfaceTopography")
    read_anything(tmp_path)
    check_hdf5_cases(range(60), tmp_path)


def read_anything(folder):
    """Python opens the modules of the readers, and of codes of letters, before."""
    for code in ("latin-1", "utf-16", "utf-32"):
        codecs.lookup(code)
    with h5py.File(folder / "first.h5", "w") as file:
        file["z"] = SECRET
    read_surface(folder / "first.h5", unit="m", size=1e-3)


def test_a_workbook_whose_cells_lie_far_apart_is_refused_in_seconds(tmp_path):
    """Rows padded to the stated width would be 17e9 cells."""
    path = tmp_path / "a.xlsx"
    rows = b'<row r="1"><c r="A1"><v>1</v></c></row><row r="900"><c r="XFD900"><v>2</v></c></row>'
    cell = b'<row r="%d"><c r="A%d"><v>1</v></c></row>'
    rows += b"".join(cell % (r, r) for r in range(901, 1300))
    sheet(path, rows, lambda head: head.replace(b'ref="A1"', b'ref="A1:XFD1048576"'))
    with pytest.raises(ValueError, match=r"has more than 1048576 rows or 5e\+06 cells"):
        read_moduli(path)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        read_anything(Path(scratch))
        check_hdf5_cases(range(int(sys.argv[1])), Path(scratch))
