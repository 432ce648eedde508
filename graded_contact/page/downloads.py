"""The downloads of a page: curves (CSV), and everything that it shows (HDF5)."""

import dataclasses
from functools import cached_property
from typing import Any

import numpy as np

from ..core.quantities import FIELDS, NUMBERS, in_brackets
from ..sliding.result import Sliding
from ..studies.dataset import package_versions
from .document import Document
from .model import Curve, Derivatives, Model


@dataclasses.dataclass(frozen=True, eq=False)
class ShownPoint:
    """What a page shows at one point.

    **Fields:**

    - `model`: of the scene.
    - `values`: of its knobs [SI].
    - `curves`, `contact`, `warnings`, `derivatives`: of the model at these values. The warnings,
      with which the contact has its errors, and the derivatives are None until they are computed.
    """

    model: Model
    values: tuple[float, ...]
    curves: dict[str, Curve]
    contact: Sliding
    warnings: tuple[str, ...] | None = None
    derivatives: Derivatives | None = None

    @cached_property
    def document(self) -> Document:
        """The scene at these values."""
        return self.model.changed(self.values)

    def number(self, name: str) -> tuple[float, float]:
        """Returns a number of the contact, and its error, which is NaN until it is computed."""
        error = np.nan if self.warnings is None else getattr(self.contact, f"{name}_error")
        return float(getattr(self.contact, name)), float(error)


def to_csv(shown: ShownPoint) -> bytes:
    """Returns the curves, side by side, with their units in the heading."""
    import pandas as pd
    import xarray as xr  # both take a third of a second to import

    curves = xr.Dataset(shown.curves)
    tables = [curves.drop_dims(other).to_dataframe().reset_index() for other in ("speed", "q")]
    titles = {
        name: str(name) + in_brackets(curves[name].attrs["units"]) for name in curves.variables
    }
    return pd.concat(tables, axis=1).rename(columns=titles).to_csv(index=False).encode()


def to_hdf5(shown: ShownPoint) -> bytes:
    """Returns curves, contact and derivatives as groups of xarray, with the scene as attribute."""
    import xarray as xr

    about = {"scene": shown.document.text, **package_versions()}
    contact = shown.contact
    heights = np.asarray(contact.heights)
    axes = ("x", "y")[: heights.ndim]
    found: dict[str, Any] = {"heights": (axes, heights)}
    for axis, spacing, points in zip(axes, contact.grid.spacing, heights.shape, strict=True):
        found[axis] = (axis, np.arange(points) * float(spacing))
    for name in ("pressure", "gap", "displacement"):
        found[name] = (axes, np.asarray(getattr(contact, name)))
    found |= {name: ((), np.asarray(getattr(contact, name))) for name in contact.numbers}
    # The pressure of a contact is a field, not an axis.
    known = {name: FIELDS.get(name) or NUMBERS[name] for name in found}
    fields_and_numbers = xr.Dataset({
        name: (*values, {"units": known[name].unit, "long_name": known[name].meaning})
        for name, values in found.items()
    })  # fmt: skip
    groups = {"/": xr.Dataset(shown.curves, attrs=about), "/contact": fields_and_numbers}
    if shown.derivatives is not None:
        about = {"units": "%", "long_name": "change by a step of the slider"}
        changes = shown.derivatives._asdict().items()
        groups["/change_by_step_of_slider"] = xr.Dataset(
            {name: ("slider", values, about) for name, values in changes},
            coords={"slider": shown.model.stepped(shown.values)},
        )
    return bytes(xr.DataTree.from_dict(groups).to_netcdf(engine="h5netcdf"))
