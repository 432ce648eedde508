"""Rough contact and friction of layered and graded viscoelastic solids, differentiable, in JAX.

Data flows one way: materials -> blocks -> contacts -> sliding -> studies -> design, scenes. The
main job is `slide`. SI units everywhere; `docs/conventions.md` and module docstrings state
conventions.

The names below are those that a script starts with. All others are in the rooms: `materials`,
`blocks`, `response`, `kernels`, `surfaces`, `contacts`, `sliding`, `mean_field`, `fitting`,
`readers`, `studies`, `design`, `scenes`, `plot` and `page`.
"""

import importlib
from typing import TYPE_CHECKING

from .blocks import Blend, Free, GradedLayer, HalfSpace, Layer, Rigid, Stack, shapes
from .contacts import AdhesiveLJ, HardWall, RepulsiveLJ, solve_contact
from .core import jit, with_values
from .fields import Grid
from .kernels import stack_kernel
from .materials import WLF, Arrhenius, BulkShear, Elastic, Prony, Tabulated, tyre_tread
from .mean_field import mean_field_friction
from .response import effective_modulus, surface_compliance, surface_compliance_matrix
from .sliding import Case, Sliding, slide, slide_cycle, slide_transient
from .surfaces import SelfAffine, Surface, random_surface

if TYPE_CHECKING:
    from . import design, fitting, page, plot, readers, scenes, studies
    from .design import minimise
    from .fitting import fit_prony, master_curve
    from .page import explore
    from .readers import read_moduli, read_surface
    from .scenes import read_results, read_scene, run_scene
    from .studies import propagate, sensitivity, sweep

__version__ = "0.1.0"

__all__ = [  # noqa: RUF022 (in the order in which data flow; the rooms last)
    "Elastic", "Prony", "BulkShear", "Tabulated", "WLF", "Arrhenius", "tyre_tread",
    "Stack", "Layer", "GradedLayer", "HalfSpace", "Rigid", "Free", "Blend", "shapes",
    "surface_compliance", "surface_compliance_matrix", "effective_modulus", "stack_kernel",
    "Grid", "SelfAffine", "Surface", "random_surface", "read_surface",
    "HardWall", "RepulsiveLJ", "AdhesiveLJ", "solve_contact",
    "slide", "slide_cycle", "slide_transient", "Sliding", "Case", "mean_field_friction",
    "read_moduli", "fit_prony", "master_curve",
    "sweep", "propagate", "sensitivity", "minimise", "with_values", "jit",
    "read_scene", "run_scene", "read_results", "explore",
    "materials", "blocks", "response", "kernels", "surfaces", "contacts", "sliding", "mean_field",
    "fitting", "readers", "studies", "design", "scenes", "plot", "page", "fields", "core",
]  # fmt: skip

# Imported when first needed: a script may not need files, figures and searches.
_LATE = {
    "fitting": ("fit_prony", "master_curve"),
    "readers": ("read_moduli", "read_surface"),
    "studies": ("sweep", "propagate", "sensitivity"),
    "design": ("minimise",),
    "scenes": ("read_scene", "run_scene", "read_results"),
    "plot": (),
    "page": ("explore",),
}


def __getattr__(name: str) -> object:
    for room, names in _LATE.items():
        if name == room or name in names:
            module = importlib.import_module(f".{room}", __name__)
            return module if name == room else getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
