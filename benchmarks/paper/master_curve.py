"""Beyond the paper: the friction master curve μ(a_T v), bare against coated, at three temperatures.

    python benchmarks/paper/master_curve.py [--small]

Contacts at velocities from a creep to a skid, at three temperatures each; over a_T v they lie on
one curve of ten decades, because only ω a_T enters. Printed is how well they do, where the two
curves stand, and what the coat leaves of the friction.
"""

import numpy as np
from matplotlib import rc_context
from system import (
    POISSON,
    Q0,
    SMALL,
    STYLE,
    coated,
    kept,
    num_failed,
    options,
    ordered,
    panels,
    relaxed,
    save,
    surface,
)

import graded_contact as gc
from graded_contact.studies.store import Store

REFERENCE = 268.15  # K
TEMPERATURES = (243.15, 268.15, 313.15)
PRESSURE = 0.1  # σ0/E_r0
BARE = 1e-9  # q0 d


def rubber_at(temperature):
    return gc.tyre_tread(POISSON).at(temperature)


def contact(size):
    cutoff = size.cutoffs[-1]
    rough = surface(cutoff, size)
    load = PRESSURE * relaxed(gc.tyre_tread(POISSON))

    def rub(point):
        found = gc.slide(
            coated(rubber_at(point["temperature"]), point["thickness"]),
            rough,
            pressure=load,
            velocity=point["velocity"],
            rtol=1e-3,
            throw=False,
        )
        return {"friction": found.friction, "area": found.contact_area_smooth,
                "result": found.result}  # fmt: skip

    return rub


def main():
    given = options(__doc__).parse_args()
    size = SMALL._replace(cutoffs=(16,)) if given.small else SMALL
    law = gc.tyre_tread(POISSON).shift.rebased(REFERENCE)
    factors = np.exp([float(law.log_factor(t)) for t in TEMPERATURES])
    depths = {"bare": BARE, "coated": size.depths[-1]}
    reduced = np.geomspace(1e-6, 1e4, 11 if given.small else 41)  # a_T v [m/s]
    points = [
        {"temperature": t, "thickness": d / Q0, "velocity": v}
        for t, a in zip(TEMPERATURES, factors, strict=True)
        for d in depths.values()
        for v in reduced / a
        if 1e-7 <= v <= 40
    ]

    def solve():
        with Store(given.output / "master_curve.points") as store:
            return gc.sweep(contact(size), points, store=store)

    found = kept(given, "master_curve", solve)
    print(f"{len(points)} contacts, {num_failed(found)} failed")
    found = {name: values.values for name, values in found.variables.items()}
    at = found["velocity"] * np.interp(found["temperature"], TEMPERATURES, factors)
    with rc_context(STYLE):
        figure, panes = panels(2)
        for pane, quantity in zip(panes, ("friction", "area"), strict=True):
            for (name, depth), marker in zip(depths.items(), "os", strict=True):
                for t, colour in zip(TEMPERATURES, ordered(3), strict=True):
                    here = (found["temperature"] == t) & (found["thickness"] == depth / Q0)
                    label = f"{name}, {t - 273.15:.0f} °C"
                    pane.semilogx(
                        at[here], found[quantity][here], marker, markersize=3, color=colour,
                        fillstyle="full" if name == "bare" else "none", label=label,
                    )  # fmt: skip
            pane.set(xlabel=r"$a_T v$ [m/s] at $-5$ °C", ylim=(0, None))
        panes[0].set_ylabel(r"micro-rolling friction $\mu_r$ [1]")
        panes[1].set_ylabel(r"contact area $A_c/A_0$ [1]")
        panes[0].legend()
        save(figure, given.output / "master-curve.png")
    for name, depth in depths.items():
        here = found["thickness"] == depth / Q0
        worst, top = 0.0, np.argmax(np.where(here, found["friction"], 0))
        for v in reduced:
            same = here & np.isclose(at, v, rtol=1e-6)
            if np.sum(same) > 1:
                mu = found["friction"][same]
                worst = max(worst, np.ptp(mu) / mu.mean())
        print(
            f"{name}: greatest friction {found['friction'][top]:.4f} at a_T v = {at[top]:.2g} m/s;"
            f" temperatures differ by {worst:.1e} at most"
        )


if __name__ == "__main__":
    main()
