"""Stress under pressure and traction: closed form of a line contact, equilibrium, derivatives."""

import jax
import jax.numpy as jnp
import numpy as np

import graded_contact as gc
from graded_contact.response.stress import stress_field

GRID = gc.Grid((16, 16), (4e-3, 3e-3))
SPECTRUM = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=1600, q_roll=3200, q_high=5000)
COAT = gc.Layer(gc.Elastic(3e7, 0.35), 2e-4)
BLOCK = gc.Stack(layers=(COAT,), base=gc.HalfSpace(gc.Elastic(2e6, 0.45)))


def test_line_contact_has_its_closed_form():
    """Under p0 √(1 - x²/a²) and f times that: σ_xx = -p - 2 f p0 x/a, and 2 f p0 at x = -a.

    The traction alone gives -2 f p0 (x/a ∓ √(x²/a² - 1)), the root outside of contact.
    """
    num, size, a, f = 1024, 1.0, 0.05, 0.5
    x = (np.arange(num) - num // 2) * size / num
    pressure = np.sqrt(np.maximum(1 - (x / a) ** 2, 0))
    stack = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, 0.3)))
    grid = gc.Grid((num,), size)
    zero, pressure = jnp.zeros(()), jnp.asarray(pressure)
    found = stress_field(stack, grid, pressure, zero, zero, f * pressure)
    along, far = found.stress[:, 0, 0], np.abs(x) > a
    outside = np.sign(x) * np.sqrt(np.where(far, (x / a) ** 2 - 1, 0))
    expected = -pressure - 2 * f * (x / a - outside)
    # In a plane σ_xx = σ_zz under a wave of pressure; the mean has ν/(1 - ν) σ_zz.
    expected = expected + (1 - 0.3 / 0.7) * np.mean(pressure)
    near = (np.abs(x) < 2 * a) & (np.abs(np.abs(x) - a) > 4 * size / num)
    # The images of the traction add what is linear in x.
    np.testing.assert_allclose(along[near], expected[near], atol=0.02)
    np.testing.assert_allclose(found.stress[near, 0, 2], -f * pressure[near], atol=1e-3)
    tension = np.linalg.eigvalsh(found.stress)[..., -1]
    assert abs(x[np.argmax(tension)] + a) < 2 * size / num
    np.testing.assert_allclose(np.max(tension), 2 * f, rtol=0.1)


def derivative(field, axis):
    """By NumPy; the shortest wave has none."""
    n = GRID.shape[axis]
    number = np.fft.fftfreq(n, 1 / n) * (np.arange(n) != n / 2)
    q = 2 * np.pi / float(GRID.size[axis]) * number
    q = q.reshape(np.where(np.arange(field.ndim) == axis, n, 1))
    return np.fft.ifft(1j * q * np.fft.fft(field, axis=axis), axis=axis).real


def test_traction_along_both_axes_is_in_equilibrium():
    """By differences over the depth, in a coat and below; and the surface has the traction."""
    fields = [gc.random_surface(SPECTRUM, GRID, jax.random.key(i)).heights * 1e9 for i in range(3)]
    pressure, traction = fields[0], jnp.stack(fields[1:], axis=-1)

    def at(z):
        depth = jnp.asarray(z)
        return jax.device_get(stress_field(BLOCK, GRID, pressure, depth, 0 * depth, traction))

    top = at(0.0).stress
    np.testing.assert_allclose(top[..., 2, 2], -pressure, atol=1e-6 * np.max(pressure))
    np.testing.assert_allclose(top[..., :2, 2], -traction, atol=1e-6 * np.max(pressure))
    step = 1e-7
    for z, (young, poisson) in ((1e-4, (3e7, 0.35)), (4e-4, (2e6, 0.45))):
        above, here, below = (at(z + i * step) for i in (-1, 0, 1))
        rate = (below.stress - above.stress) / (2 * step)
        for i in range(3):
            along = sum(derivative(here.stress[..., i, j], j) for j in range(2))
            force = rate[..., i, 2] + along
            scale = np.max(np.abs(rate[..., i, 2]))
            np.testing.assert_allclose(force, 0, atol=1e-5 * scale)
        # Hooke's law holds for the strains of the displacement.
        slopes = [derivative(here.displacement[..., i], j) for i in range(3) for j in (0, 1)]
        slopes = np.stack(slopes, -1).reshape(*GRID.shape, 3, 2)
        deep = (below.displacement - above.displacement)[..., None] / (2 * step)
        gradient = np.concatenate([slopes, deep], axis=-1)
        strain = (gradient + np.swapaxes(gradient, -1, -2)) / 2
        mean = np.trace(strain, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
        stress = young / (1 + poisson) * (strain + poisson / (1 - 2 * poisson) * mean)
        without_mean = here.stress - np.mean(here.stress, axis=(0, 1))
        stress = stress - np.mean(stress, axis=(0, 1))
        np.testing.assert_allclose(stress, without_mean, atol=1e-4 * np.max(np.abs(stress)))
