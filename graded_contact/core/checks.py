"""Conversion to strongly typed arrays and refusal of bad input at the public boundary.

Checks of values look at concrete arrays. Under `jit`, `vmap` or `grad` the values are unknown and
the check passes (shapes are always checked).
"""

import contextlib
import difflib
import functools
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jaxtyping import ArrayLike, Float, Inexact

from .display import short

# What users call the classes that annotations name.
_WORDS = {
    "int": "a whole number", "float": "a plain number", "bool": "True or False",
    "str": "a text", "NoneType": "None",
}  # fmt: skip

F = TypeVar("F", bound=Callable[..., Any])

# What public functions take: a number, an array of numbers, or (nested) lists of them.
Numbers = ArrayLike | Sequence[Any]


def as_float(value: Any, name: str = "value") -> Float[Array, "..."]:
    """Returns `value` as a strongly typed real floating-point array.

    Floating-point arrays keep their dtype; Python numbers and integers take JAX's default
    (float32, or float64 with `jax_enable_x64`). What holds no real numbers is refused by `name`.
    """
    array = as_numbers(value, name)
    if jnp.issubdtype(array.dtype, jnp.complexfloating):
        raise ValueError(f"`{name}={short(value)}` is refused: a real number is needed.")
    return array


def as_numbers(value: Any, name: str) -> Inexact[Array, "..."]:
    """Returns `value`, real or complex, as `as_float` does."""
    if isinstance(value, Array) and jnp.issubdtype(value.dtype, jnp.inexact):
        return value.astype(value.dtype) if value.weak_type else value
    needed = "a number or a (rectangular) array of numbers is needed"
    try:
        if value is None or isinstance(value, str | bytes | bool | np.bool_):
            raise TypeError
        if any(isinstance(leaf, Array) for leaf in jax.tree.leaves(value)):
            array = jnp.asarray(value)
        else:
            value = np.asarray(value)
            # Of whole numbers JAX keeps the last 32 or 64 bits.
            value = value.astype(float) if value.dtype.kind in "iuO" else value
            array = jax.device_put(value)  # `asarray` compiles a program for each shape
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"`{name}={short(value)}` is refused: {needed}.") from None
    if not (jnp.issubdtype(array.dtype, jnp.number) or array.dtype == bool):
        raise ValueError(f"`{name}` has dtype {array.dtype} and is refused: {needed}.")
    dtype = array.dtype if jnp.issubdtype(array.dtype, jnp.inexact) else jnp.result_type(float)
    return jnp.asarray(array, dtype=dtype)


def as_scalar(value: Any, name: str) -> Float[Array, ""]:
    """Returns one real number as an array of shape `()`, or raises `ValueError` naming `name`.

    An array in its place would be broadcast against wavenumbers or frequencies: other physics.
    """
    array = as_float(value, name)
    if array.shape != ():
        raise ValueError(
            f"`{name}` has shape {array.shape}; one number is needed. For many, use `jax.vmap`."
        )
    return array


def in_precision(tree, dtype):
    """Returns a tree with its numbers in a real dtype, complex ones in pairs of it."""

    def convert(a):
        if not eqx.is_inexact_array(a):
            return a
        kind = jnp.result_type(dtype, 1j) if jnp.iscomplexobj(a) else dtype
        return a if a.dtype == kind else a.astype(kind)

    return jax.tree.map(convert, tree)


def numbers(name: str) -> Callable[[Any], Float[Array, "..."]]:
    """Returns the converter of a field that holds an array of real numbers."""
    return functools.partial(as_float, name=name)


def scalar(
    name: str, allowed: str = "it must be finite", **limits: float
) -> Callable[[Any], Float[Array, ""]]:
    """Returns the converter of a field that holds one number, with limits as in `check_values`."""

    def convert(value: Any) -> Array:
        number = as_scalar(value, name)
        check_values(name, number, allowed, **limits)
        return number

    return convert


