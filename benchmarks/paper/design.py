"""Beyond the paper: the coat that makes friction independent of the cut-off at least loss of area.

    python benchmarks/paper/design.py [--small]

Thickness, modulus and damping of one coat, by the mean field at σ0 = 0.1 E_r0: the two objectives
are how much friction changes from the fewest to all waves, |ln μ(all)/μ(fewest)|, and the area
lost against the bare block, ln A(bare)/A with all waves. The front between them is searched by
gradients, once among all coats and once among stiff ones, as wear asks for. All coats on it are
verified by contacts: friction from the fewest waves to twice as many.
"""

from functools import partial

import jax
import jax.numpy as jnp
import xarray
from contacts import RTOL
from matplotlib import rc_context
from system import (
    FULL,
    POISSON,
    Q0,
    SLOPES,
    SMALL,
    STYLE,
    VELOCITY,
    kept,
    num_failed,
    options,
    ordered,
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


def searched(given, size):
    """The fronts by mean field, a row for each design and the bare block first, with contacts."""
    fewest, every = size.cutoffs[0], size.cutoffs[-1]
    waves = size.cutoffs[-2:] if given.small else size.cutoffs[:2]  # of the contacts
    load, unit = PRESSURE * relaxed(tread()), 1 / (every * Q0)
    bare = gc.Stack(base=gc.HalfSpace(tread()))

    @partial(jax.jit, static_argnames="cutoff")
    def theory(stack, cutoff):
        found = gc.mean_field_friction(
            stack, spectrum(cutoff, size, SLOPES), pressure=load, velocity=VELOCITY, rtol=1e-3,
            throw=False,
        )  # fmt: skip
        return found.friction, found.contact_area

    bare_area = theory(bare, every)[1]

    def objectives(p):
        stack = block(p, unit)
        (less, _), (more, area) = theory(stack, fewest), theory(stack, every)
        return jnp.stack([jnp.log(more / less) ** 2, jnp.log(bare_area / area)])

    def row(stack, **labels):
        """A design's friction and area, of the theory and of contacts."""
        (less, _), (more, area) = theory(stack, fewest), theory(stack, every)
        one, other = (
            gc.slide(
                stack, surface(cutoff, size), pressure=load, velocity=VELOCITY, rtol=RTOL,
                throw=False,
            )
            for cutoff in waves
        )  # fmt: skip
        numbers = {
            **labels, "friction_fewest": less, "friction_all": more, "contact_area": area,
            "friction_by_contact": one.friction, "friction_of_more_waves": other.friction,
            "contact_area_by_contact": other.contact_area_smooth,
        }  # fmt: skip
        message = gc.contacts.RESULTS[one.result] or gc.contacts.RESULTS[other.result]
        return {name: float(value) for name, value in numbers.items()} | {"message": message}

    rows = [row(bare, softest=0.0, **dict.fromkeys(LOWER, 0.0))]
    for softest in SOFTEST:
        front = gc.design.pareto_front(
            objectives, LOWER | {"modulus": softest}, UPPER,
            num_points=3 if given.small else 9, num_starts=2 if given.small else 6, rtol=1e-6,
        )  # fmt: skip
        for design, _ in front:
            p = design.parameters
            rows.append(row(block(p, unit), softest=softest, **p))
    columns = {name: ("point", [one[name] for one in rows]) for name in rows[0]}
    return xarray.Dataset(columns)


def main():
    given = options(__doc__).parse_args()
    size = SMALL if given.small else FULL
    found = kept(given, "design", lambda: searched(given, size))
    print(f"{found.sizes['point']} designs, {num_failed(found)} failed")
    found = {name: values.values for name, values in found.items()}
    change = found["friction_all"] / found["friction_fewest"] - 1
    area = found["contact_area"] / found["contact_area"][0]
    by_contact = found["friction_of_more_waves"] / found["friction_by_contact"] - 1
    area_by_contact = found["contact_area_by_contact"] / found["contact_area_by_contact"][0]
    for i in range(len(change)):
        told = ", ".join(f"{k} {found[k][i]:.3g}" for k in ("softest", *LOWER))
        print(
            f"    {told if i else 'bare'}: friction changes by {change[i]:.2%}, area {area[i]:.3f} "
            f"of the bare block's; by contact {by_contact[i]:.2%}, {area_by_contact[i]:.3f}"
        )
    with rc_context(STYLE):
        figure, panes = panels(2)
        for softest, colour in zip(SOFTEST, ordered(3), strict=False):
            here = found["softest"] == softest
            label = f"modulus at least {softest:g} times the relaxed one"
            for pane, x, y in (
                (panes[0], change, area), (panes[1], by_contact, area_by_contact)
            ):  # fmt: skip
                pane.plot(x[here], y[here], "o-", color=colour, markersize=4, label=label)
        for pane, title in zip(panes, ("mean field", "contacts"), strict=True):
            pane.set(xlabel="change of friction with the waves [1]", title=title)
        panes[0].set_ylabel("contact area over the bare block's [1]")
        panes[0].legend()
        save(figure, given.output / "design.png")


if __name__ == "__main__":
    main()
