"""What the contact solvers share: their interface, what they return, units and a penalty.

`solve_contact`, `slide` and what builds on them take any `AbstractContactSolver`, also one's own.
The contact that it finds gets its derivatives afterwards, from another solver, of linear systems
(`implicit.py`): so a contact solver is never differentiated, and need not know how that is done.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.experimental import io_callback
from jaxtyping import Array, Bool, Float, Inexact

from ..fields.grid import multiplicity, to_spectrum
from .anderson import sums
from .law import AbstractLaw

KEPT = 5  # cycles between pressures given to `keep`

# Solves the linear system of `implicit.py`, as `LinearSplitting` does: called with the kernel times
# the penalty, s and the right side, and with the keyword `rtol`, it returns τ.
LinearSolver = Callable[..., Float[Array, "*shape"]]


class Prescribed(NamedTuple):
    """What holds the bodies together: a mean pressure [Pa] or a mean gap [m]; the other is None."""

    pressure: Float[Array, ""] | None
    gap: Float[Array, ""] | None


class Iterated(eqx.Module):
    """The contact that a solver found.

    **Fields:**

    - `pressure`: of the law [Pa], shape of the heights; its mean is the prescribed one, if any.
    - `gap`: at which the law has this pressure [m].
    - `mismatch`: pressure of the solid less that of the law [Pa].
    - `displacement`: of the solid under its pressure, but for a mean [m].
    - `error`: estimated relative error of the pressure (root mean square) [1]; all other errors
      are estimated afterwards (`estimates.py`).
    - `ended`: whether before the limit of steps: at `rtol`, or where rounding hides the rest.
    - `num_steps`: on the finest grid.
    - `num_fft_pairs`: of all grids, coarse ones by their size.
    """

    pressure: Float[Array, "*shape"]
    gap: Float[Array, "*shape"]
    mismatch: Float[Array, "*shape"]
    displacement: Float[Array, "*shape"]
    error: Float[Array, ""]
    ended: Bool[Array, ""]
    num_steps: Array
    num_fft_pairs: Float[Array, ""]


class AbstractContactSolver(eqx.Module):
    """An algorithm that finds contacts, and its settings.

    **Fields:**

    - `linear`: the solver of the linear systems of derivatives. `LinearSplitting()` takes whatever
      contact was found.
    - `memory`: how many earlier iterates are kept, two fields each: what a solve will take is told
      before anything is allocated.
    - `finds_unstable`: whether equilibria may be unstable ones, under laws that attract. Where the
      grid does not resolve the attraction, the contact then ends with `RESULTS.unresolved`.
    """

    linear: eqx.AbstractVar[LinearSolver]
    memory: eqx.AbstractVar[int]
    finds_unstable: eqx.AbstractClassVar[bool]

    @abstractmethod
    def solve(
        self,
        kernel: Inexact[Array, "*half"],
        heights: Float[Array, "*shape"],
        law: AbstractLaw,
        prescribed: Prescribed,
        *,
        rtol: Float[Array, ""],
        start: Float[Array, "*shape"] | None,
    ) -> Iterated:
        """Returns the contact of heights with the solid of a kernel.

        Called once inside `jax.jit`, without derivatives. What it may not solve it refuses by
        `ValueError`; a failure that only values show is left to `error` and `ended`.

        **Arguments:**

        - `kernel`: M [m/Pa] on the half spectrum, real or complex, its entry at q = 0 being 0.
        - `heights`: h [m], positive into the solid, of any mean.
        - `law`: gives pressures point by point, see `AbstractLaw`.
        - `prescribed`: the mean pressure or the mean gap.
        - `rtol`: wanted relative error of the pressure [1].
        - `start`: a pressure [Pa] to begin from, or None.
        """


def watch_of(keep: Callable[[Array], None] | None, unit: Float[Array, ""]) -> Callable | None:
    """Returns what to call with the number of each cycle and its pressure in `unit`.

    Out of a compiled loop, it calls `keep` in Python with the pressure [Pa] of every few cycles.
    """
    if keep is None:
        return None

    def watch(cycle, pressure):
        due = cycle % KEPT == KEPT - 1
        jax.lax.cond(due, lambda: io_callback(keep, None, pressure * unit), lambda: None)

    return watch


def penalty_for(
    kernel: Inexact[Array, "*half"], participation: Float[Array, ""] | float, law: AbstractLaw
) -> Float[Array, ""]:
    """Returns ρ = 1.8 s^0.4/√(|M| at three times the lowest wavenumber × least |M|) [Pa/m].

    It balances the softest modes, which carry the displacement, against the stiffest, which carry
    the edges of the contact; s is ⟨|σ|⟩²/⟨σ²⟩. Factor and power are within
    10 % of the fewest FFT pairs of `bench_contact.py viscoelastic`. For a law that attracts, at
    least twice its steepest rise, so that its proximal map is single-valued.
    """
    long = jnp.abs(third_mode(kernel))
    # Not the root of the product, which underflows in float32.
    penalty = 1.8 * participation**0.4 / jnp.sqrt(long) / jnp.sqrt(least_compliance(kernel))
    return jax.lax.stop_gradient(jnp.maximum(penalty, 2 * law.steepest_rise))


def pressure_unit(
    kernel: Inexact[Array, "*half"], heights: Float[Array, "*shape"], prescribed: Prescribed
) -> Float[Array, ""]:
    """Returns a typical pressure: the prescribed one, and what flattens the longest waves.

    `heights` are of zero mean.
    """
    length = root_mean_square(heights) + (0 if prescribed.gap is None else jnp.abs(prescribed.gap))
    unit = length / jnp.abs(third_mode(kernel))
    unit = unit + (0 if prescribed.pressure is None else jnp.abs(prescribed.pressure))
    return jnp.where(unit > 0, unit, 1)


def third_mode(kernel: Inexact[Array, "*half"]) -> Inexact[Array, ""]:
    """Returns the kernel of the long waves: at three times the lowest wavenumber along x.

    Along y where there is but one row.
    """
    if kernel.ndim == 2 and len(kernel) == 1:
        kernel = kernel[0]
    return kernel[(3,) + (0,) * (kernel.ndim - 1)]


def least_compliance(kernel: Inexact[Array, "*half"]) -> Float[Array, ""]:
    """Returns the least |M| of any wave."""
    return jnp.min(jnp.where(first_mode(kernel.shape), jnp.inf, jnp.abs(kernel)))


def first_mode(shape: tuple[int, ...]) -> Bool[Array, "*half"]:
    """Returns where a half spectrum of this shape has its mean, as a mask.

    Setting that entry by a mask is done on the way, by an index in a pass of its own.
    """
    numbers = [jax.lax.broadcasted_iota(jnp.int32, shape, axis) for axis in range(len(shape))]
    return sum(numbers[1:], numbers[0]) == 0


def participation(pressure: Float[Array, "*shape"]) -> Float[Array, ""]:
    """Returns ⟨|σ|⟩²/⟨σ²⟩, a measure of the loaded area fraction [1], at least one point's."""
    total, squared = sums(jnp.abs(pressure), pressure**2)
    return participation_of(total, squared, pressure.size)


