"""What a result prints: its numbers with units, arrays by shape, how it ended."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.blocks.stress import InteriorFields
from graded_contact.contacts.operator import Steady
from graded_contact.contacts.solution import FAILURES, RESULTS, ContactSolution, if_known
from graded_contact.core.display import number, with_error, with_unit
from graded_contact.core.quantities import quantity_of
from graded_contact.designs.limits import Stiffness
from graded_contact.designs.results import Candidate
from graded_contact.fitting.quality import FitErrors, Floor
from graded_contact.sliding.problem import SteadyProblem
from graded_contact.studies.search import Descent
from graded_contact.studies.uncertainty import Sensitivity
from graded_contact.surfaces.reading_steps import ReadingStep
from graded_contact.surfaces.statistics import Statistics

RESULT_CLASSES = (
    gc.Sliding, gc.ContactSolution, gc.contacts.ContactPath, gc.surfaces.CutoffCurve,
    gc.mean_field.MeanField, Statistics, InteriorFields, Sensitivity, gc.Layer, gc.Elastic,
    gc.Prony, gc.materials.StrainSoftening, gc.WLF, gc.Grid, gc.Surface,
    Candidate, Descent, Stiffness, Floor, FitErrors, ReadingStep, gc.HardWall, gc.AdhesiveLJ,
)  # fmt: skip


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
    found.kept.numbers.update(dict.fromkeys(found.numbers, jnp.array(0.0)))
    numbers |= {"friction": jnp.array(friction), "friction_error": jnp.array(1.7e-4)}
    numbers |= {"friction_grid_error": jnp.array(1.7e-4)}
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
    assert ["mean_gap", "[m]", "6.13e-05"] in [row.split() for row in text.splitlines()]
    assert line(text, "pressure [Pa]") == "16 × 12 float64"
    assert line(text, "result") == "successful"
    stopped = repr(sliding(result=RESULTS.max_steps_reached))
    assert line(stopped, "result").startswith("The contact solver reached `max_steps`")
    assert stopped.startswith("Sliding (not converged: partial results)")
    steep = sliding(slope_in_contact=jnp.array(0.8))
    assert "small strains" in repr(steep)


def test_only_results_show_units_since_a_derivative_has_the_class_of_what_it_is_by():
    layer = gc.Layer(gc.Elastic(1e7, 0.3), 1e-5)
    rubber = gc.Prony(1e6, [1e7], [1e-3], 0.4, shift=gc.WLF(10.0, 50.0, 300.0))
    stack = gc.Stack(layers=(layer,), base=gc.HalfSpace(rubber))
    slope = jax.grad(lambda s: jnp.abs(gc.surface_compliance(s, 1e4, 1e3)))(stack)
    for text in (repr(slope), repr(slope.layers[0]), repr(slope.base.material)):
        assert "thickness" in text or "equilibrium" in text
        assert "[m]" not in text and "[Pa]" not in text
    omega = np.geomspace(1.0, 1e5, 20)
    assert "equilibrium  1e+06" in repr(rubber)
    assert "equilibrium [Pa]" in repr(gc.fit_prony(omega, rubber.modulus(omega), terms=1))


def test_traced_results_show_their_shapes():
    seen = []
    jax.jit(lambda s: seen.append((repr(s), eqx.tree_pformat(s))))(sliding())
    assert seen[0][0] == seen[0][1]
    assert "f64[]" in seen[0][0]


@pytest.mark.parametrize("kind", RESULT_CLASSES, ids=lambda kind: kind.__name__)
def test_every_number_is_in_the_table_of_quantities(kind):
    for name, annotation in kind.__annotations__.items():
        name = "modulus" if name == "young" else name
        if "Float" in str(annotation) and "np.ndarray" not in str(annotation):
            assert quantity_of(name, kind.__name__), name


def test_a_refused_object_is_named_on_one_line(unchecked_types):
    with pytest.raises(ValueError, match="`base=Layer") as refusal:
        gc.Stack(layers=(), base=gc.Layer(gc.Elastic(1e6), 1e-3))
    assert "\n" not in str(refusal.value)


def test_a_result_prints_how_the_solve_ended():
    assert str(RESULTS.successful).endswith("RESULTS<successful>")
    assert "Loosen `rtol`" in str(RESULTS.rounding)


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


def test_a_number_and_its_error_have_one_unit_and_a_sign_changes_no_unit():
    assert with_error(3.21e-5, 4.11e-8, "m") == "32.100 ± 0.041 µm"
    assert with_error(24.6e-12, 454e-12, "m") == "0 ± 480 pm"  # encloses 24.6 + 454
    assert with_error(-7.68e-25, 3e-26, "m", noise=1e-21) == "0 m"
    assert with_unit(-1.54e-9, "m") == "-1.54 nm" and with_unit(0.0, "m") == "0 m"


def test_rounding_of_the_heights_is_printed_as_zero_and_a_small_number_is_not():
    """A mean gap of 1e-25 m is no number beside heights of 1 µm; one of 1 fm is."""
    heights = jnp.asarray(1e-6 * np.random.default_rng(0).normal(size=(16, 12)))
    for gap, shown in ((-7.68e-25, "0"), (1e-15, "1e-15")):
        found = sliding()
        contact = dataclasses.replace(
            found.contact, displacement=heights, mean_gap=jnp.array(gap), pressure=1e6 + 0 * heights
        )
        assert line(repr(contact), "mean_gap [m]") == shown
        assert line(repr(contact), "mean_pressure [Pa]") == "2"


@pytest.mark.parametrize("end", FAILURES)
def test_no_number_of_a_failed_solve_is_printed(end):
    found = sliding(result=end, friction=np.nan)
    failed = dataclasses.replace(found, contact=if_known(end, found.contact))
    failed.kept.numbers.update({name: jnp.array(np.nan) for name in failed.numbers})
    first, *rows = (row.strip() for row in repr(failed).splitlines())
    assert first == "Sliding (failed: no numbers)"
    words = {row.partition("  ")[0]: row.partition("  ")[2].strip() for row in rows}
    others = ("contact", "result", "grid_errors", "caveats")
    assert {words[name] for name in words if name not in others} == {"—", "16 × 12 float64"}
    assert words["friction"] == words["contact_area"] == "—" and words["caveats"] == "none"


def test_a_cell_of_a_table_has_no_digits_beyond_the_second_of_its_error():
    for value, error, expected in (
        (0.51175, 0.43, "0.51"), (0.51175, 1e-3, "0.5118"), (0.51175, 1e-9, "0.51175"),
        (0.51175, 0.0, "0.51175"), (0.2, 0.3, "<0.5"), (np.nan, 0.1, "—"),
    ):  # fmt: skip
        assert number(value, ".5f", error) == expected
    for error, expected in ((1e-8, "1.23e-07"), (6e-10, "1.234e-07"), (1e-7, "1.2e-07")):
        assert number(1.234e-7, ".3e", error) == expected
    assert number(123456.0, "#.4g", 3e3) == "1.235e+05"
    assert number(123456.0, "#.4g", 3e4) == "1.23e+05"
