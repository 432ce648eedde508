import re
import sys
from pathlib import Path

import jax
import numpy as np
import pytest
from scene_texts import damaged

from graded_contact import read_surface, surface_from_heights
from graded_contact.fields.grid import Grid
from graded_contact.surfaces.random_surface import random_surface
from graded_contact.surfaces.reading_steps import step
from graded_contact.surfaces.spectrum import SelfAffine
from graded_contact.surfaces.statistics import statistics

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


def test_spikes_around_large_holes_are_reported_and_discarded_on_request():
    path, third = _measured("frt-2.frt"), [0, 0.03, 0.04, 0.05]
    spiky = read_surface(path, region=third, fill="harmonic")
    assert any("Filled 1844 missing points" in n and "see `rim=1`" in n for n in spiky.history)
    assert any("25% of the points were not measured" in text for text in spiky.caveats)
    assert any("rms heights from the mean" in text for text in spiky.caveats)
    surface = read_surface(path, region=third, rim=1, fill="harmonic")
    assert not any("stand out" in note for note in surface.history)
    assert statistics(surface).rms_height < 3e-7  # without the spikes of 3e-4 m


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("di-5.di", 100_000), ("sur-2.sur", 9000), ("matrix-3.txt", 400_000), ("frt-2.frt", 3000),
        ("hfm-1.hfm", 100_000), ("belgian_block_open.npz", 3000),
    ],
)  # fmt: skip
def test_truncated_files_are_refused_by_name(name, kept, tmp_path):
    path = tmp_path / name
    path.write_bytes(_measured(name).read_bytes()[:kept])
    with pytest.raises(ValueError, match=name):
        read_surface(path)


def test_what_a_file_states_is_not_overridden_and_a_channel_must_be_of_heights():
    path = _measured("di-5.di")
    one, two = read_surface(path, channel="ZSensor"), read_surface(path, channel=0)
    np.testing.assert_array_equal(one.heights, two.heights)
    for options, message in [
        ({"unit": "um"}, "leave out `unit='um'`"),
        ({"size": 1e-5}, "leave out `size`"),
        ({"channel": "PeakForceError"}, "is not a length"),
        ({"channel": "Height"}, r"pass `channel`, one of \['ZSensor', .*, not 'Height'"),
    ]:
        with pytest.raises(ValueError, match=message):
            read_surface(path, **options)


# Invented files and arrays


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, r"pass `unit`, for instance 'um', and `size` \[m\]"),
        ({"size": 1.0, "unit": "nm", "region": [0, 2, 0, 1]}, "must lie in the map"),
        ({"size": 1.0, "unit": "furlong"}, "`unit='furlong'` is not a length"),
        ({"size": -1.0, "unit": "nm"}, "`size=-1` is refused"),
        ({"size": [1.0, 1.0, 1.0], "unit": "nm"}, r"`size` has shape \(3,\)"),
        ({"size": 1.0, "unit": "nm", "periodic": "taper"}, "`periodic='taper'` must be"),
        ({"size": 1.0, "unit": "nm", "rim": -1}, "`rim=-1` must be a whole number"),
        ({"size": 1.0, "unit": "nm", "shape": (8,)}, "2 whole numbers are needed"),
    ],
)
def test_bad_options_are_refused(options, message, tmp_path):
    np.save(tmp_path / "map.npy", _rough((8, 8)))
    with pytest.raises(ValueError, match=message):
        read_surface(tmp_path / "map.npy", **options)


def test_what_is_no_file_of_heights_is_refused_by_name(tmp_path, monkeypatch):
    pytest.importorskip("SurfaceTopography")
    with pytest.raises(FileNotFoundError, match=r"absent\.sur"):
        read_surface(tmp_path / "absent.sur")
    (tmp_path / "noise.bin").write_bytes(bytes(range(256)) * 4)
    (tmp_path / "empty.txt").write_bytes(b"")
    for name in ("noise.bin", "empty.txt", ""):
        with pytest.raises(ValueError, match=re.escape(f"`path={tmp_path / name}`")):
            read_surface(tmp_path / name, unit="m", size=1.0)
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    with pytest.raises(ImportError, match=r"pip install graded_contact\[io\]"):
        read_surface(tmp_path / "noise.bin")


