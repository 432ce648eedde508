"""The tabs of a page beside its sliders: layers, data of the user, and files to save."""

import io
from collections.abc import Callable
from functools import partial
from typing import Any

import panel as pn

from ..core.escaping import in_html
from ..readers.moduli import read_moduli
from ..readers.topography import read_surface
from ..scenes.described import base_name, layer_name
from . import document as tables
from .downloads import to_csv, to_hdf5
from .entries import read_entry, read_pairs, read_units
from .session import Session
from .widgets import LARGEST_DROP, Dropper
from .wording import FIELD_WORDS, for_page

WIDE: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 0}
PADDED: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": (4, 8)}
HALF: dict[str, Any] = {**PADDED, "min_width": 60}
STYLES = """
.head {display: flex; gap: 2px 30px; align-items: baseline; color: #2b2f36;
  font-family: system-ui, sans-serif}
.head b {font-size: 19px; font-weight: 600; font-variant-numeric: tabular-nums}
.head span, .head i {font-size: 12px; color: #5b616b; display: block}
.head i {display: inline; margin-left: 6px} .head u {text-decoration: none}
.title {font-size: 14px; font-weight: 600; flex: 1 1 260px; max-width: 420px; line-height: 1.3;
  min-width: 0; overflow-wrap: anywhere}
@media (max-width: 1099px) {.head i u {display: none}}
@media (max-width: 899px) {.head {gap: 0 5px; flex-wrap: wrap}
  .head b {font-size: 11px; letter-spacing: -0.02em} .head u {display: none}
  .head span, .head i {font-size: 10px} .head i {margin-left: 3px}
  .title {flex: 0 0 100%; max-width: 100%; font-size: 12px; white-space: nowrap; overflow: hidden;
  text-overflow: ellipsis}}
.say {font: 12px system-ui, sans-serif; line-height: 1.35; overflow-wrap: anywhere;
  color: #5b616b}
.error {color: #a33600}
"""
# How to make a part of a surface periodic, in words and in the words of `read_surface`.
EDGES = {
    "joined (harmonic)": "harmonic", "mirrored: twice as long": "mirror",
    "tapered to zero": "window", "periodic already": "none",
}  # fmt: skip
DEFORMATIONS = {"as the file says": "", "tension (E)": "tension", "shear (G)": "shear"}
# How texts of fields are read, and examples.
READ: dict[str, Callable[[str], Any]] = {
    "size": lambda text: read_entry(text, "m"), "units": read_units, "columns": read_pairs,
}  # fmt: skip
LIKE = {
    "size": "a length, such as 1 mm", "units": "for instance modulus=MPa, frequency=Hz",
    "columns": "for instance storage=2, loss=3",
}  # fmt: skip
NEW_MATERIAL = "a new elastic material"
LONGEST_MATERIAL = 40  # characters of its name


class LayersTab(pn.viewable.Viewer):
    """The tab that adds and removes layers; `material` chooses one for the data of the user."""

    def __init__(self, session: Session):
        super().__init__()
        self._session, self._layers = session, pn.Column(**WIDE)
        self._chosen: Any = pn.widgets.Select(
            label="Add a layer of", options={NEW_MATERIAL: ""}, value="", **PADDED
        )
        self.material: Any = pn.widgets.Select(label="of material", **PADDED)
        name: Any = pn.widgets.TextInput(
            label="name of the new material", value=tables.NEW_NAME, max_length=LONGEST_MATERIAL,
            disabled=self._chosen.param.value.rx.bool(), **PADDED,
        )  # fmt: skip
        add = pn.widgets.Button(label="Add layer", color="primary", **PADDED)
        add.on_click(lambda _: session.change(
            partial(tables.with_layer, material=self._chosen.value or None, name=name.value)
        ))  # fmt: skip
        # Above the layers of the scene, so that the button stays in its place.
        self._column = pn.Column(self._chosen, name, add, self._layers, **PADDED)

    def __panel__(self) -> Any:
        return self._column

    def show(self, content: dict[str, Any]) -> None:
        """Shows the layers of a scene, each with a button that removes it."""
        change, names = self._session.change, list(content["materials"])
        self.material.options = names
        self._chosen.options = {NEW_MATERIAL: ""} | {name: name for name in names}
        rows = []
        for i, layer in enumerate(content.get("layers", [])):
            button = pn.widgets.Button(label="Remove", width=80, margin=(2, 8), align="center")
            button.on_click(lambda _, i=i: change(partial(tables.without_layer, index=i)))
            rows.append(pn.Row(heading(f"{i + 1}  {layer_name(layer)}"), button, **WIDE))
        top, base = "From the loaded surface downwards", f"base  {base_name(content)}"
        self._layers[:] = [heading(top), *rows, heading(base)]


