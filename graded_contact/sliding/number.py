"""Numbers of results: attributes that are computed when they are read, and then kept.

    @observable("friction coefficient")
    def friction(found): ...

    class Sliding(AbstractSliding):
        friction, friction_error = friction, friction.error({"solver": ..., "grid": ...})

`s.friction` runs one program. `s.compute("friction", "contact_area")` computes both in one.
"""

import dataclasses
import functools
from collections.abc import Callable, Collection, Mapping
from operator import attrgetter
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import Stack
from ..contacts.solution import ContactSolution, if_known
from ..core.checks import is_concrete
from ..core.compilation import compiled
from ..core.derivative import derivative_apart
from ..core.quantities import NUMBERS, TRANSIENT, Quantity
from ..fields.grid import Grid
from .case import HEATED, WINDOW
from .limits import WARN_ABOVE, Above, NumberOf
from .problem import Problem

# What formulas take: a `Sliding`, a `CyclicSliding` or a `TransientSliding`.
Found = Any
Formula = Callable[[Found], Any]
# The facts of the contacts that have errors by these causes.
NEEDED = {"temperature": [HEATED], "kernel": [WINDOW]}
REMEDIES = {"grid": "more points", "time": "more times", "memory": "a shorter motion"}
_OF_CONTACT = {field.name for field in dataclasses.fields(ContactSolution)}


class Observable(property):
    """A number of a result of sliding, or a field over time, as its attribute.

    **Arguments:**

    - `formula`: of a result; the attribute has its docstring.
    - `meaning`, `unit`: see `Quantity`.
    - `needs`: only contacts with these `facts` print and store it.
    - `warns`: limit above which there is a warning, or None.
    """

    def __init__(
        self,
        formula: Formula,
        meaning: str,
        unit: str = "1",
        *,
        needs: Collection[str] = (),
        warns: Above | None = None,
    ):
        super().__init__(formula)
        self.formula, self.needs, self.warns = formula, needs, warns
        self.quantity = Quantity("", unit, meaning)

    def __set_name__(self, owner: type, name: str) -> None:
        self.quantity = self.quantity._replace(name=name)
        NUMBERS.setdefault(name, self.quantity)

    def __get__(self, found: Any, owner: type | None = None) -> Any:
        if found is None:
            return self
        # Numbers of `contact` need no program.
        name = self.quantity.name
        return self.of(found) if name in _OF_CONTACT else found.compute(name)[0]

    def __call__(self, found: Found) -> Any:
        return self.formula(found)

    @property
    def is_error(self) -> bool:
        """Whether it is an estimated error: without a derivative, and from `Neighbours`."""
        return self.quantity.name.endswith("_error")

    def of(self, found: Found) -> Any:
        """Returns the number of a result; a transient solve recorded some of them step by step."""
        recorded, name = getattr(found, "recorded", {}), self.quantity.name
        return recorded[name] if name in recorded else self.formula(found)

    def error(
        self,
        parts: Mapping[str, Formula],
        *,
        over: Callable[[str, NumberOf], Any] | None = None,
        needs: Collection[str] = (),
    ) -> "Observable":
        """Returns the estimated error of the number, the sum of its parts.

        **Arguments:**

        - `parts`: formulas by their causes: "solver", "grid", "time", "memory", "kernel" (of a
          non-periodic surface) or "temperature". `error_parts` of a result returns them.
        - `over`: the relative error of a number by its name; above `WARN_ABOVE` there is a warning.
          None: there is none.
        - `needs`: facts of the contacts that have the error, beside those that have the number.
        """

        def errors(found):
            known = (cause for cause in parts if {*NEEDED.get(cause, ())} <= found.facts)
            return {cause: parts[cause](found) for cause in known}

        unit, meaning = self.quantity.unit, self.quantity.meaning
        errors.__doc__ = f"Estimated error of the {meaning} [{unit}]: the sum of its parts."
        warns = None
        if over is not None:
            remedies = [REMEDIES[cause] for cause in parts if cause in REMEDIES]
            sentence = (
                f"The {meaning} has an error of about {{value:.0%}}: take "
                f"{', or '.join(remedies)}. `error_parts` returns the causes."
            )
            warns = Above(WARN_ABOVE, sentence, lambda n: over(self.quantity.name, n))
        words = f"estimated error of the {meaning}"
        more: Any = {"needs": [*self.needs, *needs], "warns": warns}
        return Observable(errors, words, unit, **more)


