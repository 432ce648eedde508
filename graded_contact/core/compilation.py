"""Programs that compile in less time.

XLA's older generator of CPU code, at its second level of optimisation, takes half the time that the
defaults take (`bench_contact.py first`). The code was as fast within the scatter of a busy
machine. At level 0 it takes half of that again; a contact then takes 1.1 (32²), 1.4 (64²) or 2.1
times (128²) as long: at 64² the first 300 contacts gain. What is computed once, without a loop,
has level 0 up to 256²: a contact takes 1.1 times, its errors 1.35 times as long, and the first 130
contacts gain. Such options belong to a whole program: inside the `jit` of a user the user sets
them.
"""

import functools
import logging
import os
import warnings
from collections.abc import Callable, Iterable
from typing import Any, TypeVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import ShapedArray
from jax.extend.core import Jaxpr, Primitive, jaxprs_in_params
from jax.interpreters import mlir
from jax.sharding import get_abstract_mesh, use_abstract_mesh

from .checks import is_concrete, knowing

F = TypeVar("F", bound=Callable[..., Any])

COMPILING = "compiling (first run only)"
LESS_WORK = {
    "xla_cpu_use_fusion_emitters": False,  # the older generator
    "xla_cpu_parallel_codegen_split_count": 4,  # parts of a program, each with work of its own
    # Else independent parts of a program wait side by side, each with its fields.
    "xla_cpu_scheduler_type": "CPU_SCHEDULER_TYPE_MEMORY_OPTIMIZED",
}
_LEVEL = "xla_backend_optimization_level"
_OF_SMALL, _OF_LARGE = 0, 2  # of 3
# A program is small if nearly all of its operations return at most this many elements (64² points,
# or as many waves), and if it is short: the mean of these, each times the turns of known loops.
_SMALL, _NEARLY_ALL, _SHORT = 4500, 0.95, 20_000
# And so is one without loops up to this many elements (256² points).
_WITHOUT_LOOPS = 70_000


def jit(function: F) -> F:
    """Compiles a function in less time than `jax.jit`: half of it for large programs on a CPU.

    For example `gc.jit(jax.value_and_grad(lambda stack: gc.slide(stack, ...).friction))`. Inside
    another `jit`, or under `vmap` and `grad`, it is `eqx.filter_jit`. Arguments that are refused
    are refused before anything is compiled.

    A program of contacts of up to 64² points, without long loops, is not optimised. For many
    thousand of them, set `XLA_FLAGS=--xla_backend_optimization_level=2` in the environment.

    **Arguments:**

    - `function`: of any arguments. Arrays are traced, also those inside stacks and other objects.
      All else is fixed, plain numbers too, and the function is compiled again for another value
      (with a warning): pass numbers that vary as arrays, by `jnp.asarray`.

    **Returns:** the compiled function. What it returns may contain texts and other objects, too.
    """
    return _compiled(function, True)


def compiled(function: F) -> F:
    """Returns `jit` for functions of the package, whose arguments may be results that are NaN."""
    return _compiled(function, False)


def _compiled(function: F, checks: bool) -> F:
    """The compiled function; `checks` see the numbers with which it is compiled."""
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
                    if checks:
                        _warn_of_numbers(key, programs)
                    programs[key] = _program(function, arrays, others, checks)
                numbers, rest = jax.block_until_ready(programs[key](arrays))
        except (RuntimeError, ValueError) as error:  # the cause, without the frames around it
            cause = str(error).rpartition("EquinoxRuntimeError: ")[2].partition("\n\n\n---")[0]
            raise (RuntimeError(cause) if cause != str(error) else error) from None
        return eqx.combine(numbers, rest.value)

    return cast(F, run)


def _warn_of_numbers(key: tuple, before: Iterable[tuple]) -> None:
    """Warns if a program differs from one `before` by plain numbers alone."""

    def others(key):
        return [float if isinstance(part, float) else part for part in key]

    if any(others(key) == others(one) for one in before):
        numbers = ", ".join(f"{part:g}" for part in key if isinstance(part, float))
        warnings.warn(
            f"`gc.jit` compiles again for the plain numbers {numbers}. Pass numbers that vary as "
            "arrays: `jnp.asarray(...)`.",
            stacklevel=3,
        )


