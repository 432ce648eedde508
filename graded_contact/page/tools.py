"""Tools of a page: layers, one's own data, the scene saved and taken away."""

import html
import os
import tempfile
import weakref
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import panel as pn

from ..files.output import check_name
from ..files.schema import toml_text
from ..files.sealed import replacing
from .document import (
    Document,
    free_name,
    with_layer,
    with_moduli,
    with_topography,
    without_layer,
)

LARGEST = 64  # MB of one file
CHUNK = 4_000_000  # bytes of one message
HELD = 4 * LARGEST  # MB of unfinished uploads of all pages together
# What makes a part of a surface periodic, as people and as `read_surface` call it.
EDGES = {
    "joined (harmonic)": "harmonic", "mirrored: twice as long": "mirror",
    "tapered to zero": "window", "periodic already": "none",
}  # fmt: skip
NEW = "a new elastic material"
SMALL: dict[str, Any] = {"margin": (4, 8), "sizing_mode": "stretch_width"}

Change = Callable[[Document], Document]
Take = Callable[[Document, Path], Document]


class Dropper(pn.widgets.FileDropper):
    """A place to drop a file, which is refused beyond `LARGEST` whatever the browser says.

    A new file replaces one that is not finished.
    """

    _all: ClassVar[weakref.WeakSet["Dropper"]] = weakref.WeakSet()

    def __init__(self, **params: Any):
        super().__init__(**params)
        self._all.add(self)

    @property
    def held(self) -> int:
        """Bytes of what is not finished."""
        return sum(len(part) for parts in self._file_buffer.values() for part in parts)

    def _process_event(self, event: Any) -> None:
        name, data = event.data.get("name"), event.data.get("data", b"")
        if event.event_name == "upload_event":
            if event.data.get("chunk") == 1:
                self._file_buffer.clear()
            elif name not in self._file_buffer:
                return  # the rest of a file that was refused
            reason = ""
            if self.held + len(data) > LARGEST * 10**6:
                reason = f"it has more than {LARGEST} MB."
            elif sum(dropper.held for dropper in self._all) + len(data) > HELD * 10**6:
                reason = "too many files are on their way to this server: try again later."
            if reason:
                self._file_buffer.clear()
                self.mime_type = {"": f"`{name}` is refused: {reason}"}
                return
        super()._process_event(event)


