"""Heights in the layouts that people have: counters, units, columns, grids of maps, HDF5.

One map has cells of 6.4 um, an rms height of 0.1 um; every layout must give its size and slope.
"""

import struct

import h5py
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from graded_contact import read_surface, surface_from_heights
from graded_contact.fields.grid import Grid
from graded_contact.readers.length_headings import units_in
from graded_contact.scenes.collect import surface_variables
from graded_contact.scenes.results import surface_of
from graded_contact.surfaces.random_surface import random_surface
from graded_contact.surfaces.rescaling import resample, rescale
from graded_contact.surfaces.spectrum import SelfAffine
from graded_contact.surfaces.surface import Surface

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


def framed(labels_x, labels_y, corner="", lines=LINES):
    head = ",".join([corner, *(f"{label:g}" for label in labels_x)])
    return f"{head}\n{rows(lines, labels=labels_y)}"


# Counters


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("layout", ["both", "columns", "lines", "names"])
def test_counters_of_a_data_frame_are_no_coordinates(tmp_path, layout, first):
    count = np.arange(N) + first
    numbers = ",".join(map(str, count))
    names = "," + ",".join(f"c{i}" for i in count)
    text = {
        "both": framed(count, count),
        "columns": f"{numbers}\n{rows(LINES)}",
        "lines": rows(LINES, labels=count),
        "names": f"{names}\n{rows(LINES, labels=count)}",
    }[layout]
    refused(tmp_path, text, r"points are counted beside it; pass `size` \[m\]", unit="um")
    check(read(tmp_path, text, unit="um", size=SIZE))


def test_counted_lines_that_a_data_frame_dropped_are_missing(tmp_path):
    kept = np.delete(np.arange(N), [3, 9])
    surface = read(tmp_path, framed(np.arange(N), kept, lines=LINES[kept]), unit="um", size=SIZE)
    missing = np.asarray(surface.measured)[:N, :N] == 0
    np.testing.assert_array_equal(np.flatnonzero(missing[0]), [N - 10, N - 4])
    np.testing.assert_allclose(surface.grid.size, 2 * SIZE, rtol=1e-6)


def test_whole_numbers_with_a_unit_or_another_step_are_coordinates(tmp_path):
    count = np.arange(N)
    up = LINES.T  # y has its own direction
    for text, options, edge in [
        (framed(count, count, "x [mm] \\ z [µm]"), {}, N * 1e-3),
        ("z in um, x and y in mm\n" + framed(count, count), {}, N * 1e-3),
        (framed(10 * count, 10 * count), {"unit": "um"}, N * 1e-5),
    ]:
        check(read(tmp_path, text, **options), up, edge)
    refused(tmp_path, "# unit: um\n" + framed(count, count), r"pass `size` \[m\]")


@pytest.mark.parametrize("separator", [",", "\t", ";"])
@pytest.mark.parametrize("columns", ["col{}", "{}"])
def test_labels_in_words_count_the_points_and_a_size_is_asked_for(tmp_path, columns, separator):
    head = separator.join(["", *(columns.format(i) for i in range(N))])
    lines = rows(LINES, separator).splitlines()
    text = "\n".join([head, *(f"row{i}{separator}{line}" for i, line in enumerate(lines))])
    refused(tmp_path, text, r"the edge lengths of a matrix of heights.*; pass .*`size`")
    surface = read(tmp_path, text, unit="um", size=SIZE)
    check(surface)
    assert "Left out the labels of its lines, such as 'row0'." in surface.history
    refused(tmp_path, "a\n" + "row one,1\n" * 9, r"no table of numbers; it ends with \['row one'")


