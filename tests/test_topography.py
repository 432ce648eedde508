import re
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from graded_contact.grid import Grid
from graded_contact.surface import Surface, statistics
from graded_contact.topography import read_surface, surface_from_heights

DATA = Path(__file__).parents[1] / "../shared/data/surfaces"
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


def test_a_few_missing_points_change_the_tabulated_statistics_little():
    """The filling continues spikes at the rims, hence the slopes 7 % above the table."""
    surface = read_surface(_measured("sur-2.sur"), periodic="mirror")
    actual, along = _step_slopes(surface)
    np.testing.assert_allclose(actual, 1.71e-8, rtol=0.02)
    np.testing.assert_allclose(along, (0.002286, 0.002226), rtol=0.08)
    assert any("Filled 117 missing points" in note for note in surface.history)


def test_spikes_around_large_holes_are_reported_and_discarded_on_request():
    path = _measured("frt-2.frt")
    notes = read_surface(path).history
    assert any("Filled 12314 missing points" in n and "see `rim=1`" in n for n in notes)
    surface = read_surface(path, rim=1)
    assert not any("stand out" in note for note in surface.history)
    assert statistics(surface).rms_height < 3e-7  # without the spikes of 3e-4 m


@pytest.mark.parametrize("name", ["matrix-3.txt", "tmd-1.tmd", "hfm-1.hfm"])
def test_files_that_are_not_periodic_are_refused_as_such(name):
    with pytest.raises(ValueError, match="a surface that is not periodic"):
        read_surface(_measured(name), periodic=None)


def test_windowed_files_keep_their_rms_height_when_resampled():
    surface = read_surface(_measured("matrix-3.txt"), shape=(128, 128))
    assert surface.grid.shape == (128, 128)
    np.testing.assert_allclose(statistics(surface).rms_height, 3.522e-8, rtol=0.01)
    assert "Resampled" in surface.history[-1]


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("di-5.di", 500), ("di-5.di", 100_000), ("sur-2.sur", 9000), ("matrix-3.txt", 400_000),
        ("frt-2.frt", 3000), ("hfm-1.hfm", 100_000), ("tmd-1.tmd", 1000),
        ("belgian_block_open.npz", 3000),
    ],
)  # fmt: skip
def test_truncated_files_are_refused_by_name(name, kept, tmp_path):
    path = tmp_path / name
    path.write_bytes(_measured(name).read_bytes()[:kept])
    with pytest.raises(ValueError, match=name):
        read_surface(path)


def test_a_file_that_tells_its_size_or_unit_is_not_overruled():
    path = _measured("matrix-3.txt")
    with pytest.raises(ValueError, match="leave out `unit='um'`"):
        read_surface(path, unit="um")
    with pytest.raises(ValueError, match="leave out `size`"):
        read_surface(path, size=1e-5)


def test_channels_are_chosen_by_name_or_index_and_must_be_heights():
    path = _measured("di-5.di")
    one, two = read_surface(path, channel="ZSensor"), read_surface(path, channel=0)
    np.testing.assert_array_equal(one.heights, two.heights)
    with pytest.raises(ValueError, match="is not a length"):
        read_surface(path, channel="PeakForceError")
    with pytest.raises(ValueError, match="it has no `channel='Height'`, only"):
        read_surface(path, channel="Height")


# Invented files and arrays


def _saved(tmp_path, values):
    pytest.importorskip("SurfaceTopography")
    np.save(tmp_path / "map.npy", values)
    return tmp_path / "map.npy"


def test_units_and_sizes_of_a_bare_file_are_converted_to_metres(tmp_path):
    values = _rough((20, 30))
    surface = read_surface(
        _saved(tmp_path, 1e9 * values), unit="nm", size=(2e-6, 3e-6), periodic="mirror"
    )
    np.testing.assert_allclose(surface.grid.size, [4e-6, 6e-6], rtol=1e-12)
    np.testing.assert_allclose(surface.heights[:20, :30], _levelled(values), atol=1e-18)


def test_a_line_scan_of_two_columns_gives_a_profile(tmp_path):
    pytest.importorskip("SurfaceTopography")
    heights, x = 1e6 * _rough((64,)), 2.0 * np.arange(64)
    np.savetxt(tmp_path / "line.txt", np.stack([x, heights], axis=1))
    surface = read_surface(tmp_path / "line.txt", unit="um", periodic="mirror")
    assert surface.grid.shape == (128,)
    np.testing.assert_allclose(surface.grid.spacing, 2e-6, rtol=1e-10)
    np.testing.assert_allclose(surface.heights[:64], 1e-6 * _levelled(heights), atol=1e-18)
    np.savetxt(tmp_path / "line.txt", np.stack([x**1.2, heights], axis=1))
    with pytest.raises(ValueError, match="not equally spaced"):
        read_surface(tmp_path / "line.txt", unit="um")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unit": "nm"}, "it does not tell its size; pass `size`"),
        ({"size": 1.0}, "it does not tell its unit; pass `unit`"),
        ({"size": 1.0, "unit": "furlong"}, "`unit='furlong'` is not a length"),
        ({"size": 1.0, "unit": "V"}, "`unit='V'` is not a length"),
        ({"size": -1.0, "unit": "nm"}, "`size=-1` is refused"),
        ({"size": (1.0, 1.0, 1.0), "unit": "nm"}, "it needs 2 lengths"),
        ({"size": 1.0, "unit": "nm", "periodic": "taper"}, "`periodic='taper'` is refused"),
        ({"size": 1.0, "unit": "nm", "fill": "mean"}, "`fill='mean'` is refused"),
        ({"size": 1.0, "unit": "nm", "rim": -1}, "`rim=-1` is refused"),
        ({"size": 1.0, "unit": "nm", "shape": (8,)}, "2 whole numbers are needed"),
    ],
)
def test_bad_options_are_refused(options, message, tmp_path):
    path = _saved(tmp_path, _rough((8, 8)))
    with pytest.raises(ValueError, match=message):
        read_surface(path, **options)


