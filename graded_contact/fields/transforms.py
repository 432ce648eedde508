"""Real transforms of whole fields, on one device or several.

Over several devices (`devices.py`) rows are transformed first; then all devices exchange blocks,
once, so that each has whole columns to transform. XLA itself would gather the field on each device.
"""

from functools import partial

import jax
import jax.numpy as jnp
from jax import Array
from jax.sharding import PartitionSpec as Spec
from jaxtyping import Complex, Float

from .devices import ROWS, mesh_of, padded, whole_along


def to_spectrum(field: Float[Array, "*shape"]) -> Complex[Array, "*half"]:
    """Returns the unnormalised half spectrum Σ_x f(x) exp(-i q·x)."""
    mesh = mesh_of(field)
    if mesh is None:
        return jnp.fft.rfftn(field)
    # Rows are whole on each device: transform them first, then exchange blocks.
    rows, columns = field.shape

    @partial(jax.shard_map, mesh=mesh, in_specs=Spec(ROWS), out_specs=Spec(None, ROWS))
    def transform(block):
        half = padded(jnp.fft.rfft(block), 1, mesh.size)
        half = jax.lax.all_to_all(half, ROWS, 1, 0, tiled=True)
        return jnp.fft.fft(half[:rows], axis=0)

    # Laid by columns; what pads the field is cut off.
    return whole_along(transform(padded(field, 0, mesh.size))[:, : columns // 2 + 1], 0)


def to_field(spectrum: Complex[Array, "*half"], shape: tuple[int, ...]) -> Float[Array, "*shape"]:
    """Returns the real field of a half spectrum, the inverse of `to_spectrum`."""
    mesh = mesh_of(spectrum)
    if mesh is None:
        return jnp.fft.irfftn(spectrum, shape)

    @partial(jax.shard_map, mesh=mesh, in_specs=Spec(None, ROWS), out_specs=Spec(ROWS))
    def transform(block):
        # Columns first, as they are whole here: the reverse of `to_spectrum`.
        half = padded(jnp.fft.ifft(block, axis=0), 0, mesh.size)
        half = jax.lax.all_to_all(half, ROWS, 0, 1, tiled=True)
        return jnp.fft.irfft(half[:, : shape[-1] // 2 + 1], shape[-1])

    return whole_along(transform(padded(whole_along(spectrum, 0), 1, mesh.size))[: shape[0]], 1)
