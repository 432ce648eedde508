import jax
import numpy as np
from scipy.special import gamma

import graded_contact as gc
from graded_contact.surfaces import (
    SpectrumTable,
    radial_spectrum,
    random_surface,
    statistics,
)

HURST, ROLL, PLATEAU = 0.8, 2 * np.pi / 3e-3, 1e-18


def _density(q):
    return PLATEAU * (1 + (q / ROLL) ** 2) ** -(1 + HURST)


def _line_density(q):
    """∫ dk_y C(√(q² + k_y²)) in closed form."""
    full = np.sqrt(np.pi) * gamma(HURST + 0.5) / gamma(HURST + 1)
    return PLATEAU * ROLL * full * (1 + (q / ROLL) ** 2) ** -(0.5 + HURST)


def test_a_line_of_a_power_law_has_the_spectrum_of_the_surface():
    # The inversion alone, without the scatter of a line.
    q = np.geomspace(0.3 * ROLL, 300 * ROLL, 31)
    found = np.asarray(SpectrumTable.from_line(q, _line_density(q)).values) / _density(q)
    np.testing.assert_allclose(found[q > ROLL], 1, rtol=0.1)
    np.testing.assert_allclose(found[q > 3 * ROLL], 1, rtol=0.02)
    np.testing.assert_allclose(found, 1, rtol=0.6)


def test_surface_of_a_table_has_its_roughness_and_its_spectrum():
    q = np.geomspace(2 * np.pi / 1e-3, np.pi * 127 / 1e-3, 30)
    table = SpectrumTable(q, _density(q), ("Of a test.",), ("It is doubtful.",))
    rough = random_surface(table, gc.Grid((128, 128), 1e-3), jax.random.key(1))
    assert (rough.history, rough.warnings) == (table.history, table.warnings)
    rms_slope = jax.jit(lambda table: table.rms_slope)(table)
    np.testing.assert_allclose(statistics(rough).rms_slope, rms_slope, rtol=0.02)
    found, values = map(np.asarray, radial_spectrum(rough, 24))
    known = (values > 0) & (found < q[-1] / 1.2)
    np.testing.assert_allclose(values[known], _density(found[known]), rtol=0.06)


def test_moments_of_a_table_are_integrals_of_its_powers():
    table = SpectrumTable([1.0, 10.0, 100.0], [1.0, 1e-2, 1e-5])  # q^-2, then q^-3 / 10
    q2 = 2 * np.pi * (np.log(10) + 0.1 * 100 * (1 / 10 - 1 / 100))
    moments = jax.jit(lambda table: [table.moment(order) for order in (0, 2)])(table)
    np.testing.assert_allclose(moments[0], q2, rtol=1e-12)
    q4 = 2 * np.pi * ((100 - 1) / 2 + 0.1 * 100 * (100 - 10))
    np.testing.assert_allclose(moments[1], q4, rtol=1e-12)
    part = table.between(2.0, 50.0)
    density = jax.jit(lambda q: part.density(q))(np.array([1.9, 5.0, 51.0]))
    np.testing.assert_allclose(density, [0, 0.04, 0])
    np.testing.assert_allclose(table.between(0.5, 200.0).q, table.q)
