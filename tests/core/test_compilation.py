"""Programs that compile in less time outside `jit`."""

import logging
import os
import subprocess
import sys
from collections import Counter

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.core import checks, compilation
from graded_contact.core.compilation import COMPILING, compiled, jit, one_by_one
from graded_contact.core.derivative import derivative_apart, still
from graded_contact.core.fixed_point import attach_fixed_point

X = jnp.array([0.3, -1.2])


@jit
def squares(x, *, sign=1):
    return sign * jnp.sum(x**2)


def test_results_are_the_same_outside_jit_inside_it_and_under_derivatives():
    expected = -float(np.sum(np.square(X)))
    for found in (
        squares(X, sign=-1),
        jax.jit(lambda x: squares(x, sign=-1))(X),
        jax.jit(lambda unit: unit * squares(X, sign=-1))(1.0),  # known, and yet traced
        jax.vmap(lambda x: squares(x, sign=-1))(X[None])[0],
    ):
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    np.testing.assert_allclose(jax.grad(squares)(X), 2 * X)
    np.testing.assert_allclose(jax.jacfwd(squares)(X), 2 * X)


@pytest.fixture
def afresh():
    compilation._options.cache_clear()
    yield
    compilation._options.cache_clear()


def test_options_of_the_environment_stay_and_the_log_says_once_that_it_compiles(
    afresh, monkeypatch, caplog
):
    monkeypatch.setenv("XLA_FLAGS", "--xla_backend_optimization_level=3")
    with caplog.at_level(logging.INFO, "graded_contact"):
        options = compilation._options()
        compilation._options()
    assert caplog.text.count(COMPILING) == 1
    assert "xla_backend_optimization_level" not in options


STORED_FROM = "jax_persistent_cache_min_compile_time_secs"
SMALL = """
import jax, graded_contact as gc
gc.jit(lambda x: x + 1)(1.0)
"""


def test_a_folder_for_programs_alone_is_enough(tmp_path):
    own = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    own["JAX_COMPILATION_CACHE_DIR"] = str(tmp_path)
    subprocess.run([sys.executable, "-c", SMALL], env=own, check=True)
    assert [*tmp_path.iterdir()]


def test_a_limit_of_the_environment_to_what_is_stored_stays(monkeypatch):
    name, before = STORED_FROM, jax.config.values[STORED_FROM]
    monkeypatch.setenv(name.upper(), "1000")
    try:
        jax.config.update(name, 1000)
        compilation.keep_small_programs()
        assert jax.config.values[name] == 1000
    finally:
        jax.config.update(name, before)


