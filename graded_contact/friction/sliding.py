"""The numbers of a sliding contact: friction, areas, their errors and warnings."""

from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..contact.area import (
    contact_area,
    contact_area_corrected,
    contact_area_error,
    contact_area_smooth,
)
from ..contact.estimates import error_of
from ..contact.law import AbstractLaw
from ..contact.observables import (
    energy_imbalance,
    friction,
    friction_error,
    friction_share,
    shear_friction,
    shear_friction_error,
    slope_in_contact,
    unmeasured_shares,
)
from ..contact.operator import displace
from ..contact.solution import RESULTS, ContactSolution
from ..contact.window import (
    change_by_kernel,
    is_window,
    on_cell,
    on_window,
    stiffness_at_edges,
)
from ..core.checks import (
    is_concrete,
)
from ..core.compilation import compiled
from ..core.derivative import derivative_apart, largest
from ..core.display import shown
from ..core.warnings import caveats_of
from ..fields.grid import Grid, coordinates, wave_frequencies
from ..response.heated import HeatedContact
from ..response.window import doubled
from ..rheology.measured import is_unknown
from ..rheology.shear import ShearStress


class _Observable:
    """An attribute of `Sliding` that is computed when it is first read.

    The number is stored with the object, unless it is traced. Under `jit` XLA drops what nothing
    uses.
    """

    def __init__(
        self, formula: Callable[["Sliding"], Float[Array, "..."]], has_derivative: bool = True
    ):
        self.formula, self.has_derivative = formula, has_derivative

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, sliding: "Sliding", kind: type | None = None) -> Float[Array, "..."]:
        if sliding is None:
            return self  # pyright: ignore[reportReturnType]
        return sliding.compute(self.name)[0]

    def of(self, sliding: "Sliding") -> Float[Array, "..."]:
        return self.formula(sliding if self.has_derivative else jax.lax.stop_gradient(sliding))


def _cell(s: "Sliding") -> Grid:
    """The cell of the kernel: that of the surface, or of a window's surroundings, too."""
    return doubled(s.grid) if is_window(s.kernel, s.grid.shape) else s.grid


def _loaded(s: "Sliding"):
    """The pressure on the cell, and its own displacement, which balances energy to rounding."""
    pressure = on_cell(s.pressure, s.kernel)
    return pressure, displace(s.kernel, pressure)


def _displaced(s: "Sliding"):
    """Pressure and displacement on the cell."""
    return _loaded(s) if is_window(s.kernel, s.grid.shape) else (s.pressure, s.displacement)


def _geometric_friction(s: "Sliding"):
    heights = on_cell(s.heights, s.kernel, "symmetric")
    return friction(on_cell(s.pressure, s.kernel), heights, _cell(s), s.velocity)


def _touching(s: "Sliding"):
    return s.contact_indicator > 0


def _indicator(s: "Sliding"):
    stiffness = stiffness_at_edges(s.kernel, _cell(s), s.grid.shape)
    return s.law.contact_indicator(s.pressure, s.gap, stiffness)


def _hysteresis(s: "Sliding"):
    return friction(*_loaded(s), _cell(s), s.velocity)


def _shear(s: "Sliding"):
    return shear_friction(s.pressure, _indicator(s), s.shear)


def _friction_error(s: "Sliding"):
    others = 0 if s.kernel_error is None else _image_error(s)
    if s.heated is not None:
        others += s.heated.friction_error
    if s.contact.target_error is not None:
        return s.contact.target_error[0] + others
    correction, cell = on_cell(s.contact.correction, s.kernel), _cell(s)
    error = others + friction_error(_loaded(s)[0], correction, s.kernel, cell, s.velocity)
    if s.shear is None:
        return error
    return error + shear_friction_error(s.pressure, s.contact.correction, _indicator(s), s.shear)


def _image_error(s: "Sliding"):
    """What the errors of a window's kernel change under this pressure.

    Contributions of single points may cancel in the estimate by chance: so twice their root sum of
    squares is added (`docs/theory/contact.md`).
    """
    pressure, cell = _loaded(s)[0], _cell(s)
    assert s.kernel_error is not None
    moved = [displace(error, pressure) for error in s.kernel_error]
    sums = sum(jnp.abs(friction(pressure, field, cell, s.velocity)) for field in moved)
    slopes = sum(slope_in_contact(pressure, field, cell) for field in moved)
    return sums + 2 * slopes / jnp.sqrt(jnp.sum(pressure != 0)) + _load_error(s)


