"""The page: a scene with sliders, in the browser or in a notebook."""

from .page import Page, explore, serve

__all__ = ["Page", "explore", "serve"]
