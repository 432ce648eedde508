"""What is known of the numbers of a material, as a CSV file beside its card.

The first line has their paths in the material; each further line one of the independent directions
in which they may be off, by one standard deviation, in their units.
"""

import csv
import os
from pathlib import Path

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from .._checks import as_float
from .._shown import shown


@shown()
class Errors(eqx.Module):
    """What is known of some numbers of a material, or of anything else that holds numbers.

    **Fields:**

    - `paths`: which numbers, see `with_values`. Static.
    - `directions`: independent errors of all of them together, each of one standard deviation, in
      the units of the numbers; shape `(directions, numbers)`. The covariance is dᵀd.
    """

    paths: tuple[str, ...] = eqx.field(static=True)
    directions: Float[Array, "directions numbers"] = eqx.field(converter=as_float)


def write_errors(path: str | os.PathLike, errors: Errors) -> None:
    """Writes errors to a CSV file, with all digits."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(errors.paths)
        writer.writerows(np.asarray(errors.directions).tolist())


def read_errors(path: str | os.PathLike) -> Errors:
    """Returns what `write_errors` or `graded-contact fit` wrote, bit for bit.

    **Arguments:**

    - `path`: of the CSV file.

    **Returns:** the errors, for `propagate`.

    **Raises:** `FileNotFoundError`; `ValueError` for anything else in the file, naming its line.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    with open(path, newline="", encoding="utf-8") as file:
        names, *lines = list(csv.reader(file)) or [[]]
    directions = np.empty((len(lines), len(names)))
    for i, line in enumerate(lines):
        try:
            directions[i] = [float(word) for word in line]
        except ValueError as error:
            raise ValueError(f"`path={path}`, line {i + 2}: {error}.") from error
    if not names or not np.all(np.isfinite(directions)):
        raise ValueError(f"`path={path}` holds no errors: paths and finite numbers are needed.")
    return Errors(tuple(names), directions)
