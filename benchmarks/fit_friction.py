"""One rough surface on differently fitted materials, for `bench_fit.py`."""

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import prony_peers as peers
from prony_peers import ISOTHERMS, MASTER_CURVES, OPTIMISED, PACKAGE, PLAIN, parts_of, read_sets
from rows import ROOT

import graded_contact as gc
from graded_contact.fitting.master import master_curve
from graded_contact.plot.style import COLOURS, PAGE, new_figure, styled

POISSON = 0.49
EDGE, SLOPE = 1e-3, 0.1  # of the cell [m], rms of the roughness [1]


def friction(size=256, velocities=15, plot=str(ROOT / "docs" / "bench_fit-friction.png")):
    """Friction of one surface of size² points on differently fitted materials."""
    q0 = 2 * np.pi / EDGE
    spectrum = gc.SelfAffine(
        rms_slope=SLOPE, hurst=0.8, q_low=q0, q_roll=4 * q0, q_high=size / 4 * q0
    )
    grid = gc.Grid((size, size), EDGE)
    road = gc.random_surface(spectrum, grid, jax.random.key(0))
    print(
        f"\ncell of {EDGE:g} m, {size} x {size} points, q from {q0:.3g} to {size / 4 * q0:.3g} ",
        end="",
    )
    print(f"rad/m, rms slope {SLOPE}, ν = {POISSON}")
    drawn = []
    for title, reference, (omega, values), pressure, speeds in scenes(velocities):
        materials = materials_of(omega, values)
        if reference is None:
            reference, name = materials["table"], "table"
        else:
            materials, name = {"truth": reference} | materials, "truth"
        curves = {
            label: friction_curve(material, road, pressure, speeds)
            for label, material in materials.items()
        }
        beyond = (q0 * speeds < omega[0]) | (np.pi * size / EDGE * speeds > omega[-1])
        report_friction(title, name, curves, speeds, beyond, materials, (omega, values))
        drawn.append((title, name, curves, speeds, beyond))
    plot_friction(drawn, plot)


def scenes(count):
    """Yields `(title, true material or None, table, pressure [Pa], velocities [m/s])`."""
    for _, measured in read_sets({"EPDM rubber": ISOTHERMS["EPDM rubber"]}):
        data = master_curve(measured.isotherms(), vertical_shift_std=0.1).fit.data
        omega, (storage, loss) = np.asarray(data.x), np.asarray(data.values)
        order = np.argsort(omega)
        table = omega[order], (storage + 1j * loss)[order]
        yield "EPDM rubber, 25 °C, measured", None, table, 6e5, np.geomspace(1e-7, 1.0, count)
    for _, measured in read_sets({"NREL polymer": MASTER_CURVES["NREL polymer"]}):
        factor = 10 ** published_shift(40.0)
        table = measured.abscissa / factor, measured.values
        title = "NREL polymer, 40 °C: storage and loss contradict each other"
        yield title, None, table, 3e6, np.geomspace(1e-7, 1.0, count)
    truth = gc.tyre_tread(POISSON)
    omega = np.geomspace(1e-3, 1e9, 120)
    noise = 0.02 * np.random.default_rng(1).standard_normal((2, len(omega)))
    storage, loss = parts_of(truth.modulus(omega)) * np.exp(noise)
    table = omega, storage + 1j * loss
    yield "tread (synthetic), 2 % of noise", truth, table, 4e5, np.geomspace(1e-6, 10.0, count)


def published_shift(celsius):
    """log10 a_T of the NREL polymer, from the table that comes with its master curve."""
    path = peers.FOLDER / "pyvisco_freq_user_master__shift_factors.csv"
    table = pd.read_csv(path, skiprows=2, header=None, index_col=0)
    return table.loc[celsius, 1]


def materials_of(omega, values):
    materials = {
        "table": gc.Tabulated(omega, values, POISSON),
        PACKAGE: gc.fit_prony(omega, values, poisson=POISSON).material,
    }
    if peers.pyvisco is not None:
        for label, optimise in ((PLAIN, False), (OPTIMISED, True)):
            material, _ = peers.pyvisco_fit(omega, values, optimise=optimise, poisson=POISSON)
            materials[label] = solid(label, material)
    return materials


