"""The one table of quantities: name, symbol, unit, meaning.

Prints, columns of tables, attributes of datasets, labels of axes and the documentation take their
words from here. A new observable is one function and one entry.
"""

from collections.abc import Iterable
from typing import NamedTuple


class Quantity(NamedTuple):
    """What a number is.

    **Fields:**

    - `name`: of the field, the column and the variable of a dataset.
    - `symbol`: as in formulas, in LaTeX.
    - `unit`: in SI, "1" if dimensionless.
    - `meaning`: in words.
    """

    name: str
    symbol: str
    unit: str
    meaning: str

    @property
    def label(self) -> str:
        """Words, symbol and unit for an axis of a figure."""
        return f"{self.meaning} ${self.symbol}$ [{self.unit}]"


def _table(quantities: Iterable[tuple[str, str, str, str]]) -> dict[str, Quantity]:
    return {name: Quantity(name, *rest) for name, *rest in quantities}


# What a study varies.
AXES = _table([
    ("velocity", "v", "m/s", "sliding velocity"),
    ("pressure", r"\sigma_0", "Pa", "mean pressure"),
    ("temperature", "T", "K", "temperature"),
    ("seed", "", "1", "seed of the random surface"),
])  # fmt: skip

# Numbers that one contact has; a name with `_error` is the estimated error of the name before it.
OBSERVABLES = _table([
    ("friction", r"\mu", "1", "friction coefficient"),
    ("friction_error", r"\delta\mu", "1", "estimated solver error of the friction coefficient"),
    ("contact_area", "A/A_0", "1", "contact area fraction (points in contact)"),
    ("contact_area_error", r"\delta A/A_0", "1", "estimated solver error of the contact area"),
    ("contact_area_corrected", "A/A_0", "1", "contact area fraction (corrected by the perimeter)"),
    ("contact_area_smooth", "A/A_0", "1", "contact area fraction (sub-pixel)"),
    ("mean_gap", r"\bar u", "m", "mean gap"),
    ("geometric_friction", r"\mu_\mathrm{geo}", "1", "friction coefficient from the surface slope"),
    ("energy_imbalance", "", "1", "relative difference of friction work and dissipation"),
    ("slope_in_contact", "", "1", "rms slope of the block, weighted by the pressure"),
    ("unmeasured_area", "", "1", "share of the contact area on filled or tapered points"),
    ("unmeasured_friction", "", "1", "share of the friction on filled or tapered points"),
    ("extrapolated_friction", "", "1", "share of the friction where no modulus was measured"),
    ("error", "", "1", "estimated relative error of the contact pressure"),
    ("num_fft_pairs", "", "1", "FFT pairs of the solve"),
    ("reduced_velocity", "a_T v", "m/s", "velocity times the time-temperature shift"),
    ("friction_standard_error", "", "1", "standard error of the friction by that of materials"),
])  # fmt: skip

# Fields over the surface.
FIELDS = _table([
    ("pressure", r"\sigma", "Pa", "contact pressure"),
    ("gap", "u", "m", "gap"),
    ("displacement", "w", "m", "displacement into the solid"),
    ("heights", "h", "m", "height into the solid"),
    ("measured", "", "1", "share of each height that was measured, not filled or tapered"),
    ("x", "x", "m", "position along x"),
    ("y", "y", "m", "position along y"),
])  # fmt: skip

# Numbers of the contact solver.
SOLVER = _table([
    ("mean_pressure", r"\bar\sigma", "Pa", "mean contact pressure"),
    ("gap_error", "", "1", "estimated solver error of the gap over the rms height"),
    ("load_error", "", "1", "relative error of the load"),
    ("complementarity_error", "", "1", "relative pressure on points with a gap"),
    ("penetration", "", "1", "relative penetration"),
])  # fmt: skip

# Numbers of materials and blocks, by the last part of their path.
PARAMETERS = _table([
    ("modulus", "E", "Pa", "Young's modulus"),
    ("poisson", r"\nu", "1", "Poisson's ratio"),
    ("equilibrium", r"E_\infty", "Pa", "long-time modulus"),
    ("strengths", "E_k", "Pa", "branch moduli"),
    ("times", r"\tau_k", "s", "relaxation times"),
    ("thickness", "d", "m", "layer thickness"),
    ("reference", "T_0", "K", "reference temperature"),
    ("width", "", "1", "width of the transition"),
])  # fmt: skip


def quantity_of(path: str) -> Quantity | None:
    """Returns the entry of a name or path: "layers[0].thickness" is a thickness."""
    return _ALL.get(path.rpartition(".")[2].partition("[")[0])


# The pressure of an axis comes before that of a field.
_ALL = {**PARAMETERS, **SOLVER, **FIELDS, **OBSERVABLES, **AXES}
