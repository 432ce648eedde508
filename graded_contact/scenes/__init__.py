"""A scene from its file to its results."""

from .plan import Plan, plan
from .results import read_results
from .scene import Scene
from .scene_file import read_scene

__all__ = ["Plan", "Scene", "plan", "read_results", "read_scene"]
