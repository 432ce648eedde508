"""Quantities: name, unit, meaning.

Prints, columns of tables, attributes of datasets, labels of axes and the documentation take their
words from here. The numbers of results of sliding bring their own, see `sliding/number.py`. A
dimensionless number with a plain name needs no entry.
"""

from typing import NamedTuple


class Quantity(NamedTuple):
    """One quantity.

    **Fields:**

    - `name`: of the field, the column and the variable of a dataset.
    - `unit`: in SI, "1" if dimensionless.
    - `meaning`: in words.
    """

    name: str
    unit: str
    meaning: str


def in_brackets(unit: str) -> str:
    """Returns a unit as it follows a name: " [Pa]"; nothing for dimensionless numbers."""
    return "" if unit in ("", "1") else f" [{unit}]"


def _by_name(*rows: tuple[str, str, str]) -> dict[str, Quantity]:
    return {name: Quantity(name, unit, meaning) for name, unit, meaning in rows}


# What a study varies.
AXES = _by_name(
    ("velocity", "m/s", "sliding velocity"),
    ("pressure", "Pa", "mean pressure"),
    ("approach", "m", "approach"),
    ("temperature", "K", "temperature"),
    ("direction", "rad", "direction of sliding"),
    ("seed", "1", "seed of the random surface"),
)

# Fields over the surface.
FIELDS = _by_name(
    ("pressure", "Pa", "contact pressure"),
    ("gap", "m", "gap"),
    ("displacement", "m", "displacement into the solid"),
    ("heights", "m", "height into the solid"),
    ("measured", "1", "share of each height that was measured, not filled or tapered"),
    ("x", "m", "position along x"),
    ("y", "m", "position along y"),
)

# Numbers of materials, layers, laws, spectra and grids, by the last part of their path. A name that
# means another quantity in one class is listed with that class.
_PARAMETERS = _by_name(
    ("modulus", "Pa", "Young's modulus"),
    ("poisson", "1", "Poisson's ratio"),
    ("equilibrium", "Pa", "long-time modulus"),
    ("strengths", "Pa", "branch moduli"),
    ("times", "s", "relaxation times"),
    ("omega", "rad/s", "angular frequency"),
    ("Tabulated.storage", "Pa", "storage modulus"),
    ("Tabulated.loss", "Pa", "loss modulus"),
    ("thickness", "m", "layer thickness"),
    ("reference", "K", "reference temperature"),
    ("c2", "K", "second constant of the WLF law"),
    ("activation_energy", "J/mol", "activation energy"),
    ("temperatures", "K", "temperatures"),
    ("q", "rad/m", "wavenumber"),
    ("angle", "rad", "angle of the lay from the x axis"),
    ("q_low", "rad/m", "lowest wavenumber"),
    ("q_roll", "rad/m", "wavenumber of the roll-off"),
    ("q_high", "rad/m", "highest wavenumber"),
    ("size", "m", "edge lengths of the cell"),
    ("range", "m", "range of the law of contact"),
    ("work", "J/m²", "work of adhesion"),
    ("viscosity", "Pa s", "viscosity of the fluid"),
    ("pressure_difference", "Pa", "difference of the fluid's pressure"),
    ("hardness", "Pa", "hardness"),
    ("ConstantShear.stress", "Pa", "shear stress in the contact"),
    ("PeakedShear.peak", "Pa", "largest shear stress in the contact"),
    ("PeakedShear.velocity", "m/s", "velocity of the largest shear stress"),
    ("conductivity", "W/(m K)", "thermal conductivity of the block"),
    ("diffusivity", "m²/s", "thermal diffusivity of the block"),
    ("counterface_conductivity", "W/(m K)", "thermal conductivity of the counterface"),
)

# Of motions, and other numbers of results.
_MOVED = "displacement of the surface over the block"
_OF_RESULTS = _by_name(
    ("CyclicSliding.displacement", "m", _MOVED),
    ("Motion.displacement", "m", _MOVED),
    ("surface_displacement", "m", _MOVED),
    ("time", "1", "time over the period"),
    ("highest_speed", "m/s", "highest speed"),
    ("period", "s", "period"),
    ("reduced_velocity", "m/s", "velocity times the time-temperature shift"),
    ("leakage_along_x", "m³/s", "leakage of the cell along x"),
    ("leakage_along_y", "m³/s", "leakage of the cell along y"),
    ("tension", "Pa", "largest principal stress in the block"),
    ("tension_depth", "m", "depth of the largest principal stress in the block"),
    ("von_mises", "Pa", "largest von Mises stress in the block"),
    ("von_mises_depth", "m", "depth of the largest von Mises stress in the block"),
    ("interface_shear", "Pa", "largest shear stress between layers"),
    ("interface_shear_depth", "m", "depth of the largest shear stress between layers"),
    ("GapFlow.conductance", "m³", "conductance of the gap along x and along y"),
    ("rms_height", "m", "rms height"),
    ("lay", "rad", "angle of the lay from the x axis"),
    ("rms_curvature", "1/m", "rms curvature"),
    ("ContactSolution.pressure", "Pa", "contact pressure"),
    ("correction", "Pa", "estimated change of the pressure to the converged one"),
    ("stress", "Pa", "stress"),
    ("stress_variance", "Pa²", "variance of the pressure"),
    ("cutoff", "rad/m", "cut-off of the roughness"),
    ("offset", "m", "offset of the middle of the contact"),
    ("elasticities", "1", "relative changes of the objective over the parameter's"),
)

# Kinds of contacts: steady sliding, a periodic motion, and a transient motion.
STEADY, CYCLE, TRANSIENT = ("steady", "cycle", "transient")

# Of the numbers of results of sliding, by their names; their classes add them.
NUMBERS: dict[str, Quantity] = {}


# The pressure of an axis comes before the pressure field.
_ALL = _PARAMETERS | _OF_RESULTS | FIELDS


def quantity_of(name: str, owner: str = "") -> Quantity | None:
    """Returns the entry of a field of the class `owner`, or of the last part of a path, or None."""
    # "layers[0].thickness" and "times[2]" are a thickness and a time.
    *_, parent, last = ("", *(word.partition("[")[0] for word in name.split(".")))
    owner = owner or parent.capitalize()
    found = _ALL.get(f"{owner}.{last}") or AXES.get(last)
    return found or NUMBERS.get(last) or _ALL.get(last)
