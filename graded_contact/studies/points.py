"""Finished points on the disk, one file each, and work that Ctrl-C ends between two points.

A file is written under another name and renamed, so that a kill leaves whole files only. Its name
is a digest of all that decides its numbers. A damaged file fails the checksums of its zip archive.
"""

import contextlib
import hashlib
import os
import re
import sys
import threading
import uuid
import zipfile
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, jaxprs_in_params

Point = dict[str, np.ndarray]  # results by name, and the `message`
T = TypeVar("T")
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")


def digest(*parts: bytes | str) -> str:
    """Returns 64 hexadecimal digits that differ if any of the parts differs."""
    found = hashlib.sha256()
    for part in parts:
        part = part.encode() if isinstance(part, str) else part
        found.update(f"{len(part)}:".encode() + part)
    return found.hexdigest()


def code_of(program: ClosedJaxpr) -> str:
    """Returns a digest that differs if a traced function has other code.

    The text of a jaxpr names the arrays that it closes over without their values. Arrays of the
    functions inside count here; arrays of the program itself do not: they are its `consts`.
    """
    return digest(_ADDRESS.sub("", str(program)), *map(bytes_of, _inner_arrays(program.jaxpr)))


def _inner_arrays(jaxpr: Jaxpr) -> Iterator[Any]:
    for equation in jaxpr.eqns:
        for inner in jax.tree.leaves(equation.params):
            if isinstance(inner, ClosedJaxpr):
                yield from inner.consts
        for inner in jaxprs_in_params(equation.params):
            yield from _inner_arrays(inner)


def bytes_of(array: Any) -> bytes:
    """Returns the bytes of an array, or of a key of random numbers."""
    if jnp.issubdtype(array.dtype, jax.dtypes.prng_key):
        array = jax.random.key_data(array)
    return np.asarray(array).tobytes()


def read_point(file: Path, names: Collection[str]) -> Point | None:
    """Returns a stored point; None if there is none with these names, or if it is damaged."""
    with contextlib.suppress(Exception):  # of many kinds, from damaged files
        with zipfile.ZipFile(file) as archive:
            if archive.testzip() is not None:
                return None
        with np.load(file) as stored:
            point = dict(stored)
        if str(point["message"]).startswith("failed") or point.keys() >= {*names}:
            return point
    return None


def write_point(file: Path, point: Point) -> None:
    """Writes a point whole or not at all."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f"{uuid.uuid4().hex}.partial")
    with open(partial, "wb") as opened:
        np.savez(opened, **cast(Any, point))
    os.replace(partial, file)


def patiently(work: Callable[[threading.Event], T]) -> T:
    """Returns `work(stop)`, done in a thread. Ctrl-C sets `stop`; a second one raises at once.

    Inside compiled code `KeyboardInterrupt` would crash the process, so the main thread waits.
    """
    stop, result = threading.Event(), Future()
    # It may be set for the calling thread only.
    precision = jax.config.jax_enable_x64  # pyright: ignore[reportAttributeAccessIssue]

    def run() -> None:
        try:
            with jax.enable_x64(precision):
                result.set_result(work(stop))
        except BaseException as error:
            result.set_exception(error)

    try:
        threading.Thread(target=run, daemon=True).start()
        return result.result()
    except KeyboardInterrupt:
        stop.set()
        print("Stopping after this point; Ctrl-C again stops at once.", file=sys.stderr)
        return result.result()