def _load_error(s: "Sliding"):
    """The error of friction by that of the load, at a given approach."""
    indicator = _indicator(s)

    def friction_under(pressure):
        changed = on_cell(pressure, s.kernel)
        found = friction(changed, displace(s.kernel, changed), _cell(s), s.velocity)
        return found + shear_friction(pressure, indicator + pressure - s.pressure, s.shear)

    pull = jax.grad(friction_under)(s.pressure)
    parts = [pull * change for change in _changes_by_kernel(s) if s.at_approach]
    return sum(map(_with_chance, parts))


def _with_chance(part: Array) -> Array:
    """The sum of contributions of points, some of which may cancel by chance."""
    return jnp.abs(jnp.sum(part)) + jnp.sqrt(jnp.sum(part**2))


def _changes_by_kernel(s: "Sliding") -> list[Array]:
    """What the errors of a window's kernel change in the pressure."""
    if s.kernel_error is None:
        return []
    given = s.pressure, _touching(s), s.at_approach
    return [change_by_kernel(s.kernel, error, *given) for error in s.kernel_error]


def _moved(s: "Sliding", kernel, field: Array | float = 0.0):
    """How far a window moves where it is loaded, less a field; and the block's mean part of it."""
    pressure, weight = on_cell(s.pressure, kernel), jax.lax.stop_gradient(jnp.abs(s.pressure))
    weight = jnp.where(jnp.sum(weight) > 0, weight, 1)
    moved = on_window(displace(kernel, pressure)) - field
    mean = kernel[(0,) * kernel.ndim].real * jnp.mean(pressure)
    return jnp.stack([jnp.sum(weight * moved) / jnp.sum(weight), mean])


def _compression(s: "Sliding"):
    if s.thickness is None:
        return jnp.zeros((), s.pressure.dtype)
    return s.approach / s.thickness


def _contact_area_error(s: "Sliding"):
    error = 0 if s.heated is None else s.heated.area_error
    touching, change = _touching(s), jnp.zeros_like(s.pressure)
    for moved in _changes_by_kernel(s):  # 0 outside contact, where points may join it
        in_contact = jnp.sqrt(jnp.sum(moved**2) / jnp.maximum(jnp.sum(touching), 1))
        change += jnp.where(touching, jnp.abs(moved), in_contact)
    if s.contact.target_error is None:
        change += jnp.abs(s.contact.correction)
    else:
        error += s.contact.target_error[1]
    return error + contact_area_error(s.contact_indicator, change)


def _unmeasured(s: "Sliding", which: int):
    if s.measured is None:
        return jnp.zeros((), s.pressure.dtype)
    measured, touching = on_cell(s.measured, s.kernel), on_cell(_touching(s), s.kernel)
    return unmeasured_shares(measured, touching, *_displaced(s), _cell(s), s.velocity)[which]


def _extrapolated(s: "Sliding"):
    if s.measured_range is None:
        return jnp.zeros((), s.pressure.dtype)
    outside = is_unknown(wave_frequencies(_cell(s), s.velocity), s.measured_range)
    return friction_share(*_displaced(s), _cell(s), s.velocity, outside)


