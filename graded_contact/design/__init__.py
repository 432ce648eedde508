"""Design: parameters that minimise an objective, by its gradients."""

from .expected import ExpectedDesign, minimise_expected
from .objectives import distance, friction_curve, loss_tangent, ripple
from .search import Descent, Design, minimise

__all__ = [
    "Descent",
    "Design",
    "ExpectedDesign",
    "distance",
    "friction_curve",
    "loss_tangent",
    "minimise",
    "minimise_expected",
    "ripple",
]
