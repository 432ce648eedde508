"""A cylinder gliding on a viscoelastic half space, against Hunter's and Goryacheva's closed form.

The section `cylinder` of `bench_contact.py`. Lengths are in units of the relaxed Hertz half-width,
load per length, radius and relaxed reduced modulus are 1. The solved cell is 8 wide; its kernel is
that of a cell `WIDE` wide, cut to distances below 4 (contacts are at most 2 wide), so that the
images of the cylinder are those at `WIDE`: they change the curvature by π²/6 WIDE⁻².
"""

import jax.numpy as jnp
import numpy as np
from contact_scenes import growth
from rows import goal, report

import graded_contact as gc
from graded_contact import reference
from graded_contact.contacts.area import edge_stiffness
from graded_contact.fields.grid import to_field, to_spectrum

CELL, WIDE = 8, 2**14
A, PEAK = map(float, reference.hertz_line(1.0, 1.0, 1.0))
CREEP = 9.0  # delayed over instantaneous compliance
QUANTITIES = ("half-width", "shift", "peak", "friction")


def cylinder(points=(16, 32, 64, 128), speeds=(0.01, 0.1, 1.0, 3.0, 10.0, 100.0)):
    """Gliding cylinder, exact: points to a half-width at rest, τv over that half-width."""
    print("# errors: half-width, shift of the middle and friction over the half-width at rest a,")
    print("# peak over its own; pairs to rtol = 1e-9")
    errors = np.array([[row(v, n) for n in points] for v in speeds])
    worst = errors.max(axis=0)
    for i, name in enumerate(QUANTITIES):
        order = -growth(points, worst[:, i])
        goal(
            f"{name} converges to the closed form at a stated order",
            f"order {order:.2f}, error {worst[-1, i]:.1e} at {points[-1]} points per a "
            f"(worst of V = {min(speeds):g}..{max(speeds):g})",
        )


def row(v, points):
    """Prints and returns the absolute errors at the speed τv/a = v on a grid."""
    exact = reference.viscoelastic_cylinder(1.0, 1.0, 1 + CREEP, CREEP, v * A, 1.0)
    expected = (exact.half_width / A, exact.offset / A, 1.0, exact.friction / A)
    found, pairs = glide(v, points)
    found = (found[0] / A, found[1] / A, found[2] / exact.peak_pressure, found[3] / A)
    errors = np.abs(np.subtract(found, expected))
    report("bench_contact-cylinder", {
        "speed": v, "points to a half-width": points, "FFT pairs": float(pairs),
        "half-width": float(errors[0]), "offset": float(errors[1]),
        "peak pressure": float(errors[2]), "friction": float(errors[3]),
    })  # fmt: skip
    return errors


def glide(v, points):
    """Half-width, shift of the middle, peak pressure and friction on a grid, and FFT pairs."""
    n = CELL * points
    x = (np.arange(n) - n // 2) * (A / points)
    alone = kernel(v, points)
    s = gc.solve_contact(alone, -(x**2) / 2, 1 / (CELL * A), rtol=1e-9)
    pressure = np.asarray(s.pressure)
    stiffness = edge_stiffness(alone[None], gc.Grid((n,), CELL * A))[1]
    left, right = edges(
        x, np.asarray(gc.HardWall().contact_indicator(s.pressure, s.gap, stiffness))
    )
    # The slope of the surface is -x.
    friction = np.sum(pressure * x) / np.sum(pressure)
    return ((right - left) / 2, (right + left) / 2, pressure.max(), friction), s.num_fft_pairs


def kernel(v, points):
    """The half space's kernel between points of a cell of 8, as if they stood alone."""
    rubber = gc.Prony.from_creep(0.75 * (1 + CREEP), [CREEP / (0.75 * (1 + CREEP))], [v * A], 0.5)
    n, wide = CELL * points, WIDE * points
    grid = gc.Grid((wide,), WIDE * A)
    far = to_field(gc.stack_kernel(gc.Stack(base=gc.HalfSpace(rubber)), grid, 1.0), (wide,))
    # Both ends of the cell are one point.
    near = jnp.concatenate([far[: n // 2], far[-n // 2 :]])
    near = near.at[n // 2].set((far[n // 2] + far[-n // 2]) / 2)
    cut = to_spectrum(near)
    return cut.at[-1].set(cut[-1].real)


def edges(x, indicator):
    """Where the contact indicator passes zero."""
    inside = np.flatnonzero(indicator > 0)
    pairs = ((inside[0], inside[0] - 1), (inside[-1], inside[-1] + 1))
    return [
        (x[i] * indicator[j] - x[j] * indicator[i]) / (indicator[j] - indicator[i])
        for i, j in pairs
    ]
