"""Derivatives of a contact against central differences of converged solutions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import BODIES, LAWS, SPEED, rough

import graded_contact as gc

GRID = gc.Grid((32, 32), 1.0)
HEIGHTS = rough(GRID, cut=4).heights
WEIGHTS = jnp.asarray(np.random.default_rng(0).normal(size=GRID.shape))


LOAD = 0.05
MEAN_GAP = 0.6 * float(jnp.std(HEIGHTS))


def observe(kernel, heights, target, law, control):
    """A number that weighs every pressure, gap and displacement, and both means."""
    s = gc.solve_contact(kernel, heights, **{control: target}, law=law, rtol=1e-11)
    field = s.pressure / LOAD + jnp.sin(20 * s.gap) + s.displacement
    return jnp.mean(WEIGHTS * field) + 3 * s.mean_gap + s.mean_pressure / LOAD


def derivatives(point, directions, control):
    """The value, its forward derivative in each direction, and its gradient: one compilation."""
    value, along = jax.linearize(lambda point: observe(*point, control), point)
    (gradient,) = jax.linear_transpose(along, point)(jnp.ones_like(value))
    return value, jax.lax.map(along, directions), gradient


@pytest.mark.parametrize(
    "law, control",
    [("hardness", "pressure"), ("repulsive", "pressure"), ("exponential", "mean_gap")],
)
def test_derivatives_match_central_differences(law, control):
    """By kernel, heights, pressure or mean gap, and every parameter of the law."""
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
    target = jnp.asarray(LOAD if control == "pressure" else MEAN_GAP)
    point = (kernel, HEIGHTS, target, LAWS[law])
    leaves, treedef = jax.tree.flatten(point)
    rng = np.random.default_rng(5)

    def random_change(leaf):
        noise = jnp.asarray(rng.normal(size=leaf.shape))
        if jnp.iscomplexobj(leaf):
            return 0.3 * (leaf.real * noise + 1j * leaf.imag)
        return noise * (0.01 if leaf.ndim else leaf)

    changes = [random_change(leaf) for leaf in leaves]
    directions = treedef.unflatten(
        [jnp.stack([d * (i == j) for j in range(len(leaves))]) for i, d in enumerate(changes)]
    )
    compiled = jax.jit(derivatives, static_argnums=2)
    _, forward, gradient = compiled(point, directions, control)
    step = 1e-6

    def value_at(i, leaf):
        moved = treedef.unflatten([*leaves[:i], leaf, *leaves[i + 1 :]])
        return compiled(moved, directions, control)[0]

    for i, (leaf, change) in enumerate(zip(leaves, changes, strict=True)):
        ends = [value_at(i, leaf + sign * step * change) for sign in (1, -1)]
        difference = float(ends[0] - ends[1]) / (2 * step)
        # JAX's cotangent of a complex input is the conjugate gradient.
        reverse = float(jnp.sum((jax.tree.leaves(gradient)[i] * change).real))
        if (law, i) == ("repulsive", 5):
            assert difference == forward[i] == 0  # where contact is said to begin moves nothing
            continue
        assert difference != 0
        np.testing.assert_allclose(forward[i], difference, rtol=1e-5, err_msg=str(i))
        np.testing.assert_allclose(reverse, forward[i], rtol=1e-7, err_msg=str(i))


def test_derivative_is_one_sided_where_a_point_only_just_touches():
    """A wave pressed just flat: its trough has σ = 0 and u = 0, and leaves if the load falls.

    Above, the pressure changes by the same everywhere; below, the trough's neighbours by more.
    """
    kernel = gc.stack_kernel(BODIES["elastic"], gc.Grid((16,), 1.0)).real
    wave = 1e-2 * jnp.cos(2 * jnp.pi * jnp.arange(16) / 16)
    flat = 1e-2 / kernel[1]  # the load at which the trough's pressure is 0

    @jax.jit
    @jax.value_and_grad
    def beside(load):
        return gc.solve_contact(kernel, wave, load, rtol=1e-12).pressure[7]

    step = 1e-3 * flat
    (above, on_the_right), (at, found), (below, on_the_left) = (
        beside(flat + d) for d in (step, 0, -step)
    )
    right, left = (above - at) / step, (at - below) / step
    np.testing.assert_allclose(right, 1, rtol=1e-6)
    assert left > 1.1
    assert min(abs(found - right), abs(found - left)) <= 1e-6
    # Away from the point the derivative is that of its side.
    np.testing.assert_allclose(on_the_right, right, rtol=1e-6)
    np.testing.assert_allclose(on_the_left, left, rtol=1e-6)


def test_mean_pressure_follows_the_load_exactly_and_nothing_the_mean_height():
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)

    def sums(load, lift):
        pressure = gc.solve_contact(kernel, HEIGHTS + lift, load).pressure
        return jnp.stack([jnp.mean(pressure), jnp.sum(WEIGHTS * pressure)])

    by_load, by_lift = jax.jit(jax.jacrev(sums, (0, 1)))(0.05, 0.0)
    np.testing.assert_allclose(by_load[0], 1.0, rtol=1e-12)
    assert abs(by_lift[1]) <= 1e-9


def check_second_derivatives(by, point, step, atol):
    """Symmetric, and differences of the gradient: one compilation."""
    both = jax.jit(lambda x: (jax.grad(by)(x), jax.jacfwd(jax.grad(by))(x)))
    found = both(point)[1]
    unit = jnp.eye(len(point))
    rows = [(both(point + step * e)[0] - both(point - step * e)[0]) / (2 * step) for e in unit]
    np.testing.assert_allclose(found, found.T, atol=1e-3 * atol)
    np.testing.assert_allclose(found, rows, atol=atol)
    assert np.all(np.diag(found) != 0)


def test_hessian_of_friction_is_symmetric_and_matches_differences():
    """By modulus and thickness of a coat, pressure and velocity."""
    x = np.arange(16) / 16
    ridges = 0.01 * np.cos(2 * np.pi * x) + 0.003 * np.cos(6 * np.pi * x + 1)
    surface = gc.Surface(jnp.asarray(ridges), gc.Grid((16,), 1.0))

    def by(x):
        coat = gc.Layer(gc.Elastic(x[0], 0.4), 0.1 * x[1])
        stack = gc.Stack(layers=(coat,), base=gc.HalfSpace(gc.Prony(0.75, [3.0], [1.0], 0.5)))
        return gc.slide(stack, surface, pressure=0.02 * x[2], velocity=x[3], rtol=1e-12).friction

    check_second_derivatives(by, jnp.array([1.0, 0.3, 1.0, 0.1]), 1e-5, 1e-6)


def test_solves_under_shard_map_and_their_derivatives_are_those_of_each():
    grid, loads = gc.Grid((8, 8), 1.0), jnp.array([0.05, 0.1])
    kernel, heights = gc.stack_kernel(BODIES["elastic"], grid), rough(grid, cut=4).heights

    def total(load):
        pressure = gc.solve_contact(kernel, heights, load, throw=False).pressure
        return jnp.sum(pressure**2)

    each = lambda loads: jax.lax.map(jax.value_and_grad(total), loads)  # noqa: E731
    spec = jax.sharding.PartitionSpec("loads")
    mesh = jax.sharding.Mesh(np.array(jax.devices()[:1]), "loads")
    over = jax.shard_map(each, mesh=mesh, in_specs=spec, out_specs=spec)
    for found, expected in zip(jax.jit(over)(loads), each(loads), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)
