"""Figures of the site that are drawn from rows of benchmarks: error against time."""

from typing import Any

from graded_contact.plot.style import PAGE, few_powers_of_ten, new_figure, styled

Rows = list[dict[str, str]]


@styled
def _panels(rows: Rows, by: str, line: str, time: str, error: str, marks: str) -> Any:
    """A panel for each of what stands in column `by`, a line for each of `line`."""
    names = list(dict.fromkeys(row[by] for row in rows))
    figure = new_figure(PAGE, 2.9)
    panels: Any = figure.subplots(1, len(names), sharex=True, sharey=True, squeeze=False)[0]
    for panel, name in zip(panels, names, strict=True):
        here = [row for row in rows if row[by] == name]
        for label in dict.fromkeys(row[line] for row in rows):
            found = [row for row in here if row[line] == label and row[error] != "not reached"]
            x, y = ([float(row[column]) for row in found] for column in (time, error))
            panel.loglog(x, y, marks, label=label)
        panel.set(title=f"{by}: {name}", xlabel=time.replace("[us]", "[µs]"))
        few_powers_of_ten(panel.xaxis, *panel.get_xlim())
    panels[0].set_ylabel(f"{error} [1]")
    panels[-1].legend()
    return figure


def grading(rows: Rows) -> Any:
    """Graded layers: error of M_zz, a panel for each profile."""
    return _panels(rows, "profile", "method", "time of a point [us]", "worst error", "o-")


def elastic(rows: Rows) -> Any:
    """Elastic contact: error of the pressure, a panel for each grid."""
    return _panels(rows, "N", "solver", "time [s]", "error of the pressure", "o")


FIGURES = {"bench_grading": grading, "bench_contact-elastic": elastic}
