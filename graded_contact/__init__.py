"""Rough contact and friction of layered and graded viscoelastic solids, differentiable, in JAX.

Data flows one way: materials -> blocks -> contacts -> sliding -> studies -> scenes. The main job
is `slide`. SI units everywhere; `docs/theory.md` and module docstrings state conventions.

The names below are those that a script starts with. All others are in the rooms: `materials`,
`blocks`, `response`, `kernels`, `surfaces`, `contacts`, `sliding`, `mean_field`, `fitting`,
`readers`, `studies`, `scenes`, `exports`, `plot` and `page`. Each name of a room is
also found here: `gc.read_errors` is `gc.studies.read_errors`.
"""

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING

from . import (
    blocks,
    contacts,
    core,
    fields,
    kernels,
    materials,
    mean_field,
    response,
    sliding,
    surfaces,
)
from .blocks import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack
from .contacts import HardWall, solve_contact
from .core import jit, with_values
from .core.deprecation import has_moved, missing
from .fields import Grid
from .materials import WLF, BulkShear, Elastic, Prony, tyre_tread
from .mean_field import mean_field_friction
from .response import surface_compliance
from .sliding import Case, Sliding, slide, slide_cycle, slide_transient
from .surfaces import SelfAffine, Surface, random_surface

if TYPE_CHECKING:
    from . import exports, fitting, page, plot, readers, scenes, studies
    from .fitting import fit_prony, master_curve
    from .readers import read_moduli, read_surface
    from .scenes import read_results, read_scene, run_scene
    from .studies import minimise, sweep

__version__ = "1.0.0rc1"

__all__ = [  # noqa: RUF022 (in the order in which data flow; the rooms last)
    "Elastic", "Prony", "BulkShear", "WLF", "tyre_tread",
    "Stack", "Layer", "GradedLayer", "HalfSpace", "Rigid", "Free", "surface_compliance",
    "Grid", "SelfAffine", "Surface", "random_surface", "read_surface",
    "HardWall", "solve_contact",
    "slide", "slide_cycle", "slide_transient", "Sliding", "Case", "mean_field_friction",
    "read_moduli", "fit_prony", "master_curve",
    "sweep", "minimise", "with_values", "jit",
    "read_scene", "run_scene", "read_results",
    "materials", "blocks", "response", "kernels", "surfaces", "contacts", "sliding", "mean_field",
    "fitting", "readers", "studies", "scenes", "exports", "plot", "page", "fields",
    "core",
]  # fmt: skip
ROOMS = (
    "materials", "blocks", "response", "kernels", "surfaces", "contacts", "sliding", "mean_field",
    "fitting", "readers", "studies", "scenes", "exports", "plot", "page", "fields",
    "core",
)  # fmt: skip
_MOVED = {"motion": "sliding", "design": "studies", "surface": "surfaces"}  # since 1.0.0rc1


def __getattr__(name: str) -> object:
    if name in _MOVED:
        has_moved(f"graded_contact.{name}", f"graded_contact.{_MOVED[name]}")
        name = _MOVED[name]
    # Files, figures and searches are imported when first needed: a script may not need them.
    if name in ROOMS:
        return importlib.import_module(f".{name}", __name__)
    if not name.startswith("_"):
        for room in map(globals().get, ROOMS):
            if room is not None and name in getattr(room, "__all__", ()):
                return getattr(room, name)
        for room in ROOMS:
            found = importlib.import_module(f".{room}", __name__)
            if name in getattr(found, "__all__", ()):
                return getattr(found, name)
    raise missing(__name__, name)


def _old_module(old: str) -> ModuleType:
    """A module that finds all public names, for `import graded_contact.motion`."""
    module = ModuleType(f"{__name__}.{old}")

    def find(name: str) -> object:
        if name.startswith("_"):
            raise missing(module.__name__, name)
        found = getattr(sys.modules[__name__], name)
        has_moved(f"{module.__name__}.{name}", f"{__name__}.{name}")
        return found

    setattr(module, "__getattr__", find)  # noqa: B010 (pyright)
    return module


sys.modules.update({f"{__name__}.{old}": _old_module(old) for old in _MOVED})


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
