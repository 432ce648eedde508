"""Design: parameters that minimise an objective, by its gradients."""

from .expected import ExpectedDesign, minimise_expected
from .search import Descent, Design, minimise

__all__ = ["Descent", "Design", "ExpectedDesign", "minimise", "minimise_expected"]
