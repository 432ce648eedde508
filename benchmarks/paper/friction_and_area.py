"""Draws Figs. micro.rolling.friction and contact.area: against pressure, under four coats.

    python benchmarks/paper/friction_and_area.py [--small]

From the table of contacts.py. A line is the mean over the surfaces, its band their least and
largest. Printed is what the paper says of these figures, in numbers.
"""

from itertools import pairwise

from contacts import (
    ROUGHNESS,
    RUBBERS,
    cutoffs_of,
    draw_spread,
    found,
    num_rows,
    rows,
)
from matplotlib import rc_context
from system import FULL, SMALL, STYLE, options, ordered, panels, save

QUANTITIES = {
    "friction": r"micro-rolling friction $\mu_r$ [1]",
    "contact_area_smooth": r"contact area $A_c/A_0$ [1]",
}


def draw(table, size, quantity, rubber=0, roughness=0):
    """One figure: a panel for each coat, a curve for each cut-off."""
    depths = [
        d for d in size.depths if num_rows(rows(table, q0d=d, rubber=rubber, roughness=roughness))
    ]
    figure, panes = panels(len(depths), height=2.9 * len(depths) / 2, rows=len(depths) // 2)
    for pane, depth in zip(panes, depths, strict=True):
        for cutoff, colour in zip(size.cutoffs, ordered(len(size.cutoffs)), strict=True):
            here = rows(table, cutoff=cutoff, q0d=depth, rubber=rubber, roughness=roughness)
            draw_spread(pane, here, "pressure_ratio", quantity, colour, f"{cutoff}")
        pane.set_title(rf"$q_0 d = {1e3 * depth:.3g} \times 10^{{-3}}$", fontsize=9)
        pane.set(xlabel=r"pressure $\sigma_0/E_{r0}$ [1]", ylabel=QUANTITIES[quantity])
        pane.set_ylim(0, None)
    panes[0].legend(title="$q_1/q_0$")
    return figure


def difference(table, depth, quantity, one, other, **labels):
    """The second of two cut-offs over the first less 1, for surfaces and pressures of both."""
    a, b = (
        rows(table, cutoff=cutoff, q0d=depth, **labels)
        .reset_coords(drop=False)
        .set_coords(["seed", "pressure_ratio"])
        .set_index(point=["seed", "pressure_ratio"])[quantity]
        for cutoff in (one, other)
    )
    return (b / a - 1).values


def say(table, size, **labels):
    """What more waves change under each coat, and what the coat changes for each cut-off."""
    for quantity in QUANTITIES:
        for depth in size.depths:
            if not num_rows(rows(table, q0d=depth, **labels)):
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
                rows(table, cutoff=cutoff, q0d=d, **labels)[quantity]
                .groupby("pressure_ratio")
                .mean()
                for d in (size.depths[0], size.depths[-1])
            )
            change = (thick / thin - 1).values
            print(
                f"    {quantity}, q1/q0 = {cutoff}: from the thinnest to the thickest coat "
                f"{change.min():+.1%} to {change.max():+.1%}"
            )


def main():
    given = options(__doc__).parse_args()
    size, table = SMALL if given.small else FULL, found(given)
    for rubber, roughness, name in ((0, 0, ""), (1, 0, "-epdm"), (0, 1, "-heights")):
        labels = {"rubber": rubber, "roughness": roughness}
        size = size._replace(cutoffs=tuple(cutoffs_of(rows(table, **labels))))
        print(f"{RUBBERS[rubber].__name__}, {ROUGHNESS[roughness]}:")
        say(table, size, **labels)
        for quantity, short in zip(QUANTITIES, ("friction", "area"), strict=True):
            with rc_context(STYLE):
                save(draw(table, size, quantity, **labels), given.output / f"{short}{name}.png")


if __name__ == "__main__":
    main()
