"""Steady sliding against time stepping, in which no complex kernel occurs."""

import jax
import jax.numpy as jnp
import numpy as np
from conftest import rough

import graded_contact as gc

RELAXED, BRANCH = 0.75, 1.5  # Pa; the branch relaxes in 1 s
GRID = gc.Grid((64,), 1.0)
SURFACE = rough(GRID)
LOAD, SPEED = 0.05, 0.1  # Pa, m/s
PLAIN = {"solver": gc.contacts.DouglasRachford(newton=False)}


@jax.jit
def friction_by_steps(step, num_steps):
    """Friction after implicit Euler steps from rest, of a spring beside one Maxwell branch.

    Waves of the branch's stretch r relax as τ ṙ = w - r, and σ = K (E w + E1 (w - r)), K = |q|/2
    (1 - ν²)⁻¹: a step is an elastic contact of the heights less what is remembered.
    """
    q = 2 * np.pi * np.arange(33)
    share = 1 / (1 + step)  # of the stretch that a step leaves
    stiff = RELAXED + share * BRANCH
    kernel = 1.5 / (np.maximum(q, 1) * stiff)
    # Seen from the surface, the material moves back.
    carried = jnp.exp(1j * q * SPEED * step)

    def advance(_, state):
        stretch, start, _ = state
        pushed = jnp.fft.irfft(carried * stretch, 64)
        memory = share * BRANCH / stiff * pushed
        found = gc.solve_contact(
            kernel, SURFACE.heights - memory, LOAD, rtol=1e-7, start=start, **PLAIN
        )
        w = found.displacement + memory
        slope = jnp.fft.irfft(1j * np.where(q < q[-1], q, 0) * jnp.fft.rfft(w), 64)
        stretch = jnp.fft.rfft(share * pushed + (1 - share) * w)
        return stretch, found.pressure, -jnp.mean(found.pressure * slope) / LOAD

    rest = (jnp.zeros(33, complex), jnp.full(64, LOAD), jnp.zeros(()))
    return jax.lax.fori_loop(0, num_steps, advance, rest)[2]


def test_time_stepping_goes_to_the_friction_of_steady_sliding_at_first_order():
    stack = gc.Stack(base=gc.HalfSpace(gc.Prony(RELAXED, [BRANCH], [1.0], 0.5)))
    steady = gc.slide(stack, SURFACE, pressure=LOAD, velocity=SPEED, rtol=1e-9).friction
    # Thirty seconds are ten times the retardation time.
    coarse, fine = (float(friction_by_steps(1 / n, 30 * n) / steady - 1) for n in (32, 64))
    assert 1e-3 < abs(fine) < 0.03
    np.testing.assert_allclose(coarse / fine, 2, rtol=0.05)
    assert abs(2 * fine - coarse) < 0.05 * abs(fine)
