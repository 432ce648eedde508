from pathlib import Path

import numpy as np
import pytest

from graded_contact import read_surface

DATA = Path(__file__).parents[3] / "shared" / "data" / "surfaces"
ROAD = {"size": (5.0, 3.08), "unit": "m"}


def _measured(name):
    if not (DATA / name).exists():
        pytest.skip(f"{name} is not beside this checkout")
    return DATA / name


def _rough(shape, seed=0):
    """A rough non-periodic map with a tilt: white noise summed along each axis."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=shape)
    for axis in range(len(shape)):
        values = np.cumsum(values, axis)
    return 1e-7 * values


def _levelled(values):
    x = np.meshgrid(*[np.arange(n) for n in values.shape], indexing="ij")
    basis = np.stack([np.ones(values.size), *[c.ravel() for c in x]], axis=1)
    return values - (basis @ np.linalg.lstsq(basis, values.ravel())[0]).reshape(values.shape)


def _step_slopes(surface):
    """Forward-difference slopes inside the first tile of a mirrored surface."""
    tile = np.asarray(surface.heights)[tuple(slice(n // 2) for n in surface.grid.shape)]
    spacing = np.asarray(surface.grid.spacing)
    along = [np.sqrt(np.mean((np.diff(tile, axis=a) / d) ** 2)) for a, d in enumerate(spacing)]
    return np.std(tile), along


# Measured files: the table of RHEOLOGY.md, made with other code.


@pytest.mark.parametrize(
    ("name", "shape", "size", "height", "slopes"),
    [
        ("matrix-3.txt", (256, 256), (1e-5, 1e-5), 3.522e-8, (0.1326, 0.1392)),
        ("di-5.di", (512, 512), (1e-6, 1e-6), 1.536e-9, (0.05627, 0.06345)),
        ("tmd-1.tmd", (300, 300), (0.01896, 0.01896), 7.434e-5, (0.1179, 0.1053)),
        ("hfm-1.hfm", (9600,), (0.0048,), 2.453e-7, (0.01583,)),
        ("belgian_block_open.npz", (500, 308), (5, 3.08), 0.02271, (0.2652, 0.2202)),
    ],
)
def test_mirrored_files_have_the_tabulated_statistics(name, shape, size, height, slopes):
    options = ROAD if name.endswith("npz") else {}
    surface = read_surface(_measured(name), periodic="mirror", **options)
    assert surface.grid.shape == tuple(2 * n for n in shape)
    np.testing.assert_allclose(surface.grid.size, 2 * np.asarray(size), rtol=1e-3)
    actual, along = _step_slopes(surface)
    np.testing.assert_allclose(actual, height, rtol=1e-3)
    np.testing.assert_allclose(along, slopes, rtol=1e-3)


# Invented files and arrays


# Text


def _texts():
    """One map of 6 x 5 heights in many layouts: name, text, arguments, notes."""
    h = np.round(1e3 * _rough((6, 5)) / 1e-7) / 1e3

    def rows(separator, decimal=".", spare=""):
        return "".join(
            separator.join(f"{v:g}".replace(".", decimal) for v in row) + spare + "\n"
            for row in h.T[::-1]  # lines of a picture
        )

    x, y = np.meshgrid(2.0 * np.arange(6), 2.0 * np.arange(5), indexing="ij")
    triples = [f"{a:g},{b:g},{c:g}" for a, b, c in zip(x.flat, y.flat, h.flat, strict=True)]
    labels = "y\\x," + ",".join(map(str, range(0, 12, 2))) + "\n"
    labelled = "".join(f"{8 - 2 * j},{line}\n" for j, line in enumerate(rows(",").splitlines()))
    square = {"unit": "um", "size": (12e-6, 10e-6)}
    spaced = {"unit": "um"}
    return h, [
        ("commas", rows(","), square),
        ("commas and spaces", rows(", "), square),
        ("a comma at the end", rows(",", spare=","), square),
        ("decimal commas", rows(";", ","), square),
        ("decimal commas, tabs", rows("\t", ","), square),
        ("spaces", rows(" "), square),
        ("header", "Instrument;A 7\nHöhe in µm\n" + rows(";"), {"size": square["size"]}),
        ("comments", "# of 2024\n# unit: um\n" + rows(" "), {"size": square["size"]}),
        ("axes", labels + labelled, spaced),
        ("a unit where axes cross", labels.replace("y\\x", "um") + labelled, {}),
        ("triples", "\n".join(triples), spaced),
        ("shuffled", "\n".join(np.random.default_rng(0).permutation(triples)), spaced),
        ("units", "x [mm],y [mm],z [nm]\n" + "\n".join(triples), {}),
    ]


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_matrices_and_triples_are_read_in_any_layout(tmp_path, encoding):
    h, texts = _texts()
    for name, text, arguments in texts:
        path = tmp_path / "map.txt"
        path.write_bytes(text.encode(encoding))
        surface = read_surface(path, periodic="mirror", **arguments)
        lateral, vertical = (1e-3, 1e-9) if name == "units" else (1e-6, 1e-6)
        expected = vertical * _levelled(h)
        np.testing.assert_allclose(
            surface.grid.size, 2 * lateral * np.array([12, 10]), err_msg=name
        )
        np.testing.assert_allclose(surface.heights[:6, :5], expected, atol=1e-9 * vertical)


@pytest.mark.parametrize(
    ("text", "heights", "unit"),
    [
        ("0,5\n0,7\n0,1\n0,9\n-0,3\n0,2\n", [0.5, 0.7, 0.1, 0.9, -0.3, 0.2], "um"),
        ("# z [um]\n1 3 2 7 5 4 4 2\n", [1.0, 3, 2, 7, 5, 4, 4, 2], None),
        ("1.234,5;\n2.000,1;\n1.500;\n900,25;\n", [1234.5, 2000.1, 1500, 900.25], "um"),
        ("1 3\n2 2\n3 7\n4 5\n", [3.0, 2, 7, 5], "um"),  # points counted
    ],
)
def test_one_column_or_row_is_a_profile(tmp_path, text, heights, unit):
    (tmp_path / "line.txt").write_text(text)
    surface = read_surface(tmp_path / "line.txt", unit=unit, size=6e-6, periodic="mirror")
    expected = 1e-6 * _levelled(np.array(heights))
    np.testing.assert_allclose(surface.heights[: len(heights)], expected, atol=1e-16)


# OpenCRG

ROAD_HEADER = """$CT
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