def observable(*words: str, **more: Any) -> Callable[[Formula], Observable]:
    """Makes an observable of a formula; arguments as of `Observable`."""
    return lambda formula: Observable(formula, *words, **more)


@functools.cache
def observables_in(kind: type) -> dict[str, Observable]:
    """Returns the numbers of a class of results by their names, in the order of prints."""
    return {
        name: entry
        for part in kind.__mro__
        for name, entry in vars(part).items()
        if isinstance(entry, Observable)
    }


def numbers_of(kind: type, facts: Collection[str]) -> tuple[str, ...]:
    """Returns the names of the numbers that prints and results of such contacts contain."""
    entries = observables_in(kind).items()
    return tuple(name for name, one in entries if {*one.needs} <= {*facts})


def value_of(name: str, found: Found) -> Any:
    """Returns a number of a result inside of the program of others."""
    return observables_in(type(found))[name].of(found)


@dataclasses.dataclass
class Kept:
    """The numbers that a result has computed.

    It is no field of the result: a copy, such as JAX makes, starts with nothing.

    **Fields:**

    - `numbers`: numbers by their names, none of them traced; of an error its parts.
    - `near`: the contacts on half the grid and with half the times, see `Neighbours`, or None.
    - `formulas`: results of formulas that several numbers share, within one program, see
      `shared`; None outside of a program.
    """

    numbers: dict[str, Any] = dataclasses.field(default_factory=dict)
    near: Any = None
    formulas: dict[Callable[[Any], Any], Any] | None = None