def test_the_window_falls_to_zero_and_keeps_the_rms_height():
    values = _rough(shape := (50, 64))
    surface = surface_from_heights(values, 1.0, periodic="window")
    level, heights = _levelled(values), np.asarray(surface.heights)
    np.testing.assert_allclose(np.std(heights), np.std(level), rtol=1e-12)
    inner = tuple(slice(n // 10 + 1, n - n // 10 - 1) for n in shape)
    a, b = (v[inner] - np.mean(v[inner]) for v in (heights, level))
    factor = np.vdot(a, b) / np.vdot(b, b)
    np.testing.assert_allclose(a, factor * b, atol=1e-12 * np.std(a))
    assert f"by {factor:.4g} to keep" in surface.history[-1]
    edge = np.take(heights, 0, 0) - np.take(heights, -1, 0)
    assert np.max(np.abs(edge)) < 0.2 * np.std(heights)


@pytest.mark.parametrize("shape", [(60,), (50, 64)])
def test_joined_edges_meet_and_keep_slope_and_interior(shape):
    """The joint solves Laplace's equation off the edges, checked on the five-point stencil."""
    values = _rough(shape)
    size = np.array([1.0, 0.4])[: len(shape)]
    surface = surface_from_heights(values, size)
    level, heights = _levelled(values), np.asarray(surface.heights)
    spacing = size / shape
    slopes = [step("", h, spacing).rms_slope for h in (heights, level)]
    np.testing.assert_allclose(*slopes, rtol=1e-12)
    # A factor that rounds to 1 is not told.
    told = re.search(r"multiplied the heights by (\S+) to", surface.history[-1])
    factor = float(told.group(1)) if told else 1.0
    assert told is None or told.group(1) != "1"
    joint = level - heights / factor
    inner = (slice(1, -1),) * len(shape)
    bent = [np.diff(joint, 2, axis) / d**2 for axis, d in enumerate(spacing)]
    bent = sum(np.moveaxis(b, a, 0)[(..., *inner[1:])] if a == 0 else b[1:-1]
               for a, b in enumerate(bent))  # fmt: skip
    scale = np.max(np.abs(np.diff(level, 2, 0))) / np.min(spacing) ** 2
    np.testing.assert_allclose(bent, 0, atol=1e-3 * scale)  # the factor is printed to 4 digits
    for axis in range(len(shape)):
        seam = np.take(heights, 0, axis) - np.take(heights, -1, axis)
        inside = np.diff(heights, axis=axis)
        assert np.sqrt(np.mean(seam**2)) < 2 * np.sqrt(np.mean(inside**2))
    assert surface.steps[-1].name == "joined" and surface.measured is None


def test_a_form_without_roughness_is_not_blown_up():
    """A saddle leaves little when its edges are joined: its slope must not go into the rest."""
    x = np.linspace(-1, 1, 64)
    rough = surface_from_heights(1e3 * _rough((64, 64)), 1.0)
    surface = surface_from_heights(1e3 * _rough((64, 64)) + np.outer(x, x), 1.0)
    factor = float(re.search(r"heights by (\S+) to", surface.history[-1]).group(1))
    assert factor == 1.1
    assert rough.caveats == () and any("when joined" in text for text in surface.caveats)


def test_a_periodic_surface_is_unchanged_even_if_a_plane_fits_it_and_a_tilt_refused():
    x = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    values = np.sin(x)[:, None] + 0.3 * np.cos(3 * x)[None, :] + 5.0
    surface = surface_from_heights(values, 1.0, periodic=None)
    np.testing.assert_allclose(surface.heights, values - 5.0, atol=1e-14)
    assert surface.history == ("Taken as periodic.",)
    with pytest.raises(ValueError, match=r"Along y the heights jump by"):
        surface_from_heights(values + 2 * x, 1.0, periodic=None)


def test_holes_are_filled_harmonically():
    """x² - y² solves Laplace's equation, on the lattice too."""
    x, y = np.meshgrid(np.arange(16.0), np.arange(20.0), indexing="ij")
    values = x**2 - y**2
    hole = (abs(x - 8) < 3) & (abs(y - 9) < 4)
    holed = np.ma.array(values, mask=hole)
    surface = surface_from_heights(holed, [16.0, 20.0], periodic="mirror", fill="harmonic")
    filled = np.asarray(surface.heights)[:16, :20] - values
    plane = _levelled(filled)
    np.testing.assert_allclose(plane, 0, atol=1e-9)
    assert f"Filled {hole.sum()} missing points" in surface.history[2]
    np.testing.assert_array_equal(np.asarray(surface.measured)[:16, :20], ~hole)
    with pytest.raises(ValueError, match="pass `fill='low'`"):
        surface_from_heights(holed, [16.0, 20.0], fill=None)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.full((8, 8), np.nan), "`heights` has 0 measured points"),
        (np.add.outer(np.arange(8.0), 2 * np.arange(9.0)), "no roughness is left"),
        (np.zeros((4, 4, 4)), "one or two whole numbers"),
    ],
)
def test_heights_without_a_surface_in_them_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        surface_from_heights(values, 1.0)


