"""A cylinder gliding on a viscoelastic half space: Hunter (1961), Goryacheva (1973)."""

import closed_forms
import jax
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.sliding.numbers.friction import geometric_friction

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
    """Within what 32 points to a half-width resolve: a fifth of a point at either edge."""
    x, found, exact = glide(speed, 32)
    inside = x[np.asarray(found.pressure) > 0]
    width = float(found.contact_area) * CELL * A
    np.testing.assert_allclose(width / 2, exact.half_width, atol=0.3 * A / 32)
    np.testing.assert_allclose(np.mean(inside), exact.offset, atol=0.5 * A / 32)
    np.testing.assert_allclose(np.max(found.pressure), exact.peak_pressure, rtol=0.03)
    for friction in (found.friction, jax.jit(geometric_friction)(found)):
        np.testing.assert_allclose(friction, exact.friction, rtol=5e-3 if speed < 10 else 0.03)
