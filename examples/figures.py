"""Draws the figures of `docs/howto/figures.md`: `python examples/figures.py [folder]`."""

import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import xarray

import graded_contact as gc
from graded_contact.scenes import parse_scene

jax.config.update("jax_enable_x64", True)
FOLDER = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1] / "docs" / "figures")
PRESSURE, VELOCITY, EDGE = 4e5, 0.1, 8e-3  # Pa, m/s, m
Q0 = 2 * np.pi / EDGE

SCENE = """
[surface]
kind = "self_affine"
rms_slope = 0.2
hurst = 0.8
q_roll = 3141.6
q_high = 12566.4
seed = 1
seeds = 6
[grid]
shape = [128, 128]
size = 8e-3
[materials.tread]
kind = "tyre_tread"
[materials.skin]
kind = "elastic"
modulus = 6.5e6
poisson = 0.49
[base]
kind = "half_space"
material = "tread"
[load]
pressure = 4e5
velocity = [1e-3, 1e-2, 0.1, 1.0, 10.0]
"""
COAT = '[[layers]]\nmaterial = "skin"\nthickness = 100e-6\n'


def save(name, figure):
    FOLDER.mkdir(parents=True, exist_ok=True)
    figure.savefig(FOLDER / f"{name}.png", dpi=140)
    print(f"wrote {FOLDER / name}.png")


def block(thickness=50e-6):
    coat = gc.Layer(gc.Elastic(6.5e6, 0.49), thickness)
    return gc.Stack(layers=(coat,), base=gc.HalfSpace(gc.tyre_tread()))


def of_contacts():
    spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=32 * Q0)
    road = gc.random_surface(spectrum, gc.Grid((256, 256), EDGE), jax.random.key(0))
    load = {"pressure": PRESSURE, "velocity": VELOCITY}
    sliding = gc.slide(block(), road, **load)
    theory = gc.mean_field_friction(block(), spectrum, **load)
    waves = gc.sliding.cumulative_friction(
        sliding.pressure, sliding.displacement, road.grid, VELOCITY
    )
    save("sliding", gc.plot.plot_sliding(sliding, road, VELOCITY))
    save("distributions", gc.plot.plot_distributions(sliding, theory))
    curves = {"contact": waves, "mean field": theory.against_cutoff}
    save("dissipation", gc.plot.plot_dissipation(curves))
    q = np.geomspace(1e2, 1e6, 200)
    save("response", gc.plot.plot_response(block(), q, [1e-3, 0.1, 10.0]))

    def friction(rubber, speed):
        base = gc.Stack(base=gc.HalfSpace(rubber))
        return gc.mean_field_friction(
            base, spectrum, pressure=PRESSURE, velocity=speed, rtol=1e-3
        ).friction

    omega = np.geomspace(1e-1, 1e8, 46)
    found = {
        f"{v:g} m/s": gc.sensitivity(
            lambda rubber, v=v: friction(rubber, v), gc.tyre_tread(), omega
        )
        for v in (1e-3, 1.0)
    }
    save("sensitivity", gc.plot.plot_sensitivity(found))


def of_materials():
    shift = gc.WLF(8.0, 120.0, 293.15)
    truth = gc.Prony(2e6, np.geomspace(2e7, 1e6, 8), np.geomspace(1e-7, 1, 8), 0.49, shift)
    omega, draw = 2 * np.pi * np.geomspace(0.1, 30, 14), np.random.default_rng(0)

    def isotherm(kelvin):
        exact = np.asarray(truth.at(kelvin).modulus(omega)) * kelvin / 293.15
        noise = draw.lognormal(0, 0.02, (2, omega.size))
        return kelvin, omega, exact.real * noise[0] + 1j * exact.imag * noise[1]

    isotherms = [isotherm(kelvin) for kelvin in np.arange(253.15, 334, 10)]
    curve = gc.master_curve(isotherms, vertical_shift_std=0.1, terms=7, poisson=0.49)
    save("master_curve", gc.plot.plot_master_curve(curve))
    save("fit", gc.plot.plot_fit(gc.fit_prony(*isotherms[4][1:], terms=4, poisson=0.49)))


def of_studies():
    texts = (SCENE, SCENE.replace("[base]", COAT + "[base]"))
    results = [gc.run_scene(parse_scene(text)) for text in texts]
    both = xarray.concat(results, "block", join="override", combine_attrs="drop")
    both = both.assign_coords(block=["bare", "100 µm coat"])
    save("compare", gc.plot.plot_sweep(both))
    spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=32 * Q0)

    def friction(x):
        coat = gc.Layer(gc.Elastic(x["modulus"], 0.49), x["thickness"])
        coated = gc.Stack(layers=(coat,), base=gc.HalfSpace(gc.tyre_tread()))
        return gc.mean_field_friction(
            coated, spectrum, pressure=PRESSURE, velocity=VELOCITY
        ).friction

    design = gc.minimise(
        friction, {"thickness": 5e-6, "modulus": 2e6}, {"thickness": 2e-4, "modulus": 2e7},
        constraints=lambda x: jnp.stack([1 - x["thickness"] / 1e-4, 1 - x["modulus"] / 1e7]),
        num_starts=4,
    )  # fmt: skip
    save("search", gc.plot.plot_search(design))


of_contacts()
of_materials()
of_studies()
