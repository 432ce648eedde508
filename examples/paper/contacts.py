"""Figures of rubber, roughness and contact: RealPart, PSD, amplitude, friction, area, asymptote.

    python examples/paper/contacts.py           from the stored contacts, seconds
    python examples/paper/contacts.py --solve   with sixteen times fewer waves, minutes

`contacts.h5` has friction and area of the paper's grids (2048² to 8192² points), which take hours:
one to five surfaces for each cut-off, by this package.
"""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import xarray
from system import (
    CLOSE_UP,
    CUTOFFS,
    DEPTHS,
    POISSON,
    PRESSURES,
    Q0,
    VELOCITY,
    coated,
    panels,
    parser_of,
    save,
    spectrum,
    surface,
    tread,
)

import graded_contact as gc
from graded_contact.plot.style import ordered

STORED = Path(__file__).with_name("contacts.h5")
FEWER = 16  # times fewer waves with --solve, under coats that are as thick to the shortest
NUMBERS = {
    "friction": r"micro-rolling friction $\mu_r$ [1]",
    "contact_area": r"contact area $A_c/A_0$ [1]",
}


def stored() -> xarray.Dataset:
    """Returns the contacts of the paper's grids, a row for each."""
    table = xarray.load_dataset(STORED, group="contacts", engine="h5netcdf")
    main = (table["message"] == "") & (table["rubber"] == 0) & (table["roughness"] == 0)
    return table.isel(point=main.values)


