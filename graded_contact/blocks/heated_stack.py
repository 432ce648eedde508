"""A block whose temperature varies with depth."""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..materials.material import Elastic
from .stack import HalfSpace, Layer, Stack, is_graded


def check_heated(name: str, stack: Stack) -> None:
    """Raises `ValueError` for a body whose layers cannot be cut."""
    if is_graded(stack):
        raise ValueError(
            f"`{name}` has a graded layer: `heating` needs layers of one material each."
        )


def heated(stack: Stack, temperature: Array, rises: Array, edges: Array) -> Stack:
    """Returns a block in thin layers, each at its temperature.

    **Arguments:**

    - `stack`: the block, without graded layers.
    - `temperature`: of the block below the last edge [K].
    - `rises`: above `temperature` between two edges each [K], shape `(cells,)`.
    - `edges`: depths from 0 [m], shape `(cells + 1,)`.
    """
    layers, top = [], jnp.zeros((), edges.dtype)

    def cut(material, bottom):
        """Layers of a material down to `bottom`; those that lie elsewhere have no thickness."""
        # No temperature changes it: one layer is enough.
        if isinstance(material, Elastic):
            return []
        materials = jax.vmap(material.at)(temperature + rises)
        thickness = jnp.diff(jnp.clip(edges, top, bottom))
        return [
            Layer(jax.tree.map(lambda leaf, i=i: leaf[i], materials), thickness[i])
            for i in range(len(rises))
        ]

    for layer in stack.layers:
        assert isinstance(layer, Layer)
        bottom = top + layer.thickness
        thin = cut(layer.material, bottom)
        rest = bottom - jnp.maximum(top, edges[-1]) if thin else layer.thickness
        layers += [*thin, Layer(layer.material.at(temperature), jnp.maximum(rest, 0))]
        top = bottom
    base = stack.base
    if isinstance(base, HalfSpace):
        layers += cut(base.material, jnp.maximum(top, edges[-1]))
        base = HalfSpace(base.material.at(temperature))
    return dataclasses.replace(stack, layers=tuple(layers), base=base)
