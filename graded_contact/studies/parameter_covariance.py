"""The covariance of the numbers of a material, as a CSV file next to its table.

The first line holds the paths of the numbers in the material. Each further line is one independent
direction of their errors: one standard deviation, in the units of the numbers.
"""

import csv
import dataclasses
import io
import os
from collections.abc import Callable
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import as_float, check_values, nearest, within
from ..core.display import shown
from ..core.files import read_file
from ..core.parameters import paths, with_values
from ..sliding.bodies import TwoBodies, in_both
from .dataset import write_whole

_LARGEST = 10_000_000  # bytes of a file; 500 numbers have 6 MB

T = TypeVar("T")


@shown()
class Errors(eqx.Module):
    """Errors of some numbers of a material, or of any other object that holds numbers.

    **Fields:**

    - `paths`: which numbers, see `with_values`. Static.
    - `directions`: independent errors of all of them together, each of one standard deviation, in
      the units of the numbers; shape `(directions, numbers)`. The covariance is dᵀd.
    """

    paths: tuple[str, ...] = eqx.field(static=True)
    directions: Float[Array, "directions numbers"] = eqx.field(converter=as_float)

    def __check_init__(self):
        if not self.paths:
            raise ValueError("`paths` is empty: at least one path is needed.")
        if len(set(self.paths)) < len(self.paths):
            raise ValueError(f"`paths={self.paths}` names a number twice.")
        shape, count = self.directions.shape, len(self.paths)
        if shape[1:] != (count,):
            raise ValueError(
                f"`directions` has shape {shape}, not a column for each of {count} paths."
            )
        check_values("directions", self.directions, "errors are finite")


def moved(tree: T, errors: Errors, steps: Float[Array, " directions"]) -> T:
    """Returns `tree` with its numbers changed by so many standard deviations in each direction."""
    # A number that the tree does not have is refused by `with_values`, with the nearest name.
    known, off = paths(tree), steps @ errors.directions
    changes = zip(errors.paths, off, strict=True)
    return with_values(tree, {path: known.get(path, 0) + change for path, change in changes})


def with_standard_error(
    solved: Callable[[TwoBodies], dict[str, Any]],
    bodies: TwoBodies,
    errors: Errors | None,
    name: str = "friction",
) -> dict[str, Any]:
    """Returns what `solved` finds of bodies and, if errors are known, `friction_standard_error`.

    `name` is the number that stands for the friction. One backward pass gives its slopes along all
    directions of the errors.
    """
    if errors is None:
        return solved(bodies)
    errors = dataclasses.replace(errors, paths=tuple(map(in_both, errors.paths)))

    def friction(steps):
        found = solved(moved(bodies, errors, steps))
        return found[name], found

    none = jnp.zeros(len(errors.directions), errors.directions.dtype)
    slopes, found = jax.grad(friction, has_aux=True)(none)
    return {**found, "friction_standard_error": jnp.linalg.norm(slopes)}


def check_errors(errors: Errors, material: object) -> None:
    """Raises `ValueError` unless the errors fit the material.

    They must be of single numbers that the material has, and cover each series entirely.
    """
    known = paths(material)
    single = [path for path, value in known.items() if not value.ndim]
    # Errors of a series are correlated: a part of them would give a wrong covariance.
    series = {path.rpartition("[")[0] for path in errors.paths} & {*known}
    for path in errors.paths:
        if path not in single:
            raise ValueError(f"{path!r} is not a number of the material; {nearest(path, single)}")
    for path in single:
        if path.rpartition("[")[0] in series and path not in errors.paths:
            raise ValueError(f"{path!r} is missing: these errors seem to be of another material.")


def write_errors(path: str | os.PathLike, errors: Errors) -> None:
    """Writes errors to a CSV file, with all digits."""
    text = io.StringIO()
    csv.writer(text).writerows([errors.paths, *np.asarray(errors.directions).tolist()])
    write_whole(path, text.getvalue())


def read_errors(path: str | os.PathLike) -> Errors:
    """Returns what `write_errors` or `graded-contact fit` wrote, bit for bit.

    **Arguments:**

    - `path`: of the CSV file.

    **Returns:** the errors, for `propagate`.

    **Raises:** `FileNotFoundError`; `ValueError` for anything else in the file, naming its line.
    """
    content = read_file(path, _LARGEST)
    with within(f"`path={path}`:"):
        try:
            text = io.StringIO(content.decode("utf-8-sig"), newline="")
            names, *lines = list(csv.reader(text)) or [[]]
        except csv.Error as error:
            raise ValueError(f"{error}.") from error
        rows = []
        for number, line in enumerate(lines, start=2):
            if line and len(line) != len(names):
                raise ValueError(f"line {number} has {len(line)} numbers under {len(names)} paths.")
            with within(f"line {number}:"):
                rows += [[float(word) for word in line]] if line else []
        return Errors(tuple(names), np.reshape(rows, (len(rows), len(names))))
