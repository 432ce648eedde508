"""Two bodies: sums of compliances, exchanged bodies, traction on both, energy, derivatives."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import rough

import graded_contact as gc
from graded_contact.fields.grid import wavevector
from graded_contact.mean_field import mean_field_friction
from graded_contact.response.stress import stress_field
from graded_contact.sliding import Coulomb, contact_stress, slide_cycle
from graded_contact.sliding.case import WINDOW
from graded_contact.sliding.interior.heat_source import shear_traction

Q0, LOAD = 2 * np.pi, 0.2


def rubber(strength=3.0, time=0.05, equilibrium=1.0, poisson=0.3):
    return gc.Stack(base=gc.HalfSpace(gc.Prony(equilibrium, [strength], [time], poisson)))


def elastic(modulus, poisson=0.3):
    """As rubber whose branch has no strength: all half spaces share programs."""
    return rubber(1e-13 * modulus, 1.0, modulus, poisson)


RIGID = elastic(1e13)


N = 15  # points and times of all lines: they share programs
ROUGH, OTHER = rough((N,), 1.0), rough((N,), 1.0, seed=3)
OTHER_BLOCK = rubber(10.0, 0.5, 1.0, 0.4)


NAMES = "friction", "contact_area", "block_friction", "energy_imbalance", "pressure_friction"


def slide(stack, counterface=RIGID, surface=ROUGH, velocity=1.0, **how):
    """With all numbers that tests ask for, in one program."""
    how = {"pressure": LOAD, "rtol": 1e-10, "shear": Coulomb(0.0)} | how
    found = gc.slide(stack, surface, velocity=velocity, counterface=counterface, **how)
    found.compute(*NAMES)
    return found


def cycle(stack, surface, displacement, **how):
    how = {"pressure": LOAD, "rtol": 1e-9, "period": 1.0} | how
    how["pressure"] = np.broadcast_to(how["pressure"], len(displacement)).astype(float)
    return slide_cycle(stack, surface, displacement=displacement, **how)


def reduced(modulus, poisson):
    return modulus / (1 - poisson**2)


def test_two_elastic_bodies_are_one_with_the_sum_of_compliances():
    """And a counterface that is very stiff is a rigid one."""
    for first, second in (((2.0, 0.3), (2.0, 0.3)), ((1.0, 0.2), (7.0, 0.45))):
        one = slide(elastic(1 / (1 / reduced(*first) + 1 / reduced(*second)), 0.0))
        two = slide(elastic(*first), elastic(*second))
        largest = float(one.pressure.max())
        np.testing.assert_allclose(two.pressure, one.pressure, atol=1e-9 * largest)
        np.testing.assert_allclose(two.gap, one.gap, atol=1e-9 * np.std(ROUGH.heights))
    rigid = gc.slide(rubber(), ROUGH, pressure=LOAD, velocity=1.0, rtol=1e-10)
    np.testing.assert_allclose(slide(rubber()).friction, rigid.friction, rtol=1e-8)
    np.testing.assert_allclose(slide(rubber()).contact_area, rigid.contact_area, rtol=1e-8)


def test_the_counterface_is_at_rest_under_its_waves():
    """It has its relaxed moduli, and the block loses all power."""
    found = slide(rubber(), rubber(10.0, 0.5))
    relaxed = slide(rubber(), elastic(1.0))
    np.testing.assert_allclose(found.friction, relaxed.friction, rtol=1e-8)
    assert found.energy_imbalance < 1e-12 and found.friction > 0.01


def steady_kernels(stack, counterface, coefficient, grid, velocity):
    """M_zz + f M_zx of both bodies; the counterface's compliance is turned about the x axis."""
    qx = np.asarray(wavevector(grid)[0])
    q = np.where(qx == 0, 1.0, qx)
    turned = np.diag([1.0, -1.0, -1.0])
    block = np.asarray(gc.surface_compliance_matrix(stack, q, 0 * q, -qx * velocity))
    other = np.asarray(gc.surface_compliance_matrix(counterface, q, 0 * q, 0 * q))
    # The forces on the counterface are opposite, and so is what opens the gap.
    other = turned @ other @ turned
    force = np.array([coefficient, 0.0, 1.0])
    found = (block @ force)[:, 2] + (other @ force)[:, 2]
    return np.where(qx == 0, 0, found)


def test_traction_acts_on_the_counterface_in_the_opposite_direction():
    first, second = rubber(), rubber(10.0, 0.5)
    for velocity in (1.0, -2.0):
        found = slide(first, second, velocity=velocity, shear=Coulomb(0.4))
        along = np.sign(velocity) * 0.4
        expected = steady_kernels(first, second, along, ROUGH.grid, velocity)
        np.testing.assert_allclose(found.operator.kernel, expected, rtol=1e-10)