def solved() -> xarray.Dataset:
    """Returns contacts with fewer waves, a row for each."""
    rubber, all_waves = tread(), CUTOFFS[-1] // FEWER
    stiffness = float(rubber.equilibrium) / (1 - POISSON**2)
    tables = []
    for cutoff in CUTOFFS:
        rough = surface(cutoff // FEWER, all_waves, 0)

        def contact(point, rough=rough):
            s = gc.slide(
                coated(rubber, point["q0d"] / Q0), rough, velocity=VELOCITY, rtol=1e-3, throw=False,
                pressure=point["pressure_ratio"] * stiffness,
            )  # fmt: skip
            return {"friction": s.friction, "contact_area": s.contact_area}

        axes = {"q0d": FEWER * np.array([DEPTHS[0], DEPTHS[-1]]), "pressure_ratio": PRESSURES}
        table = gc.sweep(contact, axes, progress=True)
        tables.append(table.stack(point=list(axes)).reset_index("point").assign_coords(
            cutoff=("point", np.full(len(axes["q0d"]) * len(PRESSURES), cutoff // FEWER))
        ))  # fmt: skip
    return xarray.concat(tables, "point")


def rows(table: xarray.Dataset, **labels: float) -> xarray.Dataset:
    """Returns the rows with these labels, such as cutoff=256."""
    chosen = np.ones(table.sizes["point"], bool)
    for name, value in labels.items():
        chosen &= np.isclose(table[name], value, rtol=1e-9, atol=0)
    return table.isel(point=chosen)


def curves(pane, table: xarray.Dataset, along: str, number: str, **labels: float) -> None:
    """Draws the mean over the surfaces for each cut-off, in a band from least to largest."""
    cutoffs = np.unique(table["cutoff"])
    for cutoff, colour in zip(cutoffs, ordered(len(cutoffs)), strict=True):
        each = rows(table, cutoff=cutoff, **labels)[number].groupby(along)
        mean = each.mean()
        pane.semilogx(mean[along], mean, "o-", markersize=3, color=colour, label=f"{cutoff:.0f}")
        pane.fill_between(mean[along], each.min(), each.max(), color=colour, alpha=0.25, lw=0)


def against_pressure(table: xarray.Dataset, number: str):
    """Returns Figs. micro.rolling.friction and contact.area: against pressure, for each coat."""
    counts = {
        d: len(np.unique(rows(table, q0d=d)["pressure_ratio"])) for d in set(table.q0d.values)
    }
    depths = sorted(depth for depth, count in counts.items() if count > len(CLOSE_UP))
    figure, panes = panels(len(depths), height=2.9 * len(depths) / 2, rows=len(depths) // 2)
    for pane, depth in zip(panes, depths, strict=True):
        curves(pane, table, "pressure_ratio", number, q0d=depth)
        pane.set_title(rf"$q_0 d = {1e3 * depth:.3g} \times 10^{{-3}}$")
        pane.set(xlabel=r"pressure $\sigma_0/E_{r0}$ [1]", ylabel=NUMBERS[number], ylim=(0, None))
    panes[0].legend(title="$q_1/q_0$")
    return figure


def against_thickness(table: xarray.Dataset):
    """Returns Fig. asymptote: against the thickness of the coat, at two pressures."""
    figure, panes = panels(4, height=5.6, rows=2)
    coats = table.isel(point=(table["q0d"] > 1e-6).values)  # without the bare block
    scenes = [(pressure, number) for pressure in reversed(CLOSE_UP) for number in NUMBERS]
    for pane, (pressure, number) in zip(panes, scenes, strict=True):
        curves(pane, coats, "q0d", number, pressure_ratio=pressure)
        pane.set_title(rf"$\sigma_0/E_{{r0}} = {pressure:g}$")
        pane.set(xlabel="thickness $q_0 d$ [1]", ylabel=NUMBERS[number], ylim=(0, None))
    panes[0].legend(title="$q_1/q_0$")
    return figure


def real_part():
    """Returns Fig. RealPart: the modulus; the band that sliding excites is shaded."""
    omega = np.geomspace(1e-4, 1e12, 400)
    figure, (pane,) = panels(1, width=5.4)
    modulus = tread().complex_modulus(jnp.asarray(omega)) / tread().equilibrium
    pane.loglog(omega / (2 * np.pi), modulus.real, label="real part")
    pane.loglog(omega / (2 * np.pi), modulus.imag, label="imaginary part")
    pane.axvspan(*(np.array([1, CUTOFFS[-1]]) * Q0 * VELOCITY / (2 * np.pi)), alpha=0.1)
    pane.set(xlabel="frequency [1/s]", ylabel=r"$E_r/E_{r0}$ [1]")
    pane.legend()
    return figure


def densities():
    """Returns Fig. PSD: three cut-offs of one spectrum."""
    figure, (pane,) = panels(1, width=5.4)
    for cutoff, colour in zip(CUTOFFS, ordered(len(CUTOFFS)), strict=True):
        rough = spectrum(cutoff)
        q = np.geomspace(Q0, cutoff * Q0, 200)
        label = f"{cutoff}: slope {rough.rms_slope:.3f}, height {1e3 * rough.rms_height:.3f} mm"
        pane.loglog(q, rough.density(jnp.asarray(q)), color=colour, label=label)
    pane.set(xlabel="wavenumber q [1/m]", ylabel="C(q) [m⁴]")
    pane.legend(title="$q_1/q_0$")
    return figure


def amplitudes(marks: tuple[float, ...]):
    """Returns Figs. amplitude.wave and psd.test: h_q, and where q d of two coats has marks."""
    figure, (pane,) = panels(1, width=5.4)
    q = np.geomspace(Q0, CUTOFFS[-1] * Q0, 200)
    pane.loglog(q, Q0 * np.sqrt(spectrum(CUTOFFS[-1]).density(jnp.asarray(q))))
    for depth, colour in ((DEPTHS[0], "tab:red"), (DEPTHS[-1], "black")):
        for mark, style in zip(marks, ("--", ":"), strict=False):
            label = rf"$q d = {mark:g}$, $q_0 d = {1e3 * depth:.3g} \times 10^{{-3}}$"
            pane.axvline(mark / depth * Q0, color=colour, linestyle=style, label=label)
    pane.set(xlabel="wavenumber q [1/m]", ylabel=r"$h_q = q_0\sqrt{C}$ [m]")
    pane.legend()
    return figure


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--solve", action="store_true", help="solve contacts with fewer waves")
    given = parser.parse_args()
    table = solved() if given.solve else stored()
    figures = {
        "rubber": real_part(), "spectrum": densities(), "amplitude": amplitudes((1.0,)),
        "amplitude-range": amplitudes((0.1, 2.0)), "friction": against_pressure(table, "friction"),
        "area": against_pressure(table, "contact_area"),
    }  # fmt: skip
    if not given.solve:
        figures["asymptote"] = against_thickness(table)
    for name, figure in figures.items():
        save(figure, given.output, name)


if __name__ == "__main__":
    main()
