"""Values that no smooth positive spectrum explains are found, and no others."""

from pathlib import Path

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.fitting import wild_values, without
from graded_contact.materials.measured import Measured

DATA = Path(__file__).parents[3] / "shared" / "data" / "rheology"
SI_TIME = {"kind": "relaxation", "units": {"time": "s", "modulus": "Pa"}}


def made(log_values, omega, isotherm=None):
    """Moduli from logarithms of shape (2, points), each point on a line of its own."""
    storage, loss = np.exp(log_values)
    isotherm = np.zeros(len(omega), int) if isotherm is None else isotherm
    lines = np.arange(len(omega)) + 2
    values = storage + 1j * loss
    return Measured("frequency", "tension", omega, values, None, isotherm, lines, Path("x"), ())


def tread(draw, count, decades, noise):
    lowest = 10 ** draw.uniform(-2, 6)
    omega = np.geomspace(lowest, lowest * 10**decades, count)
    modulus = np.asarray(gc.tyre_tread().modulus(omega))
    logs = np.log(np.stack([modulus.real, modulus.imag]))
    return omega, logs + noise * draw.standard_normal(logs.shape)


def test_normal_errors_are_never_wild():
    draw = np.random.default_rng(0)
    for _ in range(20):
        omega, logs = tread(draw, 10, 3, 0.02)
        assert not wild_values(made(logs, omega))


@pytest.mark.parametrize("off", [0.7, 30.0])
def test_wild_values_are_found_among_many(off):
    draw = np.random.default_rng(1)
    found, expected = [], []
    for number in range(20):
        omega, logs = tread(draw, 40, 6, 0.02)
        wild = draw.random(logs.shape) < 0.05
        logs += np.where(wild, draw.choice([-off, off], logs.shape), 0)
        places = [(v.name.startswith("loss"), v.row) for v in wild_values(made(logs, omega))]
        found += [(number, *place) for place in places]
        expected += [(number, bool(c), int(i)) for c, i in np.argwhere(wild)]
    assert not set(found) - set(expected)
    assert len(found) > 0.97 * len(expected)


def test_the_residual_is_what_a_value_was_changed_by_and_rows_are_left_out():
    omega, logs = tread(np.random.default_rng(2), 40, 6, 0.01)
    logs[0, 17] += np.log(3)
    logs[1, 30] -= 5
    measured = made(logs, omega)
    loss, storage = sorted(wild_values(measured), key=lambda value: value.name)
    assert (storage.row, loss.row) == (17, 30) and storage.where.startswith("line 19 (")
    np.testing.assert_allclose([storage.residual, loss.residual], [np.log(3), -5], atol=0.05)
    assert "times what is expected" in str(storage) and "1/1" in str(loss)
    rest = without(measured, [storage, loss])
    assert len(rest.lines) == 38 and not {19, 32} & set(rest.lines)
    assert not wild_values(rest)