def test_traction_does_not_part_two_equal_bodies_at_rest():
    """Dundurs's constant β is 0."""
    alone = slide(elastic(1.0))
    largest = float(alone.pressure.max())
    found = slide(elastic(2.0), elastic(2.0), shear=Coulomb(0.5))
    np.testing.assert_allclose(found.pressure, alone.pressure, atol=1e-8 * largest)
    unlike = slide(elastic(2.0, 0.1), elastic(2.0, 0.49), shear=Coulomb(0.5))
    assert np.max(np.abs(unlike.pressure - alone.pressure)) > 1e-2 * largest


def test_force_on_two_bodies_is_what_block_and_interface_lose():
    found = slide(rubber(), rubber(10.0, 0.5), shear=Coulomb(0.4))
    assert found.energy_imbalance < 1e-10
    assert 0 < found.block_friction < found.friction


def test_exchanged_bodies_have_the_same_friction_and_lose_their_works():
    """The frames of counterface and block are equivalent; numbers of points and times are odd."""
    steps = np.array([0, 1, 2, 3, 4, 5, 5, 4, 3, 3, 2, 1, 1, 0, 0])  # which both frames resolve
    s, how = steps / N, {"shear": Coulomb(0.3), "rtol": 1e-10}
    found = cycle(rubber(), ROUGH, s, counterface=OTHER_BLOCK, block_surface=OTHER, **how)
    swapped = cycle(OTHER_BLOCK, OTHER, -s, counterface=rubber(), block_surface=ROUGH, **how)
    works = "work", "load_work", "dissipated_power", "counterface_power", "interface_power"
    work, load_work, *lost = found.compute(*works, "contact_area_pixels", "friction")[:5]
    swapped.compute(*works, "contact_area_pixels", "friction")
    np.testing.assert_allclose(work + load_work, sum(lost), rtol=1e-10)
    for name in ("mean_gap", "work", "load_work", "contact_area_pixels"):
        tiny = 1e-9 * float(jnp.max(jnp.abs(getattr(found, name))))
        same = getattr(swapped, name), getattr(found, name)
        np.testing.assert_allclose(*same, rtol=1e-6, atol=tiny)
    np.testing.assert_allclose(swapped.friction, -found.friction, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(swapped.counterface_power, found.dissipated_power, rtol=1e-6)
    np.testing.assert_allclose(swapped.dissipated_power, found.counterface_power, rtol=1e-6)
    # The pressure is the same field, seen from the other body.
    moved = np.stack([np.roll(p, -k) for p, k in zip(swapped.pressure, steps, strict=True)])
    largest = float(found.pressure.max())
    np.testing.assert_allclose(moved, found.pressure, atol=1e-6 * largest)


def test_roughness_on_the_block_alone_is_that_of_a_counterface_that_moves_backwards():
    """So Coulomb's traction in a cycle is that of steady sliding."""
    flat = dataclasses.replace(ROUGH, heights=jnp.zeros(N))
    once = np.arange(N) / N  # once through the period of the surface
    how = {"shear": Coulomb(0.3), "rtol": 1e-10}
    found = cycle(rubber(), flat, once, counterface=OTHER_BLOCK, block_surface=ROUGH, **how)
    expected = slide(OTHER_BLOCK, rubber(), velocity=-1.0, **how)
    found.compute("friction", "mean_friction")
    np.testing.assert_allclose(found.friction, expected.friction, rtol=1e-6)
    np.testing.assert_allclose(found.mean_friction, expected.friction, rtol=1e-6)


def test_two_bodies_obey_the_conditions_of_contact_with_a_dense_matrix():
    """By sums over waves and frequencies of both; energy is what friction, load and bodies have."""
    n, nt = N, N
    t = x = np.arange(N) / N
    s = 0.15 * np.sin(2 * np.pi * t) + 0.05 * np.cos(4 * np.pi * t)
    load = LOAD * (1 + 0.4 * np.sin(2 * np.pi * t))
    own, other = rough((n,), 1.0, last=3), rough((n,), 1.0, last=3, seed=3)
    counterface = rubber(8.0, 0.2, 2.0)
    found = cycle(rubber(), own, s, pressure=load, counterface=counterface, block_surface=other)
    powers = "dissipated_power", "counterface_power"
    found.compute(*powers, "work", "load_work", "traction", "energy_imbalance")
    q, w = 2 * np.pi * np.fft.fftfreq(n, 1 / n), 2 * np.pi * np.fft.fftfreq(nt, 1 / nt)
    waves, iw = q[q != 0], 1j * w
    moduli = 1 + 3 * iw * 0.05 / (1 + iw * 0.05), 2 + 8 * iw * 0.2 / (1 + iw * 0.2)
    beat = np.exp(iw * t[:, None])
    moved, rates = [], []
    p = np.asarray(found.pressure)
    for modulus, place in zip(moduli, (s, 0 * s), strict=True):
        kernel = 2 * (1 - 0.3**2) / (np.abs(waves)[:, None] * modulus)
        point = np.exp(1j * waves * (x[None, :, None] + place[:, None, None]))
        wave = np.einsum("uyq,uw,uy->qw", point.conj(), beat.conj(), p) * kernel / (n * nt)
        moved.append(np.einsum("txq,tw,qw->tx", point, beat, wave).real)
        # At fixed points of the body.
        rates.append(np.einsum("txq,tw,qw->tx", point, beat, iw * wave).real)
    along = np.exp(1j * q * (x[None, :, None] + s[:, None, None]))
    passing = (along @ (np.fft.fft(other.heights) / n)).real
    gap = sum(moved) - own.heights - passing + np.asarray(found.mean_gap)[:, None]
    scale = np.std(own.heights)
    assert np.all(p >= 0) and np.min(gap) > -1e-6 * scale
    assert np.max(np.abs(p * gap)) < 1e-6 * scale * p.max() and 0.1 < np.mean(p > 0) < 0.9
    np.testing.assert_allclose(p.mean(axis=1), load, rtol=1e-12)
    powers = [np.mean(p * rate) for rate in rates]
    np.testing.assert_allclose(found.dissipated_power, powers[0], rtol=1e-7)
    np.testing.assert_allclose(found.counterface_power, powers[1], rtol=1e-7)
    np.testing.assert_allclose(found.work + found.load_work, sum(powers), rtol=1e-7)
    slope = lambda field: np.fft.ifft(1j * q * np.fft.fft(field, axis=-1), axis=-1).real  # noqa: E731
    parts = [np.mean(slope(body.heights) ** 2) for body in (other, own)]
    forms = moved[0] - passing, own.heights - moved[1]
    force = [-np.mean(p * slope(form), axis=1) for form in forms]
    force = (parts[1] * force[0] + parts[0] * force[1]) / sum(parts)
    np.testing.assert_allclose(found.traction, force, rtol=1e-7, atol=1e-12)
    assert found.energy_imbalance < 1e-10 and min(powers) > 0


def test_stress_in_the_counterface_is_that_in_the_block_of_exchanged_bodies():
    """From the counterface the traction of the motion is that of the opposite motion."""
    soft, stiff = elastic(1.0), elastic(4.0, 0.45)
    depths = [0.0, 0.1]
    found = slide(soft, stiff, shear=Coulomb(0.3))
    traction = jax.jit(shear_traction)(found)
    in_counterface = [
        stress_field(stiff, found.grid, found.pressure, depth, 0 * found.velocity, -traction).stress
        for depth in jnp.array(depths)
    ]
    exchanged = slide(stiff, soft, velocity=-1.0, shear=Coulomb(0.3))
    in_block = contact_stress(exchanged, depths)
    scale = np.max(np.abs(in_block.stress))
    von_mises, tension = jax.jit(lambda at: (at.von_mises, at.tension))(in_block)
    np.testing.assert_allclose(in_counterface, in_block.stress, atol=1e-6 * scale)
    assert np.max(von_mises) > 0.1 * LOAD
    principal = np.linalg.eigvalsh(in_block.stress)[..., -1]
    np.testing.assert_allclose(tension, principal, atol=1e-9 * scale)
    np.testing.assert_allclose(in_block.shear[0], 0.3 * exchanged.pressure, atol=1e-3 * scale)
    open_edges = dataclasses.replace(found.problem, facts=frozenset({WINDOW}))
    with pytest.raises(ValueError, match="on a non-periodic surface"):
        contact_stress(dataclasses.replace(found, problem=open_edges), [0.0])


def test_the_mean_field_of_exchanged_bodies_is_the_same():
    track = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=Q0, q_roll=2 * Q0, q_high=64 * Q0)
    own = gc.SelfAffine(rms_slope=0.1, hurst=0.7, q_low=Q0, q_roll=2 * Q0, q_high=32 * Q0)
    first, second, how = rubber(), rubber(10.0, 0.5), {"pressure": LOAD, "velocity": 1.0}
    found = mean_field_friction(first, track, own_roughness=own, counterface=second, **how)
    other = mean_field_friction(second, own, own_roughness=track, counterface=first, **how)
    np.testing.assert_allclose(other.friction, found.friction, rtol=1e-4)
    np.testing.assert_allclose(other.contact_area, found.contact_area, rtol=1e-4)
