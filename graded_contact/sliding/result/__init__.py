"""The results of sliding: a contact and its problem, from which numbers are computed."""

from collections.abc import Collection

from ...contacts.solution import ContactSolution
from ...core.warnings import NumberOf, ResultWarning
from ..number import numbers_in, warnings_in, with_observables
from ..problem import CycleProblem, Problem
from .cycle import CyclicSliding
from .steady import Sliding
from .transient import TransientSliding


def result_of(problem: Problem, contact: ContactSolution) -> Sliding | CyclicSliding:
    """Returns the result of a contact."""
    if isinstance(problem, CycleProblem):
        return CyclicSliding(contact, problem)
    return Sliding(contact, problem)


RESULTS = {kind.kind: kind for kind in (Sliding, CyclicSliding, TransientSliding)}


def numbers_of(kind: str, facts: Collection[str] = ()) -> tuple[str, ...]:
    """Returns the names of the numbers that prints and results of such contacts contain."""
    entries = numbers_in(RESULTS[kind]).items()
    return tuple(name for name, entry in entries if entry.is_stored(facts))


def warnings_of(number: NumberOf, kind: str) -> tuple[ResultWarning, ...]:
    """Returns the warnings of the numbers of such contacts, see `warnings_by`."""
    return warnings_in(RESULTS[kind], number)


__all__ = [
    "RESULTS",
    "CyclicSliding",
    "Sliding",
    "TransientSliding",
    "numbers_of",
    "result_of",
    "warnings_of",
    "with_observables",
]
