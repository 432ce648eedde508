"""Programs that compile in less time.

XLA's older generator of CPU code, at its second level of optimisation, takes half the time that the
defaults take (`bench_contact.py first`). At level 0 it takes half of that again. A contact then
takes 1.1 (32²), 1.4 (64²) or 2.1 times (128²) as long, and a program without loops 1.35 times up to
256². Such options belong to a whole program: inside the `jit` of a user the user sets them.
"""

import functools
import logging
import os
import threading
from collections.abc import Callable
from typing import Any, TypeVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax.sharding import get_abstract_mesh, use_abstract_mesh
from threadpoolctl import ThreadpoolController

from .checks import is_concrete

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

LESS_WORK = {
    "xla_cpu_use_fusion_emitters": False,  # the older generator
    "xla_cpu_parallel_codegen_split_count": 4,  # parts of a program, each with work of its own
    # Else independent parts of a program wait side by side, each with its fields.
    "xla_cpu_scheduler_type": "CPU_SCHEDULER_TYPE_MEMORY_OPTIMIZED",
}
_LEVEL = "xla_backend_optimization_level"
# Numbers of the largest array given or returned, up to which level 0 pays: 64² points, or 256²
# without loops.
WITH_LOOPS, WITHOUT_LOOPS = 4500, 70_000


def jit(function: F, small: int = WITH_LOOPS) -> F:
    """Compiles a function in less time than `jax.jit`: half of it for large programs on a CPU.

    For example `gc.jit(jax.value_and_grad(lambda stack: gc.slide(stack, ...).friction))`. Inside
    another `jit`, or under `vmap` and `grad`, it is `eqx.filter_jit`.

    **Arguments:**

    - `function`: of any arguments. Arrays are traced, also those inside stacks and other objects.
      All else is fixed, plain numbers too, and the function is compiled again for another value:
      pass numbers that vary as arrays, by `jnp.asarray`.
    - `small`: points of the largest array that it is given, closes over or returns, up to which the
      program is not optimised: it compiles in half the time, and takes about 1.4 times as long.

    **Returns:** the compiled function. What it returns may contain texts and other objects, too.
    """
    within, programs = eqx.filter_jit(function), {}

    @functools.wraps(function)
    def run(*args, **kwargs):
        if not alone((args, kwargs)):
            return within(*args, **kwargs)
        arrays, others = eqx.partition((args, kwargs), eqx.is_array)
        fixed, tree = jax.tree.flatten(others)
        key = (tree, *fixed, *(np.shape(array) for array in jax.tree.leaves(arrays)))
        try:
            # Derivatives set this mesh, and JAX would compile a program for it, too.
            with use_abstract_mesh(get_abstract_mesh()):
                if key not in programs:
                    programs[key] = _program(function, arrays, others, small)
                with one_thread_of_lapack:
                    numbers, rest = jax.block_until_ready(programs[key](arrays))
        except (RuntimeError, ValueError) as error:
            reason = reason_of(error)
            raise (RuntimeError(reason) if reason != str(error) else error) from None
        return eqx.combine(numbers, rest.value)

    return cast(F, run)


def reason_of(error: Exception) -> str:
    """Returns why a program failed, without the frames around it."""
    return str(error).rpartition("EquinoxRuntimeError: ")[2].partition("\n\n\n---")[0]


compiled_loop = jit
compiled = functools.partial(jit, small=WITHOUT_LOOPS)


class _OneThread:
    """Limits LAPACK to one thread while any program runs, and restores its limit afterwards.

    Its threads wait for one another by turning: beside other processes small systems, as in
    Newton steps, take ten times as long.
    """

    def __init__(self):
        self._lock, self._programs, self._limit = threading.Lock(), 0, None

    def __enter__(self):
        with self._lock:
            self._programs += 1
            if self._programs == 1:
                self._limit = _lapack().limit(limits=1)

    def __exit__(self, *_):
        with self._lock:
            self._programs -= 1
            if self._programs == 0 and self._limit is not None:
                self._limit.restore_original_limits()


one_thread_of_lapack = _OneThread()


@functools.cache
def _lapack() -> ThreadpoolController:
    scipy.linalg.lapack.dgesv  # noqa: B018 (loads the library that JAX calls)
    return ThreadpoolController().select(user_api="blas")


class _Fixed(eqx.Module):
    """A result of a program that is no array."""

    value: Any = eqx.field(static=True)


def _program(function: Callable, arrays: Any, others: Any, small: int) -> Callable:
    """The compiled function of arrays, with these other arguments."""

    def traced(inputs):
        args, kwargs = eqx.combine(inputs, others)
        numbers, rest = eqx.partition(function(*args, **kwargs), eqx.is_array)
        return numbers, _Fixed(rest)

    functools.update_wrapper(traced, function)
    del traced.__wrapped__  # whose arguments JAX would look for
    trace = jax.jit(traced).trace(arrays).jaxpr
    largest = max((aval.size for aval in (*trace.in_avals, *trace.out_avals)), default=1)
    largest = max([largest, *map(np.size, trace.consts)])
    return jax.jit(traced, compiler_options=options(0 if largest <= small else 2))


def alone(arguments: Any) -> bool:
    """Returns whether a function of these arguments runs outside `jit` and all transformations."""
    # Inside `jit` constants are traced, too.
    return all(map(is_concrete, [*jax.tree.leaves(arguments), jnp.zeros((), bool)]))


@functools.cache
def options(level: int) -> dict[str, Any]:
    """Options of `jax.jit` that this XLA knows and the environment does not set."""
    keep_small_programs()
    flags, usual = os.environ.get("XLA_FLAGS", ""), LESS_WORK | {_LEVEL: level}
    free = {name: value for name, value in usual.items() if name not in flags}
    return free if _are_known(free) else {n: v for n, v in free.items() if _are_known({n: v})}


def _are_known(chosen: dict[str, Any]) -> bool:
    """Whether this XLA knows all these options: their names come and go."""
    try:
        jax.jit(lambda: 0, compiler_options=chosen)()
    except jax.errors.JaxRuntimeError:
        return False
    return True


def varying(state: T) -> T:
    """Returns the state of a loop, under `jax.shard_map` marked as different on each device.

    So is all that steps return if any of their numbers is, and JAX asks for it at the start, too.
    """
    axes = get_abstract_mesh().manual_axes
    if not axes:
        return state
    here = sum(jax.lax.axis_index(axis) for axis in axes)
    return jax.tree.map(lambda leaf: jnp.where(here >= 0, leaf, leaf), state)


@functools.cache
def say_compiling(what: str) -> None:
    """Prints to the standard error, once, that this compiles for long."""
    logging.getLogger("graded_contact").warning("compiling %s (first call only)", what)


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
