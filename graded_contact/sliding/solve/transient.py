"""The contact of a case in a transient motion."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ...contacts.solution import RESULTS
from ...core.checks import is_concrete, short
from ...fields.devices import required
from ..case import Case
from ..numerics import Numerics
from ..result import TransientSliding
from ..transient.pose import solved, transient_problem


def solve_transient(
    case: Case, how: Numerics, fields_at: Sequence[int] = (-1,)
) -> TransientSliding:
    """Returns the contact of a case with displacements at times; see `slide_transient`."""
    count = len(case.times)
    kept = _steps_kept(fields_at, count)
    found = TransientSliding(**solved(transient_problem(case), how, kept))
    if not how.throw:
        return found
    if is_concrete(found.failed) and np.ndim(found.failed) == 0 and found.failed >= 0:
        step = int(found.failed)
        raise RuntimeError(
            f"Step {step + 1} of {count}, which ends at {float(case.times[step]):.4g} s, failed: "
            f"{RESULTS[found.result]} With `throw=False` the numbers before it are returned."
        )
    good = found.failed < 0
    return dataclasses.replace(
        found,
        recorded=required(found.recorded, good, found.result.error_if),
        contact=required(found.contact, good, found.result.error_if),
    )


def _steps_kept(fields_at: Sequence[int], count: int) -> tuple[int, ...]:
    """The numbers of the steps whose fields are kept, from 0."""
    try:
        return tuple(np.arange(count)[np.asarray(fields_at)].tolist())
    except (IndexError, TypeError):
        raise ValueError(
            f"`fields_at={short(fields_at)}` must be a tuple of numbers of steps, such as (0, -1); "
            f"the {count} steps are 0 to {count - 1}, or -1 to {-count} from the last."
        ) from None
