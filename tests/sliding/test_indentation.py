"""Indentation over time by depth: a ramp, a hold and the way back.

E. H. Lee & J. R. M. Radok, J. Appl. Mech. 27 (1960) 438; T. C. T. Ting, J. Appl. Mech. 33 (1966)
845.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import graded_contact as gc
from graded_contact.contacts import DouglasRachford

RELAXED, BRANCH, TIME = 1.0, 2.0, 0.5
RAMP, HOLD, DEPTH = 1.0, 2.0, 0.03  # s, end of the hold [s], m
TIMES = np.arange(1, 25) / 8
DEPTHS = DEPTH * np.interp(TIMES, [0, 1, 2, 3], [0, 1, 1, 0])


def modulus(t):
    return RELAXED + BRANCH * np.exp(-t / TIME)


def rate(t):
    return DEPTH * (1.0 if t < RAMP else 0.0 if t < HOLD else -1.0)


def depth(t):
    return DEPTH * np.interp(t, [0, 1, 2, 3], [0, 1, 1, 0])


def over(function, low, high):
    inner = [t for t in (RAMP, HOLD) if low < t < high]
    return quad(function, low, high, points=inner or None)[0]


def stretched(since, t):
    """∫ E(t - u) dδ(u) from a time on."""
    return over(lambda u: modulus(t - u) * rate(u), since, t)


def sphere_force(t):
    """On a half space of ν = 1/2, R = 1 m: a contact that shrinks is one of before."""
    last = t
    if t > HOLD:
        if stretched(0.0, t) < 0:
            return 0.0
        last = brentq(stretched, 0, RAMP, (t,))
    grown = over(lambda s: modulus(t - s) * 1.5 * depth(s) ** 0.5 * rate(s), 0, min(last, RAMP))
    return 4 / 3 / 0.75 * grown


def surface(heights, size):
    return gc.Surface(heights, gc.Grid(heights.shape, size), periodic=False)


def rubber(branch, relaxed=RELAXED):
    return gc.Prony(relaxed, [branch], [TIME], 0.5)


def indent(base, indenter, coat=None):
    """All share a program."""
    coat = gc.Layer(base if coat is None else coat, 0.1)
    stack = gc.Stack(layers=(coat,), base=gc.HalfSpace(base))
    return gc.slide_transient(
        stack, indenter, times=TIMES, displacement=0 * TIMES, approach=DEPTHS, rtol=1e-4,
        solver=DouglasRachford(newton=False),
    )  # fmt: skip


def squared(size, n=16):
    x = (np.arange(n) - n // 2) * size / n
    return x[:, None] ** 2 + x**2


def test_the_force_of_a_sphere_is_that_of_lee_and_radok_and_on_the_way_back_of_ting():
    found = indent(rubber(BRANCH), surface(-squared(0.5) / 2, 0.5))
    force = 0.5**2 * found.load
    exact = np.array([sphere_force(t) for t in TIMES])
    np.testing.assert_allclose(force, exact, atol=0.003 * np.max(exact))
    held = (TIMES > RAMP) & (TIMES <= HOLD)
    np.testing.assert_allclose(force[held], exact[held], rtol=1e-3)


def test_the_force_of_a_punch_on_a_coat_follows_the_stretched_modulus():
    """Its contact does not change, so that E(t) is all of its time, whatever the layers."""
    punch = surface(np.where(squared(0.5) < 0.03, 0.0, -1.0), 0.5)
    found = indent(rubber(BRANCH), punch, rubber(3 * BRANCH, 3 * RELAXED)).load
    exact = np.array([max(stretched(0.0, t), 0) for t in TIMES])
    np.testing.assert_allclose(found / found[7], exact / exact[7], atol=2e-3)
    assert found[-1] == 0 < found[16]


def test_an_approach_needs_ground_below_a_body_on_a_window():
    window = surface(-squared(0.5) / 2, 0.5)
    stack, line = gc.Stack(base=gc.HalfSpace(rubber(BRANCH))), gc.Grid((8,), 1.0)
    given = dict(times=TIMES, displacement=0 * TIMES)
    with pytest.raises(ValueError, match="no limit far away"):
        flat = gc.Surface(jnp.zeros(8), line, periodic=False)
        gc.slide_transient(stack, flat, approach=DEPTHS, **given)
    with pytest.raises(ValueError, match="Prescribe `mean_gap`"):
        gc.slide_transient(stack, gc.Surface(jnp.zeros(8), line), approach=DEPTHS, **given)
    with pytest.raises(ValueError, match="Prescribe `approach`"):
        gc.slide_transient(stack, window, mean_gap=DEPTHS, **given)
