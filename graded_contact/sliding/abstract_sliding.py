"""What results of sliding have in common: observables, computed when they are read, and kept."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
from jaxtyping import Array, Float

from ..blocks.heated_stack import HeatedContact
from ..contacts.law import AbstractLaw
from ..contacts.operators.operator import AbstractOperator
from ..contacts.solution import RESULTS, ContactSolution, if_known
from ..core.caveats import caveats_of
from ..core.checks import is_concrete
from ..core.compilation import compiled
from ..core.derivative import derivative_apart
from ..core.quantities import OBSERVABLES, TRANSIENT, numbers_of
from ..fields.grid import Grid
from .bodies import Coupling
from .facts import WINDOW
from .half_grid import grid_estimate
from .problem import Problem
from .shear import ShearStress

_OF_CONTACT = {field.name for field in dataclasses.fields(ContactSolution)}


@dataclasses.dataclass
class Kept:
    """What a result keeps of what it computed.

    It is no field of the result: a copy, such as JAX makes, starts with nothing.

    **Fields:**

    - `numbers`: observables by their names, none of them traced.
    - `near`: the contacts on half the grid and with half the times, see `neighbours_of`, or None.
    - `formulas`: results of formulas that several observables share, within one program, see
      `shared`; None outside of a program.
    """

    numbers: dict[str, Array] = dataclasses.field(default_factory=dict)
    near: Any = None
    formulas: dict[Callable[[Any], Any], Any] | None = None


class AbstractSliding(eqx.Module):
    """What the results of sliding have in common: observables, and what they are made of.

    An observable is computed when it is first read, and kept unless it is traced, see `Kept`. Under
    `jit` XLA drops what nothing uses.
    """

    contact: eqx.AbstractVar[ContactSolution]
    problem: eqx.AbstractVar[Problem]
    heated: eqx.AbstractVar[HeatedContact | None]
    kind: eqx.AbstractClassVar[str]
    recorded: eqx.AbstractVar[dict[str, Array]]  # numbers of the steps of a transient solve

    def __getattr__(self, name: str) -> Array:
        # Python looks here only for what is no field. Numbers of `contact` need no program.
        entry = OBSERVABLES.get(name)
        if entry is None or not entry.is_of(self.kind, entry.needs):
            raise AttributeError(f"`{type(self).__name__}` has no attribute `{name}`.")
        return entry.of(self) if name in _OF_CONTACT else self.compute(name)[0]

    def __dir__(self):
        return [*super().__dir__(), *self.numbers]

    @functools.cached_property
    def kept(self) -> Kept:
        """What was computed before."""
        return Kept()

    # What the problem has.

    @property
    def facts(self) -> frozenset[str]:
        """What is known of this kind of contact, see `facts_of`."""
        return self.problem.facts

    @property
    def operator(self) -> AbstractOperator:
        return self.problem.operator

    @property
    def heights(self) -> Float[Array, "..."]:
        return self.problem.heights

    @property
    def grid(self) -> Grid:
        return self.problem.grid

    @property
    def law(self) -> AbstractLaw:
        return self.problem.law

    @property
    def shear(self) -> ShearStress | None:
        return self.problem.shear

    @property
    def coupling(self) -> Coupling | None:
        return self.problem.coupling

    @property
    def cell(self) -> Grid:
        """The cell of the kernel."""
        return self.operator.cell(self.grid)

    @property
    def pressure(self) -> Float[Array, "*shape"]:
        return self.contact.pressure

    @property
    def gap(self) -> Float[Array, "*shape"]:
        return self.contact.gap

    @property
    def result(self) -> RESULTS:
        return self.contact.result

    @property
    def state(self) -> str:
        return self.contact.state

    @property
    def noise(self) -> dict[str, float]:
        return self.contact.noise

    @property
    def numbers(self) -> tuple[str, ...]:
        """The names of the observables that prints and results contain."""
        return numbers_of(self.kind, self.facts)

    def compute(self, *names: str) -> list[Float[Array, "..."]]:
        """Returns the observables of these names; one program computes those that are missing."""
        kept = self.kept.numbers
        missing = tuple(name for name in names if name not in kept)
        found = _in_programs(self, missing) if missing else {}
        known = kept | found
        if all(map(is_concrete, found.values())):  # a tracer must not outlive its trace
            kept.update(found)
        return [known[name] for name in names]

    def before_display(self) -> tuple[str, ...]:
        """Computes all numbers; returns the names of those that the contact does not show."""
        self.compute(*self.numbers)
        return beyond_contact(self)

    @property
    def grid_errors(self) -> str:
        """Where the errors by the grid come from, in words; of a batch, those of its first."""
        one = self.heights.reshape(-1, *self.grid.shape)[0]
        grid = jax.tree.map(lambda sizes: sizes.reshape(-1, self.grid.ndim)[0], self.grid)
        return grid_estimate(one, grid, WINDOW in self.facts)

    @property
    def caveats(self) -> tuple[str, ...]:
        """Warnings about these numbers, one sentence each; not under `jit`."""
        known = dict(zip(self.numbers, self.compute(*self.numbers), strict=True))
        found = caveats_of(lambda name: known.get(name, 0.0), self.kind)
        return tuple(caveat.sentence for caveat in found)


def beyond_contact(found: AbstractSliding) -> tuple[str, ...]:
    """The names of numbers that `contact` lacks, or has without their error."""
    names = found.numbers
    return tuple(n for n in names if n not in _OF_CONTACT or f"{n}_error" in names)


def _in_programs(found: AbstractSliding, names: tuple[str, ...]) -> dict[str, Float[Array, "..."]]:
    """The observables of a result; of a batch one by one."""
    if found.contact.error.ndim > 0:
        return jax.lax.map(lambda one: _in_programs(one, names), found)
    # Outside of the program, so that Python reuses the programs of the contact.
    beside = next(filter(None, (OBSERVABLES[name].beside for name in names)), None)
    return _computed(found, None if beside is None else beside(found), names)


@derivative_apart
@compiled
def _computed(
    found: AbstractSliding, near: Any, names: tuple[str, ...]
) -> dict[str, Float[Array, "..."]]:
    still, near_still = jax.lax.stop_gradient((found, near))
    for one, others in ((found, near), (still, near_still)):
        one.kept.formulas, one.kept.near = {}, others
    entries = [OBSERVABLES[name] for name in names]
    numbers = {e.name: e.of(found if e.has_derivative else still) for e in entries}
    if found.kind == TRANSIENT:  # whose numbers before a failure are known
        return numbers
    return if_known(found.result, numbers)  # an area is a number even of a pressure that is none
