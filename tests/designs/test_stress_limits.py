"""Limits on the stress in a block, against closed forms and the stress at many depths."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from scene_texts import DESIGN

import graded_contact as gc
from graded_contact.designs.problem import contact_criteria, design_contact
from graded_contact.designs.results import NO_ERROR, Candidate, DesignResults
from graded_contact.designs.search import not_in_mean_field
from graded_contact.designs.table import parse_design
from graded_contact.plot import plot_design
from graded_contact.sliding import contact_stress

LIMITS = "[design.limits]\nmax_tension = 1e9\nmax_von_mises = 1e9\nmax_interface_shear = 1e9\n"
CRACKS = DESIGN.replace("shape = [32, 32]", "shape = [32]").replace(
    "[design.parameters]", f"{LIMITS}[design.parameters]"
)
COULOMB = '[shear]\nkind = "coulomb"\ncoefficient = 0.5\n'


def test_stresses_of_full_contact_have_their_closed_form():
    """Under p₁ cos(qx) on a half space σ_xz is p₁ qz exp(-qz), von Mises in plane strain √3 of it.

    The mean pressure adds (1-2ν)/(1-ν) p̄ to σ_zz - σ_xx, and is 0 here, at ν = 1/2.
    """
    depth, modulus, height, size = 3e-4, 5e6, 1e-5, 1e-2
    rubber = gc.Elastic(modulus, 0.5)
    block = gc.Stack(layers=(gc.Layer(rubber, depth),), base=gc.HalfSpace(rubber))
    grid, q = gc.Grid((32,), size), 2 * np.pi / size
    wave = gc.Surface(height * jnp.cos(q * size / 32 * jnp.arange(32)), grid)
    text = CRACKS.replace("pressure = ", "pressure = 1e6 # ")
    own = parse_design(text.replace("starts = 2", f"starts = 2\nstress_depths = [{depth}]"))
    found = contact_criteria(own, block, wave, jnp.asarray(0.1))
    largest = modulus / (1 - 0.5**2) * q * height / 2 * q * depth * np.exp(-q * depth)
    np.testing.assert_allclose(found["interface_shear"], largest, rtol=1e-3)
    np.testing.assert_allclose(found["von_mises"], np.sqrt(3) * largest, rtol=1e-3)


def test_a_limit_holds_on_the_surface_and_on_both_sides_of_each_interface():
    """And at depths between, which are computed one by one here."""
    text = CRACKS.replace("max_von_mises = 1e9\n", "")
    study = parse_design(text.replace("[design]", f"{COULOMB}[design]", 1))
    block, (rough,), speed = study.scene.stack, study.surfaces, jnp.asarray(0.1)
    criteria = contact_criteria(study, block, rough, speed)
    sliding = design_contact(study, block, rough, speed)
    d = float(block.layers[0].thickness)
    inside = contact_stress(sliding, block, np.array([d / 4, d / 2, d]), side="above")
    below = contact_stress(sliding, block, np.array([0.0, d]), side="below")
    expected = max(float(stress.largest("tension").value) for stress in (inside, below))
    np.testing.assert_allclose(criteria["tension"], expected, rtol=1e-5)
    deepest = max((inside, below), key=lambda stress: float(stress.largest("tension").value))
    at = deepest.largest("tension").place[-1]
    np.testing.assert_allclose(criteria["tension_depth"], at, rtol=1e-6)
    np.testing.assert_allclose(criteria["interface_shear_depth"], d, rtol=1e-6)
    shear = np.max(below.shear[1])
    np.testing.assert_allclose(criteria["interface_shear"], shear, rtol=1e-4)
    margins = study.limits.margins({"tension": criteria["tension"][None]}, np.array([0.1]))
    assert list(margins) == ["tension of at most 1 GPa"]
    assert not study.has_mean_field and "no shear in the contact" in not_in_mean_field(study)


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("max_tension = 1e9", "max_tension = 0", "max_tension=0` is refused"),
        ("max_tension", "max_tensile", "did you mean `max_tension`"),
        ("starts = 2", "starts = 2\nstress_depths = [-1e-6]", "`stress_depths`: .* zero"),
        ('[[layers]]\nmaterial = "coat"\nthickness = 2e-4\n', "", "interface_shear. needs a layer"),
        ("velocity = 0.1", "velocity = 0.1\nstrain_per_slope = 1.0", "strain_per_slope"),
        ("[design]", '[motion]\nkind = "sinusoidal"\nstroke = 1e-4\nfrequency = 1.0\n[design]',
         '"tension" needs steady sliding'),
    ],
)  # fmt: skip
def test_stresses_that_no_contact_has_are_refused(old, new, message):
    assert old in CRACKS
    with pytest.raises(ValueError, match=message):
        parse_design(CRACKS.replace(old, new, 1))


def test_the_figure_and_the_table_have_the_objective_its_limits_and_the_depth():
    """With units; no point is outside a panel, and no loss tangent stands for a stress."""
    text = CRACKS.partition("[design]")[0] + COULOMB + DESIGN[DESIGN.index("[design]") :]
    text = text.replace('"friction"\nratio = 1.3', '"minimise_tension"').replace(
        "[design.parameters]", "[design.limits]\nmax_von_mises = 2e6\n[design.parameters]"
    )
    study = parse_design(text.replace("verify = 2", "verify = 0"))
    numbers = {"friction": 0.8, "contact_area": 0.3, "tension": 7e5, "tension_depth": 4e-5}
    numbers |= {"von_mises": 2.5e6, "von_mises_depth": 1e-5}
    blocks = {
        name: Candidate(
            study.scene.stack, None, {k: np.array([[f * v]]) for k, v in numbers.items()}
        )
        for name, f in (("before", 1.0), ("designed", 0.5))
    }
    design = SimpleNamespace(report=lambda: "")
    results = DesignResults(study, design, blocks, "contact", "so")
    told = results.report()
    assert "von Mises stress [MPa] at 0.1 m/s, contact" in told and "2e+06" not in told
    assert "depth of the largest tension [µm] at 0.1 m/s, contact" in told
    assert NO_ERROR in told and results.missed() == []
    worse = results._replace(candidates=dict(zip(blocks, [*blocks.values()][::-1], strict=True)))
    (missed,) = worse.missed()
    assert missed == "von Mises stress missed at 0.1 m/s: 2.5 MPa of at most 2 MPa, by contact"
    tension, von_mises = plot_design(results).axes
    assert tension.get_ylabel() == "tension [kPa]"
    assert von_mises.get_ylabel() == "von Mises stress [MPa]"
    for axes in (tension, von_mises):
        points = [line.get_ydata()[0] for line in axes.lines if line.get_marker() == "o"]
        lowest, highest = axes.get_ylim()
        assert len(points) == 2 and lowest == 0 and max(points) < highest
    (grey,) = von_mises.patches
    assert np.isclose(grey.get_y(), 2)