class AbstractSliding(eqx.Module):
    """The common part of the results of sliding: how numbers are computed.

    A number is computed when it is first read, and kept unless it is traced, see `Kept`. Under
    `jit` XLA drops what nothing uses.
    """

    contact: eqx.AbstractVar[ContactSolution]
    problem: eqx.AbstractVar[Problem]
    kind: eqx.AbstractClassVar[str]
    bodies: eqx.AbstractVar[tuple[Stack, ...]]

    @functools.cached_property
    def kept(self) -> Kept:
        """The numbers that are known."""
        return Kept()

    def neighbours(self, /) -> Any:
        """Solves the contacts on coarser grids and with fewer times, see `Neighbours`."""
        raise NotImplementedError

    @property
    def near(self) -> Any:
        """Contacts on coarser grids, computed once; under tracing they are not stored."""
        near = self.kept.near
        if near is None:
            # Of a copy: neighbours that contain this contact would keep it, in a circle, for long.
            near = self.without_bodies().neighbours()
            if all(map(is_concrete, jax.tree.leaves(near))):
                self.kept.near = near
        return near

    def without_bodies(self) -> "AbstractSliding":
        """Returns a copy that the programs of numbers take: they serve contacts of all bodies."""
        return dataclasses.replace(self, bodies=())

    facts = property(attrgetter("problem.facts"))  # see `facts_of`
    operator = property(attrgetter("problem.operator"))
    heights = property(attrgetter("problem.heights"))
    grid = property(attrgetter("problem.grid"))
    law = property(attrgetter("problem.law"))
    shear = property(attrgetter("problem.shear"))
    coupling = property(attrgetter("problem.coupling"))
    pressure = property(attrgetter("contact.pressure"))
    gap = property(attrgetter("contact.gap"))
    result = property(attrgetter("contact.result"))
    state = property(attrgetter("contact.state"))
    noise = property(attrgetter("contact.noise"))

    @property
    def cell(self) -> Grid:
        """The cell of the kernel."""
        return self.operator.cell(self.grid)

    @property
    def numbers(self) -> tuple[str, ...]:
        """The names of the numbers that prints and results contain."""
        return numbers_of(type(self), self.facts)

    def compute(self, *names: str) -> list[Float[Array, "..."]]:
        """Returns the numbers of these names; one program computes those that are missing."""
        known = self._known(names)
        return [total_of(known[name]) for name in names]

    def error_parts(self, name: str) -> dict[str, Float[Array, "..."]]:
        """Returns the parts of the error of a number by their causes, such as "grid".

        A number without an estimated error has none.
        """
        error = f"{name}_error"
        return self._known((error,))[error] if error in observables_in(type(self)) else {}

    def _known(self, names: tuple[str, ...]) -> dict[str, Any]:
        kept = self.kept.numbers
        missing = tuple(name for name in names if name not in kept)
        found = _in_programs(self, missing) if missing else {}
        if all(map(is_concrete, jax.tree.leaves(found))):  # a tracer must not outlive its trace
            kept.update(found)
        return kept | found

    def before_display(self) -> tuple[str, ...]:
        """Computes all numbers; returns the names of the numbers that the contact does not show."""
        self.compute(*self.numbers)
        return beyond_contact(self)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about these numbers, one sentence each; not under `jit`."""
        values = map(np.asarray, self.compute(*self.numbers))
        known = dict(zip(self.numbers, values, strict=True))
        return warnings_of(type(self), lambda name: known.get(name, 0.0))


def warnings_of(kind: type[AbstractSliding], number: NumberOf) -> tuple[str, ...]:
    """Returns the warnings about numbers of a class of results, in the order of prints.

    `number` returns a number of the result, or of a file of results, by its name; 0 if there is
    none.
    """
    solves = "times" if kind.kind == TRANSIENT else "solves"
    rules = [(name, entry.warns) for name, entry in observables_in(kind).items() if entry.warns]
    sentences = (rule.warning(name, number, solves) for name, rule in rules)
    return tuple(sentence for sentence in sentences if sentence)


def total_of(parts: Array | dict[str, Array]) -> Array:
    """Returns a number as it is, and of the parts of an error their sum."""
    return functools.reduce(jnp.add, parts.values()) if isinstance(parts, dict) else parts


def beyond_contact(found: AbstractSliding) -> tuple[str, ...]:
    """The names of numbers that `contact` lacks, or has without their error."""
    names = found.numbers
    return tuple(n for n in names if n not in _OF_CONTACT or f"{n}_error" in names)


def with_observables(tree: Any) -> Any:
    """Returns a tree with the numbers and the contact of each result of sliding in its place."""

    def numbers(leaf):
        if not isinstance(leaf, AbstractSliding):
            return leaf
        names = beyond_contact(leaf)
        return dict(zip(names, leaf.compute(*names), strict=True)) | {"contact": leaf.contact}

    return jax.tree.map(numbers, tree, is_leaf=lambda leaf: isinstance(leaf, AbstractSliding))


def _in_programs(found: AbstractSliding, names: tuple[str, ...]) -> dict[str, Any]:
    """The numbers of a result; of a batch one by one."""
    if found.contact.error.ndim > 0:
        return jax.lax.map(lambda one: _in_programs(one, names), found)
    # Outside of the program, so that Python reuses the programs of the contact.
    near = None
    if any(observables_in(type(found))[name].is_error for name in names):
        near = found.near
    return _computed(found.without_bodies(), near, names)


@derivative_apart
@compiled
def _computed(found: AbstractSliding, near: Any, names: tuple[str, ...]) -> dict[str, Any]:
    still, near_still = jax.lax.stop_gradient((found, near))
    for one, others in ((found, near), (still, near_still)):
        one.kept.formulas, one.kept.near = {}, others
    entries = {name: observables_in(type(found))[name] for name in names}
    numbers = {n: e.of(still if e.is_error else found) for n, e in entries.items()}
    if found.kind == TRANSIENT:  # whose numbers before a failure are known
        return numbers
    return if_known(found.result, numbers)  # an area is a number even of a pressure that is none
