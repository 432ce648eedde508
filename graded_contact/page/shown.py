"""What a page shows, as files to take away: curves (CSV), everything (HDF5), a figure (PDF)."""

import csv
import io
from collections.abc import Sequence
from typing import NamedTuple

import h5py
import numpy as np

from ..core.display import unit_of
from ..files.hdf5 import put
from ..files.results import package_versions
from ..files.schema import toml_text
from ..files.study import UNITS
from ..plot.style import COLOURS, GAPS, PRESSURES, new_figure, styled
from .document import Document
from .knobs import Knob
from .model import Contact, Curves, Derivatives

CURVES = {
    "q": ("rad/m", "wavenumber"),
    "modulus": ("Pa", "composite modulus |2/(q M_zz)| at the velocity"),
    "loss_tangent": ("1", "composite loss tangent at the velocity"),
    "speed": ("m/s", "velocity"),
    "friction": ("1", "friction by mean field"),
    "contact_area": ("1", "contact area fraction by mean field"),
}
NUMBERS = (
    "friction", "friction_error", "contact_area", "contact_area_error", "contact_area_smooth",
    "mean_gap", "error",
)  # fmt: skip
FIELDS = ("pressure", "gap", "displacement")


class Shown(NamedTuple):
    """All that a page shows at one point; `derivatives` is None until the sliders rest."""

    document: Document
    knobs: Sequence[Knob]
    curves: Curves
    contact: Contact
    size: np.ndarray
    derivatives: Derivatives | None

    def csv(self) -> str:
        """Returns the curves, side by side, with their units in the heading."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([f"{name} [{unit}]" for name, (unit, _) in CURVES.items()])
        columns = [getattr(self.curves, name).tolist() for name in CURVES]
        for i in range(max(map(len, columns))):
            writer.writerow([repr(column[i]) if i < len(column) else "" for column in columns])
        return text.getvalue()

    def hdf5(self) -> bytes:
        """Returns an HDF5 file of curves, fields, numbers and derivatives, with the scene."""
        content = io.BytesIO()
        with h5py.File(content, "w", track_order=True) as file:
            file.attrs["scene"] = toml_text(self.document.content)
            file.attrs.update(package_versions())
            for scale in ("q", "speed"):
                self._put_curve(file, scale, scale)
            for name in CURVES.keys() - {"q", "speed"}:
                along = "q" if name in ("modulus", "loss_tangent") else "speed"
                self._put_curve(file, name, along)
            self._put_contact(file.create_group("contact"))
            if self.derivatives is not None:
                group = file.create_group("change_by_step_of_slider")
                steps = np.array([f"{knob.label} {knob.step}" for knob in self.knobs])
                put(file, "slider", steps, ("slider",), {"units": "1", "description": "and step"})
                for name, values in self.derivatives._asdict().items():
                    put(group, name, values, ("slider",), {"units": "%", "description": "change"})
        return content.getvalue()

    def _put_curve(self, file: h5py.File, name: str, along: str) -> None:
        unit, description = CURVES[name]
        about = {"units": unit, "description": description}
        put(file, name, getattr(self.curves, name), (along,), about)

    def _put_contact(self, group: h5py.Group) -> None:
        heights = self.contact.heights
        axes = ("x", "y")[: heights.ndim]
        for axis, length, points in zip(axes, self.size, heights.shape, strict=True):
            about = {"units": "m", "description": f"position along {axis}"}
            put(group.file, axis, np.arange(points) * (length / points), (axis,), about)
        put(group, "heights", heights, axes, {"units": "m", "description": "into the solid"})
        for name in (*NUMBERS, *FIELDS):
            values = np.asarray(getattr(self.contact.sliding, name))
            about = {"units": UNITS[name], "description": name.replace("_", " ")}
            put(group, name, values, axes if name in FIELDS else (), about)

    @styled
    def pdf(self) -> bytes:
        """Returns a vector figure of curves, contact and derivatives."""
        figure = new_figure(11.0, 5.6)
        panels = figure.subplots(2, 4)
        c = self.curves
        lines = (
            (c.q, c.modulus, "composite modulus [Pa]", "wavenumber $q$ [rad/m]", 2),
            (c.q, c.loss_tangent, "composite loss tangent [1]", "wavenumber $q$ [rad/m]", 2),
            (c.speed, c.friction, "friction [1]", "velocity [m/s]", 0),
            (c.speed, c.contact_area, "contact area fraction [1]", "velocity [m/s]", 1),
        )
        for axes, (x, y, ylabel, xlabel, colour) in zip(panels.flat, lines, strict=False):
            axes.semilogx(x, y, color=COLOURS[colour])
            axes.set(xlabel=xlabel, ylabel=ylabel)
        panels[0, 0].set_yscale("log")
        sliding = self.contact.sliding
        for axes, value in zip(panels[0, 2:], (sliding.friction, sliding.contact_area_smooth),
                               strict=True):  # fmt: skip
            axes.plot(self.contact.velocity, value, "ko", label="contact")
            axes.set_ylim(bottom=0)
            axes.legend()
        for axes, name, colours in ((panels[1, 0], "pressure", PRESSURES),
                                    (panels[1, 1], "gap", GAPS)):  # fmt: skip
            self._draw_field(figure, axes, name, colours)
        self._draw_derivatives(panels[1, 2], panels[1, 3])
        content = io.BytesIO()
        figure.savefig(content, format="pdf")
        return content.getvalue()

    def _draw_field(self, figure, axes, name: str, colours: str) -> None:
        field = shown_field(self.contact, name)
        high = float(np.nanquantile(field, 0.995)) if np.any(np.isfinite(field)) else 1.0
        unit, scale = unit_of("Pa" if name == "pressure" else "m", high)
        length, factor = unit_of("m", float(np.max(self.size)))
        axes.set_xlabel(f"$x$ [{length}]")
        if field.ndim == 1:
            x = np.arange(len(field)) * (factor * self.size[0] / len(field))
            axes.plot(x, scale * np.nan_to_num(field))
            axes.set_ylabel(f"{name} [{unit}]")
            return
        image = axes.imshow(
            scale * field.T, origin="lower", extent=(0, factor * self.size[0], 0,
            factor * self.size[1]), cmap=colours, vmin=0, vmax=scale * high,
        )  # fmt: skip
        axes.set_ylabel(f"$y$ [{length}]")
        figure.colorbar(image, ax=axes, label=f"{name} [{unit}]", extend="max")

    def _draw_derivatives(self, left, right) -> None:
        if self.derivatives is None:
            left.set_axis_off()
            right.set_axis_off()
            return
        places = np.arange(len(self.knobs))[::-1]
        panels = zip((left, right), self.derivatives._asdict().items(), COLOURS, strict=False)
        for axes, (name, values), colour in panels:
            axes.barh(places, values, color=colour)
            axes.axvline(0, color="0.5", linewidth=0.6)
            axes.set_xlabel(f"change of {name.replace('_', ' ')} [%]")
            axes.set_yticks(places, [""] * len(places))
        labels = [f"{knob.label} {knob.step}" for knob in self.knobs]
        left.set_yticks(places, labels, fontsize=6)


def shown_field(contact: Contact, name: str) -> np.ndarray:
    """Returns pressure [Pa] or gap [m], NaN where there is none: out of contact, or in it."""
    touching = np.asarray(contact.sliding.pressure) > 0
    if name == "pressure":
        return np.where(touching, np.asarray(contact.sliding.pressure), np.nan)
    return np.where(touching, np.nan, np.maximum(np.asarray(contact.sliding.gap), 0))