def test_a_missing_file_an_unknown_format_and_a_folder_are_refused_by_name(tmp_path):
    pytest.importorskip("SurfaceTopography")
    with pytest.raises(FileNotFoundError, match=r"absent\.sur"):
        read_surface(tmp_path / "absent.sur")
    (tmp_path / "noise.bin").write_bytes(bytes(range(256)) * 4)
    (tmp_path / "empty.txt").write_bytes(b"")
    for name in ("noise.bin", "empty.txt", ""):
        with pytest.raises(ValueError, match=re.escape(f"`path={tmp_path / name}`")):
            read_surface(tmp_path / name, unit="m", size=1.0)


def test_without_surface_topography_the_extra_is_named(tmp_path, monkeypatch):
    (tmp_path / "map.npy").write_bytes(b"")
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    with pytest.raises(ImportError, match=r"pip install graded_contact\[io\]"):
        read_surface(tmp_path / "map.npy")


@pytest.mark.parametrize("shape", [(60,), (50, 64)])
def test_the_window_falls_to_zero_and_keeps_the_rms_height(shape):
    values = _rough(shape)
    surface = surface_from_heights(values, 1.0)
    level, heights = _levelled(values), np.asarray(surface.heights)
    np.testing.assert_allclose(np.std(heights), np.std(level), rtol=1e-12)
    inner = tuple(slice(n // 10 + 1, n - n // 10 - 1) for n in shape)
    a, b = (v[inner] - np.mean(v[inner]) for v in (heights, level))
    factor = np.vdot(a, b) / np.vdot(b, b)
    np.testing.assert_allclose(a, factor * b, atol=1e-12 * np.std(a))
    assert f"by {factor:.4g} to keep" in surface.history[-1]
    edge = np.take(heights, 0, 0) - np.take(heights, -1, 0)
    assert np.max(np.abs(edge)) < 0.2 * np.std(heights)


def test_the_mirror_keeps_every_height_in_each_tile():
    values = _rough((8, 11))
    surface = surface_from_heights(values, [1.0, 2.0], periodic="mirror")
    h = np.asarray(surface.heights)
    np.testing.assert_allclose(h[:8, :11], _levelled(values), atol=1e-20)
    np.testing.assert_array_equal(h, h[::-1])
    np.testing.assert_array_equal(h, h[:, ::-1])


def test_a_periodic_surface_is_taken_as_it_stands_even_if_a_plane_fits_it():
    x = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    values = np.sin(x)[:, None] + 0.3 * np.cos(3 * x)[None, :] + 5.0
    surface = surface_from_heights(values, 1.0, periodic=None)
    np.testing.assert_allclose(surface.heights, values - 5.0, atol=1e-14)
    assert surface.history == ("Taken as periodic.",)


def test_a_tilted_surface_is_not_periodic():
    x = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    values = np.sin(x)[:, None] + np.cos(x)[None, :] + 2 * x[None, :]
    with pytest.raises(ValueError, match=r"Along y the heights jump by"):
        surface_from_heights(values, 1.0, periodic=None)


@pytest.mark.parametrize("kind", ["masked", "nan"])
def test_holes_are_filled_harmonically(kind):
    """x² - y² solves Laplace's equation, on the lattice too."""
    pytest.importorskip("SurfaceTopography")
    x, y = np.meshgrid(np.arange(16.0), np.arange(20.0), indexing="ij")
    values = x**2 - y**2
    hole = (abs(x - 8) < 3) & (abs(y - 9) < 4)
    damaged = np.ma.array(values, mask=hole) if kind == "masked" else np.where(hole, np.nan, values)
    surface = surface_from_heights(damaged, [16.0, 20.0], periodic="mirror")
    filled = np.asarray(surface.heights)[:16, :20] - values
    plane = _levelled(filled)
    np.testing.assert_allclose(plane, 0, atol=1e-9)
    assert f"Filled {hole.sum()} missing points" in surface.history[1]
    with pytest.raises(ValueError, match="pass `fill='harmonic'`"):
        surface_from_heights(damaged, [16.0, 20.0], fill=None)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.full((8, 8), np.nan), "`heights` has 0 measured points"),
        (np.full((8, 8), 3.0), "no roughness is left"),
        (np.add.outer(np.arange(8.0), 2 * np.arange(9.0)), "no roughness is left"),
        (np.zeros((4, 4, 4)), "one or two whole numbers"),
    ],
)
def test_heights_without_a_surface_in_them_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        surface_from_heights(values, 1.0)


def test_the_history_survives_as_part_of_a_surface():
    surface = Surface(jnp.ones((4, 4)), Grid((4, 4), 1.0), ("Invented.",))
    assert surface.history == ("Invented.",)
