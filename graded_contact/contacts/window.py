"""A contact on a window as one on a cell of twice its length: see `operators/window.py`."""

import dataclasses

import jax.numpy as jnp
from jaxtyping import Array

from ..core.compilation import compiled
from .law import Windowed, depth_of_flow
from .operators.window import with_ground
from .solution import ContactSolution
from .solver.abstract_solver import Inputs, Loading


def on_whole(inputs: Inputs, start: Array | None) -> tuple[Inputs, Array | None]:
    """Returns the inputs of the contact on the cell of a window, and its start.

    The gap of the loading belongs to the undeformed block.
    """
    operator, heights, law, loading = inputs
    if loading.gap is None:  # the mean over the cell, of which the window is a part
        loading = Loading(loading.pressure / 2**heights.ndim, None)
    else:
        operator = with_ground(operator, heights.shape)
    inputs = Inputs(operator, operator.on_cell(heights, "symmetric"), Windowed(law), loading)
    return inputs, None if start is None else operator.on_cell(start)


@compiled
def on_part(found: ContactSolution, inputs: Inputs) -> ContactSolution:
    """Returns the contact on a window, and its means there, from the contact on the cell."""
    fields = found.pressure, found.gap, found.displacement, found.correction
    pressure, gap, moved, correction = map(inputs.operator.on_surface, fields)
    opened = gap - depth_of_flow(inputs.law, pressure, gap)
    moved = moved - jnp.mean(moved)  # of zero mean on the window
    return dataclasses.replace(
        found, pressure=pressure, gap=gap, displacement=moved, correction=correction,
        mean_pressure=jnp.mean(pressure), mean_gap=jnp.mean(opened),
    )  # fmt: skip