def solid(label, material):
    """A series without E_eq has no modulus at rest, so that nothing carries the waves along v."""
    if material.equilibrium > 0:
        return material
    slowest = int(jnp.argmax(material.times))
    strength, time = float(material.strengths[slowest]), float(material.times[slowest])
    print(f"# {label} has E_eq = 0: its branch of {time:.3g} s, {strength:.3g} Pa, replaces it")
    strengths, times = (jnp.delete(v, slowest) for v in (material.strengths, material.times))
    return gc.Prony(strength, strengths, times, POISSON)


def friction_curve(material, road, pressure, velocities):
    stack = gc.Stack(base=gc.HalfSpace(material))
    solutions = [gc.slide(stack, road, pressure=pressure, velocity=v) for v in velocities]
    return np.array([(float(s.friction), float(s.contact_area)) for s in solutions])


def report_friction(title, name, curves, velocities, beyond, materials, table):
    omega, values = table
    print(f"\n{title}; table from {omega[0]:.3g} to {omega[-1]:.3g} rad/s")
    labels = [label for label in curves if label != name]
    rows = {("velocity", "[m/s]"): velocities, ("outside", "table"): beyond}
    for label, values_of in curves.items():
        rows[label, "friction"], rows[label, "area"] = values_of.T
        if label != name:
            rows[label, "change"] = values_of[:, 0] / curves[name][:, 0] - 1
    print(pd.DataFrame(rows).to_string(index=False, float_format="{:.4g}".format))
    inside = ~beyond if np.any(~beyond) else np.full(len(beyond), True)
    for label in labels:
        fitted = parts_of(materials[label].modulus(omega))
        storage, loss = np.sqrt(np.mean(np.log(fitted / parts_of(values)) ** 2, axis=1))
        change = curves[label][inside, 0] / curves[name][inside, 0] - 1
        print(
            f"  {label}: friction off by {change[np.argmax(np.abs(change))]:+.1%} at worst "
            f"within the table; rms log error of E' {storage:.1%}, of E'' {loss:.1%}"
        )
    print("(outside: frequencies beyond the table, where E' stays and E'' falls off as 1/ω or ω)")


@styled
def plot_friction(drawn, target):
    figure = new_figure(PAGE, 4.6)
    axes = figure.subplots(2, len(drawn), squeeze=False, sharex="col", height_ratios=(3, 2))
    styles = {
        "table": ("black", "-"), "truth": ("black", "--"), PACKAGE: (COLOURS[0], "-"),
        PLAIN: (COLOURS[1], "-"), OPTIMISED: (COLOURS[4], "-"),
    }  # fmt: skip
    for (above, below), (title, name, curves, velocities, beyond) in zip(
        axes.T, drawn, strict=True
    ):
        for label, values in curves.items():
            colour, line = styles[label]
            above.loglog(velocities, values[:, 0], line, color=colour, label=label)
            change = 100 * (values[:, 0] / curves[name][:, 0] - 1)
            below.semilogx(velocities, change, line, color=colour)
        for panel in (above, below):
            shade_runs(panel, velocities, beyond)
        above.set_title(title.replace(": ", ":\n"))
        above.legend()
        below.set(xlabel="velocity [m/s]", ylabel=f"change from the {name} [%]", ylim=(-85, 25))
    axes[0, 0].set_ylabel("friction")
    figure.savefig(target)
    print(f"# {target}; grey: frequencies beyond the table")


def shade_runs(panel, velocities, beyond):
    """Greys velocities that excite frequencies beyond the table."""
    edges = np.sqrt(velocities[1:] * velocities[:-1])
    edges = np.concatenate([velocities[:1], edges, velocities[-1:]])
    for i in np.flatnonzero(beyond):
        panel.axvspan(edges[i], edges[i + 1], color="0.9", linewidth=0, zorder=0)
