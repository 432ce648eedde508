"""What a result prints: its numbers with units, arrays by shape, how it ended."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contact.solution import RESULTS, ContactSolution
from graded_contact.core.quantities import quantity_of
from graded_contact.files.design_scene import DesignScene, Stiffness
from graded_contact.fitting.lengths import Length
from graded_contact.fitting.quality import FitErrors, Floor
from graded_contact.friction.sliding import OBSERVABLES
from graded_contact.response.interior import InteriorFields
from graded_contact.roughness.surface import Statistics, Step
from graded_contact.studies.cost import Cost
from graded_contact.studies.design import Design, History, Run
from graded_contact.studies.run_design import Candidate, DesignResults
from graded_contact.studies.uncertainty import Estimate, Sensitivity

RESULT_CLASSES = (
    gc.Sliding, gc.ContactSolution, gc.contacts.ContactPath, gc.contacts.CutoffCurve,
    gc.contacts.MeanField, Statistics, InteriorFields, Sensitivity, gc.Layer, gc.Elastic, gc.Prony,
    gc.WLF, gc.Grid, gc.Surface,
    Candidate, Run, Stiffness, Floor, FitErrors, Step, gc.HardWall, gc.AdhesiveLJ,
)  # fmt: skip


def sliding(friction=0.25, shape=(16, 12), result=RESULTS.successful, **numbers):
    """A `Sliding` with a number of its own in every field, without solving anything."""
    fields = {f.name: jnp.array(2.0) for f in dataclasses.fields(ContactSolution)}
    field = jnp.zeros(shape)
    fields |= {"pressure": field, "displacement": field, "gap": field, "correction": field}
    fields |= {"target_error": None}
    contact = ContactSolution(**fields | {"mean_gap": jnp.array(6.13e-5), "result": result})
    found = gc.Sliding(
        contact=contact,
        kernel=field,
        heights=field,
        measured=None,
        grid=gc.Grid(shape, 1.0),
        velocity=jnp.array(0.0),
        law=gc.HardWall(),
    )
    vars(found).update(dict.fromkeys(OBSERVABLES, jnp.array(0.0)))
    numbers |= {"friction": jnp.array(friction), "friction_error": jnp.array(1.7e-8)}
    vars(found).update(numbers)
    return found


def line(text, name):
    """What stands behind a name."""
    (found,) = (row for row in text.splitlines() if row.strip().startswith(f"{name} "))
    return found.strip().removeprefix(name).strip()


def test_a_result_shows_numbers_units_errors_shapes_and_how_it_ended():
    text = repr(sliding())
    assert line(text, "friction") == "0.25 ± 1.7e-08"
    assert "friction_error" not in text
    assert line(text, "mean_gap [m]") == "6.13e-05"
    assert line(text, "pressure [Pa]") == "16 × 12 float64"
    assert line(text, "result") == "successful"
    failed = repr(sliding(result=RESULTS.max_steps_reached))
    assert line(failed, "result").startswith("The contact solver reached `max_steps`")
    steep = sliding(slope_in_contact=jnp.array(0.8))
    assert "small strains" in repr(steep)


def test_a_derivative_shows_no_units_of_what_it_is_by(unchecked_types):
    layer = gc.Layer(gc.Elastic(1e7, 0.3), 1e-5)
    rubber = gc.Prony(1e6, [1e7], [1e-3], 0.4, shift=gc.WLF(10.0, 50.0, 300.0))
    stack = gc.Stack(layers=(layer,), base=gc.HalfSpace(rubber))
    slope = jax.grad(lambda s: jnp.abs(gc.surface_compliance(s, 1e4, 1e3)))(stack)
    for text in (repr(slope), repr(slope.layers[0]), repr(slope.base.material)):
        assert "thickness" in text or "equilibrium" in text
        assert "[m]" not in text and "[Pa]" not in text
    assert ">thickness<" in slope._repr_html_()
    for same in (stack, gc.with_values(stack, {"layers[0].thickness": 2e-5}), stack.at(310.0)):
        assert "thickness [m]" in repr(same) and "equilibrium [Pa]" in repr(same)
    omega = np.geomspace(1.0, 1e5, 20)
    fitted = gc.fit_prony(omega, np.asarray(rubber.modulus(omega)), terms=1).material
    for material in (rubber.at(310.0), fitted):
        assert "equilibrium [Pa]" in repr(material)


def test_a_derivative_of_a_result_shows_no_units(unchecked_types):
    grid = gc.Grid((8, 8), 1e-3)
    heights = jnp.asarray(np.random.default_rng(0).normal(size=(8, 8)))

    def of(scale):
        return gc.surface.statistics(gc.Surface(scale * heights, grid))

    assert "rms_height [m]" in repr(of(1e-6))
    assert "rms_height  " in repr(jax.jvp(of, (1e-6,), (1.0,))[1])


def test_a_stack_of_graded_layers_is_shown():
    blend = gc.Blend(gc.Elastic(1e6, 0.3), gc.Elastic(1e7, 0.3))
    stack = gc.Stack(layers=(gc.GradedLayer(blend, 1e-4),), base=gc.Rigid())
    assert "modulus [Pa]" in repr(stack)
    assert "thickness [m]" in repr(gc.blocks.sliced(stack, num_slices=2))


def test_notebooks_see_a_table_with_the_same_rows_and_their_meaning():
    page = sliding()._repr_html_()
    assert page.count("<tr") == len(repr(sliding()).splitlines()) - 1
    assert "0.25 ± 1.7e-08" in page
    assert 'title="friction coefficient"' in page


def test_traced_results_show_their_shapes():
    seen = []
    jax.jit(lambda s: seen.append((repr(s), eqx.tree_pformat(s), s._repr_html_())))(sliding())
    assert seen[0][0] == seen[0][1]
    assert "f64[]" in seen[0][0]
    assert "f64[]" in seen[0][2]


def test_parts_rows_and_lists_are_shown():
    materials = [gc.Elastic(2e6, 0.3), gc.Prony(1e5, jnp.geomspace(1, 9, 9), jnp.ones(9))]
    layers = [gc.Layer(material, 1e-4) for material in (materials * 5)]
    text = repr(gc.Stack(layers=layers, base=gc.Rigid()))
    assert text.count("thickness [m]") == 8
    assert "modulus [Pa]" in text  # of `Elastic`: the field `young`, the path `modulus`
    assert line(text, "...") == "2 more"
    assert "9 float64, 1 to 9" in text
    assert text.splitlines()[-1].split() == ["base", "Rigid"]


def test_batches_of_results_and_other_values_are_shown():
    batch = jax.vmap(lambda x: Estimate(x, 2 * x))(jnp.array([1.0, jnp.nan]))
    assert line(repr(batch), "value") == "1, nan"
    assert line(repr(batch), "standard_error") == "2, nan"


def test_a_design_shows_units_by_path_and_how_it_ended():
    path = "layers[0].thickness"
    history = History(np.ones(2), np.ones((2, 1)), np.zeros((2, 0)))
    run = Run([2e-5], 0.3, history, 2, True, True, "It met the tolerance.")
    design = Design({path: 2e-5}, 0.3, {path: -1.5}, np.zeros(0), (run,))
    text = repr(design)
    assert line(text, f"{path} [m]") == "2e-05" and text.count(f"{path} ") == 2
    assert line(text, "message") == "It met the tolerance." and line(text, "converged") == "True"
    numbers = np.array([[0.11, 0.12]])
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(2e6)))
    of_field: Any = Estimate(jnp.array(1.0), jnp.array(0.1))
    candidate = Candidate(block, of_field, numbers, numbers / 2)
    nothing: Any = None
    found = DesignResults(nothing, design, None, {"before": candidate, "designed": candidate})
    text, page = repr(found), found._repr_html_()
    assert line(text, "polished") == "none" and text.count("0.11, 0.12") == 2
    assert text.splitlines()[0] == "DesignResults" and page.count("0.055, 0.06") == 2


@pytest.mark.parametrize("kind", [DesignScene, DesignResults, Length, Cost])
def test_what_is_made_of_other_things_is_shown_too(kind):
    assert kind.__repr__ is Design.__repr__


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