@shown(
    "friction", "friction_error", "hysteresis_friction", "shear_friction", "contact_area",
    "contact_area_error", "contact_area_corrected", "contact_area_smooth", "geometric_friction",
    "energy_imbalance", "slope_in_contact", "unmeasured_area", "unmeasured_friction",
    "extrapolated_friction", "contact", "caveats",
)  # fmt: skip
class Sliding(eqx.Module):
    """Friction, contact area and fields of a sliding contact.

    The contact is solved. Every other number is computed when it is read. A batch, from
    `jax.lax.map`, `jax.vmap` or a stack of leaves, has arrays of numbers. Errors and
    `energy_imbalance` have no derivative.

    **Observables:**

    - `friction`: force opposing the motion over the load [1], hysteresis and shear together; >= 0
      for passive materials, nan where a mean gap leaves no contact.
    - `friction_error`: estimated error of the friction from the solver [1], with heating also that
      of the temperatures. The error of the grid adds to it, see `geometric_friction`.
    - `hysteresis_friction`: the part of the friction that is dissipated in the block [1].
    - `shear_friction`: the part from shear in the sub-pixel contact area [1]; 0 without `shear`.
    - `contact_area`: fraction of points in contact [1]. A pixel count, without a derivative.
    - `contact_area_error`: fraction of points that the solver may have put on the wrong side [1];
      with `friction_rtol`, the error of `contact_area_smooth`.
    - `contact_area_corrected`: `contact_area` less its known excess at the edges [1].
    - `contact_area_smooth`: sub-pixel area fraction [1], for gradients.
    - `geometric_friction`: friction with hysteresis from the surface's slope instead of the block's
      [1]. Its difference from `friction` is the error of the grid.
    - `energy_imbalance`: work of hysteresis against dissipation in the block, relative [1].
    - `slope_in_contact`: rms slope of the block where it carries the load [1], the strains there.
    - `unmeasured_area`, `unmeasured_friction`: shares of the contact area and of the hysteresis on
      points that were filled or tapered, not measured [1]; 0 where `Surface.measured` is None.
    - `extrapolated_friction`: share of the hysteresis from waves that excite frequencies at which a
      material was not measured [1]: its modulus there is an extrapolation. See `coverage`.
    - `compression`: how far a body on a window moved into layers on a rigid base, over their
      thickness [1]; else 0.
    - `contact_indicator`: how far points are inside contact or outside [Pa], shape of the heights;
      see `AbstractLaw.contact_indicator`.

    On a window (`Surface(..., periodic=False)`) the errors of friction and area include the error
    of the kernel; at a given approach they also include the error of the load.
    Such a contact also has `approach`, `approach_error`, `moment` and `rim_load`; at a given
    approach also `mean_pressure_error`.

    **Fields:**

    - `contact`: pressure, gap and convergence, see `ContactSolution`; also reached directly as
      `.pressure`, `.gap`, `.displacement` [Pa, m, m], `.mean_pressure` [Pa], `.mean_gap` [m],
      `.error`, `.num_fft_pairs` and `.result`.
    - `kernel`: M of the block [m/Pa], see `stack_kernel`; on a window see `window_kernel`.
    - `heights`: h of the surface [m].
    - `measured`: share of each height that was measured [1], or None, see `Surface`.
    - `grid`, `law`: of the surface and of the contact.
    - `velocity`: of the surface over the block [m/s].
    - `measured_range`: lowest and highest ω at which all materials were measured [rad/s], or None.
    - `kernel_error`: two estimated errors of the kernel of a window [m/Pa], see
      `response/window.py`; None if periodic.
    - `shear`: shear stress [Pa] as a function of the pressure, or None.
    - `heated`: temperatures of the contact, see `HeatedContact`, or None.
    - `thickness`: of the layers between a window and a rigid base [m], else None.
    - `at_approach`: whether the approach was given, not the load. Static.
    """

    contact: ContactSolution
    kernel: Inexact[Array, "..."]
    heights: Float[Array, "..."]
    measured: Float[Array, "..."] | None
    grid: Grid
    velocity: Float[Array, "..."]
    law: AbstractLaw
    measured_range: tuple[Float[Array, "..."], Float[Array, "..."]] | None = None
    kernel_error: Inexact[Array, "..."] | None = None
    shear: ShearStress | None = None
    heated: HeatedContact | None = None
    thickness: Float[Array, "..."] | None = None
    at_approach: bool = eqx.field(default=False, static=True)

    friction = _Observable(lambda s: _hysteresis(s) + _shear(s))
    friction_error = _Observable(_friction_error, has_derivative=False)
    hysteresis_friction = _Observable(_hysteresis)
    shear_friction = _Observable(_shear)
    contact_area = _Observable(lambda s: contact_area(_touching(s)).astype(s.pressure.dtype))
    contact_area_error = _Observable(_contact_area_error, has_derivative=False)
    contact_area_corrected = _Observable(
        lambda s: contact_area_corrected(_touching(s)).astype(s.pressure.dtype)
    )
    contact_area_smooth = _Observable(lambda s: contact_area_smooth(s.contact_indicator))
    geometric_friction = _Observable(lambda s: _geometric_friction(s) + _shear(s))
    energy_imbalance = _Observable(
        lambda s: energy_imbalance(*_loaded(s), s.kernel, _cell(s), s.velocity),
        has_derivative=False,
    )
    slope_in_contact = _Observable(lambda s: slope_in_contact(*_displaced(s), _cell(s)))
    unmeasured_area = _Observable(lambda s: _unmeasured(s, 0))
    unmeasured_friction = _Observable(lambda s: _unmeasured(s, 1))
    extrapolated_friction = _Observable(_extrapolated)
    compression = _Observable(_compression)
    contact_indicator = _Observable(_indicator)

    def compute(self, *names: str) -> list[Float[Array, "..."]]:
        """Returns the observables of these names; one program computes those that are missing."""
        missing = tuple(name for name in names if name not in vars(self))
        found = _computed(self, missing) if missing else {}
        if all(map(is_concrete, found.values())):
            vars(self).update(found)
        return [found[name] if name in found else vars(self)[name] for name in names]

    def before_display(self) -> tuple[str, ...]:
        """Computes all that is shown; returns the names of what only a window shows."""
        self.compute(*OBSERVABLES)
        if self.kernel_error is None or self.error.ndim > 0:
            return ()
        if self.at_approach:
            return "mean_pressure", "mean_pressure_error", "approach", "rim_load"
        moved = ("approach", "approach_error") if jnp.isfinite(self.approach) else ()
        return (*moved, "rim_load")

    @property
    def caveats(self) -> tuple[str, ...]:
        """Warnings about these numbers, one sentence each; not under `jit`."""
        self.before_display()
        return tuple(caveat.sentence for caveat in caveats_of(self))

    @property
    def pressure(self) -> Float[Array, "*shape"]:
        return self.contact.pressure

    @property
    def gap(self) -> Float[Array, "*shape"]:
        return self.contact.gap

    @property
    def displacement(self) -> Float[Array, "*shape"]:
        return self.contact.displacement

    @property
    def mean_gap(self) -> Float[Array, ""]:
        return self.contact.mean_gap

    @property
    def mean_pressure(self) -> Float[Array, ""]:
        return self.contact.mean_pressure

    @property
    def mean_pressure_error(self) -> Float[Array, ""]:
        """The estimated error of the mean pressure at a given approach [Pa].

        It includes that of the window's kernel, which `contact.load_error` does not.
        """
        if not self.at_approach:
            raise ValueError("Only a contact at a given `approach` has a `mean_pressure_error`.")
        own = partial(error_of, lambda change: jnp.mean(self.pressure + change)[None])
        solver = own(self.mean_pressure[None], self.contact.correction, self.mean_pressure)[0]
        changes = _changes_by_kernel(self)
        return solver + sum(map(_with_chance, changes)) / self.pressure.size

    @property
    def error(self) -> Float[Array, ""]:
        return self.contact.error

    @property
    def approach(self) -> Float[Array, ""]:
        """How far a body on a window moved into the block after its first touch [m].

        Relative to the block far away; NaN if that displacement has no limit, see `solve_contact`.
        Negative if nothing touches.
        """
        if not is_window(self.kernel, self.grid.shape):
            raise ValueError("Only a body on a window has an `approach`; use `mean_gap`.")
        moved, mean = _moved(self, self.kernel, self.heights + self.gap)
        ground = self.kernel[(0,) * self.kernel.ndim] != 0
        return moved + jnp.where(ground, mean, jnp.nan) + largest(self.heights)

    @property
    def approach_error(self) -> Float[Array, ""]:
        """The estimated error of `approach` at this load, that of the kernel included [m]."""
        assert self.kernel_error is not None
        images = sum(jnp.sum(jnp.abs(_moved(self, error))) for error in self.kernel_error)
        return self.contact.gap_error * jnp.std(self.heights) + images

    @property
    def moment(self) -> Float[Array, " axes"]:
        """The moment of the pressure about the middle of a window [N m], of a line [N].

        Force times distance along each axis.
        """
        places = coordinates(self.grid)
        forces = self.pressure * jnp.prod(self.grid.spacing)
        return jnp.stack([jnp.sum(forces * (place - jnp.mean(place))) for place in places])

    @property
    def rim_load(self) -> Float[Array, "..."]:
        """The share of the load on the outermost points of a window [1]; 0 if periodic.

        NaN without a load.
        """
        rim = np.full(self.grid.shape, self.kernel_error is not None)
        rim[(slice(1, -1),) * self.grid.ndim] = False
        axes = tuple(range(-self.grid.ndim, 0))
        return jnp.sum(self.pressure, axes, where=rim) / jnp.sum(self.pressure, axes)

    @property
    def num_fft_pairs(self) -> Float[Array, ""]:
        return self.contact.num_fft_pairs

    @property
    def result(self) -> RESULTS:
        return self.contact.result


OBSERVABLES = tuple(
    name
    for name, attribute in vars(Sliding).items()
    if isinstance(attribute, _Observable) and name != "contact_indicator"
)


def with_observables(tree: Any) -> Any:
    """Returns a tree with the observables and the contact of each `Sliding` in its place."""

    def numbers(leaf):
        if not isinstance(leaf, Sliding):
            return leaf
        values = zip(OBSERVABLES, leaf.compute(*OBSERVABLES), strict=True)
        return dict(values) | {"contact": leaf.contact}

    return jax.tree.map(numbers, tree, is_leaf=lambda leaf: isinstance(leaf, Sliding))


@derivative_apart
@compiled
def _computed(sliding: Sliding, names: tuple[str, ...]) -> dict[str, Float[Array, "..."]]:
    if sliding.contact.error.ndim > 0:  # a batch
        return jax.lax.map(lambda one: _computed(one, names), sliding)
    return {name: vars(Sliding)[name].of(sliding) for name in names}
