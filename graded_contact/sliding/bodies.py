"""Two bodies: traction and the counterface move their surfaces, beside the pressure on the block.

The counterface carries the rough surface and moves with it. The pressure σ moves its surface into
the counterface, away from the block, so that the gap opens by both,

    u = ū + w + w_c - h,

and the traction acts on it as on the block, in the opposite direction. Seen from the counterface,
with z into it, both are pressure and traction on an ordinary block: w_c = M_zz σ - M_zi τ_i. Two
equal bodies without frequencies do not move along z under their traction, as Dundurs's constant β =
0.

The waves of the counterface are at rest under the surface: under steady sliding M is taken at
ω = 0, real and even. In a cycle the pressure under the surface varies with time, and M is taken at
the frequencies of the period, without the phases of the motion. It is not diagonal in the waves of
the block: the kernel of the contact then contains the middle of its values, a real number for each
q, and the rest lags (`isothermal.py`). No value is further from the middle than the middle is
large, so that the loop contracts.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..blocks.stack import Stack
from ..contacts.operators.operator import AbstractOperator, Field
from ..contacts.operators.space_time import SpaceTime
from ..core.display import shown
from ..fields.grid import Waves, resample_spectrum

OF_COUNTERFACE = "counterface."  # begins the paths of its numbers, beside a block's


@shown(unset=False)
class TwoBodies(NamedTuple):
    """The block, and the counterface or None if it is rigid; values by paths are in both.

    Paths of the counterface begin with `OF_COUNTERFACE`, of the block with nothing, see
    `in_both`.
    """

    stack: Stack
    counterface: Stack | None

    def at(self, temperature: ScalarLike) -> "TwoBodies":
        """Returns both bodies at another temperature [K]."""
        return TwoBodies(*(body and body.at(temperature) for body in self))  # pyright: ignore


def in_both(path: str) -> str:
    """Returns the path in `TwoBodies` of a number of the block or of the counterface."""
    return path if path.startswith(OF_COUNTERFACE) else f"stack.{path}"


class Coupling(eqx.Module):
    """How traction moves the surface of a body: not at all by default.

    **Fields:**

    - `lift`: M_zi [m/Pa] of the traction along each component i.
    - `along`: M_ij [m/Pa].
    - `in_kernel`: whether the kernel of the body contains the traction. Static.
    """

    lift: tuple[Waves, ...] = ()
    along: tuple[tuple[Waves, ...], ...] = ()
    in_kernel: bool = eqx.field(default=False, static=True)

    @property
    def lags(self) -> bool:
        """Whether a traction that is no part of the kernel moves the surface."""
        return bool(self.lift) and not self.in_kernel

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
        if self.lags:
            down = down + self._lifted(sheared)
        moved = [
            functools.reduce(jnp.add, map(jnp.multiply, row, sheared), -lift * pressed)
            for lift, row in zip(self.lift, self.along, strict=True)
        ]
        return [pressed, *sheared], [down, *moved]

    def _lifted(self, sheared: Sequence[Waves]) -> Waves:
        return functools.reduce(jnp.add, map(jnp.multiply, self.lift, sheared))


class Counterface(eqx.Module):
    """How the counterface deforms, in waves at rest under the surface; z counts into the
    counterface.

    **Fields:**

    - `operator`: M_zz, in a cycle over its frequencies; with `coupling.in_kernel` it contains the
      traction.
    - `in_kernel`: the part of M that the kernel of the contact contains [m/Pa].
    - `coupling`: how the traction on the counterface moves its surface.
    - `lags`: whether `in_kernel` is not all of M. Static.
    """

    operator: AbstractOperator
    in_kernel: Waves
    coupling: Coupling = Coupling()
    lags: bool = eqx.field(default=False, static=True)

    def beside(self, block: SpaceTime) -> SpaceTime:
        """Returns the operator of the contact from the operator of the block."""
        return dataclasses.replace(block, kernel=block.kernel + self.in_kernel)

    def displace(self, pressure: Field, tractions: Sequence[Field]) -> Field:
        """Returns w_c [m] under the pressure and the tractions on the counterface."""
        moved = self.operator.displace(pressure)
        if self.coupling.lags:
            moved = moved + self.coupling.lifted(self.operator, tractions)
        return moved

    def beyond_kernel(self, pressure: Field, tractions: Sequence[Field]) -> Float[Array, "..."]:
        """Returns the part of w_c [m] that the kernel of the contact lacks; 0 if there is none."""
        rest = jnp.zeros((), pressure.dtype)
        if self.lags:
            lacking = self.operator.compliance - self.in_kernel
            rest = self.operator.filtered(lacking, pressure)
        if self.coupling.lags:
            rest = rest + self.coupling.lifted(self.operator, tractions)
        return rest

    def on(
        self, operator: AbstractOperator, old: tuple[int, ...], new: tuple[int, ...]
    ) -> "Counterface":
        """Returns the counterface on another cell, with the waves that both resolve.

        `operator` has the kernel of the counterface there; `old` and `new` are the shapes of the
        cells.
        """
        axes = self.in_kernel.ndim
        kept = resample_spectrum(self.in_kernel, old[-axes:], new[-axes:])
        coupling = coupling_on(self.coupling, old, new)
        return Counterface(operator, kept, coupling, self.lags)


def of_block(both: AbstractOperator, counterface: Counterface | None) -> AbstractOperator:
    """Returns the operator of the block from the operator of the contact."""
    return both if counterface is None else both.with_kernel(both.kernel - counterface.in_kernel)


def middle_of(kernel: Inexact[Array, "nt *half"]) -> Float[Array, "*half"]:
    """Returns the middle of the real parts of the first axis."""
    return (jnp.max(kernel.real, axis=0) + jnp.min(kernel.real, axis=0)) / 2


def coupling_on(coupling: Coupling, old: tuple[int, ...], new: tuple[int, ...]) -> Coupling:
    """Returns a coupling on another cell, with the waves that both resolve."""
    return jax.tree.map(lambda waves: resample_spectrum(waves, old, new), coupling)
