from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from graded_contact.core.anderson import Iterates, accelerate

accelerated = jax.jit(accelerate)
step = partial(accelerated, running=True)


def run(matrix, b, memory, cycles):
    """Accelerated iteration z -> Az + b from zero; the errors of its states."""
    exact = np.linalg.solve(np.eye(len(b)) - matrix, b)
    state, errors = Iterates.empty(jnp.zeros(len(b)), memory + 1), []
    for _ in range(cycles):
        image = matrix @ state.z + b
        state = step(state, image, jnp.linalg.norm(image - state.z))
        errors.append(float(np.linalg.norm(state.z - exact) / np.linalg.norm(exact)))
    return np.array(errors)


def test_memory_of_all_dimensions_solves_an_affine_map_at_once():
    """As GMRES does, in one step more than dimensions; the plain iteration would take 10⁴."""
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix = jnp.asarray(basis @ np.diag([0.999, -0.9, 0.5]) @ basis.T)
    errors = run(matrix, jnp.asarray(rng.normal(size=3)), memory=3, cycles=8)
    assert errors[0] > 0.1
    assert errors[4] <= 1e-5
    assert errors[7] <= 1e-10


def test_short_memory_still_helps_a_rotation_that_contracts():
    """A nonsymmetric map, as that of a sliding body."""
    turn = np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
    matrix = jnp.asarray(0.95 * np.kron(np.diag([1.0, 0.5]), turn))
    b = jnp.asarray([1.0, 0.0, 0.3, -0.2])
    assert run(matrix, b, memory=2, cycles=30)[-1] <= 1e-8
    plain = 0.95**30
    assert plain > 0.2


def test_misleading_history_is_forgotten():
    """After a jump of the map, changes five times the least so far start it anew."""
    start = Iterates.empty(jnp.zeros(2), 4)
    near = step(start, jnp.array([1e-3, 0.0]), jnp.asarray(1.0))
    far = step(near, near.z + jnp.array([1.0, 1.0]), jnp.asarray(1.0))
    assert near.count == 1
    assert far.count == 1
    np.testing.assert_allclose(far.z, near.z + 1.0)


def test_last_step_is_the_image_alone():
    start = Iterates.empty(jnp.zeros(2), 4)
    first = step(start, jnp.array([1.0, 0.0]), jnp.asarray(1.0))
    image = jnp.array([1.5, 0.1])
    last = accelerated(first, image, jnp.asarray(0.1), running=False)
    np.testing.assert_array_equal(last.z, image)
    assert not np.array_equal(step(first, image, jnp.asarray(0.1)).z, image)
