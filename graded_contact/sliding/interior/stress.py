"""The stress in a body under the pressure and the traction of a contact."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...blocks.stack import Stack, interface_depths
from ...core.checks import Numbers, as_float, is_concrete
from ...core.compilation import compiled
from ...core.derivative import derivative_apart, largest
from ...core.display import shown
from ...fields.frequency import wave_frequencies
from ...fields.grid import wavenumber
from ...materials.softening import softens
from ...response.compliance import surface_compliance
from ...response.downwards import Side
from ...response.stress import stress_field, von_mises
from ..bodies import BodyName
from ..case import WINDOW
from ..result import Sliding
from .heat_source import as_depths, shear_traction

_SAME = 1e-3  # relative difference of two kernels of one block, in float32 and of tables
Depths = Float[Array, " depths"]


@shown(units=False)
class ContactStress(eqx.Module):
    """The stress in a body at some depths under a contact; positive in tension.

    **Fields:**

    - `stress`: σ [Pa], shape `(depths, *grid.shape, 3, 3)`, along (x, y, z).
    - `depths`: z [m], shape `(depths,)`.
    """

    stress: Float[Array, "depths *shape 3 3"]
    depths: Float[Array, " depths"]

    @property
    def von_mises(self) -> Float[Array, "depths *shape"]:
        """The von Mises stress [Pa]."""
        return von_mises(self.stress)

    @property
    def tension(self) -> Float[Array, "depths *shape"]:
        """The largest principal stress [Pa], which opens cracks."""
        return jnp.linalg.eigvalsh(self.stress)[..., -1]

    @property
    def shear(self) -> Float[Array, "depths *shape"]:
        """The shear stress in the plane z = constant [Pa], which slides a layer off another."""
        squared = self.stress[..., 0, 2] ** 2 + self.stress[..., 1, 2] ** 2
        return jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1)), 0)


def contact_stress(
    sliding: Sliding,
    stack: Stack,
    depths: Numbers,
    *,
    side: Side = "below",
    body: BodyName = "block",
) -> ContactStress:
    """Returns the stress in a body under the pressure and the traction of a contact.

    The traction is that of the law of `shear`, coupled or not. Differentiable in the contact, in
    every leaf of `stack` and in `depths`.

    **Arguments:**

    - `sliding`: a result of `slide` on a periodic surface.
    - `stack`: the body: its block or counterface, with heating `sliding.heated.stack` or
      `.counterface`.
    - `depths`: z [m], shape `(depths,)`; 0 is the surface. See `interface_depths`.
    - `side`: the layer "above" or "below" an interface, where σ_xx, σ_yy and σ_xy jump.
    - `body`: "block" or "counterface". The z axis is into the body: that of the counterface is
      opposite.

    **Returns:** stresses, see `ContactStress`.

    **Raises:** `ValueError` for a refused argument, such as another block than that of the contact.
    """
    if WINDOW in sliding.facts:
        raise ValueError("`sliding` is on a window; a contact on a periodic surface is needed.")
    depths = as_depths(depths)
    if body == "counterface" and sliding.problem.counterface is None:
        raise ValueError('`body="counterface"` is refused: the contact has a rigid counterface.')
    _check_body(sliding, stack, body)
    return ContactStress(_stress_apart(sliding, stack, depths, side, body), depths)


def _check_body(sliding: Sliding, stack: Stack, body: BodyName) -> None:
    """Raises `ValueError` unless two waves have the kernel of the contact; not if traced."""
    problem, q = sliding.problem, wavenumber(sliding.grid)
    counterface = problem.counterface if body == "counterface" else None
    operator, coupling = problem.block, sliding.coupling
    if counterface is not None:
        operator, coupling = counterface.operator, counterface.coupling
    kernel = operator.kernel
    # In a contact, a block that softens may have another strain in each wave.
    if softens(stack) or not all(map(is_concrete, jax.tree.leaves((sliding, stack)))):
        return
    modes = np.unique([1, max(1, min(sliding.grid.shape) // 4)])
    modes = (modes[2 * modes < min(sliding.grid.shape)],) * sliding.grid.ndim
    shear: Any = sliding.shear  # with a coupling there is one
    if coupling is not None and coupling.in_kernel:
        sign = 1 if counterface is None else -1
        kernel = kernel - sign * shear.law.coefficient * coupling.lift[0]
    velocity = _velocity(sliding, body)
    omega = jnp.broadcast_to(wave_frequencies(sliding.grid, velocity), q.shape)[modes]
    own = surface_compliance(stack, q[modes], omega)
    if not np.allclose(own, kernel[modes], rtol=_SAME, atol=0):
        raise ValueError(
            f"`stack` is refused: the contact has another {body}. Pass the stack that `slide` "
            "took, with heating `sliding.heated.stack` (or `.counterface`), and of the counterface "
            '`body="counterface"`.'
        )


def _velocity(sliding: Sliding, body: BodyName) -> Array:
    """The velocity of the surface over a body [m/s]."""
    return sliding.velocity if body == "block" else jnp.zeros_like(sliding.velocity)


@compiled
def _stress(sliding: Sliding, stack: Stack, depths: Array, side: Side, body: BodyName):
    traction = shear_traction(sliding)
    if body == "counterface" and traction is not None:
        traction = -traction
    how = {"side": side, "traction": traction}
    grid, pressure, velocity = sliding.grid, sliding.pressure, _velocity(sliding, body)
    at = lambda z: stress_field(stack, grid, pressure, z, velocity, **how).stress  # noqa: E731
    return jax.lax.map(at, depths)


_stress_apart = derivative_apart(_stress)


STRESSES = ("tension", "von_mises", "interface_shear")


def largest_stress(
    name: str, found: Sliding, stack: Stack, depths: Sequence[float] | None = None
) -> tuple[Array, Array]:
    """Returns the largest stress [Pa] in a block under a contact, and its depth [m].

    **Arguments:**

    - `name`: of `STRESSES`.
    - `found`, `stack`: the contact, and its block.
    - `depths`: z [m]; None for the surface, three depths in each layer, and all interfaces. The
      shear between layers is always at interfaces.
    """
    faces = interface_depths(stack)
    if name == "interface_shear":
        name, above, below = "shear", faces, faces[:0]
    elif depths is not None:
        above = below = as_float(depths, "depths")
    else:
        whole = jnp.diff(faces, prepend=0.0)
        above = jnp.ravel(faces - jnp.array([[0.75], [0.5], [0.0]]) * whole)
        deep = faces[: None if hasattr(stack.base, "material") else -1]  # else nothing is below
        below = jnp.append(0.0, deep)
    sides: tuple[tuple[Depths, Side], ...] = (above, "above"), (below, "below")
    values = [_at_depths(found, stack, name, at, side) for at, side in sides if at.size]
    values = jnp.concatenate(values)
    return jnp.max(values), jnp.append(above, below)[jnp.argmax(values)]


@compiled
def _at_depths(found: Sliding, stack: Stack, name: str, depths: Depths, side: Side) -> Depths:
    # One depth after another, also in the derivative: the stresses of all would fill the memory.
    of = lambda z: getattr(contact_stress(found, stack, z[None], side=side), name)  # noqa: E731
    return jax.lax.map(jax.checkpoint(lambda z: largest(of(z))), depths)
