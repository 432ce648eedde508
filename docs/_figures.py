"""Figures of the site that are drawn from rows of benchmarks, or from the program of a page."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from graded_contact.materials.library import tyre_tread
from graded_contact.plot.style import (
    COLUMN,
    PAGE,
    TEMPERATURES,
    few_powers_of_ten,
    ordered,
    styled,
)

Rows = list[dict[str, str]]


@styled
def _panels(rows: Rows, by: str, line: str, time: str, error: str, marks: str) -> Any:
    """A panel for each of what stands in column `by`, a line for each of `line`."""
    names = list(dict.fromkeys(row[by] for row in rows))
    figure = Figure(figsize=(PAGE, 2.9))
    panels: Any = figure.subplots(1, len(names), sharex=True, sharey=True, squeeze=False)[0]
    for panel, name in zip(panels, names, strict=True):
        here = [row for row in rows if row[by] == name]
        for label in dict.fromkeys(row[line] for row in rows):
            found = [row for row in here if row[line] == label and row[error] != "not reached"]
            x, y = ([float(row[column]) for row in found] for column in (time, error))
            panel.loglog(x, y, marks, label=label)
        panel.set(title=f"{by}: {name}", xlabel=time.replace("[us]", "[µs]"))
        few_powers_of_ten(panel.xaxis, *panel.get_xlim())
    panels[0].set_ylabel(f"{error}")
    panels[-1].legend()
    return figure


def grading(rows: Rows) -> Any:
    """Graded layers: error of M_zz, a panel for each profile."""
    return _panels(rows, "profile", "method", "time of a point [us]", "worst error", "o-")


def elastic(rows: Rows) -> Any:
    """Elastic contact: error of the pressure, a panel for each grid."""
    return _panels(rows, "N", "solver", "time [s]", "error of the pressure", "o")


def total(rows: Rows) -> Any:
    """True errors, of the grid above all, against seconds: a line for each way."""
    return _panels(rows, "number", "way", "time [s]", "true error", "o-")


HOT = 150.0  # K, rises above it have no meaning for a rubber


@styled
def measurement(rows: Rows) -> Any:
    """Parts of friction over velocity, a colour for each temperature; points are contacts."""
    figure = Figure(figsize=(PAGE, 5.6))
    panels: Any = figure.subplots(2, 2).ravel()
    names = ("hysteresis", "shear", "friction", "friction")
    celsius = list(dict.fromkeys(float(row["temperature [C]"]) for row in rows))
    styles = {"mean field": "-", "contact": "o", "contact, heated": "s"}
    for temperature, colour in zip(celsius, ordered(len(celsius), TEMPERATURES), strict=True):
        shift = float(tyre_tread().shift.factor(temperature + 273.15))
        for model, style in styles.items():
            found = [
                row
                for row in rows
                if (row["model"], float(row["temperature [C]"])) == (model, temperature)
                and float(row["rise of the surface [K]"]) < HOT
            ]
            velocity = np.array([float(row["velocity [m/s]"]) for row in found])
            filled = colour if model == "contact, heated" else "none"
            label = f"{temperature:g} °C" if model == "mean field" else None
            for panel, name, factor in zip(panels, names, (1, 1, 1, shift), strict=True):
                values = [float(row[f"{name} [1]"]) for row in found]
                panel.semilogx(
                    factor * velocity, values, style, color=colour, mfc=filled, label=label
                )
    for panel, text in zip(panels, ("hysteresis", "shear", "total", "total"), strict=True):
        panel.set(xlabel="sliding velocity $v$ [m/s]", title=text, ylim=(0, None))
    for panel in panels[::2]:
        panel.set_ylabel("friction coefficient")
    panels[3].set(xlabel="reduced velocity $a_T v$ [m/s]")
    panels[0].legend(title="lines: mean field")
    marks = [
        panels[3].plot([], [], style, color="k", mfc=filled, label=label)[0]
        for style, filled, label in (("o", "none", "contact"), ("s", "k", "contact, heated"))
    ]
    panels[3].legend(handles=marks, loc="upper left")
    return figure


@styled
def neural_profile(found: dict[str, Any]) -> Any:
    """A trained profile over height, and the friction before and after."""
    heights, velocities = np.linspace(0, 1, 101), found["velocities"]
    figure = Figure(figsize=(PAGE, 2.9))
    panels: Any = figure.subplots(1, 2)
    for name, factor in zip(
        ("modulus", "relaxation times"), found["trained"].factors(heights), strict=True
    ):
        panels[0].semilogy(heights, factor, label=name)
    panels[0].set(xlabel="height in the skin $s$", ylabel="factor over the rubber below")
    for name, label in (("before", "without the skin"), ("after", "with the trained skin")):
        panels[1].semilogx(velocities, found[name], "o-", label=label)
    panels[1].set(xlabel="sliding velocity [m/s]", ylabel="friction coefficient", ylim=(0, None))
    for panel in panels:
        panel.legend()
    return figure


@styled
def rubber(rows: Rows) -> Any:
    """The friction of a sphere over velocity, beside numbers that were read from a figure."""
    figure = Figure(figsize=(COLUMN, 2.4))
    axes = figure.subplots()

    def column(name, of):
        return [float(row[name]) for row in of]

    axes.loglog(column("velocity [m/s]", rows), column("friction", rows), label="here")
    known = [row for row in rows if row["published"]]
    read = np.array(column("published", known))
    axes.errorbar(
        column("velocity [m/s]", known), read, 0.08 * read, fmt="o", capsize=2,
        label="Carbone & Putignano, ± 8 %",
    )  # fmt: skip
    axes.set(xlabel="sliding velocity [m/s]", ylabel="friction coefficient [1]")
    axes.legend()
    return figure


@styled
def coats(rows: Rows) -> Any:
    """The highest pressure under a sphere on one coat, by three sources."""
    figure = Figure(figsize=(COLUMN, 2.4))
    axes = figure.subplots()
    found = [row for row in rows if row["scene"].startswith("one coat")]
    ratios = [float(row["scene"].partition("= ")[2]) for row in found]
    for name, marks, label in (
        ("integral", "-", "axisymmetric integral"),
        ("here", "o", "here"),
        ("published", "s", "read from a figure"),
    ):
        values = [float(row[name]) for row in found]
        axes.loglog(ratios, values, marks, mfc="none", label=label)
    axes.set(
        xlabel="modulus of the coat over that of the base [1]",
        ylabel="peak over that of Hertz [1]",
    )
    few_powers_of_ten(axes.xaxis, *axes.get_xlim())
    few_powers_of_ten(axes.yaxis, *axes.get_ylim())
    axes.legend()
    return figure


@styled
def adhesion(rows: Rows) -> Any:
    """Pull-off forces of an adhesive sphere between both limits."""
    figure = Figure(figsize=(COLUMN, 2.4))
    axes = figure.subplots()
    for name, marks, label in (
        ("pull-off", "o", "here"),
        ("rings", "-", "rings, same law"),
        ("constant tension", "--", "Maugis, constant tension"),
    ):
        tabor, force = ([float(row[c]) for row in rows] for c in ("Tabor parameter", name))
        axes.semilogx(tabor, force, marks, label=label)
    for limit, label in ((2, "Bradley, DMT"), (1.5, "JKR")):
        axes.axhline(limit, color="k", lw=0.8, ls=":")
        axes.annotate(label, (float(rows[0]["Tabor parameter"]), limit), va="bottom")
    axes.set(xlabel="Tabor parameter [1]", ylabel="pull-off force over $\\pi wR$ [1]")
    axes.set_ylim(1.4, 2.35)
    axes.legend(loc="upper right")
    return figure


FIGURES = {
    "bench_published-rubber": rubber,
    "bench_published-layers": coats,
    "bench_published-adhesion": adhesion,
    "bench_grading": grading,
    "bench_contact-elastic": elastic,
    "bench_contact-total": total,
    "bench_measurement-friction": measurement,
}
# By the name of a page of docs/howto: drawn from the names that its program defines, which takes a
# minute. So `python docs/_figures.py` draws them, and the repository has them.
OF_PAGES = {"neural_profile": neural_profile, "seal": lambda found: found["figure"]}

if __name__ == "__main__":
    from _generated import run_program

    for page, draw in OF_PAGES.items():
        place = Path(__file__).parent / "figures" / f"{page}.png"
        draw(run_program(Path(__file__).parent / "howto" / f"{page}.md")).savefig(place)