@pytest.mark.parametrize(("edge", "unit"), [("{:.4f} mm", 1e-3), ("{:g}µm", 1e-6)])
def test_lengths_with_a_unit_beside_a_matrix_are_its_coordinates(tmp_path, edge, unit):
    apart = [edge.format(i * SIZE / N / unit) for i in range(N)]
    lines = rows(LINES).splitlines()
    body = "\n".join(f"{y},{line}" for y, line in zip(apart, lines, strict=True))
    for corner, options in (("", {"unit": "um"}), ("z [um]", {})):
        check(read(tmp_path, ",".join([corner, *apart]) + "\n" + body, **options), LINES.T)
    refused(tmp_path, ",".join(["", *apart]) + "\n" + body, "unit of the heights of a matrix")
    named = ",".join(["", *(f"col{i}" for i in range(N))])
    refused(
        tmp_path, f"{named}\n{body}", "lengths of one unit are needed along both axes", unit="um"
    )
    uneven = ",".join(["", *apart]).replace(apart[3], edge.format(3.5 * SIZE / N / unit))
    refused(tmp_path, f"{uneven}\n{body}", "not equally spaced", unit="um")


def test_counters_in_lists_of_points_are_no_positions(tmp_path):
    points = np.stack([X.ravel(), Y.ravel(), LINES.ravel()], 1)
    for text in ("x,y,z\n" + rows(points), rows(points), rows(points, labels=np.arange(N * N))):
        refused(tmp_path, text, r"positions count the points; pass `size`", unit="um")
        check(read(tmp_path, text, unit="um", size=SIZE), LINES)
    points[:, :2] *= STEP
    check(read(tmp_path, ",x,y,z\n" + rows(points, labels=np.arange(N * N)), unit="um"), LINES)
    line = np.stack([np.arange(N), LINES[0]], 1)
    refused(tmp_path, "x,z\n" + rows(line), r"pass `size` \[m\]", unit="um")
    assert read(tmp_path, "x [um],z [um]\n" + rows(line)).grid.size[0] == pytest.approx(2e-6 * N)
    assert read(tmp_path, rows(line), unit="um", columns={"x": 1, "z": 2}).grid.size[
        0
    ] == pytest.approx(2e-6 * N)


# Units


@pytest.mark.parametrize(
    ("line", "heights", "lengths", "shared"),
    [
        ("x [mm] \\ z [µm]", "um", "mm", None),
        ("x [mm] / z [nm]", "nm", "mm", None),
        ("x, y in mm; z in um", "um", "mm", None),
        ("# x_um z_nm", "nm", "um", None),
        ("x y z [um]", "um", "um", None),
        ("heights in nm, axes in µm", "nm", "um", None),
        ("unit: um", None, None, "um"),
        ("Height: 10 um", None, None, None),  # a size
        ("range of z [um]", None, None, None),
        ("heights in:", None, None, None),
        ("Z [V]", "V", None, None),
    ],
)
def test_a_unit_counts_for_what_is_named_before_it(line, heights, lengths, shared):
    assert units_in([line]) == (heights, lengths, shared)


def test_each_stated_unit_counts_and_no_option_overrides_it(tmp_path):
    line = np.stack([STEP * np.arange(N), LINES[0]], 1)
    for text in ("X [in],Z [mil]\n", "X (inch),Z (thou)\n", "X,Z\nin,mil\n"):
        surface = read(tmp_path, text + rows(line))
        assert surface.grid.size[0] == pytest.approx(2 * N * STEP * 0.0254)
        height = surface.steps[0].rms_height
        np.testing.assert_allclose(height, 2.54e-5 * np.std(LINES[0]), rtol=1e-5)
        same = read(tmp_path, text + rows(line), unit="mil")
        np.testing.assert_array_equal(same.heights, surface.heights)
        for unit in ("in", "um"):
            refused(tmp_path, text + rows(line), f"leave out `unit='{unit}'`", unit=unit)
    # A unit fills what the file leaves open, and nothing else.
    surface = read(tmp_path, "X [mm],Z\n" + rows(line), unit="nm")
    assert surface.grid.size[0] == pytest.approx(2 * N * STEP * 1e-3)
    assert surface.steps[0].rms_height == pytest.approx(1e-9 * np.std(LINES[0]), rel=1e-5)
    for heading, kind in (("X [mm],Z [V]", "V"), ("t [s],Z [um]", "s")):
        refused(tmp_path, f"{heading}\n{rows(line)}", f"in '{kind}' is not a length", unit="um")


