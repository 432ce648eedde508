"""Draws Fig. asymptote: friction and area against the thickness of the coat, at two pressures.

    python benchmarks/paper/asymptote.py [--small]

From the table of contacts.py, as friction_and_area.py. The bare block is a dash at the left.
"""

import numpy as np
from contacts import draw_spread, found, num_rows, rows
from friction_and_area import QUANTITIES, difference
from matplotlib import rc_context
from system import CLOSE_UP, FULL, SMALL, STYLE, options, ordered, panels, save

BARE = 1e-6  # q0 d below which nothing feels the coat


def draw(table, size):
    figure, panes = panels(4, height=5.6, rows=2)
    for pane, (pressure, quantity) in zip(
        panes, ((p, q) for p in reversed(CLOSE_UP) for q in QUANTITIES), strict=True
    ):
        for cutoff, colour in zip(size.cutoffs, ordered(len(size.cutoffs)), strict=True):
            here = rows(table, cutoff=cutoff, pressure_ratio=pressure, rubber=0, roughness=0)
            coated, bare = here.isel(point=here.q0d > BARE), here.isel(point=here.q0d <= BARE)
            draw_spread(pane, coated, "q0d", quantity, colour, f"{cutoff}")
            thinnest = coated.q0d.min().item()
            if num_rows(bare):
                mean = bare[quantity].mean().item()
                pane.plot([thinnest / 2.2, thinnest / 1.5], 2 * [mean], color=colour)
        pane.set_title(rf"$\sigma_0/E_{{r0}} = {pressure:g}$", fontsize=9)
        pane.set(xlabel="thickness $q_0 d$ [1]", ylabel=QUANTITIES[quantity], ylim=(0, None))
    panes[0].legend(title="$q_1/q_0$")
    return figure


def main():
    given = options(__doc__).parse_args()
    size, table = SMALL if given.small else FULL, found(given)
    with rc_context(STYLE):
        save(draw(table, size), given.output / "asymptote.png")
    labels = {"rubber": 0, "roughness": 0}
    for pressure in CLOSE_UP:
        at = rows(table, pressure_ratio=pressure, **labels)["q0d"]
        for quantity in QUANTITIES:
            for depth in np.unique(at):
                change = difference(
                    table, depth, quantity, *size.cutoffs[-2:], pressure_ratio=pressure, **labels
                )
                if not change.size:
                    continue
                print(
                    f"σ0/E_r0 = {pressure}, q0 d = {depth:.3g}: {quantity} from q1/q0 = "
                    f"{size.cutoffs[-2]} to {size.cutoffs[-1]} {np.mean(change):+.1%}"
                )


if __name__ == "__main__":
    main()
