"""A cylinder gliding on a viscoelastic half space: Hunter (1961), Goryacheva (1973)."""

import closed_forms
import numpy as np
import pytest

import graded_contact as gc

CREEP = 9.0  # delayed over instantaneous compliance
A, _ = map(float, closed_forms.hertz_line(1.0, 1.0, 1.0))  # half-width at rest
CELL = 64  # half-widths; images change the curvature of the cylinder by π²/6 CELL⁻² = 4e-4


def glide(speed, points):
    """The contact with F = R = E_r = 1 and τv/a = `speed`, `points` to a half-width a."""
    n = CELL * points
    glassy = 0.75 * (1 + CREEP)
    rubber = gc.Prony.from_creep(glassy, [CREEP / glassy], [speed * A], 0.5)
    x = (np.arange(n) - n // 2) * (A / points)
    surface = gc.Surface(-(x**2) / 2, gc.Grid((n,), CELL * A))
    # The contact is smaller than a point of the coarse grids.
    how = dict(solver=gc.contacts.DouglasRachford(coarsest=n), rtol=1e-7)
    stack, load = gc.Stack(base=gc.HalfSpace(rubber)), 1 / (CELL * A)
    found = gc.slide(stack, surface, pressure=load, velocity=1.0, **how)
    return x, found, closed_forms.viscoelastic_cylinder(1.0, 1.0, 1 + CREEP, CREEP, speed * A, 1.0)


@pytest.mark.parametrize("speed", [0.1, 1.0, 10.0])
def test_contact_is_that_of_the_gliding_cylinder(speed):
    """Within what 16 points to a half-width resolve: a fifth of a point at either edge."""
    x, found, exact = glide(speed, 16)
    inside = x[np.asarray(found.pressure) > 0]
    width = float(found.contact_area) * CELL * A
    np.testing.assert_allclose(width / 2, exact.half_width, atol=0.3 * A / 16)
    np.testing.assert_allclose(np.mean(inside), exact.offset, atol=0.5 * A / 16)
    np.testing.assert_allclose(np.max(found.pressure), exact.peak_pressure, rtol=0.03)
    np.testing.assert_allclose(found.friction, exact.friction, atol=0.006 * A)


def test_friction_converges_to_that_of_the_gliding_cylinder():
    errors = []
    for points in (16, 64):
        _, found, exact = glide(1.0, points)
        both = found.friction, found.geometric_friction
        errors.append([abs(f / exact.friction - 1) for f in both])
    (coarse, coarse_geometric), (fine, fine_geometric) = errors
    # First order at least; the images leave a few 1e-4.
    assert fine < coarse / 4
    assert fine < 1e-3 and fine_geometric < 1e-3 and coarse_geometric < 1e-2
