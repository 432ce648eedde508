"""The stress in the block under the pressure and the traction of a contact."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...blocks.stack import interface_depths
from ...core.checks import Numbers, as_float, check_rows
from ...core.compilation import compiled
from ...core.derivative import derivative_apart, largest, root_or_zero
from ...core.display import shown
from ...response.downwards import Side
from ...response.stress import checked_depth, stress_field, von_mises
from ..case import WINDOW
from ..result import Sliding
from .heat_source import shear_traction

Depths = Float[Array, " depths"]


@shown(units=False)
class ContactStress(eqx.Module):
    """The stress in the block at some depths under a contact; positive in tension.

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
        return root_or_zero(squared)


def contact_stress(sliding: Sliding, depths: Numbers, *, side: Side = "below") -> ContactStress:
    """Returns the stress in the block under the pressure and the traction of a contact.

    The traction follows the law of `shear`, coupled or not. Differentiable in the contact, with
    the block that it keeps, and in `depths`. For the stress in the counterface, which rests under
    the surface, pass it to `response.stress.stress_field` with the opposite traction.

    **Arguments:**

    - `sliding`: a result of `slide` on a periodic surface.
    - `depths`: z [m], shape `(depths,)`; 0 is the surface. See `interface_depths`.
    - `side`: the layer "above" or "below" an interface, where σ_xx, σ_yy and σ_xy jump.

    **Returns:** stresses, see `ContactStress`.

    **Raises:** `ValueError` for a refused argument.
    """
    if WINDOW in sliding.facts:
        raise ValueError("`sliding` is on a non-periodic surface; a periodic one is needed.")
    depths = as_float(depths, "depths")
    check_rows(1, depths=depths)
    depths = checked_depth("depths", sliding.bodies[0], depths)
    return ContactStress(_stress(sliding, depths, side), depths)


@derivative_apart
@compiled
def _stress(sliding: Sliding, depths: Array, side: Side):
    given, traction = (sliding.bodies[0], sliding.grid, sliding.pressure), shear_traction(sliding)
    at = lambda z: stress_field(*given, z, sliding.velocity, traction, side).stress  # noqa: E731
    return jax.lax.map(at, depths)


STRESSES = ("tension", "von_mises", "interface_shear")


def largest_stress(name: str, found: Sliding) -> tuple[Array, Array]:
    """Returns the largest stress [Pa] in a block under a contact, and its depth [m].

    Of the surface, three depths in each layer, and both sides of all interfaces. The shear between
    layers is at interfaces.

    **Arguments:**

    - `name`: of `STRESSES`.
    - `found`: the contact.
    """
    stack = found.bodies[0]
    faces = interface_depths(stack)
    if name == "interface_shear":
        name, above, below = "shear", faces, faces[:0]
    else:
        whole = jnp.diff(faces, prepend=0.0)
        above = jnp.ravel(faces - jnp.array([[0.75], [0.5], [0.0]]) * whole)
        deep = faces[: None if hasattr(stack.base, "material") else -1]  # else nothing is below
        below = jnp.append(0.0, deep)
    sides: tuple[tuple[Depths, Side], ...] = (above, "above"), (below, "below")
    values = [_at_depths(found, name, at, side) for at, side in sides if at.size]
    values = jnp.concatenate(values)
    return jnp.max(values), jnp.append(above, below)[jnp.argmax(values)]


@compiled
def _at_depths(found: Sliding, name: str, depths: Depths, side: Side) -> Depths:
    # One depth after another, also in the derivative: the stresses of all would fill the memory.
    of = lambda z: getattr(contact_stress(found, z[None], side=side), name)  # noqa: E731
    return jax.lax.map(jax.checkpoint(lambda z: largest(of(z))), depths)
