"""The contact of a case in a transient motion."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ...contacts.solution import RESULTS
from ...core.checks import is_concrete
from ...fields.devices import required
from ..case import Case, Numerics
from ..result import TransientSliding
from ..transient.solve import solved, transient_problem


def solve_transient(case: Case, how: Numerics, fields_at: Sequence[int]) -> TransientSliding:
    """Returns the contact of a case with displacements at times; see `slide_transient`."""
    count = len(case.times)
    kept = tuple(np.arange(count)[np.atleast_1d(fields_at)].tolist())
    found = TransientSliding(**solved(transient_problem(case), how, kept))
    if not how.throw:
        return found
    if is_concrete(found.failed) and np.ndim(found.failed) == 0 and int(found.failed) >= 0:
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
