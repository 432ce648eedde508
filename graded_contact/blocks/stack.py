"""The parts of a block: layers from the loaded surface downwards, on a base."""

import dataclasses
from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ..core.checks import check_type, is_concrete, scalar, short, within
from ..core.display import shown
from ..materials.material import AbstractMaterial, Prony, material_called
from .tolerance import AbstractGradedSolver

LIQUID = (
    "is a liquid (its equilibrium modulus is 0), which flows forever under waves that stand still, "
    "such as waves across a motion. Give it an equilibrium modulus (`equilibrium`). Steady sliding "
    "in one dimension at velocities other than 0 and the mean field of a spectrum need none."
)


as_thickness = scalar("thickness", "a thickness [m] is zero (no layer) or positive", at_least=0)


def _as_profile(profile: Any) -> Any:
    if isinstance(profile, AbstractMaterial) or not callable(profile):
        raise ValueError(
            f"`profile={short(profile)}` must be called as profile(s, omega) and return (E, ν), "
            "such as `Blend(bottom, top)`."
        )
    if not isinstance(profile, eqx.Module):
        return _as_part(profile)
    # JAX traces every leaf: activation functions in the layers of a network are leaves.
    traced = all(map(eqx.is_array_like, jax.tree.leaves(profile)))
    return profile if traced else jax.tree.map(_as_part, profile)  # a scene finds its own objects


def _as_part(leaf: Any) -> Any:
    """A number or array; a function as a pytree without leaves, which JAX does not trace."""
    if eqx.is_array_like(leaf):
        return leaf
    if not callable(leaf):
        raise ValueError(
            f"`profile` has a field with {short(leaf)}, which is no number, array or function: "
            "declare the field with `eqx.field(static=True)`."
        )
    return jax.tree_util.Partial(leaf)


@shown(units=False, unset=False)
class Layer(eqx.Module):
    """A homogeneous layer.

    **Fields:**

    - `material`: the material of the layer.
    - `thickness`: d [m]. Zero means no layer.
    """

    material: AbstractMaterial = eqx.field(converter=material_called("material"))
    thickness: Float[Array, ""] = eqx.field(converter=as_thickness)


@shown(units=False, unset=False)
class GradedLayer(eqx.Module):
    """A layer whose moduli vary continuously with height.

    **Fields:**

    - `profile`: called as profile(s, omega) with heights s [1], 0 at the layer's bottom and 1 at
      its top, and ω [rad/s]; returns (E [Pa], ν [1]). `Blend`, or any module or function
      as described in `blocks/profile.py`. Only a module has parameters
      that can be differentiated; each new function is compiled anew. Functions inside a module,
      such as the activation functions of a network, are fixed.
    - `thickness`: d [m]. Zero means no layer.
    """

    profile: Any = eqx.field(converter=_as_profile)
    thickness: Float[Array, ""] = eqx.field(converter=as_thickness)


@shown(units=False)
class HalfSpace(eqx.Module):
    """A base so deep that its bottom has no effect.

    **Fields:**

    - `material`: the material of the half space.
    """

    material: AbstractMaterial = eqx.field(converter=material_called("material"))


@shown(units=False)
class Rigid(eqx.Module):
    """A rigid base, to which the lowest layer is bonded."""


@shown(units=False)
class Free(eqx.Module):
    """No base: the bottom of the lowest layer carries no traction."""


def _as_layers(layers: Any) -> tuple[Layer | GradedLayer, ...]:
    if not isinstance(layers, Sequence):
        raise ValueError(f"`layers={short(layers)}` must be a tuple of layers: `layers=(layer,)`.")
    for i, layer in enumerate(layers):
        check_type(f"layers[{i}]", layer, Layer, GradedLayer)
    return tuple(layers)


@shown(units=False)
class Stack(eqx.Module):
    """A block: layers on a base, each bonded to what lies below it.

    **Fields:**

    - `layers`: from the loaded surface downwards; may be empty on a half space.
    - `base`: below the lowest layer.
    - `graded_solver`: of the graded layers, with its tolerance, such as `Riccati()`; None means
      `Layering()`.
    """

    layers: tuple[Layer | GradedLayer, ...] = eqx.field(
        converter=_as_layers, default=(), kw_only=True
    )
    base: HalfSpace | Rigid | Free = eqx.field(kw_only=True)
    graded_solver: AbstractGradedSolver | None = eqx.field(default=None, kw_only=True)

    def __check_init__(self):
        check_type("base", self.base, HalfSpace, Rigid, Free)
        check_type("graded_solver", self.graded_solver, AbstractGradedSolver, type(None))
        if not self.layers and not isinstance(self.base, HalfSpace):
            raise ValueError(
                f"`layers` is empty on a {type(self.base).__name__} base: there is nothing to "
                "deform. Give at least one layer, or a `HalfSpace` as `base`."
            )

    def at(self, temperature: ScalarLike) -> "Stack":
        """Returns the stack with every material at another temperature [K].

        A graded layer's profile must have a method `at(temperature)`, as the ready ones do.
        """
        parts = []
        for place, part in _parts(self).items():
            with within(f"`{place}`:"):
                if isinstance(part, Layer | HalfSpace):
                    part = dataclasses.replace(part, material=part.material.at(temperature))
                elif isinstance(part, GradedLayer):
                    if not hasattr(part.profile, "at"):
                        raise ValueError(
                            f"`profile={short(part.profile)}` has no method `at(temperature)`: "
                            "the temperature of this graded layer cannot be changed."
                        )
                    part = dataclasses.replace(part, profile=part.profile.at(temperature))
                parts.append(part)
        return dataclasses.replace(self, layers=tuple(parts[:-1]), base=parts[-1])


