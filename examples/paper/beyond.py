"""Beyond the paper: a master curve of friction, a graded surface, a map and a design.

    python examples/paper/beyond.py [--small]

The friction master curve μ(a_T v), bare against coated: contacts at velocities from creep to skid,
at three temperatures each; over a_T v they are on one curve of ten decades, because only ω a_T
enters. The script prints their largest deviation, and both curves.

A layer graded continuously, compared with steps of equal integral of stiffness. The modulus passes
linearly with height from the tread's to that of the surface, the relaxed one of the tread or twenty
times that; the steps have, each over its part of the depth, the same mean of the complex modulus.
The script prints the errors of friction and area with one, two and four steps.

What friction depends on, d ln μ/d ln(property) over pressure and thickness, by the derivative of
each contact, all properties at once: the coat's thickness and modulus, the rubber's relaxed
modulus, the strengths of its relaxations (all together), pressure and velocity.

The coat that makes friction independent of the cut-off at least loss of area: thickness, modulus
and damping of one coat, by the mean field at σ0 = 0.1 E_r0. The two objectives are how much
friction changes from the fewest to all waves, |ln μ(all)/μ(fewest)|, and the area lost against the
bare block, ln A(bare)/A with all waves. A gradient search computes the front between them, once for
all coats and once for stiff ones, which wear requires. All coats on it are verified by contacts:
friction from the fewest waves to twice as many.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import xarray
from contacts import RTOL
from system import (
    POISSON,
    Q0,
    SLOPES,
    SMALL,
    VELOCITY,
    coated,
    kept,
    num_failed,
    ordered,
    panels,
    read,
    relaxed,
    save,
    solved_points,
    spectrum,
    surface,
    tread,
)

import graded_contact as gc
from graded_contact.response.layering import sliced

LABELS = {
    "friction": r"micro-rolling friction $\mu_r$ [1]",
    "area": r"contact area $A_c/A_0$ [1]",
}


def solved(given, name: str, solve: Callable[[Path], xarray.Dataset]) -> xarray.Dataset:
    """The table of an earlier run, or `solve` with a folder that keeps finished points."""
    found = kept(given, name, lambda: solve(given.output / f"{name}.points"))
    print(f"{found.message.size} contacts, {num_failed(found)} failed")
    return found


def slid(stack, rough, pressure, velocity, rtol) -> dict:
    found = gc.slide(stack, rough, pressure=pressure, velocity=velocity, rtol=rtol, throw=False)
    return {"friction": found.friction, "area": found.contact_area, "result": found.result}


# Master curve -------------------------------------------------------------------------------

REFERENCE = 268.15  # K
TEMPERATURES = (243.15, 268.15, 313.15)
PRESSURE = 0.1  # σ0/E_r0
BARE = 1e-9  # q0 d


def master_curve(given, size):
    rubber, rough = gc.tyre_tread(POISSON), surface(size.cutoffs[-1], size)
    law, load = rubber.shift.rebased(REFERENCE), PRESSURE * relaxed(rubber)
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

    def rub(point):
        stack = coated(rubber.at(point["temperature"]), point["thickness"])
        return slid(stack, rough, load, point["velocity"], 1e-3)

    table = solved(given, "master_curve", lambda store: solved_points(rub, points, store))
    found = {name: values.values for name, values in table.variables.items()}
    at = found["velocity"] * np.interp(found["temperature"], TEMPERATURES, factors)
    figure, panes = panels(2)
    for pane, (quantity, label) in zip(panes, LABELS.items(), strict=True):
        for (name, depth), marker in zip(depths.items(), "os", strict=True):
            for t, colour in zip(TEMPERATURES, ordered(3), strict=True):
                here = (found["temperature"] == t) & (found["thickness"] == depth / Q0)
                pane.semilogx(
                    at[here], found[quantity][here], marker, markersize=3, color=colour,
                    fillstyle="full" if name == "bare" else "none",
                    label=f"{name}, {t - 273.15:.0f} °C",
                )  # fmt: skip
        pane.set(xlabel=r"$a_T v$ [m/s] at $-5$ °C", ylabel=label, ylim=(0, None))
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


# Graded surface -----------------------------------------------------------------------------

STEPS = (0, 1, 2, 4)  # 0: continuous
TICKS = (0.02, 0.05, 0.1, 0.2, 0.5)
TOPS = (1.0, 20.0)  # modulus of the surface over the relaxed one


def graded_surface(given, size):
    rubber, rough = tread(), surface(size.cutoffs[-1], size)
    depth = 2 / size.cutoffs[-1] * 4  # q d = 8 for the shortest wave, 1/8 of it for the longest
    ratios = np.geomspace(0.02, 0.5, 3 if given.small else 9)
    axes = {"pressure": ratios * relaxed(rubber)}

    def contact(top, steps):
        skin = gc.Elastic(top * relaxed(rubber) * (1 - POISSON**2), POISSON)
        layer = gc.GradedLayer(gc.Blend(bottom=rubber, top=skin), depth / Q0)
        stack = gc.Stack(layers=[layer], base=gc.HalfSpace(rubber))
        stack = sliced(stack, steps) if steps else stack
        return lambda point: slid(stack, rough, point["pressure"], VELOCITY, 1e-4)

    def solve(store):
        tables = [
            [gc.sweep(contact(top, steps), axes, store=store) for steps in STEPS] for top in TOPS
        ]
        together = xarray.combine_nested(tables, ["top", "steps"])
        return together.assign_coords(top=list(TOPS), steps=list(STEPS))

    found = solved(given, "graded_surface", solve).transpose("top", "steps", ...)
    figure, panes = panels(4, height=5.6, rows=2)
    scenes = [(row, top, *of) for row, top in enumerate(TOPS) for of in LABELS.items()]
    for pane, (row, top, quantity, axis) in zip(panes, scenes, strict=True):
        curves = found[quantity].values[row]
        for steps, curve in zip(STEPS, curves, strict=True):
            label = f"{steps} step{'s' * (steps > 1)}" if steps else "continuous"
            pane.semilogx(ratios, curve, "-" if steps else "k-", label=label)
            if steps:
                off = curve / curves[0] - 1
                print(
                    f"surface at {top:g} E0, {label}: {quantity} off by {off.min():+.1%} "
                    f"to {off.max():+.1%}"
                )
        pane.set(xlabel=r"pressure $\sigma_0/E_{r0}$ [1]", ylabel=axis, ylim=(0, None))
        pane.minorticks_off()
        pane.set_xticks(TICKS, labels=map(str, TICKS))
        pane.set_title(rf"surface at {top:g} $E_0$", fontsize=9)
    panes[0].legend()
    save(figure, given.output / "graded-surface.png")


# Map of properties --------------------------------------------------------------------------

PROPERTIES = {
    "thickness": "thickness of the coat",
    "coat": "modulus of the coat",
    "equilibrium": "relaxed modulus of the rubber",
    "strengths": "strengths of its relaxations",
    "pressure": "pressure",
    "velocity": "velocity",
}


def property_map(given, size):
    rubber, rough, count = tread(), surface(size.cutoffs[-1], size), 3 if given.small else 9
    depths = np.geomspace(0.1, 4, count) / size.cutoffs[-1]
    ratios = np.geomspace(0.01, 0.5, count)
    axes = {"thickness": depths / Q0, "pressure": ratios * relaxed(rubber)}

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
        stack = gc.Stack(layers=[layer], base=gc.HalfSpace(block))
        pressure, velocity = point["pressure"] * times["pressure"], VELOCITY * times["velocity"]
        found = slid(stack, rough, pressure, velocity, 1e-5)
        return jnp.log(found["friction"]), found

    def slopes(point):
        logs = {name: jnp.zeros(()) for name in PROPERTIES}
        by, found = jax.grad(log_friction, has_aux=True)(logs, point)
        return {f"slope_{name}": slope for name, slope in by.items()} | found

    found = solved(given, "property_map", lambda store: gc.sweep(slopes, axes, store=store))
    figure, panes = panels(6, width=9, height=5.2, rows=2)
    for pane, (name, title) in zip(panes, PROPERTIES.items(), strict=True):
        values = found[f"slope_{name}"].values
        far = np.nanmax(np.abs(values))
        drawn = pane.pcolormesh(
            ratios, depths * size.cutoffs[-1], values, cmap="RdBu_r", vmin=-far, vmax=far,
            shading="nearest",
        )  # fmt: skip
        pane.contour(ratios, depths * size.cutoffs[-1], found["area"], [0.25, 0.5, 0.9],
                     colors="0.3", linewidths=0.8)  # fmt: skip
        pane.set(xscale="log", yscale="log", title=title)
        pane.grid(visible=False)
        figure.colorbar(drawn, ax=pane)
        print(f"d ln μ/d ln({title}): {np.nanmin(values):+.2f} to {np.nanmax(values):+.2f}")
    for pane in panes[3:]:
        pane.set_xlabel(r"pressure $\sigma_0/E_{r0}$ [1]")
    for pane in panes[::3]:
        pane.set_ylabel("thickness $q_1 d$ [1]")
    save(figure, given.output / "property-map.png")


# Design -------------------------------------------------------------------------------------

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
            "contact_area_by_contact": other.contact_area,
        }  # fmt: skip
        ends, good = gc.contacts.RESULTS, gc.contacts.RESULTS.successful
        message = next((ends[s.result] for s in (one, other) if s.result != good), "")
        return {name: float(value) for name, value in numbers.items()} | {"message": message}

    rows = [row(bare, softest=0.0, **dict.fromkeys(LOWER, 0.0))]
    for softest in SOFTEST:
        lower, count = LOWER | {"modulus": softest}, 3 if given.small else 9
        options = {"num_starts": 2 if given.small else 6, "rtol": 1e-6}
        ends = [
            gc.minimise(lambda p, i=i: objectives(p)[i], lower, UPPER, **options) for i in (0, 1)
        ]
        levels = np.geomspace(ends[1].value, objectives(ends[0].parameters)[1], count)[1:-1]
        front = [ends[1], ends[0]]
        for level in levels:  # the least change of friction with at most this loss of area
            limit = lambda p, level=level: 1 - objectives(p)[1] / level  # noqa: E731
            front.append(
                gc.minimise(lambda p: objectives(p)[0], lower, UPPER, constraints=limit, **options)
            )
        for design in sorted(front, key=lambda one: objectives(one.parameters)[1]):
            p = design.parameters
            rows.append(row(block(p, unit), softest=softest, **p))
    columns = {name: ("point", [one[name] for one in rows]) for name in rows[0]}
    return xarray.Dataset(columns)


def design(given, size):
    found = kept(given, "design", lambda: searched(given, size))
    print(f"{found.sizes['point']} designs, {num_failed(found)} failed")
    found = {name: values.values for name, values in found.items()}
    change = found["friction_all"] / found["friction_fewest"] - 1
    area = found["contact_area"] / found["contact_area"][0]
    by_contact = found["friction_of_more_waves"] / found["friction_by_contact"] - 1
    area_by_contact = found["contact_area_by_contact"] / found["contact_area_by_contact"][0]
    for i in range(len(change)):
        coat = ", ".join(f"{k} {found[k][i]:.3g}" for k in ("softest", *LOWER))
        print(
            f"    {coat if i else 'bare'}: friction changes by {change[i]:.2%}, area {area[i]:.3f} "
            f"of the bare block's; by contact {by_contact[i]:.2%}, {area_by_contact[i]:.3f}"
        )
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


def main():
    given, full = read(__doc__)
    size = SMALL._replace(cutoffs=(16,)) if given.small else SMALL
    for figure in (master_curve, graded_surface, property_map):
        figure(given, size)
    design(given, full)


if __name__ == "__main__":
    main()
