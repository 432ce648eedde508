"""Draws all figures that follow from the table of contacts.py, and prints their numbers.

    python examples/paper/contact_figures.py [--small]

Figs. micro.rolling.friction and contact.area: against pressure, under four coats. A line is the
mean over the surfaces, its band their least and largest.

Fig. asymptote: against the thickness of the coat, at two pressures; the bare block is a dash at the
left.

The dissipation cut-off q_μ: the share of friction by all waves up to q_μ is 95 %. Drawn for the
roughness with all waves.

Beyond the paper, Persson's mean field with a layered M_zz: friction and area of the theory over
those of the contact, against the area of the contact, by three forms of the theory.
"""

from itertools import pairwise, product

import jax
import jax.numpy as jnp
import numpy as np
from contacts import ROUGHNESS, RUBBERS, WAVES, cutoffs_of, draw_spread, found, num_rows, rows
from system import (
    CLOSE_UP,
    POINTS_PER_WAVE,
    Q0,
    VELOCITY,
    coated,
    ordered,
    panels,
    read,
    save,
    spectrum,
)

import graded_contact as gc

QUANTITIES = {
    "friction": r"micro-rolling friction $\mu_r$ [1]",
    "contact_area": r"contact area $A_c/A_0$ [1]",
}
MAIN = {"rubber": 0, "roughness": 0}
CASES = {"": MAIN, "-epdm": MAIN | {"rubber": 1}, "-heights": MAIN | {"roughness": 1}}
BARE = 1e-6  # q0 d below which nothing feels the coat
ALL = 0.95
CORRECTIONS = ("none", "yang_persson", "wang_mueser")
BANDS = ((0, 0.1), (0.1, 0.3), (0.3, 0.7), (0.7, 1.01))  # of the contact area


def curves(pane, table, size, along, of, **labels):
    """Draws a curve for each cut-off."""
    for cutoff, colour in zip(size.cutoffs, ordered(len(size.cutoffs)), strict=True):
        draw_spread(pane, rows(table, cutoff=cutoff, **labels), along, of, colour, f"{cutoff}")


def difference(table, quantity, one, other, **labels):
    """The second of two cut-offs over the first less 1, for surfaces and pressures of both."""
    a, b = (
        rows(table, cutoff=cutoff, **labels)
        .reset_coords(drop=False)
        .set_coords(["seed", "pressure_ratio"])
        .set_index(point=["seed", "pressure_ratio"])[quantity]
        for cutoff in (one, other)
    )
    return (b / a - 1).values


# Figs. micro.rolling.friction and contact.area ----------------------------------------------


