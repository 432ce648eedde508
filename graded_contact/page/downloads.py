"""The downloads of a page: curves (CSV), everything that it shows (HDF5), a figure (PDF)."""

import io
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from ..core.quantities import FIELDS, OBSERVABLES
from ..plot.contact import draw_field, masked_fields
from ..plot.style import COLOURS, entitle, new_figure, styled
from ..studies.dataset import package_versions
from .model import Contact, Derivatives, Model


class Shown(NamedTuple):
    """What a page shows at one point.

    **Fields:**

    - `model`: of the scene.
    - `values`: of its knobs [SI].
    - `curves`, `contact`, `derivatives`: of the model at these values; the last one is None until
      it is computed.
    """

    model: Model
    values: tuple[float, ...]
    curves: xr.Dataset
    contact: Contact
    derivatives: Derivatives | None = None


def to_csv(shown: Shown) -> bytes:
    """Returns the curves, side by side, with their units in the heading."""
    curves = shown.curves
    tables = [curves.drop_dims(other).to_dataframe().reset_index() for other in ("speed", "q")]
    titles = {name: f"{name} [{curves[name].attrs['units']}]" for name in curves.variables}
    return pd.concat(tables, axis=1).rename(columns=titles).to_csv(index=False).encode()


def to_hdf5(shown: Shown) -> bytes:
    """Returns curves, contact and derivatives as groups of xarray, with the scene as attribute."""
    groups = {
        "/": shown.curves.assign_attrs(
            scene=shown.model.changed(shown.values).text, **package_versions()
        ),
        "/contact": _contact(shown),
    }
    if shown.derivatives is not None:
        about = {"units": "%", "long_name": "change by a step of the slider"}
        changes = shown.derivatives._asdict().items()
        groups["/change_by_step_of_slider"] = xr.Dataset(
            {name: ("slider", values, about) for name, values in changes},
            coords={"slider": shown.model.stepped(shown.values)},
        )
    return bytes(xr.DataTree.from_dict(groups).to_netcdf(engine="h5netcdf"))


def _contact(shown: Shown) -> xr.Dataset:
    """Numbers and fields of the contact, with the words of the table of quantities."""
    sliding, heights = shown.contact.sliding, shown.contact.heights
    axes = ("x", "y")[: heights.ndim]
    found: dict[str, Any] = {"heights": (axes, heights)}
    for axis, length, points in zip(axes, shown.model.size, heights.shape, strict=True):
        found[axis] = (axis, np.arange(points) * (length / points))
    for name in ("pressure", "gap", "displacement"):
        found[name] = (axes, np.asarray(getattr(sliding, name)))
    found |= {name: ((), np.asarray(getattr(sliding, name))) for name in sliding.numbers}
    # The pressure of a contact is a field, not an axis.
    about = {name: FIELDS.get(name) or OBSERVABLES[name].quantity for name in found}
    return xr.Dataset({
        name: (*values, {"units": about[name].unit, "long_name": about[name].meaning})
        for name, values in found.items()
    })  # fmt: skip


@styled
def to_pdf(shown: Shown) -> bytes:
    """Returns a vector figure of curves, contact and derivatives."""
    figure = new_figure(11.0, 5.6)
    entitle(figure, shown.model.title(shown.values))
    halves: Any = figure.subfigures(2, 1)
    upper, lower = halves
    panels: Any = upper.subplots(1, 4), lower.subplots(1, 2 if shown.derivatives is None else 4)
    sliding = shown.contact.sliding
    points = {"friction": sliding.friction, "contact_area": sliding.contact_area_smooth}
    for axes, name in zip(panels[0], ("modulus", "loss_tangent", *points), strict=True):
        curve: Any = shown.curves[name]
        scale = "log" if name == "modulus" else "linear"
        curve.plot(ax=axes, xscale="log", yscale=scale, color=COLOURS[0])
        if name in points:
            axes.plot(shown.contact.velocity, points[name], "ko", label="contact")
            axes.set_ylim(bottom=0)
            axes.legend()
    for axes, (name, values) in zip(panels[1], masked_fields(sliding).items(), strict=False):
        draw_field(axes, name, values, shown.model.size)
    for bar in (axes for axes in lower.axes if axes not in panels[1]):
        for colours in bar.collections:
            colours.set_rasterized(True)  # as vectors they have white lines between them
    if shown.derivatives is not None:
        _draw_derivatives(shown, shown.derivatives, panels[1][2:])
    content = io.BytesIO()
    figure.savefig(content, format="pdf")
    return content.getvalue()


def _draw_derivatives(shown: Shown, derivatives: Derivatives, panels) -> None:
    places = np.arange(len(shown.model.knobs))[::-1]
    changes = zip(panels, derivatives._asdict().items(), COLOURS, strict=False)
    for axes, (name, values), colour in changes:
        axes.barh(places, values, color=colour)
        axes.axvline(0, color="0.5", linewidth=0.6)
        axes.set_xlabel(f"change of {name.replace('_', ' ')} [%]")
        axes.set_yticks(places, [""] * len(places))
    labels = shown.model.stepped(shown.values)
    panels[0].set_yticks(places, labels, fontsize=6)
