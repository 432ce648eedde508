"""The suite runs in double precision, with annotations checked at run time."""

import atexit
import functools
import gc
import os
import shutil
import signal
import tempfile
from importlib.metadata import version

# Compiling is most of the suite's time; optimising is a third of that, fusing loops half of the
# rest, and cutting programs into parts for threads a tenth. What serves only the speed of programs,
# XLA's checks of itself, and lines of Python inside of programs are a tenth of what is left. Set
# XLA_FLAGS to have them. XLA ends the process at a flag that it no longer knows.
os.environ.setdefault(
    "XLA_FLAGS",
    "--xla_backend_optimization_level=0 --xla_cpu_parallel_codegen_split_count=1"
    + " --xla_cpu_use_fusion_emitters=false --xla_cpu_enable_concurrency_optimized_scheduler=false"
    " --xla_disable_hlo_passes=hlo-verifier --xla_cpu_emitter_verification_level=0"
    " --xla_llvm_disable_expensive_passes=true --xla_llvm_enable_alias_scope_metadata=false"
    " --xla_llvm_enable_noalias_metadata=false --xla_llvm_enable_invariant_load_metadata=false"
    * version("jaxlib").startswith("0.10."),
)
os.environ.setdefault("JAX_TRACEBACK_IN_LOCATIONS_LIMIT", "0")
# Threads of small matrices mostly wait, and burn the processor while they do.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Processes of commands share what they compile, apart from the folder of a user; workers do, too.
if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    folder = os.environ["JAX_COMPILATION_CACHE_DIR"] = tempfile.mkdtemp(prefix="compiled-")
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.3"
    atexit.register(shutil.rmtree, folder, ignore_errors=True)

import jax
import jaxtyping
import pytest
from _pytest import runner
from hypothesis import settings
from jaxtyping import install_import_hook

# Traces make millions of objects that stay: looking for garbage among them is a tenth of the time.
gc.set_threshold(200_000, 20, 1000)

# A shell tells jobs in its background to ignore Ctrl-C; tests of it send it to their own process.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples for everyone; HYPOTHESIS_PROFILE=search looks for new ones.
settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("search", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))

jax.config.update("jax_enable_x64", True)
# A test hardly ever finds a program of another one.
jax.config.update("jax_enable_compilation_cache", False)
# JAX makes a compiler's context for each program, and keeps it: a third of the time of a small
# program, and 1 MB. All programs share one.
if version("jax").startswith("0.10."):
    from jax._src.interpreters import mlir

    mlir.make_ir_context = functools.cache(mlir.make_ir_context)
own_jaxtyped = jaxtyping.jaxtyped


def jaxtyped(*, typechecker):
    """As that of jaxtyping, but a function without annotations, which has nothing to check, stays.

    It would be checked in each call, and a function inside another one is made anew in each call.
    """
    decorate = own_jaxtyped(typechecker=typechecker)
    return lambda made: made if getattr(made, "__annotations__", None) == {} else decorate(made)


jaxtyping.jaxtyped = jaxtyped
# Stays on: modules imported later are checked too.
install_import_hook("graded_contact", "typecheck.check")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    return runner.pytest_runtest_protocol(item, nextitem)


# Python takes memory for frames in pieces. A call that begins a piece gives it back at its end,
# and a loop of such calls does little else. A large frame below leaves room for all others.
pytest_runtest_protocol.__code__ = pytest_runtest_protocol.__code__.replace(co_stacksize=270_000)


@pytest.fixture
def unchecked_types():
    """Annotations are not checked, as outside the suite: the package's own refusals are seen."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


def pytest_sessionfinish():
    """pytest looks for garbage five times at its end: not among what is kept until then."""
    gc.collect()
    gc.freeze()


LONGEST = [
    "cli", "run_scene", "friction_table", "history", "cycle", "resolution", "run_design", "window",
    "once", "page", "problem", "sliding", "persson", "bond", "master", "grading", "adhesion",
    "plot", "motion", "heat", "prony", "adjoint", "matrix", "material", "bodies", "traction",
    "history_bodies", "surface", "stress_limits", "interior", "compliance", "sweep", "seal",
    "costs", "area", "observables", "stochastic", "failed", "shear", "fuzz", "doors",
]  # fmt: skip


def pytest_collection_modifyitems(items):
    """The longest files come first: files stay on one worker, and none shall wait at the end."""
    place = {name: i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem[5:], len(place)))
