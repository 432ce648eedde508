"""Heat in the mean field: each scale at its temperature, the fixed point and its derivative."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.mean_field.heating_by_scale import _rises
from graded_contact.sliding import Heating, PeakedShear

Q0 = 2 * np.pi / 1e-2
ROAD = gc.SelfAffine(rms_slope=1.5, hurst=0.8, q_low=Q0, q_roll=3 * Q0, q_high=1e4 * Q0)
TREAD = gc.Stack(base=gc.HalfSpace(gc.tyre_tread()))
TISSUE = Heating(0.25, 1.1e-7, 1.0)
WEAK, STRONG = (PeakedShear(peak, 6e-3, 0.1, gc.Arrhenius(9.65e4, 293.15)) for peak in (1e-3, 6e6))
COOL = {"pressure": 3e5, "temperature": 293.15}


@jax.jit
def of(stack, velocity, shear, heating):
    how = COOL | {"velocity": velocity, "heating": heating, "shear": shear}
    return gc.mean_field_friction(stack, ROAD, **how)


def friction(velocity, heating=TISSUE, shear=WEAK):
    return of(TREAD, velocity, shear, heating)


def cold(velocity, shear=WEAK):
    return of(TREAD.at(293.15), velocity, shear, None)


def test_slow_sliding_and_good_conductors_stay_cold():
    slow = friction(1e-8)
    assert 0 < slow.heated.surface_rise < 1e-5
    np.testing.assert_allclose(slow.friction, cold(1e-8).friction, rtol=1e-6)
    metal = friction(1.0, Heating(2.5e5, 0.11, 0.0))
    assert 0 < metal.heated.surface_rise < 2e-3
    same = cold(1.0)
    np.testing.assert_allclose(metal.friction, same.friction, rtol=1e-4)
    assert same.heated is None


@pytest.mark.parametrize("shear", [WEAK, STRONG])
def test_heat_lowers_the_friction_of_the_tread_at_high_speed(shear):
    """Hysteresis at 20 °C grows with speed; heat stops that, and with shear friction falls."""
    speeds = (0.1, 1.0, 10.0) if shear is WEAK else (0.1, 10.0)
    warm = np.array([friction(v, shear=shear).friction for v in speeds])
    same = np.array([cold(v, shear=shear).friction for v in speeds])
    if shear is WEAK:
        assert np.all(np.diff(same) > 0) and np.all(warm < same)
        growth = [np.diff(np.log(a)) for a in (same, warm)]
        assert np.all(growth[1] < growth[0]) and growth[1][-1] < 0.2 * growth[0][-1]
    else:
        assert same[-1] > same[0] and np.all(np.diff(warm) < 0) and warm[-1] < 0.7 * warm[0]


def test_the_temperature_of_one_wave_is_the_integral_of_its_green_function():
    """Green's function of the half space over the depths of the heat and of the scale."""
    wave, scale, kappa, diffusivity, speed = 1e3, 3e3, 0.25, 1e-7, 3e-4
    heating = Heating(kappa, diffusivity, 0.0)
    q, x, heat, shear = [wave, wave * (1 + 1e-9)], [0.0, 5e-3], [0.0, 2.0], 0.0
    found = _rises(heating, *map(jnp.asarray, (q, x, heat, shear, [scale], speed)))
    # Depths above which the shares 0 ... 1 of the heat and of the scale lie.
    shares = (np.arange(500) + 0.5) / 500
    made, seen = -np.log1p(-shares) / (2 * wave), -np.log1p(-shares) / (2 * scale)
    seen = np.append(0.0, seen)[:, None]
    cosine = np.cos((np.arange(16) + 0.5) * np.pi / 32)
    total = 0
    for k in np.sqrt(wave**2 + 1j * wave * speed * cosine / diffusivity):
        green = np.exp(-k * abs(made - seen)) + np.exp(-k * (made + seen))
        total = total + np.mean((green / (2 * kappa * k)).real, 1) / len(cosine)
    # Half of the power of a wave's own heat, of the mean square x.
    true = 0.5 * 2.0 * 5e-3 * np.array([total[0], np.mean(total[1:])])
    np.testing.assert_allclose(found, true, rtol=1e-3)
