"""The paper's contact: one rubber, one coat, one roughness cut off at three wavenumbers.

M. Scaraggi & D. Comingio, "Rough contact mechanics for graded bulk rheology: The role of
small-scale wavelengths on rubber friction", section "Numerical results" and the captions there.
What they leave open or contradict is chosen here, once for all figures:

- The tread is not tabulated ("under low operating temperatures"): `gc.tyre_tread` at -5 °C, and
  ν = 1/2.
- The stated slopes (0.077, 0.095, 0.11) do not belong to the stated rms height of 0.16 mm, which
  with H = 0.8 and a flat roll-off gives 0.128, 0.150, 0.176. Friction and area follow the slopes:
  `SLOPES` has 0.11 with all waves (0.080 and 0.094 with fewer, 0.10 mm), `HEIGHTS` 0.16 mm.
- The coat's thickness is "from q0 d = 0.63e-4" in the text and 0.63e-3 in the figures; 10 µm is the
  latter.
"""

import argparse
import io
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray
from matplotlib import rcParams
from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

import graded_contact as gc
from graded_contact.plot.style import ordered as ordered

jax.config.update("jax_enable_x64", True)

Q0, HURST = 63.0, 0.8  # 1/m, of the longest wave; Hurst exponent
VELOCITY = 0.1  # m/s
POISSON = 0.5
POINTS_PER_WAVE = 8  # of the shortest
TEMPERATURE = 268.15  # K
SLOPES, HEIGHTS = {"rms_slope": 0.11}, {"rms_height": 1.6e-4}  # with all waves
DOCS = Path(__file__).parents[2] / "docs"
DOTS_PER_INCH = 150
STYLE = gc.plot.STYLE


class Size(NamedTuple):
    """How much is computed.

    **Fields:**

    - `cutoffs`: q1/q0 [1], the last with all waves.
    - `depths`: q0 d [1] of the figures' four panels.
    - `more_depths`: q0 d [1] of the figure against thickness, besides; the first is all but bare.
    - `pressures`: σ0/E_r0 [1].
    - `surfaces`: how many at each cut-off.
    """

    cutoffs: tuple[int, ...]
    depths: tuple[float, ...]
    more_depths: tuple[float, ...]
    pressures: tuple[float, ...]
    surfaces: tuple[int, ...]


FULL = Size(
    cutoffs=(256, 512, 1024),
    depths=(0.63e-3, 3.2e-3, 4.4e-3, 6.3e-3),
    more_depths=(1e-9, 0.2e-3, 1.3e-3, 2.1e-3, 9e-3, 13e-3),
    pressures=(0.01, 0.02, 0.04, 0.07, 0.1, 0.17, 0.3, 0.5),
    surfaces=(5, 5, 1),
)
# Sixteen times fewer waves, under coats that are as thick to the shortest.
SMALL = Size(
    cutoffs=(16, 32, 64),
    depths=(16 * 0.63e-3, 16 * 6.3e-3),
    more_depths=(1e-9,),
    pressures=(0.1, 0.3),
    surfaces=(2, 2, 2),
)
CLOSE_UP = (0.1, 0.3)  # σ0/E_r0 of the figure against thickness


def tread() -> gc.Prony:
    """The block's rubber."""
    return gc.tyre_tread(POISSON).at(TEMPERATURE)


def epdm() -> gc.Prony:
    """A measured rubber in its place, see epdm.toml."""
    terms = tomllib.loads(Path(__file__).with_name("epdm.toml").read_text("utf-8"))
    return gc.Prony(**terms, poisson=POISSON)


def relaxed(rubber: gc.Prony) -> float:
    """E_r0 [Pa], the reduced modulus at rest."""
    return float(rubber.equilibrium) / (1 - POISSON**2)


def coated(rubber: gc.Prony, thickness) -> gc.Stack:
    """The rubber under an elastic coat of its own relaxed modulus; thickness in m."""
    coat = gc.Elastic(rubber.equilibrium, POISSON)
    return gc.Stack(layers=[gc.Layer(coat, thickness)], base=gc.HalfSpace(rubber))


def spectrum(cutoff: int, size: Size, roughness: dict[str, float]) -> gc.SelfAffine:
    """C(q) up to a cut-off, the same below it for every cut-off.

    **Arguments:**

    - `cutoff`: q1/q0.
    - `roughness`: `SLOPES` or `HEIGHTS`, of all waves.
    """

    def up_to(cutoff, **amplitude):
        return gc.SelfAffine(hurst=HURST, q_low=Q0, q_roll=4 * Q0, q_high=cutoff * Q0, **amplitude)

    inside = jnp.asarray(2 * Q0)
    one = up_to(cutoff, rms_height=1.0).density(inside)
    return up_to(
        cutoff,
        rms_height=jnp.sqrt(up_to(size.cutoffs[-1], **roughness).density(inside) / one),
    )


