"""Solves all contacts of the paper's figures into one table of the file of results.

    python examples/paper/contacts.py [--small] [--again] [--only CUTOFF ...]

Friction, area and more at every cut-off, thickness, pressure and surface, for the tread; at heights
of 0.16 mm in place of the matched slopes and for a second rubber at fewer of them, without the
shortest waves. Each point is stored in a folder as it ends: the same command continues. The table
has a row for each point, no fields; `contact_figures.py` draws from it. At the paper's size
it takes hours and 10 GB (N = 8192), see docs/paper.md.
"""

import argparse
import time
from itertools import product
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray
from system import (
    CLOSE_UP,
    FULL,
    HEIGHTS,
    Q0,
    SLOPES,
    SMALL,
    VELOCITY,
    Size,
    coated,
    epdm,
    grid,
    kept,
    num_failed,
    options,
    relaxed,
    results,
    solved_points,
    surface,
    tread,
)

import graded_contact as gc

RTOL = 1e-2  # of the pressure; against 1e-3 friction changes by 5e-5, smooth area by 4e-5
STORE = "contacts.points"
WAVES = 48  # at which the friction of longer waves is kept


class Part(NamedTuple):
    """Contacts that share a rubber and a roughness.

    **Fields:**

    - `rubber`, `roughness`: their numbers in the table, see `RUBBERS` and `ROUGHNESS`.
    - `points`: seed, q0 d and σ0/E_r0 of each.
    """

    rubber: int
    roughness: int
    points: list[tuple[int, float, float]]


RUBBERS = (tread, epdm)
ROUGHNESS = (SLOPES, HEIGHTS)


def parts(size: Size, cutoff: int) -> tuple[Part, ...]:
    """All contacts of a cut-off, those first that one surface needs to show the main figure."""
    seeds = range(size.surfaces[size.cutoffs.index(cutoff)])
    ends = product((0,), (size.depths[0], size.depths[-1]), size.pressures)
    first = list(ends)
    points = [
        *first,
        *product(seeds, size.depths, size.pressures),
        *product(seeds, size.more_depths, CLOSE_UP),
    ]
    others = () if cutoff == size.cutoffs[-1] else (Part(1, 0, first), Part(0, 1, first))
    return Part(0, 0, list(dict.fromkeys(points))), *others


def contact(part: Part, cutoff: int, size: Size):
    """Friction and area at a point of the sweep, which has seed, thickness and pressure."""
    rubber = RUBBERS[part.rubber]()
    roughness = ROUGHNESS[part.roughness]
    cell = grid(cutoff)
    large = cutoff > size.cutoffs[0]

    def rub(point):
        rough = surface(cutoff, size, roughness, point["seed"])
        scene = coated(rubber, point["thickness"]), rough, point["pressure"], VELOCITY
        if large:
            # Half the memory; at this tolerance single precision changes friction by 6e-5.
            scene = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), scene)
        stack, rough, pressure, velocity = scene
        found = gc.slide(stack, rough, pressure=pressure, velocity=velocity, rtol=RTOL, throw=False)
        waves = gc.sliding.cumulative_friction(
            found.pressure, found.displacement, cell, VELOCITY, WAVES
        )
        return {
            "friction": found.friction,
            "friction_error": found.friction_error,
            "geometric_friction": found.geometric_friction,
            "contact_area_pixels": found.contact_area_pixels,
            "contact_area": found.contact_area,
            "mean_gap": found.mean_gap,
            "error": found.error,
            "num_fft_pairs": found.num_fft_pairs,
            "friction_up_to": waves.friction,
            "result": found.result,
        }

    return rub


def solve(size: Size, folder: Path, cutoffs: tuple[int, ...]) -> xarray.Dataset:
    """The table: a row for each point with its labels; finished points are kept in a folder."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    tables = []
    every = [(part, cutoff) for cutoff in cutoffs for part in parts(size, cutoff)]
    for part, cutoff in every:
        stiffness = relaxed(RUBBERS[part.rubber]())
        points = [
            {"seed": seed, "thickness": depth / Q0, "pressure": ratio * stiffness}
            for seed, depth, ratio in part.points
        ]
        start = time.perf_counter()
        name = f"rubber {part.rubber}, roughness {part.roughness}, q1/q0 = {cutoff}"
        table = solved_points(contact(part, cutoff, size), points, folder)
        seconds = time.perf_counter() - start
        print(f"{name}: {len(points)} points, {seconds:.0f} s, {num_failed(table)} failed")
        _, depth, ratio = np.array(part.points).T
        same = {"rubber": part.rubber, "roughness": part.roughness, "cutoff": cutoff}
        labels = {key: np.full(len(points), value) for key, value in same.items()}
        labels |= {"q0d": depth, "pressure_ratio": ratio}
        tables.append(table.assign_coords({key: ("point", at) for key, at in labels.items()}))
    return xarray.concat(tables, "point").assign_coords(point=range(sum(map(num_rows, tables))))


def num_rows(table: xarray.Dataset) -> int:
    return table.sizes["point"]


def found(given: argparse.Namespace) -> xarray.Dataset:
    """The table, solved unless it is in the file of results."""
    size = SMALL if given.small else FULL
    return kept(given, "contacts", lambda: solve(size, given.output / STORE, size.cutoffs))


def rows(table: xarray.Dataset, **labels: float) -> xarray.Dataset:
    """The rows of the table with these labels, such as cutoff=256, that succeeded."""
    chosen = table["message"] == ""
    for name, value in labels.items():
        chosen = chosen & np.isclose(table[name], value, rtol=1e-9, atol=0)
    return table.isel(point=chosen.values)


def cutoffs_of(table: xarray.Dataset) -> list[int]:
    return np.unique(table["cutoff"]).tolist()


def draw_spread(pane, rows: xarray.Dataset, along: str, of: str, colour, label: str) -> None:
    """The mean of a quantity over the surfaces, in a band from their least to their largest."""
    each = rows[of].groupby(along)
    mean = each.mean()
    pane.semilogx(mean[along], mean, "o-", markersize=3, color=colour, label=label)
    pane.fill_between(mean[along], each.min(), each.max(), color=colour, alpha=0.25, linewidth=0)


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("--only", type=int, nargs="+", help="cut-offs q1/q0 to solve now")
    given = parser.parse_args()
    if given.only is None:
        print(f"{num_rows(found(given))} contacts in {results(given)}")
    else:
        solve(SMALL if given.small else FULL, given.output / STORE, tuple(given.only))


if __name__ == "__main__":
    main()