def data_tab(session: Session, material: Any) -> pn.Column:
    """Returns the tab that takes files of the user.

    **Arguments:**

    - `session`: of the page.
    - `material`: the choice of the material that new moduli are for.
    """
    of_moduli: dict[str, Any] = {
        "units": pn.widgets.TextInput(placeholder="modulus=MPa", label="its units", **HALF),
        "columns": pn.widgets.TextInput(placeholder="loss=3", label="its columns", **HALF),
        "deformation": pn.widgets.Select(label="measured in", options=DEFORMATIONS, **PADDED),
    }
    of_heights: dict[str, Any] = {
        "unit": pn.widgets.TextInput(placeholder="um", label="unit of its heights", **HALF),
        "size": pn.widgets.TextInput(placeholder="1e-3", label="edge length [m]", **HALF),
        "periodic": pn.widgets.Select(label="its edges", options=EDGES, **PADDED),
    }
    with_moduli = lambda *args, options: tables.with_moduli(  # noqa: E731
        *args, options=options, name=str(material.value)
    )
    moduli = _with_fields(session, of_moduli, with_moduli)
    topography = _with_fields(session, of_heights, tables.with_topography)
    done = pn.pane.HTML(pn.bind(_what_was_done, session.param.model), stylesheets=[STYLES],
                        margin=(8, 8, 2, 8))  # fmt: skip
    tab = pn.Column(**PADDED)

    def dropper(take: Callable[[str, bytes], None]) -> Dropper:
        def dropped(event: Any) -> None:
            for name, data in event.new.items():
                take(name, data)
            # A fresh dropper: the browser shows refused files as complete too.
            tab[tab.objects.index(event.obj)] = dropper(take)

        new = Dropper(**PADDED)
        new.param.watch(lambda event: session.show_message(event.new), "refusal")
        new.param.watch(dropped, "value")
        return new

    tab[:] = [
        heading("Your moduli over frequency (DMA, rheometer), or isotherms at several "
                 "temperatures"),
        material, pn.Row(of_moduli["units"], of_moduli["columns"], **WIDE),
        of_moduli["deformation"], dropper(moduli),
        heading("Your topography"),
        pn.Row(of_heights["unit"], of_heights["size"], **WIDE), of_heights["periodic"],
        dropper(topography),
        heading("The fields apply to the file that you dropped last; for the next one they are "
                "empty again. Fill in what a file does not say."),
        done,
        heading(f"At most {LARGEST_DROP} MB; stored in {session.folder.name}"),
    ]  # fmt: skip
    return tab


def _with_fields(
    session: Session, fields: dict[str, Any], change: Callable[..., Any]
) -> Callable[[str, bytes], None]:
    """Returns what takes a file, and takes it again with each change of the fields beside it."""
    begin = {name: widget.value for name, widget in fields.items()}
    last: list[Any] = []  # name and data of the last file

    def dropped(name: str, data: bytes) -> None:
        if last:  # the fields are those of the file before
            last.clear()
            for field, widget in fields.items():
                widget.value = begin[field]
        last[:] = [name, data]
        read_again()

    def read_again(*_: Any) -> None:
        if not last:
            return
        (file, data), values = last, {}
        for name, widget in fields.items():
            if not widget.value:
                continue
            try:
                values[name] = READ.get(name, str)(widget.value)
            except ValueError as error:
                text = f"“{FIELD_WORDS[name]}” {widget.value} is refused: {error}. Enter "
                session.show_message(f"{text}{LIKE[name]}.")
                return
        session.take_file(file, data, partial(change, options=values))

    for widget in fields.values():
        widget.param.watch(read_again, "value")
    return dropped


def _what_was_done(model: Any) -> str:
    """What was understood of the files of a scene, and done to its surface, one line each."""
    if model is None:
        return ""
    sentences = [for_page(text, read_moduli) for text in model.document.scene.notes]
    sentences += [for_page(text, read_surface) for text in model.surface.history]
    return paragraph("What was read and done:") + "".join(map(paragraph, sentences))


def save_tab(session: Session) -> pn.Column:
    """Returns the tab that saves the scene and offers files."""
    wide: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": (6, 8)}
    name: Any = pn.widgets.TextInput(label="name of the scene", value="explored", **wide)
    save = pn.widgets.Button(label="Save scene (TOML)", color="primary", **wide)
    save.on_click(lambda _: session.save(name.value))
    kinds = {"csv": ("Curves (CSV)", to_csv), "h5": ("Everything (HDF5)", to_hdf5)}
    downloads = [
        pn.widgets.FileDownload(
            callback=lambda write=write: io.BytesIO(write(session.shown)), label=label,
            filename=f"explored.{kind}", disabled=session.param.shown.rx.is_(None), **wide,
        )
        for kind, (label, write) in kinds.items()
    ]  # fmt: skip
    return pn.Column(name, save, *downloads, **WIDE)


def heading(text: str) -> pn.pane.HTML:
    return pn.pane.HTML(paragraph(text), stylesheets=[STYLES], margin=(8, 8, 2, 8))


def paragraph(text: str, error: bool = False) -> str:
    kind = 'say error" role="alert' if error else "say"
    return f'<div class="{kind}">{in_html(text)}</div>' if text else ""
