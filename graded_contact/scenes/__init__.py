"""A scene from its file to its results."""

from .results import read_results
from .run_scene import run_scene
from .scene import Scene, read_scene

__all__ = ["Scene", "read_results", "read_scene", "run_scene"]