def test_a_size_fills_an_open_unit_of_positions_and_must_have_their_proportions(tmp_path):
    text = framed(2.5 * np.arange(N), 2.5 * np.arange(N))
    check(read(tmp_path, text, unit="um", size=SIZE), LINES.T)
    refused(tmp_path, text, "its edges are as", unit="um", size=(SIZE, 2 * SIZE))


def test_a_unit_where_axes_cross_is_a_caveat_for_the_heights(tmp_path):
    text = framed(STEP * np.arange(N), STEP * np.arange(N), "um")
    surface = read(tmp_path, text)
    check(surface, LINES.T)
    assert surface.assumed == surface.caveats
    assert surface.assumed == ("The heights are in 'um', as x and y; otherwise pass `unit`.",)
    surface = read(tmp_path, text, unit="nm")
    assert not surface.assumed
    check(surface, LINES.T, unit=1e-9)


def test_the_unit_of_edges_alone_is_asked_for_by_name_and_does_not_scale_the_heights(tmp_path):
    def silent(file):
        file["height"] = LINES
        attributes(file["height"], units="um", dx=2e-7, dy=2e-7)

    def sized(file):
        file["height"] = LINES
        attributes(file["height"], units="um", size=[SIZE, SIZE])

    asked = r"the unit of the edges 6\.4e-06.* of .*pass `size` \[m\], or the `unit` of these edges"
    for fill in (silent, sized):
        with pytest.raises(ValueError, match=asked + "; the heights are in 'um'"):
            hdf5(tmp_path, fill)
        check(hdf5(tmp_path, fill, size=SIZE), LINES)
        surface = hdf5(tmp_path, fill, unit="m")
        check(surface, LINES)
        assert any("`unit='m'` counts for its edges alone" in note for note in surface.history)
        with pytest.raises(ValueError, match="states 'um'; leave out `unit='nm'`"):
            hdf5(tmp_path, fill, size=SIZE, unit="nm")
    line = np.stack([STEP * np.arange(N), LINES[0]], 1)
    text = "z in um\n" + rows(line, " ")
    refused(tmp_path, text, r"the unit of the edges 6\.4 of a line scan; pass `size`")
    surface = read(tmp_path, text, unit="mm")
    assert surface.grid.size[0] == pytest.approx(2e-3 * N * STEP)
    assert surface.steps[0].rms_height == pytest.approx(1e-6 * np.std(LINES[0]), rel=1e-5)
    refused(tmp_path, rows(line), r"the unit of the heights and of the edges 6\.4 of a line scan")


@pytest.mark.parametrize("size", ["4mm", b"4", [1e-3, "4mm"]])
def test_a_size_in_words_is_refused_with_what_is_allowed(tmp_path, size):
    refused(tmp_path, rows(LINES), r"`size=.*4.*must be a positive number \[m\]", size=size)


def test_an_array_of_three_axes_is_refused_by_its_shape(tmp_path):
    np.save(tmp_path / "a.npy", np.stack([LINES, LINES]))
    match = r"3 axes, its shape is \(2, 32, 32\): heights have one axis or two"
    with pytest.raises(ValueError, match=match):
        read_surface(tmp_path / "a.npy", unit="um", size=(SIZE, SIZE))


# Columns


def profile(names, *, index=False, words=False):
    line = np.stack([STEP * np.arange(N), LINES[0]], 1)
    text = rows(line, labels=np.arange(N) if index else None)
    text = text.replace("\n", ",good\n") if words else text
    return f"{names}\n{text}" if names else text