def _holed():
    """A rough surface of which a border and islands, 31 %, are missing; and its mask."""
    spectrum = SelfAffine(rms_slope=0.2, hurst=0.8, q_low=6.3e3, q_roll=1.9e4, q_high=1e5)
    surface = random_surface(spectrum, Grid((96, 96), 1e-3), jax.random.key(1))
    heights = np.array(surface.heights)
    x, y = np.meshgrid(np.arange(96), np.arange(96), indexing="ij")
    missing = (x < 7) | (y >= 85) | (x >= 91)
    for cx, cy, r in [(22, 30, 8), (53, 68, 10), (71, 22, 7), (45, 45, 5), (75, 70, 6)]:
        missing |= (x - cx) ** 2 + (y - cy) ** 2 < r**2
    heights[missing] = np.nan
    return heights, missing


def test_filled_holes_lie_lower_than_their_rims_whose_spikes_are_caveats():
    heights, missing = _holed()
    surface = surface_from_heights(heights, 1e-3, periodic="mirror")
    tile = np.asarray(surface.heights)[:96, :96]
    near = [np.roll(missing, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    assert np.max(tile[missing]) < np.max(tile[~missing & np.any(near, axis=0)])
    assert np.mean(tile[missing]) < np.mean(tile[~missing]) - np.std(tile[~missing])
    np.testing.assert_array_equal(np.asarray(surface.measured)[:96, :96], ~missing)
    assert any("31% of the points" in text for text in surface.caveats)
    rng = np.random.default_rng(0)
    rims = np.argwhere(~missing & (np.roll(missing, 1, 0) | np.roll(missing, 1, 1)))
    for i, j in rng.permutation(rims)[:20]:
        heights[i, j] += 1e-3 * rng.exponential()
    caveats = surface_from_heights(heights, 1e-3).caveats
    assert any("rms heights from the mean" in text for text in caveats)


def test_the_largest_measured_part_is_named_and_can_be_cut_out():
    heights, missing = _holed()
    note = next(n for n in surface_from_heights(heights, 1e-3).history if "`region=" in n)
    region = [float(v) for v in re.search(r"region=\[(.*?)\]", note).group(1).split(",")]
    best = 0  # by brute force: the widest run of each pair of rows
    for i in range(96):
        whole = np.ones(96, bool)
        for j in range(i, 96):
            whole &= ~missing[j]
            runs = np.diff(np.flatnonzero(~np.concatenate([[False], whole, [False]]))) - 1
            best = max(best, (j + 1 - i) * int(runs.max()))
    cut = surface_from_heights(heights, 1e-3, region=region, periodic="mirror")
    assert np.prod(cut.grid.shape) == 4 * best
    assert cut.measured is None and cut.caveats == ()
    first = np.rint(np.array(region) / (1e-3 / 96)).astype(int)
    part = heights[first[0] : first[1], first[2] : first[3]]
    nx, ny = part.shape
    np.testing.assert_allclose(cut.heights[:nx, :ny], _levelled(part), atol=1e-15)
    np.testing.assert_allclose(cut.grid.size, 2e-3 * np.array(part.shape) / 96)


def test_every_step_of_reading_has_its_roughness():
    heights, missing = _holed()
    surface = surface_from_heights(
        heights, 1e-3, region=[0, 0.75e-3, 0, 1e-3], shape=(24, 32), periodic="window"
    )
    names = [row.name for row in surface.steps]
    assert names == ["read", "cropped", "tilt removed", "filled", "tapered", "resampled"]
    read, cropped, _, filled, tapered, resampled = surface.steps
    np.testing.assert_allclose(read.rms_height, np.nanstd(heights))
    np.testing.assert_allclose(read.missing, np.mean(missing))
    np.testing.assert_allclose(cropped.rms_height, np.nanstd(heights[:72]))
    assert filled.missing == 0
    np.testing.assert_allclose(tapered.rms_height, filled.rms_height)
    np.testing.assert_allclose(resampled.rms_height, np.std(surface.heights))
    assert any("when resampled" in text for text in surface.caveats)
    assert surface.measured.shape == (24, 32)
    # The window marks its flanks.
    flank = np.sin(np.pi / 2 * (3 + 0.5) / 9.6) ** 2  # 96 points, the fourth from the edge
    whole = surface_from_heights(np.nan_to_num(heights), 1e-3, periodic="window")
    np.testing.assert_allclose(whole.measured[3, 48], flank, rtol=1e-12)


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


@pytest.mark.parametrize("word", ["NaN", "---", "", "inf"])
def test_words_between_the_numbers_are_missing_points(tmp_path, word):
    h, _ = _texts()
    cells = [[f"{v:g}" for v in row] for row in h.T[::-1]]
    cells[3][2] = cells[1][4] = word
    (tmp_path / "map.csv").write_text("\n".join(map(",".join, cells)))
    surface = read_surface(tmp_path / "map.csv", unit="um", size=1e-5, periodic="mirror")
    assert any(f"Missing points are written {word!r}." in note for note in surface.history)
    expected = np.ones((6, 5))
    expected[2, 1] = expected[4, 3] = 0
    np.testing.assert_array_equal(surface.measured[:6, :5], expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2,3\n4,5\n6,7,8\n", "line 2 has 2 cells, those before it 3"),
        ("1,2,3,4\n1,2,3x,4\n" * 4, "line 2 holds '3x', which is no number"),
        ("0,12\n1,15\n2,9\n4,7\n", "commas may be decimal marks or separate two columns"),
        ("0,12,1,05,2,71\n0,31,1,99,2,03\n" * 3, "decimal marks and to separate columns too"),
        (" \n", "it is empty"),
        ("0 1\n5 2\n1 3\n7 1\n3 4\n", "goes back and forth"),
        ("0 0 1\n1 0.3 2\n5 7 1\n2.2 3 9\n4 5.1 2\n", "form no grid"),
        ("0 3 1 4\n2 5 9 2\n4 6 5 3\n6 8 9 7\n8 3 2 3\n", "an axis. remove it"),
    ],
)
def test_texts_that_could_be_read_in_two_ways_or_in_none_are_refused(tmp_path, text, message):
    (tmp_path / "map.txt").write_text(text)
    with pytest.raises(ValueError, match=message):
        read_surface(tmp_path / "map.txt", unit="um", size=1e-5)


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


def test_an_unequal_line_scan_is_interpolated_and_its_gaps_are_missing(tmp_path):
    """A parabola on jittered positions, with one gap; units in the heading differ."""
    rng = np.random.default_rng(0)
    x = np.arange(60) + rng.uniform(-0.2, 0.2, 60)
    x[30:] += 9
    z = 0.01 * x**2 + np.sin(x)
    lines = [f"{a:.6f};{b:.6f}".replace(".", ",") for a, b in zip(x, z, strict=True)]
    (tmp_path / "line.csv").write_text("Weg [mm];Höhe [µm]\n" + "\n".join(lines))
    surface = read_surface(tmp_path / "line.csv", periodic="mirror")
    assert any("are not equally spaced: interpolated linearly" in n for n in surface.history)
    assert [s.name for s in surface.steps[:2]] == ["read", "equally spaced"]
    num = surface.grid.shape[0] // 2
    step = float(surface.grid.spacing[0])
    np.testing.assert_allclose(step, 1e-3 * np.median(np.diff(x)), rtol=1e-5)
    at = 1e-3 * x[0] + step * np.arange(num)
    lost = np.asarray(surface.measured)[:num] == 0
    np.testing.assert_array_equal(lost, (at > 1e-3 * x[29]) & (at < 1e-3 * x[30]))
    truth = 1e-6 * np.interp(1e3 * at, x, z)
    apart = (np.asarray(surface.heights)[:num] - truth)[~lost]
    line = np.polyval(np.polyfit(at[~lost], apart, 1), at[~lost])
    np.testing.assert_allclose(apart, line, atol=1e-11)


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
    surface = read_surface(tmp_path / "a.crg", periodic="mirror", fill="harmonic")
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


def test_long_sections_at_unequal_distances_are_interpolated(tmp_path):
    v = [-1.5, -1.25, -1.0, 0.0, 1.0, 1.25, 1.5]
    heights = np.random.default_rng(0).normal(size=(8, 7)).round(4)
    (tmp_path / "a.crg").write_bytes(_road("LRFI", heights, v))
    surface = read_surface(tmp_path / "a.crg", periodic="mirror")
    np.testing.assert_allclose(surface.grid.size, [8.0, 2 * 13 * 0.25])
    assert any("interpolated linearly to 13 equally spaced" in n for n in surface.history)
    even = np.stack([np.interp(np.arange(13) * 0.25 - 1.5, v, row) for row in heights])
    np.testing.assert_allclose(surface.heights[:8, :13], _levelled(even), atol=1e-7)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"LONG_SECTION_V_INCREMENT = 0.25", b"", "no distance between its long sections"),
        (b"#:LRFI", b"#:XYZ", "its format 'XYZ' is not known"),
        (b"long section 3,m", b"long section 3,V", "not all in one unit of length"),
        (b"$$$$", b"$", "its header does not end"),
        (b"* LONG", b"REFERENCE_LINE_START_U = 0\nREFERENCE_LINE_END_U = 9.5\n* LONG", "9 of 20 r"),
    ],
)
def test_damaged_roads_are_refused(tmp_path, old, new, message):
    content = _road("LRFI", 1e3 * _rough((9, 11)), "LONG_SECTION_V_INCREMENT = 0.25\n")
    assert old in content
    (tmp_path / "a.crg").write_bytes(content.replace(old, new))
    with pytest.raises(ValueError, match=message):
        read_surface(tmp_path / "a.crg")


