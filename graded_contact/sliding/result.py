"""The results of sliding: a contact and its problem, from which observables are computed."""

import dataclasses
import inspect
from typing import Any, ClassVar, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..blocks.heated_stack import HeatedContact
from ..contacts.law import AbstractLaw
from ..contacts.operator import AbstractOperator
from ..contacts.solution import RESULTS, ContactSolution, if_known
from ..contacts.window import Window
from ..core.checks import is_concrete
from ..core.compilation import jit
from ..core.derivative import derivative_apart
from ..core.display import shown
from ..core.quantities import OBSERVABLES, numbers_of
from ..core.warnings import CYCLE_RULES, RULES, caveats_of
from ..fields.frequency import direction_and_speed
from ..fields.grid import Grid
from .half_grid import grid_estimate
from .problem import Coupling, CycleProblem, Problem, SteadyProblem
from .shear import ShearStress

K = TypeVar("K", bound=type)
_OF_CONTACT = {field.name for field in dataclasses.fields(ContactSolution)}


def describe(kind: K) -> K:
    """Puts the observables of a class into its docstring, once all are registered."""
    lines = []
    for name, entry in OBSERVABLES.items():
        if entry.is_of(kind.is_cycle, entry.needs):
            text = inspect.cleandoc(entry.formula.__doc__ or "").replace("\n\n", "\n")
            lines.append(f"- `{name}`: {text}".replace("\n", "\n  "))
    kind.__doc__ = inspect.cleandoc(kind.__doc__ or "").replace("OBSERVABLES", "\n".join(lines))
    return kind


class AbstractSliding(eqx.Module):
    """What `Sliding` and `CyclicSliding` have in common: observables, and what they are made of.

    An observable is computed when it is first read. It is stored with the object, unless it is
    traced. Under `jit` XLA drops what nothing uses.
    """

    contact: eqx.AbstractVar[ContactSolution]
    problem: eqx.AbstractVar[Problem]
    heated: eqx.AbstractVar[HeatedContact | None]
    is_cycle: eqx.AbstractClassVar[bool]

    def __getattr__(self, name: str) -> Array:
        # Python looks here only for what is no field. Numbers of `contact` need no program.
        entry = OBSERVABLES.get(name)
        if entry is None or not entry.is_of(self.is_cycle, entry.needs):
            raise AttributeError(f"`{type(self).__name__}` has no attribute `{name}`.")
        return entry.formula(self) if name in _OF_CONTACT else self.compute(name)[0]

    def __dir__(self):
        return [*super().__dir__(), *self.numbers]

    @property
    def facts(self) -> frozenset[str]:
        """What else is known of this kind of contact, see `observable`."""
        return frozenset()

    # What the problem has.

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
        return numbers_of(self.is_cycle, self.facts)

    def compute(self, *names: str) -> list[Float[Array, "..."]]:
        """Returns the observables of these names; one program computes those that are missing."""
        missing = tuple(name for name in names if name not in vars(self))
        found = _in_programs(self, missing) if missing else {}
        known = vars(self) | found
        if all(map(is_concrete, found.values())):  # a tracer must not outlive its trace
            vars(self).update(found)
        return [known[name] for name in names]

    def before_display(self) -> tuple[str, ...]:
        """Computes all numbers; returns the names of those that the contact does not show."""
        self.compute(*self.numbers)
        return _beyond_contact(self)

    @property
    def grid_errors(self) -> str:
        """Where the errors by the grid come from, in words; of a batch, those of its first."""
        one = self.heights.reshape(-1, *self.grid.shape)[0]
        return grid_estimate(one, self.grid, "window" in self.facts)

    @property
    def caveats(self) -> tuple[str, ...]:
        """Warnings about these numbers, one sentence each; not under `jit`."""
        self.compute(*self.numbers)
        rules = CYCLE_RULES if self.is_cycle else RULES
        return tuple(caveat.sentence for caveat in caveats_of(self, rules))


@shown("contact", "grid_errors", "caveats")
class Sliding(AbstractSliding):
    """Friction, contact area and fields of a sliding contact.

    The contact is solved. Every other number is computed when it is read. A batch, from
    `jax.lax.map`, `jax.vmap` or a stack of leaves, has arrays of numbers. Errors and
    `energy_imbalance` have no derivative.

    On a window (`Surface(..., periodic=False)`) the errors of friction and area include the error
    of the kernel; at a given approach they also include the error of the load.

    **Observables:**

    OBSERVABLES

    **Fields:**

    - `contact`: pressure, gap and convergence, see `ContactSolution`; also reached directly as
      `.pressure`, `.gap`, `.displacement` [Pa, m, m] and `.result`.
    - `problem`: what was solved, see `SteadyProblem`; its `operator`, `heights`, `grid`, `law`,
      `velocity`, `shear`, `coupling` and others are also reached directly. `.kernel` is the M of
      the block [m/Pa], see `stack_kernel` and `window_kernel`.
    - `heated`: temperatures of the contact, see `HeatedContact`, or None.
    """

    contact: ContactSolution
    problem: SteadyProblem
    heated: HeatedContact | None = None
    is_cycle: ClassVar[bool] = False

    @property
    def facts(self) -> frozenset[str]:
        known = {
            "window": isinstance(self.operator, Window),
            "ground": self.problem.ground,
            "heated": self.heated is not None,
            "load follows": self.problem.prescribed != "pressure",
            "coupled": self.coupling is not None,
            "given load": not self.at_approach,
        }
        return frozenset(fact for fact, holds in known.items() if holds)

    @property
    def directions(self) -> list[float]:
        """The unit vector of the traction, by its components: one, along the velocity."""
        return [1.0]

    @property
    def at_approach(self) -> bool:
        """Whether the approach was given, not the load."""
        return self.problem.prescribed == "approach"

    @property
    def velocity(self) -> Float[Array, "..."]:
        return self.problem.velocity

    @property
    def kernel(self) -> Inexact[Array, "..."]:
        return self.operator.kernel

    @property
    def displacement(self) -> Float[Array, "*shape"]:
        return self.contact.displacement

    @property
    def speed(self) -> Float[Array, ""]:
        """|v| [m/s]."""
        return direction_and_speed(self.velocity)[1]