def _road(form, heights, v):
    """An OpenCRG file of heights, with a channel of headings before them."""
    named = "".join(
        f"D:long section {j + 1},m\n" if isinstance(v, str) else f"D:long section at v = {p:g},m\n"
        for j, p in enumerate(v if not isinstance(v, str) else heights[0])
    )
    parameters = v if isinstance(v, str) else ""
    header = ROAD_HEADER.format(form=form, v=parameters, channels=named).encode()
    rows = np.concatenate([np.full((len(heights), 1), 0.01), heights], axis=1)
    if form[2] == "B":
        values = rows.ravel()
        double = form[1] == "D"
        values = np.concatenate([values, np.full(-len(values) % (10 if double else 20), np.nan)])
        return header + values.astype(">f8" if double else ">f4").tobytes()
    width, each = (10, 8) if form[1] == "R" else (20, 4)
    lines = []
    for row in rows:
        cells = [f"{v:{width}.7f}" if np.isfinite(v) else "*missing*".rjust(width) for v in row]
        lines += ["".join(cells[i : i + each]) for i in range(0, len(cells), each)]
    return header + "\n".join(lines).encode() + b"\n"


@pytest.mark.parametrize("form", ["LRFI", "LDFI", "KRBI", "KDBI"])
def test_roads_are_read_in_every_form(tmp_path, form):
    heights = np.round(1e7 * 1e4 * _rough((9, 11))) / 1e7
    heights[2, 0] = heights[5, 10] = np.nan
    (tmp_path / "a.crg").write_bytes(_road(form, heights, "LONG_SECTION_V_INCREMENT = 0.25\n"))
    surface = read_surface(tmp_path / "a.crg", periodic="mirror")
    np.testing.assert_allclose(surface.grid.size, [9.0, 5.5])
    measured = np.isfinite(heights)
    np.testing.assert_array_equal(surface.measured[:9, :11], measured)
    x, y = np.meshgrid(np.arange(9), np.arange(11), indexing="ij")
    basis = np.stack([np.ones(99), x.ravel(), y.ravel()], axis=1)[measured.ravel()]
    level = heights[measured] - basis @ np.linalg.lstsq(basis, heights[measured])[0]
    apart = np.asarray(surface.heights)[:9, :11][measured] - level
    np.testing.assert_allclose(apart, apart[0], atol=1e-8)
    assert any("slope and banking of the reference line were left out" in n
               for n in surface.history)  # fmt: skip
