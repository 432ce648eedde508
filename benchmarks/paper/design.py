"""Beyond the paper: the coat that makes friction independent of the cut-off at least loss of area.

    python benchmarks/paper/design.py [--small]

Thickness, modulus and damping of one coat, by the mean field at σ0 = 0.1 E_r0: the two objectives
are how much friction changes from the fewest to all waves, |ln μ(all)/μ(fewest)|, and the area
lost against the bare block, ln A(bare)/A with all waves. The front between them is searched by
gradients, once among all coats and once among stiff ones, as wear asks for, and coats on it are
verified by contacts.
"""

import jax.numpy as jnp
import numpy as np
from matplotlib import rc_context
from system import (
    FULL,
    POISSON,
    Q0,
    SLOPES,
    SMALL,
    STYLE,
    VELOCITY,
    options,
    panels,
    relaxed,
    save,
    spectrum,
    surface,
    tread,
)

import graded_contact as gc

PRESSURE = 0.1  # σ0/E_r0
# Thickness times q1, modulus of the coat over the relaxed one of the rubber, and of a relaxation
# its strength over that modulus and its time [s].
LOWER = {"depth": 0.05, "modulus": 1.0, "step": 0.01, "time": 1e-5}
UPPER = {"depth": 6.0, "modulus": 20.0, "step": 3.0, "time": 1e-1}
SOFTEST = (1.0, 5.0)


def block(p, unit):
    """The tread under a coat; `depth` is in units of the shortest wave's 1/q1."""
    rubber = tread()
    modulus = p["modulus"] * rubber.equilibrium
    coat = gc.Prony(
        modulus, jnp.atleast_1d(p["step"] * modulus), jnp.atleast_1d(p["time"]), POISSON
    )
    return gc.Stack(layers=[gc.Layer(coat, p["depth"] * unit)], base=gc.HalfSpace(rubber))


def main():
    given = options(__doc__).parse_args()
    size = SMALL if given.small else FULL
    fewest, every = size.cutoffs[0], size.cutoffs[-1]
    load, unit = PRESSURE * relaxed(tread()), 1 / (every * Q0)
    bare = gc.Stack(base=gc.HalfSpace(tread()))

    def theory(stack, cutoff):
        found = gc.mean_field_friction(
            stack, spectrum(cutoff, size, SLOPES), pressure=load, velocity=VELOCITY, rtol=1e-3,
            throw=False,
        )  # fmt: skip
        return found.friction, found.contact_area

    area_bare = theory(bare, every)[1]

    def objectives(p):
        stack = block(p, unit)
        (less, _), (more, area) = theory(stack, fewest), theory(stack, every)
        return jnp.stack([jnp.log(more / less) ** 2, jnp.log(area_bare / area)])

    def contact(name, stack):
        waves = size.cutoffs[-2:] if given.small else size.cutoffs[:2]
        found = []
        for cutoff in waves:
            rough = surface(cutoff, size)
            found.append(gc.slide(stack, rough, pressure=load, velocity=VELOCITY, rtol=1e-3))
        less, more = (float(one.friction) for one in found)
        print(
            f"contacts, {name}: friction {less:.5f} at q1/q0 = {waves[0]}, {more:.5f} at "
            f"{waves[1]} ({more / less - 1:+.1%}), area {float(found[-1].contact_area_smooth):.4f}"
        )

    contact("bare", bare)
    with rc_context(STYLE):
        figure, (pane,) = panels(1, width=5.0)
        for softest in SOFTEST:
            front = gc.design.pareto_front(
                objectives, LOWER | {"modulus": softest}, UPPER,
                num_points=3 if given.small else 9, num_starts=2 if given.small else 6, rtol=1e-6,
            )  # fmt: skip
            change, loss = np.array([value for _, value in front]).T
            label = f"modulus at least {softest:g} times the relaxed one"
            pane.plot(np.exp(np.sqrt(change)) - 1, np.exp(-loss), "o-", label=label)
            print(f"{label}:")
            for design, (change, loss) in front:
                told = ", ".join(f"{k} {float(v):.3g}" for k, v in design.parameters.items())
                print(
                    f"    {told}: friction changes by {np.sqrt(change):.2%}, area "
                    f"{np.exp(-loss):.3f} of the bare block's"
                )
            contact(f"first of the front, {label}", block(front[0][0].parameters, unit))
        pane.set(xlabel=f"change of friction from $q_1/q_0$ = {fewest} to {every} [1]",
                 ylabel="contact area over that of the bare block [1]")  # fmt: skip
        pane.legend()
        save(figure, given.output / "design.png")


if __name__ == "__main__":
    main()