def positive(
    name: str, unit: str, convert: Callable[..., Array] = as_scalar
) -> Callable[[Any], Array]:
    """Returns the converter of a field that holds one positive number, or with `as_float` many."""

    def checked(value: Any) -> Array:
        number = convert(value, name)
        check_positive(name, number, unit)
        return number

    return checked


def optional(convert: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Returns the converter of a field that may be None."""
    return lambda value: None if value is None else convert(value)


def instance(name: str, kind: type, words: str) -> Callable[[Any], Any]:
    """Returns the converter of a field that holds an object of one class, in `words`."""

    def convert(value: Any) -> Any:
        if not isinstance(value, kind):
            raise ValueError(f"`{name}={short(value)}` must be {words}.")
        return value

    return convert


def is_concrete(value: Any) -> bool:
    """Returns whether the numbers in `value` are known now (not being traced)."""
    return not isinstance(value, Tracer)


def check_type(name: str, value: Any, *kinds: Any) -> None:
    """Raises `ValueError` unless `value` is of one of the classes, or is one of the literals."""
    if any(_is_of(value, kind) for kind in kinds):
        return
    names = (kind.__name__ if isinstance(kind, type) else repr(kind) for kind in kinds)
    words = " or ".join(_WORDS.get(name, name.removeprefix("Abstract")) for name in names)
    raise ValueError(f"`{name}={short(value)}` must be {words}.")


def _is_of(value: Any, kind: Any) -> bool:
    if not isinstance(kind, type):
        return isinstance(value, type(kind)) and value == kind
    if kind is int:
        return isinstance(value, int | np.integer) and not isinstance(value, bool)
    if kind is float:
        # Python's whole numbers have no limit, and one beyond the largest float has no float.
        if isinstance(value, int):
            return not isinstance(value, bool) and abs(value) <= sys.float_info.max
        return isinstance(value, float | np.number | np.ndarray | Array) and np.ndim(value) == 0
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    return isinstance(value, kind)


Limit = float | None


def check_values(
    name: str, value: ArrayLike, allowed: str, *,
    above: Limit = None, at_least: Limit = None, at_most: Limit = None,
) -> None:  # fmt: skip
    """Raises `ValueError` naming `name`, the first refused entry and what is `allowed`.

    NaN and infinities are always refused.
    """
    if not is_concrete(value):
        return
    for array, corner in _shards(value):
        if array.dtype == object:  # whole numbers beyond 64 bits
            array = array.astype(float)
        if array.dtype.kind in "SU":
            raise ValueError(f"`{name}={short(array.tolist())}` is refused: {allowed}.")
        good = np.isfinite(array)
        # NaN fails every comparison, and is refused without limits, too.
        good &= True if above is None else array > above
        good &= True if at_least is None else array >= at_least
        good &= True if at_most is None else array <= at_most
        if not np.all(good):
            index = tuple(int(i) for i in np.argwhere(~good)[0])
            place = ", ".join(str(i + start) for i, start in zip(index, corner, strict=True))
            where = f"[{place}]" if index else ""
            raise ValueError(f"`{name}{where}={array[index]:g}` is refused: {allowed}.")


def _shards(value: ArrayLike):
    """An array and the index at which it starts: one, or what lies on devices of this process."""
    if not isinstance(value, Array) or value.is_fully_replicated:
        array = np.asarray(value)
        return [(array, (0,) * array.ndim)]
    return [
        (np.asarray(shard.data), [rows.start or 0 for rows in shard.index])
        for shard in value.addressable_shards
    ]


def check_positive(name: str, value: ArrayLike, unit: str) -> None:
    """Raises `ValueError` unless every entry of `value` is finite and greater than zero.

    Numbers too small for all digits of their dtype are refused too: compiled code takes them for 0.
    """
    kind = getattr(value, "dtype", np.float64)
    kind = kind if np.issubdtype(kind, np.floating) else np.float64
    least = float(np.finfo(kind).tiny)
    check_values(name, value, f"it must be a positive number {unit}", at_least=least)


def check_rows(least: int, **arrays: Array) -> None:
    """Raises `ValueError` unless these are one-dimensional, of equal length, at least `least`."""
    first, *others = (array.shape for array in arrays.values())
    if any(shape != first for shape in others) or len(first) != 1 or first[0] < least:
        text = " and ".join(f"`{name}` {array.shape}" for name, array in arrays.items())
        raise ValueError(
            f"{text.replace('` ', '` has shape ', 1)}; one-dimensional arrays of equal length, at "
            f"least {least}, are needed."
        )


def check_ascending(least: int, **columns: Array) -> None:
    """Raises `ValueError` unless these are rows as in `check_rows`, and the first one ascends."""
    check_rows(least, **columns)
    name, first = next(iter(columns.items()))
    if is_concrete(first):
        entries = np.asarray(first)  # inside `jit` JAX would trace even known arrays
        falling = np.flatnonzero(np.diff(entries) <= 0) + 1
        if len(falling):
            i = falling[0]
            raise ValueError(
                f"`{name}[{i}]={entries[i]:g}` is refused: entries must be strictly increasing."
            )


def as_poisson(value: Any) -> Float[Array, ""]:
    """Returns Poisson's ratio ν; raises `ValueError` unless -1 < ν <= 1/2, as of stable solids."""
    poisson = as_scalar(value, "poisson")
    allowed = "Poisson's ratio must be greater than -1 and at most 0.5"
    check_values("poisson", poisson, allowed, above=-1, at_most=0.5)
    return poisson


def check_shape(name: str, value: Array, shape: tuple[int, ...]) -> None:
    """Raises `ValueError` unless `value` has exactly this shape."""
    if value.shape != shape:
        raise ValueError(f"`{name}` has shape {value.shape}; the shape must be {shape}.")


def check_whole(name: str, value: Any, least: int) -> None:
    """Raises `ValueError` unless `value` is a whole number of at least `least`, in 32 bits."""
    if not _is_of(value, int) or not least <= value < 2**31:
        raise ValueError(
            f"`{name}={short(value)}` must be a whole number, at least {least} and below 2^31."
        )


def check_tolerance(name: str, rtol: float, like: Any, *, floor_factor: float = 100.0) -> None:
    """Raises `ValueError` if the dtype of `like` cannot reach the relative tolerance `rtol`."""
    # A traced tolerance has no value that a check could see.
    if not (_is_of(rtol, float) and is_concrete(rtol) and 0 < rtol < 1):
        raise ValueError(
            f"`{name}={short(rtol)}` is refused: a plain number between 0 and 1 is needed, which "
            "`jit`, `grad` and `vmap` do not trace."
        )
    floor = floor_factor * float(jnp.finfo(like.dtype).eps)
    if rtol < floor:
        more = "call `jax.config.update('jax_enable_x64', True)` before creating arrays, or "
        raise ValueError(
            f"`{name}={rtol:g}` cannot be reached in {like.dtype} (the floor is {floor:.2g}): "
            f"{more if like.dtype == jnp.float32 else ''}pass a larger `{name}`."
        )


@contextlib.contextmanager
def within(place: str) -> Iterator[None]:
    """Puts a place, of a scene or a block, before the message of an error that arises there."""
    try:
        yield
    except (FileNotFoundError, ValueError) as error:
        text = str(error)
        kind = ValueError if isinstance(error, ValueError) else FileNotFoundError
        raise kind(text if text.startswith(place) else f"{place} {text}") from error


def nearest(word: Any, choices: Iterable[str]) -> str:
    """Returns a hint for a word that is not in `choices`."""
    choices = list(choices)
    close = difflib.get_close_matches(str(word), choices, n=1)
    if close:
        return f"did you mean `{close[0]}`?"
    return f"it takes {', '.join(f'`{choice}`' for choice in choices) or 'nothing'}."