@pytest.mark.parametrize("end", ["", "$$$$\n"])
def test_a_road_that_refers_to_another_file_names_it(tmp_path, end):
    text = "$CT\nlayers\n$ROAD_CRG_FILE\n* the elevations\n$FOLDER/wet.crg ! of 2005\n$\n"
    (tmp_path / "a.crg").write_text(text.replace("$FOLDER", "rough") + end)
    with pytest.raises(ValueError, match=r"in another OpenCRG file, 'rough/wet.crg': read that"):
        read_surface(tmp_path / "a.crg")


@pytest.mark.slow
def test_no_damage_to_a_file_brings_a_reader_down(tmp_path):
    """400 damaged texts, roads and arrays: read, or refused with `ValueError`."""
    rng = np.random.default_rng(20240601)
    originals = [(text.encode(), arguments, "a.txt") for _, text, arguments in _texts()[1]]
    for form in ("LRFI", "LDFI", "KRBI", "KDBI"):
        road = _road(form, 1e3 * _rough((9, 11)), "LONG_SECTION_V_INCREMENT = 0.25\n")
        originals += 3 * [(road, {}, "a.crg")]
    np.savez(tmp_path / "a.npz", _rough((8, 9)))
    content = (tmp_path / "a.npz").read_bytes()
    originals.append((content, {"unit": "um", "size": 1e-5}, "a.npz"))
    refused = 0
    for case in range(400):
        content, arguments, name = originals[case % len(originals)]
        (tmp_path / name).write_bytes(damaged(content, rng))
        try:
            assert np.all(np.isfinite(read_surface(tmp_path / name, **arguments).heights))
        except ValueError as error:
            refused += 1
            assert "`path=" in str(error) or "`size" in str(error)
    assert 80 < refused < 400
