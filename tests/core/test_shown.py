"""What a result prints: its numbers with units, arrays by shape, how it ended."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contacts.operators.operator import Steady
from graded_contact.contacts.solution import FAILURES, RESULTS, ContactSolution, if_known
from graded_contact.core.display import with_error
from graded_contact.sliding.problem import SteadyProblem


def zero(name, value):
    """A number, or the parts of an error."""
    return {"grid": jnp.array(value)} if name.endswith("_error") else jnp.array(value)


def sliding(friction=0.25, shape=(16, 12), result=RESULTS.successful, **numbers):
    """A `Sliding` with a number of its own in every field, without solving anything."""
    fields = {f.name: jnp.array(2.0) for f in dataclasses.fields(ContactSolution)}
    field = jnp.zeros(shape)
    fields |= {"pressure": field, "displacement": field, "gap": field, "correction": field}
    contact = ContactSolution(**fields | {"mean_gap": jnp.array(6.13e-5), "result": result})
    problem = SteadyProblem(
        operator=Steady(field), heights=field, grid=gc.Grid(shape, 1.0), velocity=jnp.array(0.0),
        law=gc.HardWall(),
    )  # fmt: skip
    found = gc.Sliding(contact, problem)
    found.kept.numbers.update({name: zero(name, 0.0) for name in found.numbers})
    parts = {"solver": jnp.array(0.0), "grid": jnp.array(1.7e-4)}
    numbers |= {"friction": jnp.array(friction), "friction_error": parts}
    found.kept.numbers.update(numbers)
    return found


def line(text, name):
    """What stands behind a name."""
    (found,) = (row for row in text.splitlines() if row.strip().startswith(f"{name} "))
    return found.strip().removeprefix(name).strip()


def test_a_result_shows_numbers_units_errors_shapes_and_how_it_ended():
    text = repr(sliding())
    assert line(text, "friction") == "0.25000 ± 0.00017 (solver 0.0e+00, grid 1.7e-04)"
    assert "friction_error" not in text
    assert ["mean_gap", "[m]", "6.13e-05"] in [row.split()[:3] for row in text.splitlines()]
    assert line(text, "pressure [Pa]") == "16 × 12 float64"
    assert line(text, "result") == "successful"
    stopped = repr(sliding(result=RESULTS.max_steps_reached))
    assert line(stopped, "result").startswith("The contact solver reached `max_steps`")
    assert stopped.startswith("Sliding (not converged: partial results)")
    steep = sliding(slope_in_contact=jnp.array(0.8))
    assert "small strains" in repr(steep)


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.512, 0.0081, "0.5120 ± 0.0081"),
        (0.512, 0.5, "0.51 ± 0.50"),
        (7.8271397448519e-05, 1.6e-17, "7.8271397e-05"),  # an error of rounding
        (7.8271397448519e-05, 1.6e-9, "(7.82714 ± 0.00016)e-05"),
        (123456.789, 0.02, "(1.2345679 ± 0.0000002)e+05"),
        (0.3, 0.0, "0.3"),
        (-0.25, 0.01, "-0.250 ± 0.010"),
        (2e-3, 3.2e-2, "0 ± 0.034"),
        (-3e-19, 1.3e-12, "0 ± 1.4e-12"),
        (0.3, np.nan, "0.3000 ± —"),
        (np.nan, np.nan, "—"),
        (np.nan, 0.1, "—"),
    ],
)
def test_digits_follow_the_error_and_a_number_below_it_is_zero(value, error, text):
    assert with_error(value, error) == text


@pytest.mark.parametrize("end", FAILURES)
def test_no_number_of_a_failed_solve_is_printed(end):
    found = sliding(result=end, friction=np.nan)
    failed = dataclasses.replace(found, contact=if_known(end, found.contact))
    failed.kept.numbers.update({name: zero(name, np.nan) for name in failed.numbers})
    first, *rows = (row.strip() for row in repr(failed).splitlines())
    assert first == "Sliding (failed: no numbers)"
    words = {row.partition("  ")[0]: row.partition("  ")[2].strip() for row in rows}
    others = ("contact", "result", "warnings")
    assert {words[name] for name in words if name not in others} == {"—", "16 × 12 float64"}
    assert words["friction"] == words["contact_area"] == "—" and words["warnings"] == "none"
