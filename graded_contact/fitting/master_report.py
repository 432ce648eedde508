"""A master curve in words: its law, its shifts, and which steps between isotherms are odd."""

import numpy as np

STEEP = 0.4  # decades per kelvin, two within 5 K


def report_of(curve) -> str:
    """Returns the report of a `MasterCurve`."""
    along, across = curve.shift_deviations()
    lines = [*_law_words(curve), "", "     T [K]  log10 a_T      +-       b_T      +-"]
    rows = zip(
        curve.temperatures, curve.log10_shifts, along, curve.vertical_shifts, across, strict=True
    )
    lines += [f"{t:10.2f} {a:10.3f} {da:7.3f} {b:9.4f} {db:7.4f}" for t, a, da, b, db in rows]
    return "\n".join([*lines, *_step_words(curve), "", curve.fit.report()])


def _law_words(curve):
    """The law, how well it stands for the shifts found, and which of them is exported."""
    law = curve.law
    if curve.data.law == "wlf":
        words = f"WLF with c1 = {float(law.c1):.4g}, c2 = {float(law.c2):.4g} K"
    else:
        words = f"Arrhenius with Q = {float(law.activation_energy) / 1e3:.4g} kJ/mol"
    lines = [f"{words} about {float(law.reference):.2f} K."]
    if not (curve.data.departs or curve.data.lifts):
        return lines
    if curve._constants_at_bounds():
        lines.append(
            "Error: a constant of this law ran to the end of its range, so it is no result: the "
            "shifts follow no such law."
        )
    found = curve.fit.errors().total
    lines.append(
        f"With the shifts of this table the isotherms are met within {100 * found:.3g} %, with "
        f"the law alone within {100 * curve.law_error():.3g} %: "
        f"{'the law' if curve._law_serves() else 'the table'} is what is exported."
    )
    return lines


def _step_words(curve):
    """Neighbours whose shifts are hardly those of one material."""
    temperatures, shifts = np.asarray(curve.temperatures), np.asarray(curve.log10_shifts)
    rates = np.diff(shifts) / np.diff(temperatures)
    steps = [
        f"{temperatures[i]:.2f} to {temperatures[i + 1]:.2f} K ({shifts[i + 1] - shifts[i]:+.2f})"
        for i in np.flatnonzero((rates < -STEEP) | (rates > 0))
    ]
    if not steps:
        return []
    return [
        f"Look at the steps of log10 a_T from {', '.join(steps)}: more than two decades within "
        "5 K, or upwards, are seldom those of one material."
    ]