@shown("contact", "grid_errors", "caveats")
class CyclicSliding(AbstractSliding):
    """Friction, contact area and fields over a cycle.

    Numbers are computed when they are read. Arrays over time have the shape `(nt,)`; those along
    the motion, friction and traction, `(nt, 2)` if the displacement has two components. Errors and
    `energy_imbalance` have no derivative.

    **Observables:** friction, traction, load, gap and areas over time, others of the whole cycle

    OBSERVABLES

    **Fields:**

    - `contact`: pressure, gap and convergence, see `ContactSolution`; the fields have the shape
      `(nt, *grid.shape)`. Also reached directly as `.pressure`, `.gap` [Pa, m] and `.result`.
    - `problem`: what was solved, see `CycleProblem`; its `operator`, `heights`, `grid`, `law`,
      `displacement`, `period`, `shear`, `coupling` and others are also reached directly.
    - `heated`: temperatures of the contact, see `HeatedContact`, or None.
    """

    contact: ContactSolution
    problem: CycleProblem
    heated: HeatedContact | None = None
    is_cycle: ClassVar[bool] = True

    @property
    def facts(self) -> frozenset[str]:
        known = {
            "sheared": self.shear is not None,
            "heated": self.heated is not None,
            "coupled": self.coupling is not None,
        }
        return frozenset(fact for fact, holds in known.items() if holds)

    @property
    def directions(self) -> list[Float[Array, "nt ..."]]:
        """The unit vector of the motion at each time, by its components; 0 at rest."""
        rate, back = self.motion_of_surface
        # From the time before to the time after: what the Fourier series of a rest adds is no
        # motion.
        step = jnp.mean(rate, axis=0) * (2 * self.period / len(back))
        step = step + jnp.roll(back, -1, axis=0) - jnp.roll(back, 1, axis=0)
        squared = jnp.sum(step**2, axis=1)
        moves = squared > 1e-12 * jnp.max(squared)
        length = jnp.sqrt(jnp.where(moves, squared, 1))
        unit = jnp.where(moves[:, None], step / length[:, None], 0)
        return [part.reshape(-1, *[1] * self.grid.ndim) for part in unit.T]

    @property
    def displacement(self) -> Float[Array, "nt ..."]:
        """s(t) of the surface [m]."""
        return self.problem.displacement

    @property
    def period(self) -> Float[Array, ""]:
        """T [s]."""
        return self.problem.period

    @property
    def times(self) -> Float[Array, " nt"]:
        """The times of all arrays over time [s]."""
        return self.problem.times

    @property
    def moved(self) -> Float[Array, "nt components"]:
        """The displacement, its components on the second axis [m]."""
        return self.problem.moved

    @property
    def motion_of_surface(self) -> tuple[Float[Array, "nt axes"], Float[Array, "nt axes"]]:
        """ds/dt [m/s], and the part of s [m] that comes back after each period."""
        return self.problem.motion_of_surface

    @property
    def velocity(self) -> Float[Array, "nt ..."]:
        """ds/dt of the surface [m/s]."""
        return self.motion_of_surface[0].reshape(self.displacement.shape)


Found = Sliding | CyclicSliding


def result_of(problem: Problem, contact: ContactSolution) -> Found:
    """Returns the result of a contact."""
    if isinstance(problem, CycleProblem):
        return CyclicSliding(contact, problem)
    return Sliding(contact, problem)


def with_observables(tree: Any) -> Any:
    """Returns a tree with the numbers and the contact of each result of sliding in its place."""

    def numbers(leaf):
        if not isinstance(leaf, AbstractSliding):
            return leaf
        names = _beyond_contact(leaf)
        return dict(zip(names, leaf.compute(*names), strict=True)) | {"contact": leaf.contact}

    return jax.tree.map(numbers, tree, is_leaf=lambda leaf: isinstance(leaf, AbstractSliding))


def _beyond_contact(found: AbstractSliding) -> tuple[str, ...]:
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
@jit
def _computed(
    found: AbstractSliding, near: Any, names: tuple[str, ...]
) -> dict[str, Float[Array, "..."]]:
    still, near_still = jax.lax.stop_gradient((found, near))
    for one, others in ((found, near), (still, near_still)):
        vars(one).update(_shared={}, _near=others)  # see `observables.shared`
    entries = [OBSERVABLES[name] for name in names]
    numbers = {e.name: e.formula(found if e.has_derivative else still) for e in entries}
    return if_known(found.result, numbers)  # an area is a number even of a pressure that is none
