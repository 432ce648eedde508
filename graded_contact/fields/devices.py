"""Fields over several devices.

An array that lies on a mesh of devices carries it in its type, and so does all that is computed
from it, under `jit`, `vmap` and derivatives too: that is how a transform knows what to do. Fields
lie on the devices by rows (axis 0), half spectra inside compiled programs by columns. XLA parts
all pointwise operations; operations that mix rows or columns need them whole. On one
device nothing here does anything.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import AbstractMesh, Mesh, NamedSharding
from jax.sharding import PartitionSpec as Spec

from ..core.checks import is_concrete, short
from ..core.compilation import reason_of

T = TypeVar("T")
ROWS = "rows"  # the only axis of our meshes


def put_on(devices: Sequence[jax.Device], array: Array) -> Array:
    """Returns an array of which each device has a copy; results are on these devices.

    **Raises:** `ValueError` unless these are devices.
    """
    listed = isinstance(devices, Sequence | np.ndarray) and len(devices) > 0
    if not listed or not all(isinstance(device, jax.Device) for device in devices):
        raise ValueError(f"`devices={short(devices)}` must be a list such as `jax.devices()`.")
    # Small and needed everywhere, such as the size of a cell: not worth parting.
    return jax.device_put(array, NamedSharding(Mesh(np.array(devices), ROWS), Spec()))


def mesh_of(array: Array) -> AbstractMesh | None:
    """Returns the devices of an array, or None for one (or if the user distributes the work)."""
    mesh = jax.typeof(array).sharding.mesh
    return mesh if mesh.axis_names == (ROWS,) and mesh.are_all_axes_auto and mesh.size > 1 else None


def num_devices(array: Array) -> int:
    """Returns the number of devices of an array."""
    mesh = mesh_of(array)
    return 1 if mesh is None else mesh.size


def sharding_on(like: Array) -> NamedSharding | None:
    """Returns how fields are distributed over the devices of a concrete array; None for one."""
    if mesh_of(like) is None:
        return None
    # The mesh of a type is abstract; only a concrete array names its devices.
    placed = cast(NamedSharding, like.sharding)
    return NamedSharding(placed.mesh, Spec(ROWS))


def spread(field: Array, like: Array) -> Array:
    """Returns a field by rows on the devices of another array."""
    mesh = mesh_of(like)
    if mesh is None:
        return field
    # Outside `jit` a field is moved; inside, the compiler is told where it shall lie.
    if is_concrete(like):
        return jax.device_put(field, sharding_on(like))
    return jax.lax.with_sharding_constraint(field, NamedSharding(mesh, Spec(ROWS)))


def whole_along(array: Array, axis: int) -> Array:
    """Returns a field or spectrum, under `jit` with the whole axis on each device."""
    mesh = mesh_of(array)
    if mesh is None or is_concrete(array):
        return array
    # The other axis is parted, so that memory stays shared.
    over = Spec(None, ROWS) if axis % array.ndim == 0 else Spec(ROWS)
    return jax.lax.with_sharding_constraint(array, NamedSharding(mesh, over))


def binned(place: Array, spectrum: Array, num_bins: int) -> Array:
    """Returns the sum over the modes in each bin, of half spectra `place` and `spectrum`."""
    parts = num_devices(spectrum)

    def by_device(array):
        array = padded(array, -1, parts).reshape(*array.shape[:-1], parts, -1)
        return jnp.moveaxis(array, -2, 0).reshape(parts, -1)

    # Each device sums its own columns: XLA would gather them for one sum.
    count = partial(jnp.bincount, length=num_bins)
    return jnp.sum(jax.vmap(count)(by_device(place), by_device(spectrum)), axis=0)


def required(tree: T, good: Array | bool, check: Callable[[Array, Array], Array]) -> T:
    """Returns a tree, or raises unless it is `good`: at once if this is concrete, else at run time.

    `check` puts a check on a number: it fails where its second argument is true.
    """
    if is_concrete(good) and good:
        return tree
    # XLA takes what a check is put on to one device, whole: a number, by which all fields are
    # multiplied, as are then their derivatives: these fail also where only they are computed.
    try:
        one = check(jnp.asarray(1.0), jnp.logical_not(good))
    except RuntimeError as error:
        raise RuntimeError(reason_of(error)) from None
    if is_concrete(one):
        return tree
    return jax.tree.map(lambda a: a if a.dtype == bool else a * one.astype(a.dtype), tree)


def padded(array: Array, axis: int, parts: int) -> Array:
    """Returns an array with zeros at the end of an axis, so that it falls into equal parts."""
    more = -array.shape[axis] % parts
    return jnp.pad(array, [(0, more if i == axis % array.ndim else 0) for i in range(array.ndim)])
