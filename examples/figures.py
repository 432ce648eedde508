"""Draws the figures of the docs: `python examples/figures.py`."""

from pathlib import Path

import jax
import numpy as np

import graded_contact as gc
from graded_contact.sliding import slide_case

jax.config.update("jax_enable_x64", True)
EXAMPLES = Path(__file__).parent
DOCS = EXAMPLES.parent / "docs"


def save(name, figure):
    figure.savefig(DOCS / name, dpi=140)
    print(f"wrote docs/{name}")


def coated_tread():
    """The contact of the README."""
    q0 = 2 * np.pi / 8e-3
    spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=q0, q_roll=4 * q0, q_high=32 * q0)
    road = gc.random_surface(spectrum, gc.Grid((256, 256), 8e-3), jax.random.key(0))
    coat = gc.Layer(gc.Elastic(6.5e6, 0.49), thickness=50e-6)
    block = gc.Stack(layers=(coat,), base=gc.HalfSpace(gc.tyre_tread()))
    sliding = gc.slide(block, road, pressure=4e5, velocity=0.1)
    return gc.plot.plot_sliding(sliding, road, 0.1)


def indenter():
    """The contact of the first velocity."""
    scene = gc.read_scene(EXAMPLES / "indenter.toml")
    case = scene.case({name: values[0] for name, values in scene.axes.items()})
    return gc.plot.plot_sliding(slide_case(case), case.surface, case.velocity)


def sweep(name, *shown):
    return gc.plot.plot_sweep(gc.run_scene(gc.read_scene(EXAMPLES / name)), *shown)


save("front.png", coated_tread())
save("figures/indenter.png", indenter())
save("figures/shear_and_heat.png", sweep("shear_and_heat.toml"))
save(
    "figures/seal.png",
    sweep("seal_leakage.toml", ["leakage_along_x", "leakage_along_y"], "pressure"),
)