def test_an_xla_without_an_option_takes_the_others(afresh, monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr(compilation, "LESS_WORK", {"xla_of_another_time": True})
    assert compilation._options() == {"xla_backend_optimization_level": 2}


def test_a_batch_is_computed_one_by_one():
    """The steps of each member are its own; what the function closes over may belong to a batch."""

    def halved(x, offset):
        @one_by_one
        def run(x, name):
            def body(state):
                x, steps = state
                return x / 2, steps + 1

            return {name: jax.lax.while_loop(lambda s: s[0] > offset, body, (x, 0))}

        return run(x, "halved")["halved"]

    ends, steps = jax.jit(jax.vmap(halved))(jnp.array([1.0, 8.0]), jnp.array([0.3, 1.0]))
    np.testing.assert_array_equal(ends, [0.25, 1.0])
    np.testing.assert_array_equal(steps, [2, 3])
    loops = str(jax.make_jaxpr(jax.vmap(halved))(jnp.ones(2), jnp.ones(2)))
    assert "scan[" in loops and "while[" in loops


@pytest.fixture
def programs():
    """How often each program was compiled, by the name of its function."""
    found, listening = Counter(), True

    def count(event, _, fun_name="", **__):
        if listening and event.endswith("backend_compile_duration"):
            found[fun_name] += 1

    jax.monitoring.register_event_duration_secs_listener(count)
    yield found
    listening = False


def test_a_contact_and_its_derivative_compile_each_program_once(programs):
    grid = gc.Grid((90,), 1e-3)
    heights = 1e-6 * jnp.cos(2 * jnp.pi * jnp.arange(90) / 90)
    kernel = gc.stack_kernel(gc.Stack(base=gc.HalfSpace(gc.Elastic(1e6, 0.5))), grid, 0.0)

    def gap(pressure):
        return gc.solve_contact(kernel, heights, pressure).mean_gap

    gap(1e3)
    once = {"jit(_begin)", "jit(_output)", "jit(_solution)"}
    assert {name: programs[name] for name in once} == dict.fromkeys(once, 1)
    jax.grad(gap)(1e3)
    assert programs["jit(back)"] == 1
    before = programs.total()
    jax.grad(gap)(2e3)
    assert programs.total() == before


def test_a_derivative_by_rows_and_one_inside_a_rule_compile_no_program_again(programs):
    """Rows of a Jacobian are computed one by one; inside a rule JAX traces constants, too."""

    @compiled
    def shrunk(x, rate):
        return jnp.sin(rate * x) / 2

    apart = derivative_apart(shrunk)
    x, rate = jnp.linspace(0.1, 0.2, 3), jnp.asarray(0.5)
    rows = jax.jacrev(apart)(x, rate)
    np.testing.assert_allclose(rows, np.diag(np.cos(rate * x) * rate / 2), rtol=1e-12)
    assert programs["jit(shrunk)"] == programs["jit(back)"] == 1
    total = lambda x: jnp.sum(apart(x, rate))  # noqa: E731
    second = np.diag(-np.sin(rate * x) * rate**2 / 2)
    for outer in (jax.jacfwd, jax.jacrev):
        for inner in (jax.jacfwd, jax.jacrev):
            np.testing.assert_allclose(outer(inner(total))(x), second, rtol=1e-12)
    # All of them with the options.
    assert programs["jit(_varied_along)"] and programs["jit(_varied_back)"]
    before = programs["jit(shrunk)"]

    def reached(rate):
        image = lambda rate, x: apart(x, rate) + jnp.asarray(np.float64(0.1))  # noqa: E731
        at = x
        for _ in range(60):
            at = image(still(rate), at)
        return jnp.sum(attach_fixed_point(image, rate, at))

    step = 1e-5
    expected = (reached(rate + step) - reached(rate - step)) / (2 * step)
    np.testing.assert_allclose(jax.grad(reached)(rate), expected, rtol=1e-8)
    assert programs["jit(shrunk)"] == before


def test_programs_hold_few_fields_at_once():
    """Parts that do not depend on each other are computed in turn."""

    def parts(field):
        waves = jnp.fft.rfft2(field)
        found = [jnp.fft.irfft2(waves * k) ** 2 for k in range(1, 9)]
        return jnp.stack([jnp.sum(field * part) for part in found])

    field = jnp.ones((128, 128))
    side_by_side = {"xla_cpu_scheduler_type": "CPU_SCHEDULER_TYPE_CONCURRENCY_OPTIMIZED"}
    program = jax.jit(parts).trace(field)
    ours, usual = (
        program.lower().compile(options).memory_analysis().temp_size_in_bytes
        for options in (compilation.options_for(program.jaxpr.jaxpr), side_by_side)
    )
    assert ours < 4 * field.nbytes < 8 * field.nbytes < usual


def test_a_program_that_fails_says_why_and_nothing_else():
    checked = gc.jit(lambda x: eqx.error_if(x, jnp.isnan(x), "no such load"))
    assert checked(jnp.asarray(1.0)) == 1
    with pytest.raises(RuntimeError) as failed:
        checked(jnp.asarray(jnp.nan))
    assert str(failed.value) == "no such load" and failed.value.__suppress_context__


def test_arguments_are_refused_before_anything_is_compiled(programs):
    """Numbers behind arguments are seen in derivatives too, and only in the call that compiles."""
    modulus = gc.jit(jax.value_and_grad(lambda E: 2 * gc.Elastic(E, 0.5).young))
    for weak in (True, False):
        bad = jnp.asarray(-1.0) if weak else jnp.full((), -1.0)
        with pytest.raises(ValueError, match="modulus=-1` is refused"):
            modulus(bad)
    assert not programs["<lambda>"]
    assert modulus(jnp.asarray(1.0))[0] == 2
    assert modulus(jnp.asarray(-1.0))[0] == -2  # nothing is known any more
    assert not checks._known


def test_programs_of_small_arrays_are_not_optimised(monkeypatch):
    """Stacks of small arrays count as their members, operations of loops as often as they run.

    Without loops larger arrays are small, too.
    """
    levels = []
    compiled = jax.jit

    def watch(function, **options):
        levels.append(options.get("compiler_options", {}).get("xla_backend_optimization_level"))
        return compiled(function, **options)

    options = {"xla_backend_optimization_level": 2}
    monkeypatch.setattr(compilation, "_options", lambda: options)
    monkeypatch.setattr(jax, "jit", watch)
    many = jnp.ones((4, 64, 64))
    gc.jit(lambda x: x + 1)(many[0])
    gc.jit(lambda x: x + 1)(many)
    gc.jit(lambda x: x + 1)(jnp.ones((300, 300)))
    gc.jit(lambda x: jax.lax.while_loop(lambda y: y[0, 0] < 9, lambda y: y + 1, x))(
        jnp.ones((100, 100))
    )
    gc.jit(lambda x: jax.lax.map(jnp.sin, x))(many)
    gc.jit(lambda x: jax.lax.scan(lambda y, _: (jnp.sin(y), None), x, length=100)[0])(many[0])
    assert [level for level in levels if level is not None] == [0, 0, 2, 2, 0, 2]


def test_a_plain_number_that_varies_is_a_warning():
    doubled = gc.jit(lambda x, name="y": 2 * x)
    doubled(0.5), doubled(0.5), doubled(jnp.asarray(2.0)), doubled(0.5, name="z")
    with pytest.warns(UserWarning, match="compiles again for the plain numbers 0.25"):
        assert doubled(0.25) == 0.5
