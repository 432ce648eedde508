"""Draws Figs. micro.rolling.friction and contact.area: against pressure, under four coats.

    python benchmarks/paper/friction_and_area.py [--small]

From the table of contacts.py. A line is the mean over the surfaces, its band their least and
largest. Printed is what the paper says of these figures, in numbers.
"""

from itertools import pairwise

import numpy as np
from contacts import ROUGHNESS, RUBBERS, found, rows, spread
from matplotlib import rc_context
from system import FULL, SMALL, STYLE, options, ordered, panels, save

QUANTITIES = {
    "friction": r"micro-rolling friction $\mu_r$ [1]",
    "contact_area_smooth": r"contact area $A_c/A_0$ [1]",
}


def draw(table, size, quantity, rubber=0, roughness=0):
    """One figure: a panel for each coat, a curve for each cut-off."""
    depths = [
        d
        for d in size.depths
        if len(rows(table, q0d=d, rubber=rubber, roughness=roughness)["seed"])
    ]
    figure, panes = panels(len(depths), height=2.9 * len(depths) / 2, rows=len(depths) // 2)
    for pane, depth in zip(panes, depths, strict=True):
        for cutoff, colour in zip(size.cutoffs, ordered(len(size.cutoffs)), strict=True):
            here = rows(table, cutoff=cutoff, q0d=depth, rubber=rubber, roughness=roughness)
            at, mean, least, largest = spread(here, "pressure_ratio", quantity)
            pane.semilogx(at, mean, "o-", markersize=3, color=colour, label=f"{cutoff}")
            pane.fill_between(at, least, largest, color=colour, alpha=0.25, linewidth=0)
        pane.set_title(rf"$q_0 d = {1e3 * depth:.3g} \times 10^{{-3}}$", fontsize=9)
        pane.set(xlabel=r"pressure $\sigma_0/E_{r0}$ [1]", ylabel=QUANTITIES[quantity])
        pane.set_ylim(0, None)
    panes[0].legend(title="$q_1/q_0$")
    return figure


def difference(table, depth, quantity, one, other, **labels):
    """Of two cut-offs, the second over the first less 1: surfaces that both have by pressures."""
    a, b = (
        {
            (seed, ratio): value
            for seed, ratio, value in zip(
                part["seed"], part["pressure_ratio"], part[quantity], strict=True
            )
        }
        for part in (rows(table, cutoff=cutoff, q0d=depth, **labels) for cutoff in (one, other))
    )
    both = sorted(a.keys() & b.keys())
    ratio = np.array([b[key] / a[key] - 1 for key in both])
    return ratio.reshape(max(len({seed for seed, _ in both}), 1), -1)


def say(table, size, **labels):
    """What more waves change under each coat, and what the coat changes for each cut-off."""
    for quantity in QUANTITIES:
        for depth in size.depths:
            if not len(rows(table, q0d=depth, **labels)["seed"]):
                continue
            for one, other in pairwise(size.cutoffs):
                change = difference(table, depth, quantity, one, other, **labels)
                if not change.size:
                    continue
                print(
                    f"    {quantity}, q0 d = {depth:.3g}: from q1/q0 = {one} to {other} "
                    f"{change.min():+.1%} to {change.max():+.1%}"
                )
        for cutoff in size.cutoffs:
            thin, thick = (
                spread(rows(table, cutoff=cutoff, q0d=d, **labels), "pressure_ratio", quantity)[1]
                for d in (size.depths[0], size.depths[-1])
            )
            change = thick / thin - 1
            print(
                f"    {quantity}, q1/q0 = {cutoff}: from the thinnest to the thickest coat "
                f"{change.min():+.1%} to {change.max():+.1%}"
            )


def main():
    given = options(__doc__).parse_args()
    size, table = SMALL if given.small else FULL, found(given)
    for rubber, roughness, name in ((0, 0, ""), (1, 0, "-epdm"), (0, 1, "-heights")):
        labels = {"rubber": rubber, "roughness": roughness}
        solved = np.unique(rows(table, **labels)["cutoff"])
        size = size._replace(cutoffs=tuple(map(int, solved)))
        print(f"{RUBBERS[rubber].__name__}, {ROUGHNESS[roughness]}:")
        say(table, size, **labels)
        for quantity, short in zip(QUANTITIES, ("friction", "area"), strict=True):
            with rc_context(STYLE):
                save(draw(table, size, quantity, **labels), given.output / f"{short}{name}.png")


if __name__ == "__main__":
    main()
