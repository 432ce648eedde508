"""The results of sliding: a contact and its surroundings, from which observables are computed."""

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
from . import caveats, errors, traction  # noqa: F401 (they register observables, in this order)
from .coupling import Coupling
from .motion import components, rate_of
from .resolution import Neighbours, grid_estimate, neighbours_of
from .shear import ShearStress

K = TypeVar("K", bound=type)
_OF_CONTACT = {field.name for field in dataclasses.fields(ContactSolution)}


def _described(kind: K) -> K:
    """Puts the observables of a class into its docstring."""
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

    contact: ContactSolution
    operator: AbstractOperator
    heights: Float[Array, "..."]
    grid: Grid
    law: AbstractLaw
    measured_range: tuple[Float[Array, "..."], Float[Array, "..."]] | None = eqx.field(
        default=None, kw_only=True
    )
    prescribed: str = eqx.field(default="pressure", kw_only=True, static=True)
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

    @property
    def neighbours(self) -> Neighbours:
        """The same contact with fewer points and fewer times, see `Neighbours`; kept."""
        near = vars(self).get("_near")
        if near is None:
            # Of a copy: neighbours that contain this contact would keep it, in a circle, for long.
            near = neighbours_of(jax.tree.map(lambda leaf: leaf, self))
            if all(map(is_concrete, jax.tree.leaves(near))):
                vars(self)["_near"] = near
        return near

    def compute(self, *names: str) -> list[Float[Array, "..."]]:
        """Returns the observables of these names; one program computes those that are missing."""
        missing = tuple(name for name in names if name not in vars(self))
        found = _of_all(self, missing) if missing else {}
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
@_described
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
    - `operator`: the block; `.kernel` is its M [m/Pa], see `stack_kernel` and `window_kernel`.
    - `heights`: h of the surface [m].
    - `measured`: share of each height that was measured [1], or None, see `Surface`.
    - `grid`, `law`: of the surface and of the contact.
    - `velocity`: of the surface over the block [m/s].
    - `measured_range`: lowest and highest ω at which all materials were measured [rad/s], or None.
    - `kernel_error`: two estimated errors of the kernel of a window [m/Pa], see
      `blocks/window_compliance.py`; None if periodic.
    - `shear`: shear stress [Pa] as a function of the pressure, or None.
    - `coupling`: how its traction moves the surface of the block, see `sliding/coupling.py`, or
      None.
    - `heated`: temperatures of the contact, see `HeatedContact`, or None.
    - `thickness`: of the layers between a window and a rigid base [m], else None.
    - `ground`: whether the block of a window does not move far away. Static.
    - `prescribed`: what was given: "pressure", "mean_gap" or "approach". Static.
    """

    velocity: Float[Array, "..."]
    measured: Float[Array, "..."] | None = None
    kernel_error: Inexact[Array, "..."] | None = None
    shear: ShearStress | None = None
    coupling: Coupling | None = None
    heated: HeatedContact | None = None
    thickness: Float[Array, "..."] | None = None
    ground: bool = eqx.field(default=False, static=True)
    is_cycle: ClassVar[bool] = False

    @property
    def facts(self) -> frozenset[str]:
        known = {
            "window": isinstance(self.operator, Window),
            "ground": self.ground,
            "heated": self.heated is not None,
            "load follows": self.prescribed != "pressure",
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
        return self.prescribed == "approach"

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
@_described
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
    - `operator`: the block in space and time.
    - `heights`, `grid`, `law`: of the surface and of the contact.
    - `displacement`: s(t) of the surface [m].
    - `period`: T [s].
    - `heated`: temperatures of the contact, see `HeatedContact`, or None.
    - `measured_range`: lowest and highest ω at which all materials were measured [rad/s], or None.
    - `shear`: shear stress [Pa] as a function of the pressure, at each time's speed; or None.
    - `coupling`: how its traction moves the surface of the block, see `sliding/coupling.py`, or
      None.
    - `prescribed`: what was given: "pressure" or "mean_gap". Static.
    """

    displacement: Float[Array, "nt ..."]
    period: Float[Array, ""]
    shear: ShearStress | None = None
    heated: HeatedContact | None = None
    coupling: Coupling | None = None
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
    def times(self) -> Float[Array, " nt"]:
        """The times of all arrays over time [s]."""
        count = len(self.displacement)
        return self.period * jnp.arange(count, dtype=self.period.dtype) / count

    @property
    def velocity(self) -> Float[Array, "nt ..."]:
        """ds/dt of the surface [m/s]."""
        return self.motion_of_surface[0].reshape(self.displacement.shape)

    @property
    def moved(self) -> Float[Array, "nt components"]:
        """The displacement, its components on the second axis [m]."""
        return components(self.displacement)

    @property
    def motion_of_surface(self) -> tuple[Float[Array, "nt axes"], Float[Array, "nt axes"]]:
        """ds/dt [m/s], and the part of s [m] that comes back after each period.

        The surface advances by the number of cells that closes the period with a step like its
        neighbours.
        """
        moved, size = self.moved, self.grid.size[: self.moved.shape[1]]
        closing = (moved[-1] - moved[-2] + moved[1] - moved[0]) / 2
        drift = size * jnp.round(jax.lax.stop_gradient((moved[-1] + closing - moved[0]) / size))
        # The velocity is periodic, the displacement only up to whole cells.
        back = moved - drift * (self.times / self.period)[:, None]
        return rate_of(back, self.period) + drift / self.period, back


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


def _of_all(found: AbstractSliding, names: tuple[str, ...]) -> dict[str, Float[Array, "..."]]:
    if found.contact.error.ndim > 0:  # a batch
        return jax.lax.map(lambda one: _of_all(one, names), found)
    # Outside of the program, so that Python reuses the programs of the contact.
    needed = any(OBSERVABLES[name].on_two_grids for name in names)
    return _computed(found, found.neighbours if needed else None, names)


@derivative_apart
@jit
def _computed(
    found: AbstractSliding, near: Neighbours | None, names: tuple[str, ...]
) -> dict[str, Float[Array, "..."]]:
    still, near_still = jax.lax.stop_gradient((found, near))
    for one, others in ((found, near), (still, near_still)):
        vars(one).update(_shared={}, _near=others)  # see `observables.shared`
    entries = [OBSERVABLES[name] for name in names]
    numbers = {e.name: e.formula(found if e.has_derivative else still) for e in entries}
    return if_known(found.result, numbers)  # an area is a number even of a pressure that is none
