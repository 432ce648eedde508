"""Heights in bundles of arrays, workbooks and zips, and limits on what these unpack to."""

import hashlib
import io
import zipfile

import numpy as np
import pytest

from graded_contact import read_surface
from graded_contact.files import cells
from graded_contact.files.topography import formats

SIZE = (4e-3, 3e-3)
RNG = np.random.default_rng(0)
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


def workbook(path, sheets):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)


def test_a_scratch_workbook_of_heights_is_read(tmp_path, expected):
    path, table = tmp_path / "a.xlsx", (1e6 * HEIGHTS.T).tolist()
    workbook(path, {"Sheet1": table, "Sheet2": [], "notes": [["measured on Monday"]]})
    same(mirrored(path, unit="um", size=SIZE), expected)
    workbook(path, {"a": [[], [None, "Height in µm"], *([None, *row] for row in table)]})
    same(mirrored(path, size=SIZE), expected)
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
    data = HEIGHTS.T.astype("<f8").tobytes()
    main = MAIN.format(hashlib.md5(data).hexdigest())
    checksum = hashlib.md5(main.encode()).hexdigest()
    return zipped({
        f"{folder}main.xml": main, f"{folder}bindata/data.bin": data,
        f"{folder}md5checksum.hex": f"{checksum} *main.xml",
    })  # fmt: skip


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("plain.x3p", x3p()),
        ("both.zip", zipped({"a/b/scan.x3p": x3p("scan/"), "__MACOSX/a/._scan.x3p": b"junk"})),
    ],
)
def test_an_x3p_in_a_folder_of_a_zip_is_read(tmp_path, expected, name, content):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / name).write_bytes(content)
    same(mirrored(tmp_path / name), expected)


def test_a_zip_of_several_files_needs_a_choice(tmp_path, expected):
    pytest.importorskip("SurfaceTopography")
    path = tmp_path / "a.zip"
    path.write_bytes(zipped({"a.x3p": x3p(), "b.x3p": x3p("b/")}))
    with pytest.raises(ValueError, match=r"pass `channel`, one of \['a.x3p', 'b.x3p'\]"):
        read_surface(path)
    same(mirrored(path, channel="b.x3p"), expected)


def test_a_name_in_a_zip_opens_no_file_of_the_machine(tmp_path):
    """A workbook is read by its path; the path of one in a zip is a name that anybody chose."""
    secret, book = tmp_path / "secret.txt", tmp_path / "book.xlsx"
    np.savetxt(secret, HEIGHTS)
    workbook(book, {"a": [[1.0]]})
    (tmp_path / "drop.zip").write_bytes(zipped({str(secret): book.read_bytes()}))
    with pytest.raises(ValueError, match="it holds a workbook: unpack it first"):
        read_surface(tmp_path / "drop.zip", size=SIZE, unit="m", periodic="mirror")


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


# Files that grow


def test_what_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(formats, "UNPACKED", 1e6)
    np.savez_compressed(tmp_path / "a.npz", np.zeros((1000, 1000)))
    (tmp_path / "b.zip").write_bytes(zipped({"scan.x3p": bytes(8_000_000)}))
    workbook(tmp_path / "c.xlsx", {"a": [[1.0] * 100] * 2000})
    monkeypatch.setattr(cells, "LARGEST", 1e6)
    for name in ("a.npz", "b.zip", "c.xlsx"):
        with pytest.raises(ValueError, match=r"unpack to [\d.]+ MB, and at most 1 MB are read"):
            read_surface(tmp_path / name, unit="m", size=1e-3)


def test_a_workbook_whose_cells_lie_far_apart_is_refused_in_seconds(tmp_path):
    """Rows padded to the stated width would be 17e9 cells."""
    path = tmp_path / "a.xlsx"
    workbook(path, {"a": [[1.0]]})
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    sheet = "xl/worksheets/sheet1.xml"
    head, _, _ = files[sheet].partition(b"<sheetData>")
    head = head.replace(b'ref="A1"', b'ref="A1:XFD1048576"')
    rows = b'<row r="1"><c r="A1"><v>1</v></c></row><row r="900"><c r="XFD900"><v>2</v></c></row>'
    cell = b'<row r="%d"><c r="A%d"><v>1</v></c></row>'
    rows += b"".join(cell % (r, r) for r in range(901, 1300))
    files[sheet] = head + b"<sheetData>" + rows + b"</sheetData></worksheet>"
    path.write_bytes(zipped(files))
    with pytest.raises(ValueError, match="has more than 5e"):
        cells.read_sheets(path)
