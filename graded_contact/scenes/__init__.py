"""A scene from its file to its results."""

from .run import read_results, run_scene
from .scene import Scene, parse_scene, read_scene

__all__ = ["Scene", "parse_scene", "read_results", "read_scene", "run_scene"]
