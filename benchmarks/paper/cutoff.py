"""The dissipation cut-off q_μ, which the paper answers in words: from the contacts themselves.

    python benchmarks/paper/cutoff.py [--small]

Friction of all waves up to q, of the table of contacts.py, over all of the friction. q_μ is where
it reaches 95 %: shorter waves do not matter. Drawn for the roughness with all waves.
"""

import numpy as np
from contacts import WAVES, cutoffs_of, found, rows
from matplotlib import rc_context
from system import (
    CLOSE_UP,
    FULL,
    POINTS_PER_WAVE,
    Q0,
    SMALL,
    STYLE,
    options,
    ordered,
    panels,
    save,
)

ALL = 0.95


def curves(table, cutoff, depth, pressure):
    """Wavenumbers [1/m] and the share of friction up to them, a row for each surface."""
    here = rows(table, cutoff=cutoff, q0d=depth, pressure_ratio=pressure, rubber=0, roughness=0)
    highest = np.sqrt(2) * POINTS_PER_WAVE / 2 * cutoff * Q0
    q = np.geomspace(Q0, highest, WAVES)  # as `cumulative_friction` has them
    up_to = here["friction_up_to"].values
    return q, up_to / up_to[:, -1:]


def reached(q, share):
    """The wavenumber where a share of the friction is reached, by the logarithm."""
    first = np.argmax(share >= ALL)
    part = (ALL - share[first - 1]) / (share[first] - share[first - 1])
    return q[first - 1] * (q[first] / q[first - 1]) ** part


def main():
    given = options(__doc__).parse_args()
    size, table = SMALL if given.small else FULL, found(given)
    depths = sorted({*size.depths, *size.more_depths})
    with rc_context(STYLE):
        figure, panes = panels(2)
        for pane, pressure in zip(panes, CLOSE_UP, strict=True):
            for depth, colour in zip(depths, ordered(len(depths)), strict=True):
                solved = rows(table, q0d=depth, pressure_ratio=pressure, rubber=0, roughness=0)
                for cutoff in cutoffs_of(solved):
                    q, shares = curves(table, cutoff, depth, pressure)
                    at = np.array([reached(q, share) for share in shares])
                    thick = f"{1e3 * depth:.2g}" if depth > 1e-6 else "0 (bare)"
                    print(
                        f"σ0/E_r0 = {pressure}, q1/q0 = {cutoff}, 1000 q0 d = {thick}: {ALL:.0%} "
                        f"of the friction up to q_μ/q0 = {at.mean() / Q0:.0f} (surfaces differ by "
                        f"{np.ptp(at) / Q0:.0f}), q_μ d = {at.mean() / Q0 * depth:.2f}"
                    )
                pane.semilogx(q / Q0, shares.mean(0), color=colour, label=thick)
            pane.axhline(ALL, color="0.5", linewidth=0.8)
            pane.set_title(rf"$\sigma_0/E_{{r0}} = {pressure:g}$", fontsize=9)
            pane.set(xlabel="wavenumber $q/q_0$ [1]", ylabel="share of the friction [1]")
        panes[0].legend(title=r"$q_0 d \times 10^3$")
        save(figure, given.output / "cutoff.png")


if __name__ == "__main__":
    main()
