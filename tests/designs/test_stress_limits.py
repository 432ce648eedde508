"""Limits on the stress in a block, against closed forms and the stress at many depths."""

import jax.numpy as jnp
import numpy as np
from scene_texts import DESIGN

import graded_contact as gc
from graded_contact.designs.problem import contact_criteria, design_contact
from graded_contact.designs.search import not_in_mean_field
from graded_contact.designs.table import parse_design
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
