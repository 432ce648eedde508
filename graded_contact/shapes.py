"""How a quantity varies with height in a graded layer: shapes φ(s) for profiles."""

from .response.shape import (
    AbstractShape,
    ErrorFunction,
    Exponential,
    Linear,
    PowerLaw,
    Sinusoidal,
    Table,
)

__all__ = [
    "AbstractShape", "ErrorFunction", "Exponential", "Linear", "PowerLaw", "Sinusoidal", "Table",
]  # fmt: skip
