"""Flow through gaps against closed forms, duality and percolation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.fields.grid import resampled
from graded_contact.sliding import Fluid, gap_flow


def test_grooves_have_the_closed_forms():
    """Gap u0(1 + ε cos x): along 1 + 3ε²/2, across (1 - ε²)^{5/2}/(1 + ε²/2)."""
    ratio, mean = 0.6, 1e-6
    profile = mean * (1 + ratio * np.cos(2 * np.pi * np.arange(32) / 32))
    across = (1 - ratio**2) ** 2.5 / (1 + ratio**2 / 2)
    np.testing.assert_allclose(across, 0.277695, atol=1e-6)
    exact = mean**3 * np.array([across, 1 + 1.5 * ratio**2])
    grooves = np.repeat(profile[:, None], 8, axis=1)
    for gap, size in ((grooves, (1.0, 3.0)), (grooves.T, (2.0, 0.5)), (profile, 1.0)):
        found = gap_flow(gap, gc.Grid(gap.shape, size))
        expected = exact[::-1] if gap.shape == (8, 32) else exact
        np.testing.assert_allclose(found.conductance, expected, rtol=1e-7)
        assert np.all(found.percolates)


def test_checkerboard_conducts_as_the_geometric_mean():
    """Corners make the grid converge slowly."""
    errors = []
    for n in (32, 128):
        side = np.arange(n) // (n // 2)
        cube = np.where((side[:, None] + side[None]) % 2, 1.0, 10.0)
        found = gap_flow(np.cbrt(cube), gc.Grid((n, n), 1.0))
        errors.append(np.max(np.abs(found.conductance / np.sqrt(10) - 1)))
    assert errors[0] < 0.08 and errors[1] < 0.03


def test_conductance_solves_the_equation_by_dense_elimination():
    """An independent assembly, of links in series, on a cell that is not square."""
    shape, size = (6, 5), (2.0, 1.0)
    gap = np.random.default_rng(3).uniform(0.2, 1.0, shape)
    number = np.arange(gap.size).reshape(shape)
    hx, hy = size[0] / shape[0], size[1] / shape[1]
    for axis in (0, 1):
        matrix, rhs, links = np.zeros((gap.size,) * 2), np.zeros(gap.size), []
        for i, j in np.ndindex(shape):
            for direction, other in ((0, ((i + 1) % 6, j)), (1, (i, (j + 1) % 5))):
                a, b = number[i, j], number[other]
                g = 2 / (gap[i, j] ** -3 + gap[other] ** -3) * (hy / hx, hx / hy)[direction]
                rise = (hx, hy)[axis] if direction == axis else 0.0
                links.append((a, b, g, rise))
                matrix[[a, b], [a, b]] += g
                matrix[[a, b], [b, a]] -= g
                rhs[a] += g * rise
                rhs[b] -= g * rise
        p = np.linalg.lstsq(matrix, rhs)[0]
        loss = sum(g * (p[b] - p[a] + rise) ** 2 for a, b, g, rise in links)
        found = gap_flow(gap, gc.Grid(shape, size)).conductance[axis]
        np.testing.assert_allclose(found, loss / (size[0] * size[1]), rtol=1e-10)


def test_closed_gaps_and_detours():
    """A wall blocks one direction; a staircase of channels winds around, and pockets do not."""
    grid = gc.Grid((8, 8), 1.0)
    wall = np.ones((8, 8))
    wall[3] = 0.0
    found = gap_flow(wall, grid)
    assert list(found.percolates) == [False, True]
    np.testing.assert_allclose(found.conductance, [0, 7 / 8])
    pocket = np.zeros((8, 8))
    pocket[2:5, 2:5] = 1.0
    found = gap_flow(pocket, grid)
    assert not np.any(found.percolates) and not np.any(found.conductance)
    stairs = np.zeros((8, 8))
    for i in range(8):
        stairs[i, [i, (i + 1) % 8]] = 1.0
    found = gap_flow(stairs, grid)
    assert np.all(found.percolates) and np.all(found.conductance > 0.01)
    across = gap_flow(np.ones((8, 8)), grid, contact=wall == 0)
    assert list(across.percolates) == [False, True]


def test_oblique_grooves_conduct_along_themselves_however_often_they_wind():
    """K = <u³> times the squared cosine of the groove with each axis; closed between grooves."""
    grid, exact = gc.Grid((128, 128), 1e-3), np.arange(4096) / 4096
    x, y = np.meshgrid(*[np.arange(128) / 128] * 2, indexing="ij")
    mean_cube = np.mean(_groove(exact) ** 3)
    for waves in ((1, 5), (5, 1), (1, 10), (2, 5), (3, 7), (2, 15)):
        found = gap_flow(_groove(waves[0] * x - waves[1] * y), grid)
        along = np.array(waves[::-1]) / np.hypot(*waves)
        assert np.all(found.percolates)
        np.testing.assert_allclose(found.conductance, mean_cube * along**2, rtol=0.03)


def _groove(turns):
    return 1e-6 * np.maximum(np.cos(2 * np.pi * turns) + 0.3, 0)


def test_percolation_is_that_of_a_walk_on_the_plane():
    rng, grid = np.random.default_rng(1), gc.Grid((9, 6), 1.0)
    seen = set()
    for _ in range(60):
        gap = 1.0 * (rng.random(grid.shape) < rng.uniform(0.45, 0.75))
        found = tuple(map(bool, gap_flow(gap, grid).percolates))
        assert found == _walk(gap > 0)
        seen.add(found)
    assert len(seen) == 4


def _walk(is_open):
    """Whether a walk over open points comes back to one of them in another copy of the cell."""
    copies, winds = {}, [False, False]
    for start in map(tuple, np.argwhere(is_open)):
        todo = [] if start in copies else [start]
        copies.setdefault(start, (0, 0))
        while todo:
            place = todo.pop()
            for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                over, beyond = zip(*map(divmod, np.add(place, step), is_open.shape), strict=True)
                copy = tuple(np.add(copies[place], over))
                if is_open[beyond] and beyond not in copies:
                    copies[beyond] = copy
                    todo.append(beyond)
                elif is_open[beyond]:
                    winds = [
                        w or a != b for w, a, b in zip(winds, copy, copies[beyond], strict=True)
                    ]
    return tuple(map(bool, winds))


def test_derivatives_match_differences_and_batches_work():
    rng = np.random.default_rng(0)
    grid, closed = gc.Grid((16, 12), (1.0, 1.5)), rng.random((16, 12)) < 0.2
    gap, ahead = rng.random((16, 12)) + 0.2, rng.standard_normal((16, 12))

    @jax.jit
    def number(gap):
        return gap_flow(gap, grid, contact=closed).conductance @ jnp.array([1.0, 0.6])

    slope, step = jnp.sum(jax.grad(number)(gap) * ahead), 1e-5
    difference = (number(gap + step * ahead) - number(gap - step * ahead)) / (2 * step)
    np.testing.assert_allclose(slope, difference, rtol=1e-7)
    many = jax.vmap(lambda factor: number(factor * gap))(jnp.array([1.0, 2.0]))
    np.testing.assert_allclose(many[1], 8 * many[0], rtol=1e-10)


def test_claimed_errors_of_the_conductance_contain_those_of_a_grid():
    """Beside four times as many points along each edge, up to close to percolation."""
    held = []
    q = 2 * np.pi / 1e-3
    block = gc.Stack(base=gc.HalfSpace(gc.Prony(1e7, [1e-5], [1e-3], 0.49)))
    spectrum = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=q, q_roll=2 * q, q_high=4 * q)
    names = [f"flow_along_{axis}{end}" for end in ("", "_error") for axis in ("x", "y")]
    for seed in range(20, 22):
        road = gc.random_surface(spectrum, gc.Grid((16, 16), 1e-3), jax.random.key(seed))
        finer = gc.Surface(resampled(road.heights, (64, 64)), gc.Grid((64, 64), 1e-3))
        for pressure in (4e4, 2e5):
            on_grid = gc.slide(block, road, pressure=pressure, velocity=1.0)
            found = np.reshape(on_grid.compute(*names), (2, 2))
            exact = gc.slide(block, finer, pressure=pressure, velocity=1.0).compute(*names[:2])
            held += [*(np.abs(found[0] - exact) <= found[1])]
            assert np.all(found[1] < 0.8 * found[0]) or pressure > 4e4
    assert len(held) == 8 and np.sum(held) >= 7


def test_leakage_between_parallel_plates_is_that_of_poiseuille():
    """h³ Δp W/(12 η L), on a cell that is not square."""
    grid, height = gc.Grid((8, 6), (2e-3, 5e-4)), 1e-6
    flow = gap_flow(np.full(grid.shape, height), grid)
    along_x, along_y = Fluid(1e-3, 1e5).leakage(flow.conductance, grid)
    np.testing.assert_allclose(along_x, height**3 * 1e5 / (12 * 1e-3) * 5e-4 / 2e-3, rtol=1e-6)
    np.testing.assert_allclose(along_y, height**3 * 1e5 / (12 * 1e-3) * 2e-3 / 5e-4, rtol=1e-6)
    for numbers, name in (((0.0, 1e5), "viscosity"), ((1e-3, -1.0), "pressure_difference")):
        with pytest.raises(ValueError, match=name):
            Fluid(*numbers)
