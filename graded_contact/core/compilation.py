"""Programs that compile in less time.

XLA's older generator of CPU code, at its second level of optimisation, takes half the time that the
defaults take (`bench_contact.py first`). The code was as fast within the scatter of a busy
machine. Such options belong to a whole program: inside the `jit` of a user the user sets them.
"""

import functools
import logging
import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

import equinox as eqx
import jax

from .checks import is_concrete

F = TypeVar("F", bound=Callable[..., Any])

COMPILING = "compiling (first run only)"
LESS_WORK = {
    "xla_cpu_use_fusion_emitters": False,  # the older generator
    "xla_backend_optimization_level": 2,  # of 3
    "xla_cpu_parallel_codegen_split_count": 4,  # parts of a program, each with work of its own
}


def jit(function: F) -> F:
    """Compiles a function in less time than `jax.jit`: half of it for large programs on a CPU.

    For example `gc.jit(jax.value_and_grad(lambda stack: gc.slide(stack, ...).friction))`. Inside
    another `jit`, or under `vmap` and `grad`, it is `eqx.filter_jit`.

    **Arguments:**

    - `function`: of any arguments. Arrays are traced, also those inside stacks and other objects.
      All else is fixed, and the function is compiled again for another value: pass numbers that
      vary as arrays.

    **Returns:** the compiled function. What it returns may contain texts and other objects, too.
    """
    within = eqx.filter_jit(function)
    # The options take time: when called.
    outside = functools.cache(lambda: cast(Any, eqx.filter_jit)(function, **_options()))

    @functools.wraps(function)
    def run(*args, **kwargs):
        if not alone((args, kwargs)):
            return within(*args, **kwargs)
        try:
            return outside()(*args, **kwargs)
        except RuntimeError as error:  # the cause, without the frames of Equinox and JAX around it
            cause = str(error).rpartition("EquinoxRuntimeError: ")[2].partition("\n\n---")[0]
            raise (RuntimeError(cause) if cause != str(error) else error) from None

    return cast(F, run)


def alone(arguments: Any) -> bool:
    """Returns whether a function of these arguments runs outside `jit` and all transformations."""
    # Inside `jit` known arguments are traced, too, as a number that depends on none.
    return all(map(is_concrete, jax.tree.leaves(arguments))) and is_concrete(_probe())


_probe = jax.jit(lambda: 0)


@functools.cache
def _options() -> dict[str, dict[str, bool | int]]:
    """The options that are not set in the environment, if this XLA knows them; of `jax.jit`."""
    logging.getLogger("graded_contact").info(COMPILING)
    keep_small_programs()
    flags = os.environ.get("XLA_FLAGS", "")
    options = {name: value for name, value in LESS_WORK.items() if name not in flags}
    # A small program tells whether this XLA knows them: names of options come and go.
    try:
        jax.jit(lambda: 0, compiler_options=options)()
    except jax.errors.JaxRuntimeError:
        return {}
    return {"compiler_options": options}


def keep_small_programs() -> None:
    """Makes JAX store all programs if a folder for them is set, unless the environment decides.

    JAX leaves out those that compile in less than a second: a solve has dozens of them.
    """
    name = "jax_persistent_cache_min_compile_time_secs"
    if jax.config.values["jax_compilation_cache_dir"] and name.upper() not in os.environ:
        jax.config.update(name, 0)


def one_by_one(function: F) -> F:
    """Returns a function of arrays and others whose batch under `vmap` is computed one by one.

    On a CPU. In a batch each loop runs until its slowest member ends, and both branches of a
    condition are computed.
    """

    def run(*args):
        if jax.default_backend() != "cpu":
            return function(*args)
        arrays, others = eqx.partition(args, eqx.is_array)
        whole = lambda arrays: function(*eqx.combine(arrays, others))  # noqa: E731
        one, closed = jax.closure_convert(whole, arrays)
        return jax.custom_batching.sequential_vmap(one)(arrays, *closed)

    return cast(F, run)
