"""Traction that moves the surface of the block, and so changes the pressure.

In gross sliding the shear stress τ acts on the block along the motion e. It moves the surface by
M_ze τ along z, so that

    w = M_zz σ + M_ze τ(σ).

Under Coulomb's law in steady sliding, w = (M_zz + f M_ze) σ: the same contact with another kernel,
whose real part must be positive. Under other laws, and where the direction changes with time, the
traction is lagged: d = M_ze τ is taken from the heights, the contact is solved, and its pressure
gives the next d. Anderson's acceleration ends this; the derivative is implicit.

In a cycle the traction has the direction in which the surface moves at each time. While the surface
rests there is none: the law is that of gross sliding.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from ..blocks.grading import AbstractGradedSolver
from ..blocks.tangential_kernel import tangential_kernels
from ..blocks.window_compliance import without_images
from ..contacts.operator import AbstractOperator, Field, Waves, first_mode
from ..contacts.solution import RESULTS, ContactSolution, ended
from ..core.checks import Numbers, is_concrete
from ..core.compilation import jit
from ..core.derivative import still
from ..core.fixed_point import attach_fixed_field, find_fixed_point
from ..fields.devices import required
from ..fields.frequency import direction_and_speed, wave_frequencies
from ..fields.grid import Grid, wavenumber
from .numerics import Numerics
from .observables import lift
from .shear import Coulomb

_LOOSER = 10  # tolerance of the traction over that of the pressure, whose noise it has


class Coupling(eqx.Module):
    """How traction moves the surface of the block.

    **Fields:**

    - `lift`: M_zi [m/Pa] of the traction along each component i.
    - `along`: M_ij [m/Pa].
    - `in_kernel`: whether the kernel of the contact contains the traction. Static.
    """

    lift: tuple[Waves, ...]
    along: tuple[tuple[Waves, ...], ...]
    in_kernel: bool = eqx.field(default=False, static=True)

    def lifted(self, operator: AbstractOperator, tractions: Sequence[Field]) -> Field:
        """Returns the displacement along z under tractions [m]."""
        waves = self._lifted([operator.to_waves(traction) for traction in tractions])
        return operator.to_field(waves, tractions[0].shape)

    def waves(
        self, operator: AbstractOperator, pressure: Field, tractions: Sequence[Field]
    ) -> tuple[list[Waves], list[Waves]]:
        """Returns the waves of pressure and tractions [Pa], and of the displacements [m].

        The displacements are those along z and along each component of the traction.
        """
        pressed, *sheared = (operator.to_waves(f) / pressure.size for f in (pressure, *tractions))
        down = operator.compliance * pressed
        if not self.in_kernel:
            down = down + self._lifted(sheared)
        moved = [
            functools.reduce(jnp.add, map(jnp.multiply, row, sheared), -lift * pressed)
            for lift, row in zip(self.lift, self.along, strict=True)
        ]
        return [pressed, *sheared], [down, *moved]

    def _lifted(self, sheared: Sequence[Waves]) -> Waves:
        return functools.reduce(jnp.add, map(jnp.multiply, self.lift, sheared))


def steady_coupling(
    case: Any, cells: Sequence[Grid], graded_solver: AbstractGradedSolver, strain: Any
) -> tuple[Coupling, Waves | None, Bool[Array, ""]]:
    """Returns the coupling of a `Case` with a velocity, errors of M_ze, and whether it is good.

    `cells` are the cell of a periodic surface, or the two of a window, which has errors.
    """
    if len(cells) == 2 and not isinstance(case.shear, Coulomb):
        raise ValueError(
            "`shear` is refused: on a window only the traction of `Coulomb` can move the surface. "
            "Pass `coupled=False`, or put the body into a periodic cell."
        )
    direction = direction_and_speed(case.velocity)[0]
    found = [
        tangential_kernels(case.stack, cell, case.velocity, direction, graded_solver, strain)
        for cell in cells
    ]
    (lift, along, good), error = found[0], None
    if len(cells) == 2:
        (far_lift, far_along, far_good), window = found[1], case.surface.grid
        lift, error = without_images(lift, far_lift, window, False)
        along, _ = without_images(along, far_along, window, False)
        good = good & far_good
    return Coupling((lift,), ((along,),), isinstance(case.shear, Coulomb)), error, good


def check_positive_kernel(kernel: Waves, cell: Grid, coefficient: Array) -> Bool[Array, ""]:
    """Returns whether Re(M_zz + f M_ze) is positive for all waves; raises `ValueError` if not.

    It raises if the numbers are known.
    """
    waves = ~first_mode(kernel.shape)
    given_way = waves & ~(kernel.real > 0) & jnp.isfinite(kernel)
    positive = ~jnp.any(given_way)
    if is_concrete(positive) and not positive:
        share = np.where(np.asarray(given_way), np.asarray(kernel.real / jnp.abs(kernel)), 1)
        q = np.asarray(wavenumber(cell)).ravel()[np.argmin(share)]
        raise ValueError(
            f"`shear` with the coefficient {float(coefficient):g} is refused: at the wavelength "
            f"{2 * np.pi / q:.3g} m the traction outweighs the stiffness of the block (the real "
            "part of M_zz + f M_zx is not positive), and sliding may have no steady state. Lower "
            "the coefficient, or pass `coupled=False`."
        )
    return positive


def _check_speeds(cycle: Any) -> None:
    """Raises `ValueError` if the kernel of steady sliding at the speed of some time is refused.

    Of a cycle that did not settle, under Coulomb's law. Its kernels have the frequencies of the
    period: the nearest takes the place of -q·v.
    """
    if not isinstance(cycle.shear.law, Coulomb):
        return
    coefficient, kernel = cycle.shear.law.coefficient, cycle.operator.kernel
    rates = cycle.motion_of_surface[0]
    last = (len(kernel) - 1) // 2
    for i in np.argsort(-np.linalg.norm(rates, axis=1)):  # the highest speed first
        turns = wave_frequencies(cycle.grid, rates[i]) * cycle.period / (2 * np.pi)
        turns = jnp.clip(jnp.round(turns), -last, last).astype(int) % len(kernel)
        turns = jnp.broadcast_to(turns, kernel.shape[1:])[None]
        along = zip(cycle.directions, cycle.coupling.lift, strict=True)
        pushed = kernel + coefficient * sum(part[i] * lift for part, lift in along)
        check_positive_kernel(jnp.take_along_axis(pushed, turns, 0)[0], cycle.grid, coefficient)


def lagged(
    solve: Callable[..., Any], result: Callable[..., Any], given: Any, numerics: Numerics,
    start: Numbers | None, solution: ContactSolution | None, none: Field,
) -> Any:  # fmt: skip
    """Returns a result of sliding under a traction that is no part of its kernel.

    **Arguments:**

    - `solve`: called as solve(given, d, start, solution); returns the result for the heights
      less d. Differentiable in `given`.
    - `result`: called as result(given, contact); returns the result with this contact.
    - `given`: what decides the contact.
    - `numerics`: tolerance of the pressure, and whether to raise.
    - `start`: a pressure, or None.
    - `solution`: the contact of an earlier solve of the same, or None.
    - `none`: a field of zeros.
    """
    fixed, tolerance = still(given), jnp.asarray(_LOOSER * numerics.rtol, none.dtype)
    pairs, settled = jnp.zeros((), none.dtype), jnp.asarray(True)
    if solution is None:

        def step(x, state):
            start, pairs = state
            found = solve(fixed, x, start, None)
            return _lift(found), (found.pressure, pairs + found.contact.num_fft_pairs)

        point = find_fixed_point(step, none, (start, pairs), tolerance, ordered=False)
        x, (start, pairs) = jax.lax.stop_gradient(point.x), point.state
        found, settled = solve(fixed, x, start, None), point.error <= tolerance
        pairs = pairs + found.contact.num_fft_pairs
    else:
        solution = still(solution)
        x = _lift(still(result(given, solution)))
        before = dataclasses.replace(solution, displacement=solution.displacement - x)
        found = solve(fixed, x, None, before)
    # Derivatives are attached only where something is traced.
    if not all(map(is_concrete, jax.tree.leaves(given))):
        contact = still(found.contact)
        image = lambda given, x: _lift(solve(given, x, None, contact))  # noqa: E731
        x = attach_fixed_field(image, given, x)
        found = solve(given, x, None, contact)
    contact = found.contact
    if numerics.throw:
        if found.is_cycle and is_concrete(settled) and not settled:
            _check_speeds(found)
        contact = required(contact, settled, RESULTS.not_settled.error_if)
    contact = ended(contact, settled, RESULTS.not_settled)
    moved = contact.displacement + x
    contact = dataclasses.replace(contact, displacement=moved, num_fft_pairs=pairs)
    return dataclasses.replace(found, contact=contact)


_lift = jit(lift)
