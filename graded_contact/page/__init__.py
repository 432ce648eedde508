"""The page: a scene with sliders, in the browser or in a notebook."""

from .serving import explore

__all__ = ["explore"]
