"""A coating for 30 % more friction at the same stiffness.

    python examples/design_coating.py [points along an edge] [surfaces]

The block is tyre tread under 0.2 mm of a softer rubber. Which thickness, moduli and relaxation
times of that coat give 30 % more friction at 0.1 m/s, if |effective modulus| of the block under
waves of 2.5 mm may change by 1 %? The mean field finds a coat in seconds, contact goes on from
there, and surfaces that the search has not seen verify it.
"""

import sys

import jax
import jax.numpy as jnp
import numpy as np

import graded_contact as gc

jax.config.update("jax_enable_x64", True)
POINTS, SURFACES = (int(word) for word in (*sys.argv[1:], 256, 8)[:2])
PRESSURE, VELOCITY = 3e5, 0.1  # Pa, m/s
Q = 2.5e3  # rad/m, of waves of 2.5 mm

coat = gc.Prony(5e6, strengths=[5e6, 1e7], times=[1e-2, 1e-4], poisson=0.49)
block = gc.Stack(layers=(gc.Layer(coat, 2e-4),), base=gc.HalfSpace(gc.tyre_tread(poisson=0.49)))
grid = gc.Grid((POINTS, POINTS), 1e-2)
road = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=2 * np.pi / 1e-2, q_roll=Q, q_high=1e4)
bounds = {
    "layers[0].thickness": (5e-5, 1e-3),
    "layers[0].material.equilibrium": (1e6, 2e7),
    "layers[0].material.strengths[0]": (1e6, 1e8),
    "layers[0].material.strengths[1]": (1e6, 1e8),
    "layers[0].material.times[0]": (1e-3, 1e-1),
    "layers[0].material.times[1]": (1e-5, 1e-3),
}
lower = {path: low for path, (low, _) in bounds.items()}
upper = {path: high for path, (_, high) in bounds.items()}
start = {path: gc.core.paths(block)[path] for path in bounds}


def by_mean_field(values):
    stack = gc.with_values(block, values)
    return gc.mean_field_friction(stack, road, pressure=PRESSURE, velocity=VELOCITY).friction


def by_contact(values, key):
    stack, surface = gc.with_values(block, values), gc.random_surface(road, grid, key)
    return gc.slide(stack, surface, pressure=PRESSURE, velocity=VELOCITY, rtol=1e-5).friction


def limits(values):
    def stiffness(stack):
        return jnp.abs(gc.effective_modulus(stack, Q, 250.0))

    change = stiffness(gc.with_values(block, values)) / stiffness(block) - 1
    thickness = values["layers[0].thickness"]
    return {"softer": 0.01 + change, "stiffer": 0.01 - change, "thick": 1 - thickness / 5e-4}


def search(friction, first, **options):
    """Returns the coat nearest to 1.3 times the friction of the block."""
    wanted = 1.3 * friction(start)

    def miss(values):
        return jnp.log(friction(values) / wanted) ** 2

    return gc.minimise(
        miss, lower, upper, first, constraints=limits, num_starts=1, progress=True, **options
    )


key = jax.random.key(0)
design = search(by_mean_field, start)
# The mean field is a theory of averages: contact goes on from its design, on one surface.
design = search(lambda v: by_contact(v, key), design.parameters, rtol=1e-4, max_steps=30)
print(design)
contact = gc.jit(by_contact)
gains = [
    float(contact(design.parameters, new) / contact(start, new))
    for new in jax.random.split(key, SURFACES)
]
error = np.std(gains, ddof=1) / np.sqrt(SURFACES)
print(f"friction over friction of the initial block on {SURFACES} new surfaces: ", end="")
print(f"{np.mean(gains):.3f} ± {error:.3f}")
