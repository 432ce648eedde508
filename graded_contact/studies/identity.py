"""What a function computes, told by its program: the same in any process, whatever it is called."""

import re
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .store import fingerprint

_ADDRESS = re.compile(r" at 0x[0-9a-f]+")


def identity(function: Callable, *arguments: Any) -> str:
    """Returns 64 hexadecimal digits that differ if the function computes anything else.

    They tell its JAX program (https://docs.jax.dev/en/latest/jaxpr.html), in which each number that
    it closes over counts bit for bit. A library that changes the program changes them as well.
    What Python does in a callback they do not see.

    **Arguments:**

    - `function`: one that JAX can trace.
    - `arguments`: as it takes them; only their shapes and dtypes count.

    **Raises:** what JAX raises for a function that it cannot trace.
    """
    program = jax.make_jaxpr(function)(*arguments)
    return fingerprint(_ADDRESS.sub("", str(program)), *_numbers(program))


def _numbers(program: Any) -> Iterator[np.ndarray]:
    """The numbers that a program and those inside it close over, which their text abridges."""
    for value in getattr(program, "consts", ()):
        if jnp.issubdtype(value.dtype, jax.dtypes.prng_key):
            value = jax.random.key_data(value)
        yield np.asarray(value)
    for equation in program.eqns:
        for inner in jax.tree.leaves(equation.params):
            if hasattr(inner, "eqns"):
                yield from _numbers(inner)