def against_pressure(given, size, table):
    for name, labels in CASES.items():
        here = size._replace(cutoffs=tuple(cutoffs_of(rows(table, **labels))))
        rubber, roughness = RUBBERS[labels["rubber"]], ROUGHNESS[labels["roughness"]]
        print(f"{rubber.__name__}, {roughness}:")
        depths = [d for d in size.depths if num_rows(rows(table, q0d=d, **labels))]
        for quantity, short in zip(QUANTITIES, ("friction", "area"), strict=True):
            say(table, here, depths, quantity, labels)
            count = len(depths)
            figure, panes = panels(count, height=2.9 * count / 2, rows=count // 2)
            for pane, depth in zip(panes, depths, strict=True):
                curves(pane, table, here, "pressure_ratio", quantity, q0d=depth, **labels)
                pane.set_title(rf"$q_0 d = {1e3 * depth:.3g} \times 10^{{-3}}$", fontsize=9)
                pane.set(xlabel=r"pressure $\sigma_0/E_{r0}$ [1]", ylabel=QUANTITIES[quantity])
                pane.set_ylim(0, None)
            panes[0].legend(title="$q_1/q_0$")
            save(figure, given.output / f"{short}{name}.png")


def say(table, size, depths, quantity, labels):
    """What more waves change under each coat, and what the coat changes for each cut-off."""
    for depth, (one, other) in product(depths, pairwise(size.cutoffs)):
        change = difference(table, quantity, one, other, q0d=depth, **labels)
        if change.size:
            print(
                f"    {quantity}, q0 d = {depth:.3g}: from q1/q0 = {one} to {other} "
                f"{change.min():+.1%} to {change.max():+.1%}"
            )
    for cutoff in size.cutoffs:
        thin, thick = (
            rows(table, cutoff=cutoff, q0d=d, **labels)[quantity].groupby("pressure_ratio").mean()
            for d in (size.depths[0], size.depths[-1])
        )
        change = (thick / thin - 1).values
        print(
            f"    {quantity}, q1/q0 = {cutoff}: from the thinnest to the thickest coat "
            f"{change.min():+.1%} to {change.max():+.1%}"
        )


# Fig. asymptote -----------------------------------------------------------------------------


def against_thickness(given, size, table):
    figure, panes = panels(4, height=5.6, rows=2)
    scenes = product(reversed(CLOSE_UP), QUANTITIES)
    coats = table.isel(point=table.q0d > BARE)
    for pane, (pressure, quantity) in zip(panes, scenes, strict=True):
        curves(pane, coats, size, "q0d", quantity, pressure_ratio=pressure, **MAIN)
        for cutoff, colour in zip(size.cutoffs, ordered(len(size.cutoffs)), strict=True):
            here = rows(table, cutoff=cutoff, pressure_ratio=pressure, **MAIN)
            bare, thinnest = here.isel(point=here.q0d <= BARE), here.q0d[here.q0d > BARE].min()
            if num_rows(bare):
                mean = bare[quantity].mean().item()
                at = [thinnest.item() / 2.2, thinnest.item() / 1.5]
                pane.plot(at, 2 * [mean], color=colour)
        pane.set_title(rf"$\sigma_0/E_{{r0}} = {pressure:g}$", fontsize=9)
        pane.set(xlabel="thickness $q_0 d$ [1]", ylabel=QUANTITIES[quantity], ylim=(0, None))
    panes[0].legend(title="$q_1/q_0$")
    save(figure, given.output / "asymptote.png")
    for pressure, quantity in product(CLOSE_UP, QUANTITIES):
        labels, (one, other) = {"pressure_ratio": pressure} | MAIN, size.cutoffs[-2:]
        for depth in np.unique(rows(table, **labels)["q0d"]):
            change = difference(table, quantity, one, other, q0d=depth, **labels)
            if change.size:
                print(
                    f"σ0/E_r0 = {pressure}, q0 d = {depth:.3g}: {quantity} from q1/q0 = {one} to "
                    f"{other} {np.mean(change):+.1%}"
                )


# The dissipation cut-off --------------------------------------------------------------------


def shares(table, cutoff):
    """Wavenumbers [1/m] and the share of friction up to them, a row for each surface."""
    highest = np.sqrt(2) * POINTS_PER_WAVE / 2 * cutoff * Q0
    q = np.geomspace(Q0, highest, WAVES)  # as `cumulative_friction` has them
    up_to = rows(table, cutoff=cutoff)["friction_up_to"].values
    return q, up_to / up_to[:, -1:]


def reached(q, share):
    """The wavenumber where a share of the friction is reached, by the logarithm."""
    first = np.argmax(share >= ALL)
    part = (ALL - share[first - 1]) / (share[first] - share[first - 1])
    return q[first - 1] * (q[first] / q[first - 1]) ** part


def dissipation(given, size, table):
    depths = sorted({*size.depths, *size.more_depths})
    figure, panes = panels(2)
    for pane, pressure in zip(panes, CLOSE_UP, strict=True):
        for depth, colour in zip(depths, ordered(len(depths)), strict=True):
            solved = rows(table, q0d=depth, pressure_ratio=pressure, **MAIN)
            thick = f"{1e3 * depth:.2g}" if depth > BARE else "0 (bare)"
            for cutoff in cutoffs_of(solved):
                q, share = shares(solved, cutoff)
                at = np.array([reached(q, one) for one in share])
                print(
                    f"σ0/E_r0 = {pressure}, q1/q0 = {cutoff}, 1000 q0 d = {thick}: {ALL:.0%} "
                    f"of the friction up to q_μ/q0 = {at.mean() / Q0:.0f} (surfaces differ by "
                    f"{np.ptp(at) / Q0:.0f}), q_μ d = {at.mean() / Q0 * depth:.2f}"
                )
            pane.semilogx(q / Q0, share.mean(0), color=colour, label=thick)
        pane.axhline(ALL, color="0.5", linewidth=0.8)
        pane.set_title(rf"$\sigma_0/E_{{r0}} = {pressure:g}$", fontsize=9)
        pane.set(xlabel="wavenumber $q/q_0$ [1]", ylabel="share of the friction [1]")
    panes[0].legend(title=r"$q_0 d \times 10^3$")
    save(figure, given.output / "cutoff.png")


# The mean field -----------------------------------------------------------------------------


def theory(size, cutoff, rubber, roughness, correction):
    """Friction and area by thicknesses [m] and pressures [Pa]."""
    material, rough = RUBBERS[rubber](), spectrum(cutoff, size, ROUGHNESS[roughness])

    def at(point):
        found = gc.mean_field_friction(
            coated(material, point[0]), rough, pressure=point[1], velocity=VELOCITY,
            correction=correction, throw=False,
        )  # fmt: skip
        return found.friction, found.contact_area

    return jax.jit(lambda points: jax.lax.map(at, points))


def mean_field(given, size, table):
    figure, panes = panels(2)
    for correction, colour in zip(CORRECTIONS, ordered(3), strict=True):
        ratios = []
        for labels in CASES.values():
            for cutoff in cutoffs_of(rows(table, **labels)):
                here = rows(table, cutoff=cutoff, **labels)
                points = np.stack([here["thickness"], here["pressure"]], axis=1)
                of = theory(size, cutoff, **labels, correction=correction)
                friction, area = of(jnp.asarray(points))
                exact = here["contact_area"]
                ratios.append([exact, friction / here["friction"], area / exact])
        area, *both = np.concatenate(ratios, axis=1)
        for pane, ratio in zip(panes, both, strict=True):
            pane.plot(area, ratio, ".", color=colour, markersize=4, label=correction)
        for low, high in BANDS:
            inside = (area >= low) & (area < high)
            if np.any(inside):
                spans = ", ".join(
                    f"{name} {r[inside].min():.2f} to {r[inside].max():.2f}"
                    for name, r in zip(("friction", "area"), both, strict=True)
                )
                print(f"{correction}, A/A0 from {low} to {min(high, 1)}: {spans} of contact's")
    for pane, name in zip(panes, ("friction", "area"), strict=True):
        pane.axhline(1, color="0.5", linewidth=0.8)
        pane.set(xlabel="contact area $A_c/A_0$ [1]", ylabel=f"mean field over contact, {name} [1]")
    panes[0].legend()
    save(figure, given.output / "mean-field.png")


def main():
    given, size = read(__doc__)
    table = found(given)
    for figure in (against_pressure, against_thickness, dissipation, mean_field):
        figure(given, size, table)


if __name__ == "__main__":
    main()
