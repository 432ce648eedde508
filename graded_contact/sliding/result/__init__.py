"""The results of sliding: a contact and its problem, from which numbers are computed."""

from ...contacts.solution import ContactSolution
from ..problem import CycleProblem, Problem
from .cycle import CyclicSliding
from .steady import Sliding
from .transient import TransientSliding


def result_of(problem: Problem, contact: ContactSolution) -> Sliding | CyclicSliding:
    """Returns the result of a contact."""
    if isinstance(problem, CycleProblem):
        return CyclicSliding(contact, problem)
    return Sliding(contact, problem)


KINDS = {kind.kind: kind for kind in (Sliding, CyclicSliding, TransientSliding)}


__all__ = ["KINDS", "CyclicSliding", "Sliding", "TransientSliding", "result_of"]
