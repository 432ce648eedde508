"""Cards for other programs."""

from .friction_cards import export_friction
from .prony_cards import export_prony

__all__ = ["export_friction", "export_prony"]
