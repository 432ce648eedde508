"""Prony series from measured moduli: errors, and their effect on friction.

    python benchmarks/bench_fit.py

Errors are root mean squares of ln(fit/measured) over all storage and loss moduli, which the package
minimises, and of fit/measured - 1. The floor of the latter is that of non-negative least squares
(SciPy) on a dense grid of times. Data and peers: `prony_peers.py`.
"""

import numpy as np
import prony_peers as peers
from prony_peers import (
    ISOTHERMS,
    MASTER_CURVES,
    OPTIMISED,
    PACKAGE,
    PLAIN,
    RELAXATIONS,
    error_of,
    fit_measured,
    read_sets,
)
from rows import goal, run, show

import graded_contact as gc
from graded_contact.fitting.master import master_curve

# errors -------------------------------------------------------------------------------------


def errors():
    """Errors over numbers of terms, on open data."""
    print("master curves; rms of ln(fit/measured) and of fit/measured - 1, in %")
    gains, ratios = [], []
    for name, measured in read_sets(MASTER_CURVES | RELAXATIONS):
        floors = peers.floor_by_nnls(measured)
        rows, best = rows_of(measured)
        print_rows(name, measured, rows, floors)
        if PLAIN in {label for label, *_ in rows}:
            gains.append((gain_at_equal_length(rows), name))
        if measured.kind == "frequency":
            ratios.append((*ratio_to_floor(measured, best, floors[0]), name))
    if gains:
        least, name = min(gains)
        goal("at pyvisco's length half its relative error", f"{least:.3g} times less on {name}")
    for ratio, terms, per_decade, name in ratios:
        goal(
            f"{name}: <= 1.05 floor at <= 2 terms per decade (log error over the NNLS floor)",
            f"{ratio:.3f} with {terms} terms, {per_decade:.2f} per decade",
        )
    shifted_isotherms()


def rows_of(measured):
    """(label, terms, log error, relative error) of all fits, and the package's best fit by BIC."""
    best = fit_measured(measured)
    rows = [(f"{PACKAGE}, BIC", best.terms, *error_of(best.material, measured))]
    if peers.pyvisco is not None:
        for label, optimise in ((PLAIN, False), (OPTIMISED, True)):
            x, values = measured.abscissa, measured.values
            material, terms = peers.pyvisco_fit(x, values, optimise=optimise)
            rows.append((label, terms, *error_of(material, measured)))
        equal = fit_measured(measured, terms=rows[1][1])
        rows.append((PACKAGE, equal.terms, *error_of(equal.material, measured)))
    return rows, best


def print_rows(name, measured, rows, floors):
    x = measured.abscissa
    for method, terms, log, relative in rows:
        show({
            "set": name, "points": len(x), "decades": np.log10(np.max(x) / np.min(x[x > 0])),
            "fit": method, "terms": terms, "log [%]": 100 * log, "relative [%]": 100 * relative,
            "over floor": relative / floors[0],
        })  # fmt: skip
    parts = zip(("all", "storage alone", "loss alone"), floors, strict=False)
    text = ", ".join(f"{part} {100 * value:.4g}" for part, value in parts)
    print(f"# floor by NNLS, relative [%]: {text}", flush=True)


def gain_at_equal_length(rows):
    by_label = {label: relative for label, _, _, relative in rows}
    return by_label[PLAIN] / by_label[PACKAGE]


def ratio_to_floor(measured, best, floor):
    """The first length whose log error is within 5 % of the floor, or the best there is."""
    x = measured.abscissa
    decades = np.log10(np.max(x) / np.min(x))
    allowed = [length for length in best.path if length.terms <= 2 * decades]
    within = [length for length in allowed if length.error <= 1.05 * floor]
    length = within[0] if within else min(allowed, key=lambda length: length.error)
    return length.error / floor, length.terms, length.terms / decades


def shifted_isotherms():
    print("\nraw isotherms, shifts and series fitted together; rms log error, % (terms); pyvisco:")
    print("the package's series on data shifted by its `get_aT`")
    gains = []
    for name, measured in read_sets(ISOTHERMS):
        parts = measured.isotherms()
        curves = [
            master_curve(parts, shift_std=along, vertical_shift_std=across).fit
            for along, across in ((3.0, 0.0), (3.0, 0.1), (0.0, 0.0))
        ]
        cells = dict(zip(("free", "and vertical", "by a WLF law"), curves, strict=True))
        if peers.pyvisco is not None:
            cells["pyvisco"] = fitted_to_shifted(parts, peers.pyvisco_shifts(parts))
            gain = cells["pyvisco"].errors()["total"] / curves[0].errors()["total"]
            gains.append((gain, name))
        show({"set": name, "isotherms": len(parts)} | {
            way: f"{100 * curve.errors()['total']:.3f} ({curve.terms})"
            for way, curve in cells.items()
        })  # fmt: skip
    if gains:
        least, name = min(gains)
        goal("nearer than with pyvisco's shifts", f"{least:.3g} times nearer or more ({name})")


def fitted_to_shifted(isotherms, log10_shifts):
    pairs = list(zip(isotherms, log10_shifts, strict=True))
    omega = np.concatenate([part.abscissa * 10**shift for part, shift in pairs])
    return gc.fit_prony(omega, np.concatenate([part.values for part, _ in pairs]))


if __name__ == "__main__":
    if peers.pyvisco is None:
        print("# pyvisco is left out: pip install pyvisco==2.1.3")
    if peers.FOLDER.is_dir():
        run(__doc__, errors)
    else:
        print(f"# skipped: the measured moduli are not there ({peers.FOLDER})")