def test_names_tell_the_columns_of_a_profile(tmp_path):
    alone = read(tmp_path, profile("x [um],z [um]"))
    swapped = rows(np.stack([LINES[0], STEP * np.arange(N)], 1))
    for text, unit in [
        (profile(",Distance [um],Height (measured) [um]", index=True), None),
        (profile("No.,Weg (µm),Höhe (µm)", index=True), None),
        (profile("", index=True), "um"),
        (profile("x [um],z [um],note", words=True), None),
        ("Height [um],Position [um]\n" + swapped, None),
    ]:
        np.testing.assert_array_equal(read(tmp_path, text, unit=unit).heights, alone.heights)


def test_columns_are_chosen_by_name_or_number(tmp_path):
    alone = read(tmp_path, profile("x [um],z [um]"))
    text = profile("n,way,trace,note", index=True, words=True)
    refused(tmp_path, text, "no table of numbers", unit="um")
    refused(tmp_path, profile("n,way,trace", index=True), "choose by `columns`", unit="um")
    for columns in ({"x": "way", "z": "trace"}, {"x": 2, "z": 3}, {"x": "WAY", "z": 3}):
        surface = read(tmp_path, text, unit="um", columns=columns)
        np.testing.assert_array_equal(surface.heights, alone.heights)
    np.save(tmp_path / "a.npy", LINES)
    for options, match in [
        ({"columns": {"x": "way"}}, "must name x and z"),
        ({"columns": {"z": 0}}, "numbers from 1"),
        ({"columns": {"x": 2, "z": 2}}, "must name different columns"),
        ({"columns": {"x": "way", "z": "absent"}}, r"no line has the columns .*'absent'"),
        ({"columns": {"x": 2, "z": 9}}, "no table of numbers"),
    ]:
        refused(tmp_path, text, match, unit="um", **options)
    with pytest.raises(ValueError, match="leave out `columns`"):
        read_surface(tmp_path / "a.npy", unit="um", size=SIZE, columns={"z": 1})


# Grids of maps

ESRI = "ncols 32\nnrows 32\nxllcorner 7.5\nyllcorner -3\ncellsize 0.2\nNODATA_value -9999\n"


def test_an_esri_grid_is_in_metres_unless_given_and_its_mark_is_missing(tmp_path):
    holed = LINES.copy()
    holed[2, 5] = -9999
    surface = read(tmp_path, ESRI + rows(holed, " "), "a.asc")
    assert surface.assumed[0].startswith("The map is in metres") and len(surface.assumed) == 1
    missing = np.asarray(surface.measured)[:N, :N] == 0
    np.testing.assert_array_equal(np.argwhere(missing), [[5, N - 3]])
    np.testing.assert_allclose(surface.grid.size, 2 * N * STEP)
    whole = rows(LINES, " ")
    check(read(tmp_path, ESRI + whole, unit="um"))
    steps = ESRI.replace("cellsize 0.2", "dx 0.2\ndy 0.2").replace("corner", "center").upper()
    check(read(tmp_path, steps + whole.replace("\n", " "), unit="um"))
    check(read(tmp_path, ESRI + whole, unit="um", size=SIZE))  # a map in degrees has no length
    for text, match in [
        (ESRI + whole[:-12], "heights for 32 x 32 points"),
        (ESRI.replace("cellsize 0.2\n", "") + whole, "no dx or cellsize above 0"),
        (ESRI + whole.replace("0.", "a.", 1), "its heights are no numbers"),
    ]:
        refused(tmp_path, text, match)


def test_without_its_mark_an_esri_grid_has_the_standards_and_nan_is_a_mark(tmp_path):
    holes = np.random.default_rng(2).random((N, N)) < 0.3
    silent = ESRI.replace("NODATA_value -9999\n", "")
    for head, mark, caveat in [
        (silent, -9999, f"{np.sum(holes)} heights of -9999 count as missing"),
        (ESRI.replace("-9999", "nan"), np.nan, None),
        (ESRI.replace("-9999", "-1"), -1, None),
    ]:
        surface = read(tmp_path, head + rows(np.where(holes, mark, LINES), " "), unit="um")
        missing = np.asarray(surface.measured)[:N, :N] == 0
        np.testing.assert_array_equal(missing, holes[::-1].T)
        assert [text.startswith(caveat) for text in surface.assumed] == [True] * bool(caveat)
    surface = read(tmp_path, silent + rows(LINES, " "), unit="um")  # it has none
    check(surface)
    assert not surface.assumed