def participation_of(total, squared, count: int):
    """Returns the participation from sums of |σ| and σ² over `count` points."""
    return jnp.maximum(total**2 / jnp.where(squared > 0, squared, 1), 1) / count


def to_mean(pressure, mean, bounds):
    """Scales a pressure to a mean within its bounds; one without upper bound simply by a factor."""
    low, high = bounds
    room = (pressure - low) * (1 - (pressure - low) / (high - low))
    total, free = sums(pressure, room)
    # Where all points are at a bound, those above the lower one exceed theirs, or all if none is.
    above = jnp.where(total > low * pressure.size, pressure - low, 1)
    room = jnp.where(free > 0, room, above)
    return pressure + room * ((mean * pressure.size - total) / jnp.sum(room))


def slope(law: AbstractLaw, v: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Returns dy/dv of the proximal map: 1 where the law holds the gap, 0 where the pressure."""
    return jax.jvp(law.proximal, (v,), (jnp.ones_like(v),))[1]


def contact_stiffness(
    kernel: Inexact[Array, "*half"], gap: Float[Array, "*shape"], s: Float[Array, "*shape"]
) -> Float[Array, ""]:
    """Returns an upper bound of dp/dū, the change of the mean pressure with the mean gap.

    The stiffness is the least energy of all fields χ of mean 1: ⟨χ M⁻¹ χ⟩ in the solid, and
    s/(1 - s) χ² in a law of slope s. Two fields are tried, the gap and a constant. At a hard wall
    the bound is infinite in full contact.

    **Arguments:**

    - `kernel`: ρM on the half spectrum, 0 at q = 0.
    - `gap`: of the law, in units of pressure over ρ.
    - `s`: slope of the law's proximal map there.
    """
    field = jnp.abs(gap)
    springs = jnp.where(s < 1, s / jnp.where(s < 1, 1 - s, 1), jnp.inf)
    bent = bending_energy(kernel, field) + jnp.mean(jnp.where(s < 1, springs, 0) * field**2)
    squared = jnp.mean(field) ** 2
    by_gap = jnp.where(squared > 0, bent / nonzero(squared), jnp.inf)
    return jnp.minimum(by_gap, jnp.mean(springs))


def bending_energy(kernel: Inexact[Array, "*half"], field: Float[Array, "*shape"]) -> Array:
    """Returns the mean energy ⟨f M⁻¹ f⟩ of a displacement, for a kernel that is 0 at q = 0."""
    weight = jnp.asarray(multiplicity(field.shape) / field.size**2, field.dtype)
    power = jnp.abs(to_spectrum(field)) ** 2 * weight
    # Of 1/M the real part counts; losses do not hold.
    known = jnp.abs(kernel) > 0
    return jnp.sum(jnp.where(known, power * jnp.real(1 / jnp.where(known, kernel, 1)), 0))


def nonzero(number: Array) -> Array:
    """Returns a number to divide by: 1 in place of 0."""
    return jnp.where(number != 0, number, 1)


def root_mean_square(field: Float[Array, "..."]) -> Float[Array, ""]:
    """Returns √⟨f²⟩."""
    return jnp.sqrt(jnp.mean(field**2))


def in_precision(tree, dtype):
    """Returns a tree with its numbers in a real dtype, complex ones in pairs of it."""

    def convert(a):
        if not eqx.is_inexact_array(a):
            return a
        return a.astype(jnp.result_type(dtype, 1j) if jnp.iscomplexobj(a) else dtype)

    return jax.tree.map(convert, tree)
