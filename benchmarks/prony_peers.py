"""Open rheological data, and fits by other programs, for `bench_fit.py`.

The files are beside the repository, in ../shared/data/rheology; their sources and licences are in
PROVENANCE.md there. Peers are pyvisco (NREL), if it is installed (`pip install pyvisco==2.1.3`),
and SciPy's non-negative least squares on a dense grid of times.
"""

import contextlib
import io
import pathlib
import warnings

import numpy as np
from scipy.optimize import nnls

import graded_contact as gc

try:
    import pandas as pd
    import pyvisco
    from pyvisco import master, prony
except ImportError:
    pyvisco = None

FOLDER = pathlib.Path(__file__).parents[2] / "shared" / "data" / "rheology"
PER_DECADE = 10  # times of the dense grid, which goes one decade beyond the data on either side
PACKAGE, PLAIN, OPTIMISED = "package", "pyvisco", "pyvisco, optimised"

_PASCAL = {"units": {"time": "s", "modulus": "Pa"}, "deformation": "tension"}
_BARE = _PASCAL | {"columns": {"time": 1, "modulus": 2}}
MASTER_CURVES = {
    "NREL polymer": ("pyvisco_freq_user_master.csv", {}),
    "Eplexor polymer": ("pyvisco_eplexor_master.csv", {}),
    "polyisoprene melt": (
        "reptate_PI_634k_T-35.tts",
        {
            "layout": {"header": 1},
            "columns": {"frequency": 1, "storage": 2, "loss": 3},
            "units": {"frequency": "rad/s", "modulus": "Pa"},
            "deformation": "shear",
            "poisson": 0.5,
        },
    ),
}
RELAXATIONS = {
    "NREL E(t)": ("pyvisco_time_user_master.csv", {}),
    "polypropylene": ("pp_stress_relaxation.csv", _PASCAL),
    "bimodal, noisy": ("respect_time_test1.dat", _BARE),
    "twin-peaked": ("respect_time_test3.dat", _BARE),
    "ring polymer": ("respect_time_test6.dat", _BARE),
}
ISOTHERMS = {
    "NREL polymer": ("pyvisco_freq_user_raw.csv", {}),
    "EPDM rubber": ("epdm70_tf_015p.csv", {"poisson": 0.5}),
    "vinyl foam": ("vinylfoam_dma_raw.csv", {"units": {"modulus": "MPa"}}),
    "polyisoprene melt": (
        "reptate_PI600k_raw_isotherms.csv",
        {"columns": {"temperature": "T_set"}, "poisson": 0.5},
    ),
}


def read_sets(sets):
    """Yields `(name, Measured)` of those whose file is there; prints what is left out."""
    for name, (file, options) in sets.items():
        if (FOLDER / file).is_file():
            yield name, gc.read_moduli(FOLDER / file, **options)
        else:
            print(f"# {name} is left out: there is no {FOLDER / file}")


def fit_measured(measured, **choices):
    """The package's fit of a master curve over frequency or time."""
    return gc.fit_prony(measured.abscissa, measured.values, kind=measured.kind, **choices)


def parts_of(modulus):
    """E' and E'' [Pa], stacked."""
    modulus = np.asarray(modulus)
    return np.stack([modulus.real, modulus.imag])


def predicted(material, kind, x):
    """E' and E'' [Pa] one after the other at the frequencies x, or E at the times x."""
    if kind == "frequency":
        return parts_of(material.complex_modulus(x)).ravel()
    decay = np.exp(-np.asarray(x)[:, None] / np.asarray(material.times))
    return float(material.equilibrium) + decay @ np.asarray(material.strengths)


def stacked(values):
    """Measured values in the order of `predicted`."""
    return parts_of(values).ravel() if np.iscomplexobj(values) else values


