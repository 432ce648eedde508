"""The results of sliding: a contact and its problem, from which numbers are computed."""

from collections.abc import Collection

from ...contacts.solution import ContactSolution
from ..number import numbers_in
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
