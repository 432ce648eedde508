"""The suite runs in double precision; pyproject.toml has annotations checked at run time."""

import gc
import os
import signal
import typing

# Compiling is most of the time, and small grids need no fast programs.
os.environ.setdefault(
    "XLA_FLAGS",
    "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true"
    " --xla_cpu_parallel_codegen_split_count=1 --xla_cpu_use_fusion_emitters=false"
    " --xla_force_host_platform_device_count=4",
)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import jaxtyping
import pytest
from hypothesis import settings

# Traces make millions of objects that stay: looking for garbage among them is a tenth of the time.
gc.set_threshold(200_000, 20, 1000)
# A shell has its jobs in the background ignore Ctrl-C; tests send it to their own process.
signal.signal(signal.SIGINT, signal.default_int_handler)
settings.register_profile("same", derandomize=True, deadline=None)
settings.load_profile("same")
jax.config.update("jax_enable_x64", True)
# Programs without the lines that made them are lowered in less time.
jax.config.update("jax_traceback_in_locations_limit", 0)


@pytest.fixture(scope="session", autouse=True)
def leaves_unchecked():
    """A check of the annotation takes twenty times the time of these, called for each leaf."""
    from graded_contact.core.checks import is_concrete
    from graded_contact.materials.softening import _is_soft

    typing.no_type_check(is_concrete)
    typing.no_type_check(_is_soft)


@pytest.fixture
def unchecked_types():
    """Annotations are not checked, as outside the suite: the package's own refusals are seen."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)
