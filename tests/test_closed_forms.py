"""Closed forms against published numbers; contacts and `test_published.py` prove the others."""

import runpy
from pathlib import Path

import closed_forms
import numpy as np
import pytest

PAPER = Path(__file__).parents[1] / "examples" / "paper" / "coated_half_space.py"
paper_coated_half_space = runpy.run_path(str(PAPER))["paper_coated_half_space_compliance"]


def test_paper_coated_half_space_is_right_only_where_poisson_ratios_are_constant():
    q = np.array([0.1, 1.0, 4.0])
    args = (q, 1.0, 2 - 1j, 0.3)
    same = paper_coated_half_space(*args, 0.3, 5 + 1j, 0.45, 0.45)
    exact = closed_forms.coated_half_space_compliance(*args, 5 + 1j, 0.45)
    np.testing.assert_allclose(same, exact, rtol=1e-12)
    # A glassy half space, ν 0.49 -> 0.3, comes out 14.6 times too soft (same solid as coating).
    soft = paper_coated_half_space(q, 1e-3, 1.0, 0.3, 0.49, 1.0, 0.3, 0.49)
    np.testing.assert_allclose(soft / closed_forms.half_space_compliance(q, 1.0, 0.3), 14.571, 1e-4)
    with pytest.raises(ValueError, match=r"`poisson_at_rest=0\.5` is refused"):
        paper_coated_half_space(q, 1.0, 1.0, 0.3, 0.5, 1.0, 0.3, 0.49)


@pytest.mark.parametrize(
    "time, peak, left, right, friction",
    [
        (0, 60.318, -6.333, 6.333, 0),
        (0.009, 78.734, -3.907, 5.838, 0.024444),
        (0.045, 84.718, -3.970, 5.051, 0.011916),
        (2.0, 85.302, -4.447, 4.509, 0.000648),
    ],
)
def test_cylinder_matches_wang_and_knothe(time, peak, left, right, friction):
    """Two cylinders of 100 mm radius, G = 1143 MPa, ν = 0.4, as CONTACT's reference output."""
    modulus = 1143e6 / (1 - 0.4)
    contact = closed_forms.viscoelastic_cylinder(600e3, 0.05, modulus, 1.0, time, 1.0)
    assert contact.peak_pressure / 1e6 == pytest.approx(peak, abs=6e-4)
    interval = np.array([-1, 1]) * contact.half_width + contact.offset
    np.testing.assert_allclose(interval * 1e3, [left, right], atol=6e-4)
    assert contact.friction == pytest.approx(friction, abs=6e-7)
    published = {0: (60.32, 80), 0.009: (78.74, 62), 0.045: (84.72, 57), 2.0: (85.31, 56)}[time]
    assert contact.peak_pressure / 1e6 == pytest.approx(published[0], rel=2e-4)
    # The program counts elements of 0.16 mm that touch at all.
    assert 0 <= published[1] - 2e3 * contact.half_width / 0.16 < 2
