"""A solve that failed has no number: not one that looks like an area, a slope, or no contact."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contacts.solution import RESULTS
from graded_contact.fields.devices import required
from graded_contact.sliding.number import observables_in

GRID = gc.Grid((16,), 1e-3)
X = np.arange(16) / 16
SURFACE = gc.Surface(1e-5 * np.cos(2 * np.pi * X) + 3e-6 * np.cos(6 * np.pi * X), GRID)
RUBBER = gc.Prony(1e6, [1e7], [1e-3], 0.4, shift=gc.WLF(10.0, 50.0, 300.0))
STACK = gc.Stack(base=gc.HalfSpace(RUBBER))
PLAIN = gc.contacts.DouglasRachford(newton=False)  # compiles in two thirds of the time


def slid(pressure, solver=PLAIN, **more):
    given = {"pressure": pressure, "velocity": 0.1, "throw": False, "solver": solver}
    return gc.slide(STACK, SURFACE, **given, **more)


def test_every_observable_of_a_failed_solve_is_nan_and_is_no_warning():
    failed = jax.jit(slid)(jnp.nan)
    assert failed.result == RESULTS.bad_pressure
    names = [
        name
        for name, entry in observables_in(gc.Sliding).items()
        if {*entry.needs} <= failed.facts and (not entry.is_error or name == "friction_error")
    ]
    assert {"contact_area", "friction_error", "slope_in_contact"} < {*names}
    found = dict(zip(names, failed.compute(*names), strict=True))
    assert [name for name in names if not np.all(np.isnan(found[name]))] == []
    assert failed.warnings == ()
    assert repr(failed).startswith("Sliding (failed: no numbers)")


@jax.jit
@jax.value_and_grad
def area(pressure):
    return slid(pressure).contact_area


def test_a_failed_solve_has_no_derivatives_and_a_sound_one_keeps_its_own():
    assert np.all(np.isnan(area(-1e5)))
    number, slope = area(1e5)
    np.testing.assert_allclose(slope, (area(1.001e5)[0] - area(0.999e5)[0]) / 200, rtol=1e-2)
    assert 0 < number < 1


def test_a_check_holds_also_where_only_a_derivative_is_computed():
    def checked(x):
        return required(x**2, x > 0, RESULTS.bad_pressure.error_if)

    slope = jax.jit(jax.grad(checked))
    assert slope(3.0) == 6
    with pytest.raises((RuntimeError, ValueError), match="pressure"):
        slope(-3.0)
