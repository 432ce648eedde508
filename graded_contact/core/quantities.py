"""Quantities: name, symbol, unit, meaning.

Prints, columns of tables, attributes of datasets, labels of axes and the documentation take their
words from here. The numbers of results of sliding bring their own, see `sliding/number.py`.
"""

from collections.abc import Iterable
from typing import NamedTuple


class Quantity(NamedTuple):
    """One quantity.

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
        return f"{self.meaning} ${self.symbol}$" + in_brackets(self.unit)


def in_brackets(unit: str) -> str:
    """Returns a unit as it follows a name: " [Pa]"; nothing for dimensionless numbers."""
    return "" if unit in ("", "1") else f" [{unit}]"


def _table(quantities: Iterable[tuple]) -> dict[str, Quantity]:
    return {name: Quantity(name, *rest) for name, *rest in quantities}


# What a study varies.
AXES = _table([
    ("velocity", "v", "m/s", "sliding velocity"),
    ("pressure", r"\sigma_0", "Pa", "mean pressure"),
    ("approach", r"\delta", "m", "approach"),
    ("temperature", "T", "K", "temperature"),
    ("direction", r"\varphi", "rad", "direction of sliding"),
    ("seed", "", "1", "seed of the random surface"),
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

# Numbers of materials, layers, laws, spectra and grids, by the last part of their path. A name that
# means another quantity in one class is listed with that class.
PARAMETERS = _table([
    ("modulus", "E", "Pa", "Young's modulus"),
    ("poisson", r"\nu", "1", "Poisson's ratio"),
    ("equilibrium", r"E_\infty", "Pa", "long-time modulus"),
    ("glassy", "E_0", "Pa", "instantaneous modulus"),
    ("strengths", "E_k", "Pa", "branch moduli"),
    ("times", r"\tau_k", "s", "relaxation times"),
    ("omega", r"\omega", "rad/s", "angular frequency"),
    ("Tabulated.storage", "E'", "Pa", "storage modulus"),
    ("Tabulated.loss", "E''", "Pa", "loss modulus"),
    ("strain", r"\varepsilon", "1", "strain amplitudes of a sweep"),
    ("StrainSoftening.storage", "f", "1", "factor of the storage modulus"),
    ("StrainSoftening.loss", "g", "1", "factor of the loss modulus"),
    ("StrainSoftening.amplitude", r"\varepsilon", "1", "strain amplitude of the modulus"),
    ("thickness", "d", "m", "layer thickness"),
    ("reference", "T_0", "K", "reference temperature"),
    ("c1", "c_1", "1", "first constant of the WLF law"),
    ("c2", "c_2", "K", "second constant of the WLF law"),
    ("activation_energy", "Q", "J/mol", "activation energy"),
    ("temperatures", "T", "K", "temperatures"),
    ("log10_factors", r"\log a_T", "1", "decadic logarithm of the shift of times"),
    ("vertical_factors", "b_T", "1", "shift of moduli"),
    ("width", "", "1", "width of the transition"),
    ("centre", "s_0", "1", "height of the middle of the transition"),
    ("rate", "", "1", "rate of the exponential"),
    ("exponent", "", "1", "exponent of the power law"),
    ("periods", "", "1", "periods over the thickness"),
    ("Sinusoidal.amplitude", "", "1", "amplitude of the wave"),
    ("Table.heights", "s", "1", "heights of the table"),
    ("Table.values", r"\phi", "1", "values of the table"),
    ("fraction", r"\phi", "1", "volume fraction of the filler"),
    ("hurst", "H", "1", "Hurst exponent"),
    ("q", "q", "rad/m", "wavenumber"),
    ("anisotropy", r"\gamma", "1", "Peklenik's number"),
    ("angle", "", "rad", "angle of the lay from the x axis"),
    ("q_low", "q_0", "rad/m", "lowest wavenumber"),
    ("q_roll", "q_r", "rad/m", "wavenumber of the roll-off"),
    ("q_high", "q_1", "rad/m", "highest wavenumber"),
    ("size", "L", "m", "edge lengths of the cell"),
    ("range", r"\rho", "m", "range of the law of contact"),
    ("work", r"\Delta\gamma", "J/m²", "work of adhesion"),
    ("viscosity", r"\eta", "Pa s", "viscosity of the fluid"),
    ("pressure_difference", r"\Delta p", "Pa", "difference of the fluid's pressure"),
    ("hardness", r"\sigma_H", "Pa", "hardness"),
    ("coefficient", "f", "1", "friction coefficient of the interface"),
    ("ConstantShear.stress", r"\tau_f", "Pa", "shear stress in the contact"),
    ("PeakedShear.peak", r"\tau_0", "Pa", "largest shear stress in the contact"),
    ("PeakedShear.velocity", "v^*", "m/s", "velocity of the largest shear stress"),
    ("steepness", "c", "1", "steepness of the peak of the shear stress"),
    ("contact_gap", "", "1", "gap below which there is contact, over the range"),
    ("conductivity", r"\kappa", "W/(m K)", "thermal conductivity of the block"),
    ("diffusivity", "D", "m²/s", "thermal diffusivity of the block"),
    ("counterface_conductivity", r"\kappa", "W/(m K)", "thermal conductivity of the counterface"),
])  # fmt: skip

# Of periodic motions, and other numbers of results.
OF_RESULTS = _table([
    *((name, "s", "m", "displacement of the surface over the block") for name in
      ("CyclicSliding.displacement", "Motion.displacement", "surface_displacement")),
    ("time", "t/T", "1", "time over the period"),
    ("highest_speed", "v", "m/s", "highest speed"),
    ("period", "T", "s", "period"),
    ("reduced_velocity", "a_T v", "m/s", "velocity times the time-temperature shift"),
    ("leakage_along_x", "Q_x", "m³/s", "leakage of the cell along x"),
    ("leakage_along_y", "Q_y", "m³/s", "leakage of the cell along y"),
    *(entry for name, what in (("tension", "principal stress in the block"),
                               ("von_mises", "von Mises stress in the block"),
                               ("interface_shear", "shear stress between layers"))
      for entry in ((name, r"\sigma", "Pa", f"largest {what}"),
                    (f"{name}_depth", "z", "m", f"depth of the largest {what}"))),
    ("GapFlow.conductance", "K", "m³", "conductance of the gap along x and along y"),
    ("rms_height", r"h_\mathrm{rms}", "m", "rms height"),
    ("rms_slope", r"h'_\mathrm{rms}", "1", "rms slope"),
    ("rms_slope_along", "", "1", "rms slope along each axis"),
    ("rms_curvature", "", "1/m", "rms curvature"),
    ("ContactSolution.pressure", r"\sigma", "Pa", "contact pressure"),
    ("measured_range", r"\omega", "rad/s", "frequencies at which all materials were measured"),
    ("correction", "", "Pa", "estimated change of the pressure to the converged one"),
    ("gap_error", "", "1", "estimated relative error of the gap"),
    ("stress", r"\sigma_{ij}", "Pa", "stress"),
    ("stress_variance", "V", "Pa²", "variance of the pressure"),
    ("cutoff", "q", "rad/m", "cut-off of the roughness"),
    ("offset", "", "m", "offset of the middle of the contact"),
    ("elasticities", "", "1", "relative change of the objective over that of the parameter"),
])  # fmt: skip


# Kinds of contacts: steady sliding, a periodic motion, and a transient motion.
STEADY, CYCLE, TRANSIENT = ("steady", "cycle", "transient")

# Of the numbers of results of sliding, by their names; their classes add them.
NUMBERS: dict[str, Quantity] = {}


# The pressure of an axis comes before that of a field.
_ALL = PARAMETERS | OF_RESULTS | FIELDS


def quantity_of(name: str, owner: str = "") -> Quantity | None:
    """Returns the entry of a field of the class `owner`, or of the last part of a path, or None."""
    # "layers[0].thickness" and "times[2]" are a thickness and a time.
    *_, parent, last = ("", *(word.partition("[")[0] for word in name.split(".")))
    owner = owner or parent.capitalize()
    found = _ALL.get(f"{owner}.{last}") or AXES.get(last)
    return found or NUMBERS.get(last) or _ALL.get(last)
