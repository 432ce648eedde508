"""A slider over figures that needs neither widgets nor Python."""

import base64
import io
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import ArrayLike

from ..core.escaping import in_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 110
TURN = (
    "const all = this.parentNode.querySelectorAll('img');"
    "all.forEach((one, i) => {one.hidden = i != this.value});"
    "this.nextElementSibling.textContent = all[this.value].alt;"
)


class FigureSlider:
    """Several figures, one of which is shown; see `slider`.

    Notebooks show the slider; without HTML the figure in the middle is shown.
    """

    def __init__(self, captions: list[str], pictures: list[bytes]):
        self.captions, self.pictures = captions, pictures

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        # The pictures are in the page itself: a click needs neither Python nor a network.
        middle = len(self.pictures) // 2
        coded = [base64.b64encode(picture).decode() for picture in self.pictures]
        images = (
            f'<img style="max-width: 100%" alt="{in_html(caption)}" '
            f'src="data:image/png;base64,{data}"{"" if i == middle else " hidden"}>'
            for i, (caption, data) in enumerate(zip(self.captions, coded, strict=True))
        )
        knob = f'<input type="range" max="{len(coded) - 1}" value="{middle}" oninput="{TURN}">'
        caption = f"<output>{in_html(self.captions[middle])}</output>"
        page = f"<div>{knob} {caption}<br>{''.join(images)}</div>"
        return {"text/html": page, "image/png": coded[middle]}


def slider(
    draw: Callable[[Any], "Figure"], values: ArrayLike | Sequence[float], label: str
) -> FigureSlider:
    """Returns a slider over a figure, for a notebook.

    All figures are drawn at once, so that the slider also works on a page without Python.

    **Arguments:**

    - `draw`: a value -> its figure.
    - `values`: positions of the slider, shape `(n,)`.
    - `label`: of the values, with their unit: "thickness [µm]".

    **Raises:** `ValueError` without values.
    """
    values = np.asarray(values)
    if values.ndim != 1 or not len(values):
        raise ValueError(f"`values` has shape {values.shape}; a row of at least one is needed.")
    captions, pictures = [], []
    for value in values:
        figure, buffer = draw(value), io.BytesIO()
        figure.savefig(buffer, dpi=DOTS_PER_INCH)
        if "matplotlib.pyplot" in sys.modules:  # it would show each figure
            sys.modules["matplotlib.pyplot"].close(figure)
        captions.append(f"{label}: {value:.4g}")
        pictures.append(buffer.getvalue())
    return FigureSlider(captions, pictures)