def grid(cutoff: int) -> gc.Grid:
    return gc.Grid((POINTS_PER_WAVE * cutoff,) * 2, 2 * np.pi / Q0)


def surface(cutoff: int, size: Size, roughness: dict[str, float] = SLOPES, seed=0) -> gc.Surface:
    """One of the surfaces; with the same seed, that of every other cut-off has the same waves."""
    rough = spectrum(cutoff, size, roughness)
    return gc.random_surface(rough, grid(cutoff), jax.random.key(seed))


# Results ------------------------------------------------------------------------------------


def solved_points(function, points: list[dict], folder: Path) -> xarray.Dataset:
    """The results of a function of a point at each of a list; finished ones stay in a folder."""
    columns = {name: np.array([point[name] for point in points]) for name in points[0]}

    def at(where):
        return function({n: jnp.asarray(at)[where["point"]] for n, at in columns.items()})

    table = gc.sweep(at, {"point": np.arange(len(points))}, store=folder, progress=True)
    return table.assign_coords({name: ("point", at) for name, at in columns.items()})


def kept(
    given: argparse.Namespace, name: str, solve: Callable[[], xarray.Dataset]
) -> xarray.Dataset:
    """The table of an earlier run, from the file of results; otherwise that of `solve`."""
    path, tables = results(given), {}
    if path.exists():
        found = xarray.open_groups(io.BytesIO(path.read_bytes()), engine="h5netcdf")
        tables = {at.strip("/"): table.load() for at, table in found.items() if at != "/"}
    if name not in tables or given.again:
        tables[name] = solve()
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(".partial")
        partial.write_bytes(xarray.DataTree.from_dict(tables).to_netcdf(engine="h5netcdf"))
        partial.replace(path)
        print(f"wrote {name} into {path}")
    return tables[name]


def num_failed(table: xarray.Dataset) -> int:
    """How many points of a table did not succeed."""
    return int(np.sum(table["message"] != ""))


def results(given: argparse.Namespace) -> Path:
    """The file of all scripts, with a group for each table."""
    return given.output / f"results{'-small' if given.small else ''}.h5"


# Figures ------------------------------------------------------------------------------------


def panels(count, width=7.6, height=3.2, rows=1):
    figure = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, layout="constrained")
    return figure, figure.subplots(rows, count // rows, squeeze=False).ravel()


def save(figure, target):
    """Writes a PNG of 64 colours, a third of the size. Its comment is what the figure shows."""
    target.parent.mkdir(parents=True, exist_ok=True)
    buffer, comment = io.BytesIO(), PngInfo()
    figure.savefig(buffer)
    comment.add_text("Comment", json.dumps(shown(figure), ensure_ascii=False), zip=True)
    image = Image.open(buffer).convert("RGB").quantize(64)
    image.save(target, optimize=True, pnginfo=comment)
    print(f"wrote {target}")


def shown(figure):
    """The texts of a figure and nine points of each line and map: the same with any font."""
    texts, numbers = [], []
    for panel in figure.axes:
        texts += [panel.get_title(), panel.get_xlabel(), panel.get_ylabel()]
        texts += [panel.get_xscale(), panel.get_yscale()]
        if (legend := panel.get_legend()) is not None:
            texts += [text.get_text() for text in (legend.get_title(), *legend.texts)]
        rows = [row for line in panel.lines for row in line.get_data()]
        rows += [part.get_array() for part in panel.collections if part.get_array() is not None]
        for row in rows:
            some = np.ravel(row)[np.linspace(0, np.size(row) - 1, 9).astype(int)]
            numbers += [float(f"{number:.5g}") for number in some]
    return {"texts": texts, "numbers": numbers}


def read(doc: str | None) -> tuple[argparse.Namespace, Size]:
    """What the command line gives, with the style of all figures switched on."""
    rcParams.update(STYLE)
    given = options(doc).parse_args()
    return given, SMALL if given.small else FULL


def options(doc: str | None) -> argparse.ArgumentParser:
    """The options of all scripts."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--small", action="store_true", help="fewer waves, pressures and surfaces: minutes for all"
    )
    parser.add_argument(
        "--again", action="store_true", help="solve, although the file of results has it"
    )
    parser.add_argument(
        "--output", type=Path, default=DOCS / "paper", help="folder of results and figures"
    )
    return parser