def _parts(stack):
    """Layers and base, by the names that errors give them."""
    return {f"layers[{i}]": layer for i, layer in enumerate(stack.layers)} | {"base": stack.base}


def check_at_rest(stack: Stack) -> None:
    """Raises `ValueError` if a material is a liquid, which at rest gives way without a limit."""
    is_series = lambda node: isinstance(node, Prony)  # noqa: E731
    for path, node in jax.tree_util.tree_leaves_with_path(stack, is_leaf=is_series):
        # A traced modulus of 0 gives a kernel that is not finite, which the solve reports.
        if is_series(node) and is_concrete(node.equilibrium) and np.asarray(node.equilibrium) == 0:
            _, place, *_ = jax.tree_util.keystr(path).split(".")
            raise ValueError(f"`{place}` {LIQUID}")


def is_graded(stack: Stack) -> bool:
    """Returns whether a stack has a graded layer."""
    return any(isinstance(layer, GradedLayer) for layer in stack.layers)


def materials_of(stack: Stack) -> list[AbstractMaterial]:
    """Returns the materials of homogeneous layers, surface first, and of the base."""
    parts = (*stack.layers, stack.base)
    return [part.material for part in parts if isinstance(part, Layer | HalfSpace)]


def moduli_of(material: AbstractMaterial, omega: Array) -> tuple[Array, Array]:
    """Returns E [Pa] and ν [1] of a material."""
    return jnp.asarray(material.complex_modulus(omega)), jnp.asarray(material.poisson_ratio(omega))


def by_kind(function: Callable[[Any], tuple], things: Sequence[Any]) -> tuple[list[tuple], Any]:
    """Returns function(thing) of each thing, arrays of one kind on a first axis, and their order.

    Concatenated over the kinds, `[order]` sorts them as the things. Those of one kind are computed
    in one: a program does not grow with their number.
    """
    kinds, rows = {}, []
    for i, thing in enumerate(things):
        leaves, structure = jax.tree.flatten(thing)
        shapes = [leaf.shape if eqx.is_array(leaf) else leaf for leaf in leaves]
        kinds.setdefault((structure, *shapes), []).append(i)
    stack = lambda *leaves: jnp.stack(leaves) if eqx.is_array(leaves[0]) else leaves[0]  # noqa: E731
    for members in kinds.values():
        together = jax.tree.map(stack, *(things[i] for i in members))
        rows.append(eqx.filter_vmap(function)(together))
    return rows, np.argsort(np.concatenate([*kinds.values()]))


def moduli_of_all(materials: Sequence[AbstractMaterial], omega: Array) -> tuple[Array, Array]:
    """Returns E [Pa] and ν [1] of materials on a first axis, the others of the rank of `omega`."""
    if not materials:
        none = jnp.zeros((0, *[1] * omega.ndim), omega.dtype)
        return none, none
    rows, order = by_kind(lambda material: moduli_of(material, omega), materials)
    modulus, poisson = (concatenated(parts, omega.ndim)[order] for parts in zip(*rows, strict=True))
    return modulus, poisson


def concatenated(parts: Sequence[Array], rank: int) -> Array:
    """Returns arrays in one, along their first axis; the others, of this rank, are broadcast."""
    parts = [part.reshape(part.shape + (1,) * (1 + rank - part.ndim)) for part in parts]
    shape = jnp.broadcast_shapes(*(part.shape[1:] for part in parts))
    return jnp.concatenate([jnp.broadcast_to(part, (len(part), *shape)) for part in parts])


def interface_depths(stack: Stack) -> Float[Array, " layers"]:
    """Returns the depth of the lower face of every layer [m], the last one being the bottom.

    **Arguments:**

    - `stack`: the block.

    **Returns:** depths [m], shape `(layers,)`.
    """
    depths = list(accumulate(layer.thickness for layer in stack.layers))
    return jnp.stack(depths) if depths else jnp.zeros((0,))