@pytest.mark.parametrize("mark", [-9999.0, 32767.0, 0.0])
def test_equal_heights_far_from_all_others_are_a_caveat_in_any_format(tmp_path, mark):
    lines = LINES + 20
    lines[4:7, 5] = mark
    np.save(tmp_path / "a.npy", lines)
    options = {"unit": "um", "size": SIZE, "periodic": "mirror"}
    with_mark = [
        read(tmp_path, rows(lines), **options),
        read_surface(tmp_path / "a.npy", **options),
        read(tmp_path, ESRI.replace("-9999", "-1") + rows(lines, " "), **options),
    ]
    for surface in with_mark:
        assert surface.measured is None  # all are
        told = [text for text in surface.assumed if "like marks of missing points" in text]
        assert len(told) == 1 and told[0] in surface.history
        assert told[0].startswith(f"3 heights of {mark:g} lie far from all")
        assert "otherwise write NaN there" in told[0] and told[0] in surface.caveats
    for honest in (LINES, np.sign(LINES), np.where(lines == mark, 20.5, lines)):
        assert not read(tmp_path, rows(honest), **options).assumed


def surfer(kind, values):
    """A grid of Surfer; its first line is the lowest, and its nodes lie on the edges."""
    end, ends = STEP * (N - 1), (values.min(), values.max())
    if kind == "DSAA":
        head = f"DSAA\n{N} {N}\n0 {end}\n0 {end}\n{ends[0]} {ends[1]}\n"
        return (head + rows(values, " ")).encode()
    if kind == "DSBB":
        head = struct.pack("<2h6d", N, N, 0, end, 0, end, *ends)
        return b"DSBB" + head + values.astype("<f4").tobytes()
    grid = struct.pack("<i2i8d", 72, N, N, 0, 0, STEP, STEP, *ends, 0, 1.70141e38)
    data = struct.pack("<i", 8 * N * N) + values.astype("<f8").tobytes()
    return b"DSRB" + struct.pack("<2i", 4, 1) + b"GRID" + grid + b"DATA" + data


@pytest.mark.parametrize("kind", ["DSAA", "DSBB", "DSRB"])
def test_grids_of_surfer_ask_for_a_unit_and_their_blanks_are_missing(tmp_path, kind):
    refused(tmp_path, surfer(kind, LINES), "pass `unit`", "a.grd")
    check(read(tmp_path, surfer(kind, LINES), "a.grd", unit="um"), LINES.T)
    holed = LINES.copy()
    holed[2, 5] = 1.70141e38
    missing = np.asarray(read(tmp_path, surfer(kind, holed), "a.grd", unit="um").measured)[:N, :N]
    np.testing.assert_array_equal(np.argwhere(missing == 0), [[5, 2]])
    refused(tmp_path, surfer(kind, LINES)[:-40], "heights", "a.grd", unit="um")


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


def test_a_scale_of_a_group_is_used_and_one_that_is_not_understood_is_named(tmp_path):
    def group(file):
        file["heights"], file["scale"] = LINES * 1e3, 1e-3
        attributes(file, unit="um", dx=STEP, dy=STEP)

    surface = hdf5(tmp_path, group)
    check(surface, LINES)
    assert surface.assumed[0].startswith("The scale 0.001 of their group is that of the heights")

    def sensitive(file):
        file["heights"] = LINES
        attributes(file["heights"], unit="um", dx_um=STEP, dy_um=STEP, sensitivity=3.0)

    assert "['sensitivity'] do not scale the heights" in hdf5(tmp_path, sensitive).caveats[0]


