"""Beyond the paper: what friction depends on, d ln μ/d ln(property) over pressure and thickness.

    python benchmarks/paper/property_map.py [--small]

By the derivative of each contact, all properties at once: the coat's thickness and modulus, the
rubber's relaxed modulus, the strengths of its relaxations (all together), pressure and velocity.
"""

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib import rc_context
from system import (
    POISSON,
    Q0,
    SMALL,
    STYLE,
    VELOCITY,
    kept,
    num_failed,
    options,
    panels,
    relaxed,
    save,
    surface,
    tread,
)

import graded_contact as gc
from graded_contact.studies.store import Store

PROPERTIES = {
    "thickness": "thickness of the coat",
    "coat": "modulus of the coat",
    "equilibrium": "relaxed modulus of the rubber",
    "strengths": "strengths of its relaxations",
    "pressure": "pressure",
    "velocity": "velocity",
}


def contact(size):
    rubber, cutoff = tread(), size.cutoffs[-1]
    rough = surface(cutoff, size)

    def log_friction(logs, point):
        """ln μ with each property multiplied by the exponential of its entry."""
        times = {name: jnp.exp(x) for name, x in logs.items()}
        block = gc.Prony(
            equilibrium=rubber.equilibrium * times["equilibrium"],
            strengths=rubber.strengths * times["strengths"],
            times=rubber.times,
            poisson=POISSON,
        )
        coat = gc.Elastic(rubber.equilibrium * times["coat"], POISSON)
        layer = gc.Layer(coat, point["thickness"] * times["thickness"])
        found = gc.slide(
            gc.Stack(layers=[layer], base=gc.HalfSpace(block)),
            rough,
            pressure=point["pressure"] * times["pressure"],
            velocity=VELOCITY * times["velocity"],
            rtol=1e-5,
            throw=False,
        )
        return jnp.log(found.friction), (found.friction, found.contact_area_smooth, found.result)

    def slopes(point):
        logs = {name: jnp.zeros(()) for name in PROPERTIES}
        found, (friction, area, result) = jax.grad(log_friction, has_aux=True)(logs, point)
        return {**found, "friction": friction, "area": area, "result": result}

    def named(point):
        return {f"slope_{k}" if k in PROPERTIES else k: v for k, v in slopes(point).items()}

    return named


def main():
    given = options(__doc__).parse_args()
    size = SMALL._replace(cutoffs=(16,)) if given.small else SMALL
    count = 3 if given.small else 9
    depths = np.geomspace(0.1, 4, count) / size.cutoffs[-1]
    ratios = np.geomspace(0.01, 0.5, count)
    axes = {"thickness": depths / Q0, "pressure": ratios * relaxed(tread())}

    def solve():
        with Store(given.output / "property_map.points") as store:
            return gc.sweep(contact(size), axes, store=store)

    found = kept(given, "property_map", solve)
    print(f"{found.message.size} contacts and gradients, {num_failed(found)} failed")
    with rc_context(STYLE):
        figure, panes = panels(6, width=9, height=5.2, rows=2)
        for pane, (name, title) in zip(panes, PROPERTIES.items(), strict=True):
            slopes = found[f"slope_{name}"].values
            far = np.nanmax(np.abs(slopes))
            drawn = pane.pcolormesh(
                ratios, depths * size.cutoffs[-1], slopes, cmap="RdBu_r", vmin=-far, vmax=far,
                shading="nearest",
            )  # fmt: skip
            pane.contour(ratios, depths * size.cutoffs[-1], found["area"], [0.25, 0.5, 0.9],
                         colors="0.3", linewidths=0.8)  # fmt: skip
            pane.set(xscale="log", yscale="log", title=title)
            pane.grid(visible=False)
            figure.colorbar(drawn, ax=pane)
            print(f"d ln μ/d ln({title}): {np.nanmin(slopes):+.2f} to {np.nanmax(slopes):+.2f}")
        for pane in panes[3:]:
            pane.set_xlabel(r"pressure $\sigma_0/E_{r0}$ [1]")
        for pane in panes[::3]:
            pane.set_ylabel("thickness $q_1 d$ [1]")
        save(figure, given.output / "property-map.png")


if __name__ == "__main__":
    main()
