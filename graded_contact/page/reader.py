"""A page of the results of what happens once: numbers over time, and the contact at its times."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import panel as pn

from ..core.quantities import TRANSIENT
from ..plot.motion import plot_film, plot_transient
from ..plot.sweeps import place_of
from ..scenes.results import (
    has_numbers,
    kept_contact,
    kept_solves,
    kind_of_results,
    read_results,
)
from .tabs import WIDE, heading

if TYPE_CHECKING:
    from xarray import Dataset


def read_transient(path: Path) -> "Dataset":
    """Returns the results of what happens once in a file.

    **Raises:** as `read_results`; `ValueError` for results of other contacts.
    """
    results = read_results(path)
    if kind_of_results(results) != TRANSIENT:
        raise ValueError(
            f"`path={path}` has no [motion] with `once = true`: of results the page shows only "
            "these. Open the scene, or print them by `graded-contact info`."
        )
    if not np.any(has_numbers(results)):
        raise ValueError(f"`path={path}` holds no solve that succeeded.")
    return results


def transient_page(results: "Dataset") -> pn.Column:
    """Returns the page of results: figures over time, and a slider over the contact.

    The slider has the times whose fields are known, of the last solve that has some.
    """
    told = filter(None, [results.attrs["title"], *results.attrs["warnings"].split("\n")])
    parts: list[Any] = [heading(text) for text in told]
    figure, picture = plot_transient(results), io.BytesIO()
    figure.savefig(picture, dpi=110)
    parts.append(pn.pane.PNG(picture.getvalue(), **WIDE))
    for index in kept_solves(results)[-1:]:
        parts += _film(results, index)
    return pn.Column(*parts, styles={"background": "white"}, **WIDE)


def _film(results: "Dataset", index: tuple[int, ...]) -> tuple[Any, Any]:
    """The numbers of a solve on the axes, and the slider over its contact."""
    fields, surface = kept_contact(results, index)
    film = pn.pane.Matplotlib(plot_film(fields, surface), tight=True)
    solve = results.isel(dict(zip(results["message"].dims, index, strict=True)))
    return heading(place_of(solve)), film