def test_a_mask_is_no_default_channel_and_what_hdf5_does_not_state_is_asked(tmp_path):
    def bare(file):
        file["data"], file["valid"] = LINES, LINES > 0

    with pytest.raises(ValueError, match=r"dataset 'data'; pass `unit`.*, and `size`"):
        hdf5(tmp_path, bare)
    surface = hdf5(tmp_path, bare, unit="um", size=SIZE)
    check(surface, LINES)
    assert "['valid'] may mark points that were not measured" in surface.caveats[0]
    for names, match in [
        (("quality", "mask"), r"\['mask', 'quality'\] are no heights"),
        (("a", "b"), r"several datasets that may be heights; pass `channel`, one of \['a', 'b'\]"),
    ]:
        with pytest.raises(ValueError, match=match):
            hdf5(tmp_path, lambda file, names=names: file.update(dict.fromkeys(names, LINES)))
    surface = hdf5(tmp_path, bare, unit="um", size=SIZE, channel="valid")  # asked for by name
    assert surface.steps[0].rms_height == pytest.approx(1e-6 * np.std(LINES > 0))


# Bytes that nothing tells to be heights


@pytest.mark.parametrize("name", ["a.png", "a.npz", "a.csv", "a.h5", "a.dat", "N00E000.hgt"])
def test_bytes_without_a_mark_are_refused_whatever_their_name_and_length(tmp_path, name):
    pytest.importorskip("SurfaceTopography")
    rng = np.random.default_rng(4)
    for length in (50, 20_000, 20_402):
        for content in (rng.bytes(length), np.arange(length // 2, dtype="<i2").tobytes()):
            refused(tmp_path, content, "is refused", name, unit="um", size=1e-5)
    for content in (rng.bytes(20_000), *(LINES.astype(form).tobytes() for form in ("f4", "f8"))):
        match = r"numpy\.fromfile.*numpy\.save"
        refused(tmp_path, content, match, name, unit="um", size=1e-5)


@pytest.mark.parametrize(
    ("start", "kind"),
    [(b"\x89PNG\r\n\x1a\n", "PNG"), (b"\xff\xd8\xff\xe0", "JPEG"), (b"GIF89a", "GIF"),
     (b"RIFF\0\0\0\0WEBP", "WebP"), (b"%PDF-1.7", "PDF"),
     (b"BM" + bytes(12) + b"\x28\0\0\0", "BMP")],
)  # fmt: skip
def test_a_picture_is_refused_by_name_also_if_it_is_called_otherwise(tmp_path, start, kind):
    content = start + np.random.default_rng(0).bytes(20_000 - len(start))
    for name in ("a.png", "a.npz", "a.h5"):
        refused(tmp_path, content, rf"picture or document \({kind}\)", name, unit="um", size=1e-5)


# Jumps between lines


def rough(seed=0, shape=(64, 64), stretch=1.0):
    """A random surface whose spectrum is stretched along x by a factor."""
    rng = np.random.default_rng(seed)
    qx, qy = (np.fft.fftfreq(n) * n for n in shape)
    q = np.hypot(stretch * qx[:, None], qy)
    amplitude = np.where(q > 0, np.maximum(q, 1) ** -1.8, 0)
    heights = np.real(np.fft.ifft2(np.fft.fft2(rng.normal(size=shape)) * amplitude))
    return 1e-7 * heights / np.std(np.diff(heights, axis=1))


def slope_of(heights, size):
    spacing = np.array(size) / heights.shape
    squares = [np.mean((np.diff(heights, axis=a) / d) ** 2) for a, d in enumerate(spacing)]
    return np.sqrt(sum(squares))


@pytest.mark.parametrize("lines", ["x", "y"])
@pytest.mark.parametrize("kind", ["shifts", "walk"])
def test_jumps_between_lines_are_a_caveat_and_levelling_takes_them_out(tmp_path, kind, lines):
    honest, size = rough(seed=3), (1.3e-5, 1.3e-5)
    shifts = 1e-7 * np.random.default_rng(1).normal(size=64)
    jumped = honest + (np.cumsum(shifts) if kind == "walk" else shifts)
    honest, jumped = (h if lines == "x" else h.T for h in (honest, jumped))
    surface = surface_from_heights(jumped, size)
    (caveat,) = surface.caveats
    assert caveat == surface.assumed[0] and f"jump from line to line along {lines}" in caveat
    assert f"pass `level_lines='{lines}'`" in caveat
    level = surface_from_heights(jumped, size, level_lines=lines)
    assert not level.caveats
    names = [step.name for step in level.steps]
    assert names == ["read", "lines levelled", "tilt removed", "joined"]
    assert any(f"Shifted each line along {lines} by the median" in note for note in level.history)
    # What is constant along the lines is lost with the jumps.
    assert level.steps[1].rms_slope == pytest.approx(slope_of(honest, size), rel=0.05)
    assert surface.steps[1].rms_slope > 1.1 * slope_of(honest, size)
    np.savez(tmp_path / "a.npz", z=jumped, unit="m", size=size)
    read_again = read_surface(tmp_path / "a.npz", level_lines=lines)
    np.testing.assert_allclose(read_again.heights, level.heights, atol=1e-12)


def test_honest_surfaces_have_no_jumps_between_lines():
    rng = np.random.default_rng(0)
    y = np.arange(64)
    ruts = 3e-6 * np.exp(-(((y - 20) / 6) ** 2)) + 1e-6 * np.cos(2 * np.pi * y / 12)
    spectrum = SelfAffine(rms_slope=0.2, hurst=0.8, q_low=6.3e3, q_roll=1.9e4, q_high=1e5)
    drawn = random_surface(spectrum, Grid((64, 64), 1e-3), jax.random.key(1)).heights
    groove = 5e-7 * rough(7, (64, 64), 1e9)[:1] / 1e-7  # along the whole of x, rough across
    honest = {
        "white": [1e-7 * rng.normal(size=(n, m)) for n, m in [(24, 24), (64, 64), (40, 128)]],
        "isotropic": [rough(seed) for seed in range(4)] + [np.asarray(drawn)],
        "lay": [rough(seed, stretch=s) for seed in range(2) for s in (3.0, 10.0, 30.0, 100.0)],
        "ruts": [rough() + ruts, rough() + groove],
        "holes": [np.where(rng.random((64, 64)) < 0.3, np.nan, rough())],
        "cut": [rough(0, (200, 200))[:50, :64]],
    }
    for kind, maps in honest.items():
        for heights in maps:
            for lines in (heights, heights.T):
                found = surface_from_heights(lines, (1e-5, 1e-5))
                assert not any("jump" in text for text in found.caveats), kind


def test_lines_of_a_profile_or_with_holes(tmp_path):
    with pytest.raises(ValueError, match="`level_lines='x'` is refused: a profile is one line"):
        surface_from_heights(rough()[0], 1e-5, level_lines="x")
    holed = rough() + 1e-7 * np.random.default_rng(1).normal(size=64)
    holed[:, 7] = np.nan
    holed[10:20, 30:40] = np.nan
    assert any("jump" in text for text in surface_from_heights(holed, 1e-5).caveats)
    assert not surface_from_heights(holed, 1e-5, level_lines="x").assumed


def test_what_was_assumed_stays_with_a_surface_and_in_results():
    heights = jnp.asarray(rough())
    surface = Surface(heights, Grid((64, 64), 1e-5), assumed=("It is in metres.", "It jumps."))
    assert surface.caveats == surface.assumed
    for changed in (rescale(surface, rms_slope=0.1), resample(surface, (32, 32))):
        assert changed.assumed == surface.assumed
    import xarray

    stored = xarray.Dataset(*surface_variables(surface))
    assert surface_of(stored).caveats == surface.caveats
    del stored.attrs["surface_assumed"]  # as in files of older versions
    assert surface_of(stored).assumed == ()
    given = surface_from_heights(rough(), 1e-5, assumed=("It is in metres.",))
    assert given.caveats[0] == "It is in metres."
