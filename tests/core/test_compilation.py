"""Programs that compile in less time outside `jit`."""

from collections import Counter

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from graded_contact.core.compilation import jit, one_by_one

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


SMALL = """
import jax, graded_contact as gc
gc.jit(lambda x: x + 1)(1.0)
"""


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
