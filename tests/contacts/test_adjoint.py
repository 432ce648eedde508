"""Derivatives of a contact against central differences of converged solutions."""

import jax
import jax.numpy as jnp
import numpy as np
from conftest import BODIES, LAWS, SPEED
from oracles import rough

import graded_contact as gc

GRID = gc.Grid((16, 16), 1.0)
HEIGHTS = rough(GRID.shape, 1.0).heights
WEIGHTS = jnp.asarray(np.random.default_rng(0).normal(size=GRID.shape))
PLAIN = gc.contacts.DouglasRachford(newton=False)


LOAD = 0.05
MEAN_GAP = 0.6 * float(np.std(HEIGHTS))


@jax.jit
def weighed(pressure, gap, displacement, mean_gap, mean_pressure):
    field = pressure / LOAD + jnp.sin(20 * gap) + displacement
    return jnp.mean(WEIGHTS * field) + 3 * mean_gap + mean_pressure / LOAD


def observe(kernel, heights, target, law):
    """A number that weighs every pressure, gap and displacement, and both means."""
    how = {"mean_gap": target, "law": law, "rtol": 1e-11, "solver": PLAIN}
    s = gc.solve_contact(kernel, heights, **how)
    return weighed(s.pressure, s.gap, s.displacement, s.mean_gap, s.mean_pressure)


def test_derivatives_match_central_differences():
    """By kernel, heights, pressure or mean gap, and every parameter of the law."""
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
    target = jnp.asarray(MEAN_GAP)
    leaves, treedef = jax.tree.flatten((kernel, HEIGHTS, target, LAWS["repulsive"]))
    rng = np.random.default_rng(5)

    def random_change(leaf):
        noise = rng.normal(size=leaf.shape)
        if np.iscomplexobj(leaf):
            return 0.3 * (leaf.real * noise + 1j * leaf.imag)
        return noise * (0.01 if leaf.ndim else leaf)

    def value(*leaves):
        return observe(*treedef.unflatten(leaves))

    changes = [np.asarray(random_change(np.asarray(leaf))) for leaf in leaves]
    # Outside of `jit` each part is compiled once, in half of the time of one program.
    gradient = jax.device_get(jax.grad(value, tuple(range(len(leaves))))(*leaves))
    step = 1e-6
    for i, change in enumerate(changes):
        only = [d * (i == j) for j, d in enumerate(changes)]
        ends = [
            value(*(x + s * step * d for x, d in zip(leaves, only, strict=True))) for s in (1, -1)
        ]
        difference = float(ends[0] - ends[1]) / (2 * step)
        if i == 5:
            assert difference == 0  # where contact is said to begin moves nothing
            assert np.all(gradient[i] == 0)
            continue
        assert difference != 0
        # JAX's cotangent of a complex input is the conjugate gradient.
        reverse = np.sum((gradient[i] * change).real)
        np.testing.assert_allclose(reverse, difference, rtol=1e-5, err_msg=str(i))
    change = [x * (i != 5) for i, x in enumerate(changes)]
    forward = jax.jvp(value, tuple(leaves), tuple(change))[1]
    reverse = sum(np.sum((g * d).real) for g, d in zip(gradient, change, strict=True))
    np.testing.assert_allclose(forward, reverse, rtol=1e-7)


def test_derivative_is_one_sided_where_a_point_only_just_touches():
    """A wave pressed just flat: its trough has σ = 0 and u = 0, and leaves if the load falls.

    Above, the pressure changes by the same everywhere; below, the trough's neighbours by more.
    """
    kernel = gc.stack_kernel(BODIES["elastic"], gc.Grid((16,), 1.0)).real
    wave = 1e-2 * np.cos(2 * np.pi * np.arange(16) / 16)
    flat = 1e-2 / float(kernel[1])  # the load at which the trough's pressure is 0

    @jax.value_and_grad
    def beside(load):
        return gc.solve_contact(kernel, wave, load, rtol=1e-12, solver=PLAIN).pressure[7]

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


def test_solves_under_shard_map_and_their_derivatives_are_those_of_each():
    grid, step = gc.Grid((32, 32), 1.0), 1e-6  # large enough for Newton steps on few points
    kernel = np.asarray(gc.stack_kernel(BODIES["elastic"], grid))
    heights = np.asarray(rough(grid.shape, 1.0, last=8).heights)
    loads = np.array([0.05, 0.1, 0.1 - step, 0.1 + step])

    def total(load):
        found = gc.solve_contact(kernel, heights, load, rtol=1e-9, throw=False)
        return jnp.sum(found.pressure**2)

    spec = jax.sharding.PartitionSpec("loads")
    mesh = jax.sharding.Mesh(np.array(jax.devices()), "loads")
    each = lambda loads: jax.lax.map(jax.value_and_grad(total), loads)  # noqa: E731
    over = jax.shard_map(each, mesh=mesh, in_specs=spec, out_specs=spec)
    values, slopes = jax.jit(over)(loads)
    np.testing.assert_allclose(values[:2], [total(load) for load in loads[:2]], rtol=1e-12)
    np.testing.assert_allclose(slopes[1], (values[3] - values[2]) / (2 * step), rtol=1e-6)
