"""Edges of contact between the points: that recede, that move steadily, and where a body ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import rough

import graded_contact as gc
from graded_contact.contacts.area import Edges, cuts_of, edge_stiffness, sub_pixel_area
from graded_contact.sliding import slide_cycle

ELASTIC = gc.Stack(base=gc.HalfSpace(gc.Elastic(1e6, 0.3)))


def places(n):
    x = (np.arange(n) - (n - 1) / 2) / n
    return x[:, None], x[None]


def punch(shape, n=32, shift=0.0):
    x, y = places(n)
    x, y = x - shift / n, y + 0.7 * shift / n
    inside = {
        "disc": np.hypot(x, y) <= 0.29,
        "square": np.maximum(abs(x), abs(y)) <= 0.25,
        "rotated square": np.maximum(abs(0.8 * x + 0.6 * y), abs(0.8 * y - 0.6 * x)) <= 0.25,
        "ring": abs(np.hypot(x, y) - 0.3) <= 0.09,
        "whole window": x + y > -n,
        "part of the window": x + 0 * y > -0.2,
    }[shape]
    return np.where(inside, 0.0, -0.3)


SHAPES = ("disc", "square", "rotated square", "ring", "whole window", "part of the window")


def area_of_punch(heights):
    surface = gc.Surface(heights, gc.Grid(heights.shape, 1.0), periodic=False)
    return gc.slide(ELASTIC, surface, pressure=1e3, velocity=0.0, rtol=1e-4).contact_area


@pytest.mark.parametrize("shape", SHAPES)
def test_a_flat_punch_touches_all_of_its_face(shape):
    """The body ends half way to the next point: its face is the squares of its points."""
    for shift in (0.0, 0.3):
        heights = punch(shape, shift=shift)
        np.testing.assert_allclose(area_of_punch(heights), np.mean(heights == 0), rtol=1e-2)


cuts = jax.jit(cuts_of, static_argnums=1)


@pytest.mark.parametrize("points", [4, 5, 16])
def test_waves_of_four_points_and_more_are_no_cuts(points):
    for phase in np.linspace(0, 2 * np.pi, 30):
        wave = np.cos(2 * np.pi * np.arange(16 * points) / points + phase)
        assert np.all(cuts(wave, True)[0] <= 1e-12)


def test_a_groove_is_cut_at_both_of_its_sides_and_a_step_of_the_seam_of_a_window_is_not():
    heights = np.array(rough((32, 32), 1.0, last=8).heights)
    heights[9:14] -= 100 * np.std(heights)
    along, across = map(np.asarray, cuts(heights, True))
    assert np.all(along[[8, 13]] == 1)
    assert np.sum(along) == 2 * 32 and np.all(across == 0)
    np.testing.assert_array_equal(cuts(np.arange(16.0), False)[0], np.arange(16) == 15)


def test_area_is_continuous_and_has_a_derivative_as_edges_pass_points():
    """A root inside and the power 3/2 outside, moved through several points, beside a step too."""
    x = jnp.arange(16.0)
    step = jnp.where(x < 9, 0.0, -5.0)

    def area(edge, softest, cut):
        inside = x < edge
        pressure = jnp.sqrt(jnp.where(inside, edge - x, 1))
        heights = step if cut else jnp.zeros(16)
        gap = np.pi / 3 * jnp.maximum(x - edge, 0) ** 1.5 - heights
        edges = Edges(softest, cuts_of(heights, False))
        return sub_pixel_area(jnp.where(inside, pressure, -gap), edges)

    at = jnp.linspace(4.0, 8.4, 2001)
    for cut in (False, True):
        both = jax.value_and_grad(lambda edge, softest, cut=cut: area(edge, softest, cut))
        of = jax.jit(jax.vmap(both, (0, None)))
        for softest in (1.0, 0.01):
            values, slopes = of(at, softest)
            assert np.all(np.isfinite(slopes)) and np.all(slopes >= 0)
            assert np.max(np.abs(np.diff(values))) <= 10 * (at[1] - at[0]) / 16
            # The mean over whole spacings: the edge moves by as much as the area.
            np.testing.assert_allclose((values[-1] - values[0]) * 16, 4.4, atol=0.1)


def test_an_elastic_block_is_as_stiff_at_all_edges_and_a_layer_is_no_lay():
    """Directions differ by their moduli, not by their wavenumbers."""
    grid = gc.Grid((32, 16), 1.0)
    kernel = gc.stack_kernel(ELASTIC, grid)
    softest, stiffest = jax.jit(lambda kernel: edge_stiffness(kernel[None], grid))(kernel)
    assert softest == stiffest
    k = np.abs(np.stack(np.meshgrid(np.fft.fftfreq(32), np.fft.fftfreq(16), indexing="ij"))) * 4
    radius = np.hypot(*k)
    near = (radius >= 0.5) & (radius <= 1.5)
    q = 2 * np.pi * np.hypot(32 * k[0] / 4, 16 * k[1] / 4)[near]
    reduced = 1e6 / (1 - 0.3**2)
    np.testing.assert_allclose(stiffest, np.exp(np.mean(np.log(reduced * q / 2))), rtol=1e-9)


def test_a_contact_that_shrinks_has_at_once_the_relaxed_area_of_its_load():
    """T. C. T. Ting, J. Appl. Mech. 33 (1966) 845: after a rest. Area by Westergaard (1939)."""
    n, num_times, full = 32, 64, 3e5
    reduced, length = 1e6 / 0.75, 1e-3
    wave = full * length / (np.pi * reduced) * np.cos(2 * np.pi * np.arange(n) / n)
    rubber = gc.Prony(1e6, [9e6], [3e-3], poisson=0.5)
    k = np.arange(num_times)
    up, down = (0.5 * (1 - np.cos(np.pi * np.clip((k - start) / 5, 0, 1))) for start in (0, 32))
    load = 0.8e5 + 1.2e5 * (up - down)
    found = slide_cycle(
        gc.Stack(base=gc.HalfSpace(rubber)), gc.Surface(wave, gc.Grid((n,), length)),
        displacement=np.zeros(num_times), period=1.0, pressure=load, rtol=1e-4,
    )  # fmt: skip
    area = np.asarray(found.contact_area)[31:50]
    relaxed = 2 / np.pi * np.arcsin(np.sqrt(load[31:50] / full))
    # One edge is off by less than a fifth of a spacing at any time, and not to one side.
    assert np.max(np.abs(area - relaxed)) <= 2 * 0.2 / n
    assert abs(np.mean(area - relaxed)) <= 2 * 0.1 / n
