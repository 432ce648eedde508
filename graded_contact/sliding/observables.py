"""The observables, in the order of prints and tables.

The import of a module registers its observables. A new module is one more line here; its numbers
may be used by the modules below it.
"""

# ruff: noqa: F401, I001
from . import load
from . import cycle_numbers
from . import history_numbers
from . import friction
from . import area
from . import doubts
from . import traction
from . import history_errors
from . import gap_flow
from . import stiffness
