"""The observables, in the order of prints and tables.

The import of a module registers its observables. A new module is one more line here; its numbers
may be used by the modules below it.
"""

# ruff: noqa: F401, I001
from .numbers import load
from .numbers import cycle
from .transient import numbers
from .numbers import friction
from .numbers import area
from .numbers import doubts
from .numbers import traction
from .transient import errors
from .numbers import gap_flow
from .numbers import stiffness
