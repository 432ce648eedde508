"""Names and numbers of axes in words, as legends, titles and tables write them."""

import re
from typing import TYPE_CHECKING

from ..core.display import unit_of, with_unit
from ..core.quantities import AXES, quantity_of
from ..scenes.toml import parse_toml
from ..surfaces.statistics import statistics
from ..surfaces.surface import Surface

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

SKEWNESS, EXCESS = 0.5, 1.0  # of heights that count as Gaussian; the excess is kurtosis less 3
ZERO_CELSIUS = 273.15  # K
_SINGULAR = {"branch moduli": "branch modulus", "relaxation times": "relaxation time"}


def title_of(name: str, scene: str = "") -> str:
    """Returns the name of an axis in words: "coat thickness" for "layers[0].thickness".

    **Arguments:**

    - `name`: of an axis, or the path of a number of the block.
    - `scene`: the TOML text, which names the materials; without it layers have numbers.
    """
    if name in AXES:
        return AXES[name].meaning
    path = re.fullmatch(r"(counterface\.)?(?:layers\[(\d+)\]|(base))\.(.*?)(?:\[(\d+)\])?", name)
    quantity = quantity_of(name)
    if path is None or quantity is None:
        return name
    counterface, layer, base, rest, entry = path.groups()
    tables = parse_toml(scene)
    tables = tables.get("counterface", {}) if counterface else tables
    layers = tables.get("layers", [])
    place = base or f"layer {int(layer) + 1}"
    table = tables.get("base", {}) if base else dict(enumerate(layers)).get(int(layer), {})
    # A path inside a graded layer names which of its two materials it means.
    end = next((end for end in ("bottom", "top") if f".{end}." in rest), "material")
    owner = table.get(end, place)
    if sum(owner in map(one.get, ("material", "bottom", "top")) for one in layers) > 1:
        owner = f"{place} ({owner})"  # a material of several layers
    # The material or the number already tells that it is of a layer.
    meaning = quantity.meaning.removeprefix("layer ")
    if entry is not None:
        meaning = f"{_SINGULAR.get(meaning, meaning)} {int(entry) + 1}"
    return f"{'counterface ' if counterface else ''}{owner} {meaning}"


def label_of(number: "DataArray") -> str:
    """Returns a number of an axis with a common unit, a temperature also in °C."""
    value, unit = number.item(), number.attrs.get("units", "")
    if unit == "K":
        return kelvin(value)
    if unit in ("", "1", "rad"):
        return f"{value:.5g}" + (" rad" if unit == "rad" else "")
    unit, factor = unit_of(unit, abs(value))
    return f"{factor * value:.3g} {unit}"


def place_of(solve: "Dataset") -> str:
    """Returns the numbers of a solve on its axes: "sliding velocity 1 m/s, mean pressure 200 kPa".

    Also those that a scene does not vary, as its temperature; of a motion the highest speed, and
    the ends of a load that changes.
    """
    words, moves = [], "time" in solve.dims
    for name, number in solve.coords.items():
        title = title_of(str(name), solve.attrs.get("scene", ""))
        if name == "velocity" and moves:
            title = "highest speed"
        ends = [number]
        if name == "pressure" and moves and solve["load"].dims == ("time",):
            load = solve["load"]
            ends = [load.min(keep_attrs=True), load.max(keep_attrs=True)]
        if not number.ndim:
            words.append(f"{title} {' to '.join(dict.fromkeys(map(label_of, ends)))}")
    return ", ".join(words)


def fluid_of(results: "Dataset") -> str:
    """Returns the fluid of results and the cell through which it leaks; nothing without [fluid]."""
    fluid = parse_toml(results.attrs.get("scene", "")).get("fluid")
    if fluid is None:
        return ""
    difference = with_unit(fluid["pressure_difference"], "Pa")
    edges = (with_unit(results[axis].attrs["period"], "m") for axis in results["heights"].dims)
    return (
        f"fluid with η = {fluid['viscosity']:g} Pa s, Δp = {difference} over the cell of "
        f"{' × '.join(edges)}"
    )


def kelvin(value: float) -> str:
    """Returns a temperature [K] also in °C: "293.15 K (20 °C)"."""
    # 0.0 is added because -0.0 would be written with its sign.
    celsius = f"{round(value - ZERO_CELSIUS, 2) + 0.0:g}".replace("-", "−")
    return f"{value:.5g} K ({celsius} °C)"


def not_gaussian(surface: Surface) -> str:
    """Returns a remark for a figure with Persson's theory if the heights are not Gaussian."""
    found = statistics(surface)
    skewness, kurtosis = float(found.skewness), float(found.kurtosis)
    if abs(skewness) <= SKEWNESS and abs(kurtosis - 3) <= EXCESS:
        return ""
    numbers = f"skewness {skewness:.2g} and kurtosis {kurtosis:.2g}".replace("-", "−")
    return f"Persson's theory is for Gaussian heights; these have {numbers}, not 0 and 3"