class _Fixed(eqx.Module):
    """What a program returns besides arrays."""

    value: Any = eqx.field(static=True)


def _program(function: Callable, arrays: Any, others: Any, checks: bool) -> Callable:
    """The compiled function of arrays, with these other arguments, by the sizes in its trace."""
    known = jax.tree.leaves(arrays) if checks else []

    def traced(inputs):
        args, kwargs = eqx.combine(inputs, others)
        with knowing(jax.tree.leaves(inputs), known):
            numbers, rest = eqx.partition(function(*args, **kwargs), eqx.is_array)
        return numbers, _Fixed(rest)

    functools.update_wrapper(traced, function)
    del traced.__wrapped__  # whose arguments JAX would look for
    trace = jax.jit(traced).trace(arrays)
    known.clear()  # of the first call
    return jax.jit(traced, compiler_options=options_for(trace.jaxpr.jaxpr))


def options_for(program: Jaxpr) -> dict[str, Any]:
    """Returns the options with which a program compiles in less time."""
    options, (sizes, runs) = _options(), np.reshape(_sizes(program), (-1, 2)).T
    most = np.quantile(sizes, _NEARLY_ALL) if sizes.size else 0
    small = most <= _SMALL and np.sum(sizes * runs) <= _SHORT * sizes.size
    small = small or (most <= _WITHOUT_LOOPS and not _has_loops(program))
    return options | {_LEVEL: _OF_SMALL} if small and _LEVEL in options else options


def _has_loops(program: Jaxpr) -> bool:
    return any(
        operation.primitive.name in ("scan", "while")
        or any(map(_has_loops, jaxprs_in_params(operation.params)))
        for operation in program.eqns
    )


def _sizes(program: Jaxpr, known: dict[int, list] | None = None) -> list[tuple[int, int]]:
    """Elements of what each operation of a program returns, and how often it runs, if known."""
    known = {} if known is None else known  # many operations share a program inside
    if id(program) in known:
        return known[id(program)]
    sizes = known[id(program)] = []
    for operation in program.eqns:
        inner = list(jaxprs_in_params(operation.params))
        turns = operation.params["length"] if operation.primitive.name == "scan" else 1
        for part in inner:
            sizes += [(size, runs * turns) for size, runs in _sizes(part, known)]
        if not inner:  # what loops stack is made of what their bodies return
            sizes += [(getattr(result.aval, "size", 0), 1) for result in operation.outvars]
    return sizes


def alone(arguments: Any) -> bool:
    """Returns whether a function of these arguments runs outside `jit` and all transformations."""
    return all(map(is_concrete, jax.tree.leaves(arguments))) and outside_jit()


def outside_jit() -> bool:
    """Returns whether no `jit` traces this call; a derivative or `vmap` may."""
    return is_concrete(_probe_p.bind())


# Depends on no number: inside `jit` it is traced, and so are known arguments.
_probe_p = Primitive("probe")
_probe_p.def_impl(lambda: np.zeros((), bool))
_probe_p.def_abstract_eval(lambda: ShapedArray((), np.dtype(bool)))
_of_probe = mlir.lower_fun(lambda: jnp.zeros((), bool), multiple_results=False)
mlir.register_lowering(_probe_p, _of_probe)


@functools.cache
def _options() -> dict[str, Any]:
    """Options of `jax.jit` that this XLA knows and the environment does not set."""
    logging.getLogger("graded_contact").info(COMPILING)
    keep_small_programs()
    # A failure has its exception: no traceback of JAX beside it.
    told = logging.getLogger("jax._src.callback")
    told.addFilter(lambda record: "callback failed" not in record.getMessage())
    flags = os.environ.get("XLA_FLAGS", "")
    usual = LESS_WORK | {_LEVEL: _OF_LARGE}
    return {name: v for name, v in usual.items() if name not in flags and _is_known({name: v})}


def _is_known(option: dict[str, Any]) -> bool:
    """Whether this XLA knows an option: their names come and go."""
    try:
        jax.jit(lambda: 0, compiler_options=option)()
    except jax.errors.JaxRuntimeError:
        return False
    return True


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