def error_of(material, measured):
    """Root mean square of the log residual and of the relative error of all values."""
    x, values = measured.abscissa, stacked(measured.values)
    ratio = predicted(material, measured.kind, x) / values
    return np.sqrt(np.mean(np.log(ratio) ** 2)), np.sqrt(np.mean((ratio - 1) ** 2))


def floor_by_nnls(measured):
    """Least relative rms errors of a positive spectrum: of all values, of E' and of E'' alone."""
    x, values = measured.abscissa, stacked(measured.values)
    first, last = np.log10(np.min(x[x > 0])), np.log10(np.max(x))
    grid = 10 ** np.arange(first - 1, last + 1, 1 / PER_DECADE)
    if measured.kind == "frequency":
        ratio = x[:, None] / grid
        storage, loss = ratio**2 / (1 + ratio**2), ratio / (1 + ratio**2)
        columns = np.concatenate([storage, loss])
    else:
        columns = np.exp(-x[:, None] / grid)
    at_rest = np.arange(len(values)) < len(x)  # E_eq is seen by the storage modulus alone
    columns = np.concatenate([columns, at_rest[:, None]], axis=1) / values[:, None]

    def least(rows):
        some = columns[rows]
        norms = np.maximum(np.linalg.norm(some, axis=0), 1e-300)
        _, misfit = nnls(some / norms, np.ones(len(some)), maxiter=100 * len(grid))
        return misfit / np.sqrt(len(some))

    floors = [least(np.full(len(values), True))]
    if measured.kind == "frequency":
        floors += [least(at_rest), least(~at_rest)]
    return floors


def pyvisco_fit(x, values, *, optimise=False, poisson=0.5):
    """The material that pyvisco fits to moduli: its default, or with `opt=True` after smoothing.

    Its defaults are one term per decade and no smoothing; its documentation smooths over five
    points before it optimises.
    """
    with _quietly():
        frame = master.smooth(_frame(x, values), 5 if optimise else 1)
        series, _ = prony.fit(prony.discretize(frame), frame, optimise)
    terms = series["df_terms"].sort_values("tau_i")
    strengths, times = series["E_0"] * terms["alpha_i"].to_numpy(), terms["tau_i"].to_numpy()
    equilibrium = max(series["E_0"] - np.sum(strengths), 0.0)
    if equilibrium < 1e-9 * series["E_0"]:  # rounding of strengths normalised to a sum of 1
        equilibrium = 0.0
    used = strengths > 0
    return gc.Prony(equilibrium, strengths[used], times[used], poisson), len(strengths)


def pyvisco_shifts(isotherms):
    """log10 a_T by pyvisco's power laws, about the middle isotherm."""
    parts = []
    for number, part in enumerate(isotherms):
        moduli = _frame(part.abscissa, part.values / 1e6)  # its start values suit MPa
        moduli = moduli.rename(columns={"f": "f_set"}).assign(Set=number, T_round=float(number))
        parts.append(moduli)
    with _quietly():
        frame = pd.concat(parts, ignore_index=True)
        frame.domain, frame.modul = "freq", "E"
        shifts, _ = master.get_aT(frame, float(len(isotherms) // 2))
    return shifts["log_aT"].to_numpy()


def _frame(x, values):
    """Measured moduli as pyvisco takes them: a data frame with attributes."""
    order = np.argsort(x)
    x, values = np.asarray(x)[order], np.asarray(values)[order]
    with _quietly():
        if np.iscomplexobj(values):
            columns = {"f": x / (2 * np.pi), "omega": x, "t": 2 * np.pi / x}
            frame = pd.DataFrame({**columns, "E_stor": values.real, "E_loss": values.imag})
            frame.domain = "freq"
        else:
            frame = pd.DataFrame({"t": x, "f": 1 / x, "omega": 2 * np.pi / x, "E_relax": values})
            frame.domain = "time"
        frame.RefT, frame.modul = 0.0, "E"
    return frame


@contextlib.contextmanager
def _quietly():
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        yield
