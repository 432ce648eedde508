"""The results of sliding: a contact and its problem, from which observables are computed."""

import inspect
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..blocks.heated_stack import HeatedContact
from ..contacts.solution import ContactSolution
from ..core.display import number, shown
from ..core.quantities import CYCLE, OBSERVABLES, STEADY, TRANSIENT
from ..fields.frequency import direction_and_speed
from .abstract_sliding import AbstractSliding, beyond_contact
from .problem import CycleProblem, Problem, SteadyProblem, TransientProblem


def describe(kind: type[AbstractSliding]) -> None:
    """Puts the observables of a class into its docstring, once all are registered."""
    lines = []
    for name, entry in OBSERVABLES.items():
        if entry.is_of(kind.kind, entry.needs):
            text = inspect.cleandoc(entry.formula.__doc__ or "").replace("\n\n", "\n")
            lines.append(f"- `{name}`: {text}".replace("\n", "\n  "))
    kind.__doc__ = inspect.cleandoc(kind.__doc__ or "").replace("OBSERVABLES", "\n".join(lines))


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
    recorded: dict[str, Array] = eqx.field(default_factory=dict)  # of a transient solve alone
    kind: ClassVar[str] = STEADY

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
    recorded: dict[str, Array] = eqx.field(default_factory=dict)  # of a transient solve alone
    kind: ClassVar[str] = CYCLE

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


@shown("contact", "failed", "grid_errors", "caveats")
class TransientSliding(AbstractSliding):
    """Friction, contact area and fields in a transient motion.

    Arrays over time have the shape `(nt,)`, one number for each of `.times`; those along the
    motion, friction and traction, `(nt, 2)` if the displacement has two components. Errors have no
    derivative. After a step that failed all numbers are NaN.

    **Observables:** friction, traction, load, gap, areas and works over time, others of the whole

    OBSERVABLES

    **Fields:**

    - `contact`: the fields at the ends of some steps, of the shape `(kept, *grid.shape)`, see
      `ContactSolution`; its numbers are the largest errors and the sums of all steps. Also reached
      directly as `.pressure`, `.gap`, `.displacement` [Pa, m, m], at the `.field_times` [s].
    - `problem`: what was solved, see `TransientProblem`; its `times`, `displacement`, `heights`,
      `grid`, `law`, `shear` and others are also reached directly.
    - `recorded`: numbers of the steps by their names, each with the times on its first axis.
    - `failed`: number of the first step that did not succeed, or -1.
    - `kept_steps`: numbers of the steps whose fields are kept. Static.
    """

    contact: ContactSolution
    problem: TransientProblem
    recorded: dict[str, Array]
    failed: Array
    kept_steps: tuple[int, ...] = eqx.field(static=True)
    heated: HeatedContact | None = None
    kind: ClassVar[str] = TRANSIENT

    @property
    def times(self) -> Float[Array, " nt"]:
        """Ends of the steps [s]."""
        return self.problem.times

    @property
    def displacement(self) -> Float[Array, "*kept"]:
        """Displacement of the block at the kept times [m]."""
        return self.contact.displacement

    @property
    def moved(self) -> Float[Array, "nt components"]:
        """The displacement s of the surface, its components on the second axis [m]."""
        return self.problem.moved

    def table(self, most: int = 25) -> str:
        """Returns the numbers over time in columns, of at most so many times."""
        entries = [OBSERVABLES[name] for name in self.numbers if name in self.recorded]
        shown_of = [(e, e.column) for e in entries if e.over_time and e.column is not None]
        rows = np.unique(np.linspace(0, len(self.times) - 1, most).round().astype(int))
        heads = ["time [s]", *(head.replace("\n", " ") for _, (head, _) in shown_of)]
        columns = [[f"{t:.4g}" for t in np.asarray(self.times)[rows]]]
        for entry, (_, form) in shown_of:
            values = np.asarray(self.recorded[entry.name])[rows].reshape(len(rows), -1)
            columns.append([" ".join(number(v, form) for v in row) for row in values])
        widths = [max(map(len, (head, *rest))) for head, rest in zip(heads, columns, strict=True)]
        lines = [heads, *zip(*columns, strict=True)]
        return "\n".join(
            "  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True))
            for line in lines
        )

    @property
    def field_times(self) -> Float[Array, " kept"]:
        """Times of the kept fields [s]."""
        return self.times[np.array(self.kept_steps)]


if TYPE_CHECKING:
    Found = Sliding | CyclicSliding
else:  # a few formulas, such as errors by the grid, also take a transient solve
    Found = Sliding | CyclicSliding | TransientSliding


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
        names = beyond_contact(leaf)
        return dict(zip(names, leaf.compute(*names), strict=True)) | {"contact": leaf.contact}

    return jax.tree.map(numbers, tree, is_leaf=lambda leaf: isinstance(leaf, AbstractSliding))
