"""Real transforms of whole fields: XLA's, on a CPU with many points those of ducc0.

Inside a loop XLA's transform runs on one thread; ducc0 (M. Reinecke), bound by jaxbind, uses all
cores there, and is faster on one. Both packages are the optional extra `fast-cpu`; where they are
installed, fields of `BOUND_FROM` points or more on a CPU go through them. Smaller fields gain
nothing, and programs with bound functions are not stored by JAX's persistent compilation cache.

Over several devices (see `_devices`) rows are transformed first; then all devices exchange blocks,
once, so that each has whole columns to transform. XLA itself would gather the field on each device.
"""

import importlib.util
import math
from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import PartitionSpec as Spec
from jaxtyping import Complex, Float

from .devices import ROWS, mesh_of, padded, whole_along

BOUND_FROM = 2**19  # points, by `bench_contact.py overhead --backends xla ducc0`


def rfftn(field: Float[Array, "*shape"]) -> Complex[Array, "*half"]:
    """Returns the unnormalised half spectrum of a real field over all its axes."""
    mesh = mesh_of(field)
    if mesh is None:
        if not _is_bound(field.shape):
            return jnp.fft.rfftn(field)
        return _bound()[0](field, size=field.shape[-1])[0]
    # Rows are whole on each device: transform them first, then exchange blocks.
    rows, columns = field.shape

    @partial(jax.shard_map, mesh=mesh, in_specs=Spec(ROWS), out_specs=Spec(None, ROWS))
    def transform(block):
        half = padded(jnp.fft.rfft(block), 1, mesh.size)
        half = jax.lax.all_to_all(half, ROWS, 1, 0, tiled=True)
        return jnp.fft.fft(half[:rows], axis=0)

    # Laid by columns; what pads the field is cut off.
    return whole_along(transform(padded(field, 0, mesh.size))[:, : columns // 2 + 1], 0)


def irfftn(spectrum: Complex[Array, "*half"], shape: tuple[int, ...]) -> Float[Array, "*shape"]:
    """Returns the real field of a half spectrum, divided by the number of points."""
    mesh = mesh_of(spectrum)
    if mesh is None:
        if not _is_bound(shape):
            return jnp.fft.irfftn(spectrum, shape)
        return _bound()[1](spectrum, size=shape[-1])[0]

    @partial(jax.shard_map, mesh=mesh, in_specs=Spec(None, ROWS), out_specs=Spec(ROWS))
    def transform(block):
        # Columns first, as they are whole here: the reverse of `rfftn`.
        half = padded(jnp.fft.ifft(block, axis=0), 0, mesh.size)
        half = jax.lax.all_to_all(half, ROWS, 0, 1, tiled=True)
        return jnp.fft.irfft(half[:, : shape[-1] // 2 + 1], shape[-1])

    return whole_along(transform(padded(whole_along(spectrum, 0), 1, mesh.size))[: shape[0]], 1)


def _is_bound(shape: tuple[int, ...]) -> bool:
    """Whether fields of this shape go through ducc0."""
    # On a GPU XLA's transforms are those of the vendor.
    return math.prod(shape) >= BOUND_FROM and _is_installed() and jax.default_backend() == "cpu"


@cache
def _is_installed() -> bool:
    return all(importlib.util.find_spec(name) is not None for name in ("jaxbind", "ducc0"))


@cache
def _bound():
    """The two transforms as JAX primitives, linear and each with its transpose."""
    import ducc0  # pyright: ignore[reportMissingImports]
    from jaxbind import get_linear_call, load_kwargs  # pyright: ignore[reportMissingImports]

    def axes_of(ndim, batch_axes):
        batched = batch_axes[0] if batch_axes else ()
        return [axis for axis in range(ndim) if axis not in batched]

    def weights(array, axes, size):
        """How often each entry of a half spectrum occurs in the full one, broadcastable."""
        column = np.arange(size // 2 + 1)
        twice = np.where((column == 0) | (2 * column == size), 1.0, 2.0).astype(array.real.dtype)
        return twice.reshape([-1 if axis == axes[-1] else 1 for axis in range(array.ndim)])

    def run(transform, out, args, dumped):
        options = load_kwargs(dumped)
        axes = axes_of(args[0].ndim, options["batch_axes"])
        transform(args[0], out[0], axes, options["size"])

    def forward(field, out, axes, size):
        ducc0.fft.r2c(field, axes=axes, out=out, nthreads=0)

    def forward_transposed(spectrum, out, axes, size):
        # A half spectrum counts most modes once that the full one has twice.
        spectrum = np.conj(spectrum) / weights(spectrum, axes, size)
        ducc0.fft.c2r(spectrum, axes=axes, lastsize=size, forward=False, out=out, nthreads=0)

    def inverse(spectrum, out, axes, size):
        ducc0.fft.c2r(
            spectrum, axes=axes, lastsize=size, forward=False, inorm=2, out=out, nthreads=0
        )

    def inverse_transposed(field, out, axes, size):
        ducc0.fft.r2c(field, axes=axes, inorm=2, out=out, nthreads=0)
        np.conj(out, out=out)
        np.multiply(out, weights(out, axes, size), out=out)

    def shaped(to_half: bool):
        def abstract(array, size, batch_axes=None):
            last = axes_of(array.ndim, batch_axes)[-1]
            shape = list(array.shape)
            shape[last] = size // 2 + 1 if to_half else size
            unit = np.ones((), array.dtype)
            dtype = (unit + 0j).dtype if to_half else unit.real.dtype
            batched = batch_axes[0][-1] if batch_axes and batch_axes[0] else ()
            return ((tuple(shape), dtype, batched),)

        return abstract

    half, full = shaped(to_half=True), shaped(to_half=False)
    ways = ((forward, forward_transposed, half, full), (inverse, inverse_transposed, full, half))
    return tuple(
        get_linear_call(partial(run, f), partial(run, g), of, back, func_can_batch=True)
        for f, g, of, back in ways
    )