class Tools:
    """Widgets that change, save and hand out the scene.

    **Arguments:**

    - `folder`: the only place where anything is written.
    - `change`: called with what turns the scene's tables into others.
    - `tell`: called with a sentence for the page, and whether it is a refusal.
    """

    def __init__(
        self,
        folder: Path,
        change: Callable[[Change], None],
        tell: Callable[[str, bool], None],
    ):
        self._folder, self._change, self._tell = folder, change, tell
        self._saved: set[str] = set()
        self.layers, self.files = pn.Column(**SMALL), pn.Column(**SMALL)
        self._told = {
            "unit": pn.widgets.TextInput(placeholder="um", label="unit of its numbers", width=125),
            "size": pn.widgets.TextInput(placeholder="1e-3", label="edge length [m]", width=125),
            "periodic": pn.widgets.Select(label="its edges", options=EDGES, **SMALL),
        }
        self._material: Any = pn.widgets.Select(label="of material", **SMALL)
        self.files.extend([
            _heading("Your moduli (DMA or rheometer, over frequency)"),
            self._material, self._dropper(self._take_moduli),
            _heading("Your topography"), 
            pn.Row(self._told["unit"], self._told["size"], margin=0), self._told["periodic"],
            self._dropper(self._take_topography),
            _heading(f"At most {LARGEST} MB; kept in {folder.name}"),
        ])  # fmt: skip

    def show(self, document: Document) -> None:
        """Follows the scene: its layers and materials."""
        content = document.content
        names = list(content["materials"])
        self._material.options = names
        chosen: Any = pn.widgets.Select(label="one more on top, of", options=[NEW, *names], **SMALL)
        add = pn.widgets.Button(label="Add layer", color="primary", **SMALL)
        add.on_click(lambda _: self._add(chosen.value))
        rows = []
        for i, layer in enumerate(content.get("layers", [])):
            button = pn.widgets.Button(label="Remove", width=80, margin=(2, 8))
            button.on_click(partial(self._remove, i))
            name = f"{i + 1}  {layer_name(layer)}"
            rows.append(pn.Row(pn.pane.Str(name, width=150, margin=(8, 8)), button, margin=0))
        base = content["base"]
        rows.append(pn.pane.Str(f"base  {base.get('material', base['kind'])}", margin=(8, 8)))
        self.layers[:] = [_heading("From the loaded surface downwards"), *rows, chosen, add]

    def save(self, document: Document, name: str) -> None:
        """Writes the scene as NAME.toml into the folder; another's file is not replaced."""
        try:
            check_name(name)
            path = self._folder / f"{name}.toml"
            if path.exists() and name not in self._saved:
                raise ValueError(f"{path} exists: take another name.")
            self._folder.mkdir(parents=True, exist_ok=True)
            with replacing(path) as partial_path:
                Path(partial_path).write_text(toml_text(document.content), "utf-8")
        except (ValueError, OSError) as error:
            self._tell(str(error), True)
            return
        self._saved.add(name)
        self._tell(f"Saved as {path}: `graded-contact run` and `explore` open it.", False)

    def _add(self, material: str) -> None:
        self._change(lambda document: with_layer(document, None if material == NEW else material))

    def _remove(self, index: int, _: Any) -> None:
        self._change(lambda document: without_layer(document, index))

    def _dropper(self, take: Callable[[], Take]) -> Dropper:
        dropper = Dropper(max_file_size=f"{LARGEST}MB", chunk_size=CHUNK, previews=[], **SMALL)
        dropper.param.watch(lambda event: self._tell(event.new[""], True) if "" in event.new
                            else None, "mime_type")  # fmt: skip
        dropper.param.watch(partial(self._dropped, take), "value")
        return dropper

    def _dropped(self, take: Callable[[], Take], event: Any) -> None:
        for name, data in event.new.items():
            content = data.encode() if isinstance(data, str) else data
            self._change(partial(self._keep, take(), name, content))
        # A fresh one: the browser calls a refused file complete too.
        place = self.files.objects.index(event.obj)
        self.files[place] = self._dropper(take)

    def _keep(self, take: Take, name: str, content: bytes, document: Document) -> Document:
        """The scene with a file, which stays in the folder if it is taken."""
        name = Path(name.replace("\\", "/")).name
        check_name(name)
        self._folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=self._folder, prefix=".dropped-") as place:
            tried = Path(place) / name
            tried.write_bytes(content)
            try:
                take(document, tried).scene()  # refused here, if at all
            except ValueError as error:
                raise ValueError(str(error).replace(f"{place}{os.sep}", "")) from error
            taken = {path.stem for path in self._folder.iterdir()}
            kept = self._folder / f"{free_name(tried.stem, taken)}{tried.suffix}"
            tried.rename(kept)
        return take(document, kept)

    def _take_moduli(self) -> Take:
        name = str(self._material.value)
        return lambda document, path: with_moduli(document, name, path)

    def _take_topography(self) -> Take:
        told = {name: str(widget.value) for name, widget in self._told.items() if widget.value}
        return lambda document, path: with_topography(document, path, told)


def layer_name(layer: dict[str, Any]) -> str:
    """Returns what a layer of a scene's tables is made of."""
    return layer["material"] if "material" in layer else f"{layer['top']} → {layer['bottom']}"


def _heading(text: str) -> pn.pane.HTML:
    return pn.pane.HTML(
        f"<span style='font-size:12px;color:#5b616b'>{html.escape(text)}</span>",
        margin=(8, 8, 2, 8),
    )
