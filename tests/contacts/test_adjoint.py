"""Derivatives of a contact against central differences of converged solutions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import BODIES, LAWS, SPEED, rough

import graded_contact as gc

GRID = gc.Grid((16, 16), 1.0)
HEIGHTS = rough(GRID, cut=4).heights
WEIGHTS = jnp.asarray(np.random.default_rng(0).normal(size=GRID.shape))
PLAIN = gc.contacts.DouglasRachford(newton=False)


LOAD = 0.05
MEAN_GAP = 0.6 * float(np.std(HEIGHTS))


def observe(kernel, heights, target, law, control):
    """A number that weighs every pressure, gap and displacement, and both means."""
    how = {control: target, "law": law, "rtol": 1e-11, "solver": PLAIN}
    s = gc.solve_contact(kernel, heights, **how)
    field = s.pressure / LOAD + jnp.sin(20 * s.gap) + s.displacement
    return jnp.mean(WEIGHTS * field) + 3 * s.mean_gap + s.mean_pressure / LOAD


@pytest.mark.parametrize("law, control", [("hardness", "pressure"), ("repulsive", "mean_gap")])
def test_derivatives_match_central_differences(law, control):
    """By kernel, heights, pressure or mean gap, and every parameter of the law."""
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
    target = jnp.asarray(LOAD if control == "pressure" else MEAN_GAP)
    leaves, treedef = jax.tree.flatten((kernel, HEIGHTS, target, LAWS[law]))
    rng = np.random.default_rng(5)

    def random_change(leaf):
        noise = jnp.asarray(rng.normal(size=leaf.shape))
        if jnp.iscomplexobj(leaf):
            return 0.3 * (leaf.real * noise + 1j * leaf.imag)
        return noise * (0.01 if leaf.ndim else leaf)

    def value(*leaves):
        return observe(*treedef.unflatten(leaves), control)

    changes = [random_change(leaf) for leaf in leaves]
    # Outside of `jit` each part is compiled once, in half of the time of one program.
    gradient = jax.grad(value, tuple(range(len(leaves))))(*leaves)
    step = 1e-6
    for i, change in enumerate(changes):
        only = [d * (i == j) for j, d in enumerate(changes)]
        ends = [
            value(*(x + s * step * d for x, d in zip(leaves, only, strict=True))) for s in (1, -1)
        ]
        difference = float(ends[0] - ends[1]) / (2 * step)
        if (law, i) == ("repulsive", 5):
            assert difference == 0  # where contact is said to begin moves nothing
            assert np.all(gradient[i] == 0)
            continue
        assert difference != 0
        # JAX's cotangent of a complex input is the conjugate gradient.
        reverse = float(jnp.sum((gradient[i] * change).real))
        np.testing.assert_allclose(reverse, difference, rtol=1e-5, err_msg=str(i))
        if law == "hardness":
            forward = jax.jvp(value, tuple(leaves), tuple(only))[1]
            np.testing.assert_allclose(forward, reverse, rtol=1e-7, err_msg=str(i))


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


def test_second_derivatives_are_symmetric_and_match_differences():
    """By the strength and the smoothing of a kernel without symmetry."""
    q = 2 * np.pi * np.arange(9)
    phase = np.exp(-0.5j * (q > 0) * (q < q[-1]))
    x = np.arange(16) / 16
    ridges = 0.01 * np.cos(2 * np.pi * x) + 0.003 * np.cos(6 * np.pi * x + 1)
    lean = 50 * np.sin(2 * np.pi * x)

    @jax.grad
    def slope(x):
        kernel, how = 2 * x[0] * phase / (q + x[1]), dict(rtol=1e-12, solver=PLAIN)
        return jnp.mean(lean * gc.solve_contact(kernel, ridges, 0.02, **how).pressure)

    point, step = np.array([1.0, 3.0]), 1e-5
    found = np.array([jax.jvp(slope, (point,), (e,))[1] for e in np.eye(2)])
    rows = [(slope(point + step * e) - slope(point - step * e)) / (2 * step) for e in np.eye(2)]
    np.testing.assert_allclose(found, found.T, atol=1e-9)
    np.testing.assert_allclose(found, rows, atol=1e-6)
    assert np.all(np.diag(found) != 0)


def test_solves_under_shard_map_and_their_derivatives_are_those_of_each():
    grid, step = gc.Grid((8, 8), 1.0), 1e-6
    kernel, heights = gc.stack_kernel(BODIES["elastic"], grid), rough(grid, cut=4).heights
    loads = np.array([0.05, 0.1, 0.1 - step, 0.1 + step])

    def total(load):
        how = dict(rtol=1e-9, solver=PLAIN, throw=False)
        return jnp.sum(gc.solve_contact(kernel, heights, load, **how).pressure ** 2)

    spec = jax.sharding.PartitionSpec("loads")
    mesh = jax.sharding.Mesh(np.array(jax.devices()[:1]), "loads")
    each = lambda loads: jax.lax.map(jax.value_and_grad(total), loads)  # noqa: E731
    over = jax.shard_map(each, mesh=mesh, in_specs=spec, out_specs=spec)
    values, slopes = jax.jit(over)(loads)
    np.testing.assert_allclose(values[:2], [total(load) for load in loads[:2]], rtol=1e-9)
    np.testing.assert_allclose(slopes[1], (values[3] - values[2]) / (2 * step), rtol=1e-6)
