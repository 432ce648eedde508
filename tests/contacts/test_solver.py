"""A custom contact solver is accepted everywhere."""

import jax
import jax.numpy as jnp
import numpy as np
from conftest import BODIES
from oracles import dense_contact, rough

import graded_contact as gc
from graded_contact.contacts import SolverOutput

GRID = gc.Grid((16, 16), 1.0)
SURFACE = rough(GRID.shape, 1.0)
LOAD = 0.05


class ProjectedGradient(gc.contacts.AbstractContactSolver):
    """Least energy of an elastic block under pressures >= 0 of the given mean, by FISTA."""

    def solve(self, operator, heights, law, loading, *, rtol, start):
        load, heights = loading.pressure, heights - jnp.mean(heights)
        displace, kernel = operator.displace, operator.kernel

        def project(field):  # to the nearest pressure that is allowed
            ends = jnp.array([jnp.min(field) - load, jnp.max(field)])

            def halve(_, ends):
                heavy = jnp.mean(jnp.maximum(field - jnp.mean(ends), 0)) > load
                return jnp.where(heavy == jnp.array([True, False]), jnp.mean(ends), ends)

            return jnp.maximum(field - jnp.mean(jax.lax.fori_loop(0, 60, halve, ends)), 0)

        def descend(state):
            old, ahead, n, _ = state
            force = displace(ahead) - heights
            new = project(ahead - force / jnp.max(kernel))
            change = jnp.linalg.norm(new - ahead) / jnp.linalg.norm(new)
            return new, new + (n / (n + 3)) * (new - old), n + 1, change

        state = (jnp.full_like(heights, load), jnp.full_like(heights, load), 0, jnp.inf)
        running = lambda s: (s[3] > 0.01 * rtol) & (s[2] < 5000)  # noqa: E731
        p, _, n, error = jax.lax.while_loop(running, descend, state)
        gap = displace(p) - heights
        gap = jnp.where(p > 0, 0, gap - jnp.sum(p * gap) / jnp.sum(p))
        return SolverOutput(p, gap, displace(p), error, error <= rtol, n, 1.0 * n)


def test_a_custom_solver_finds_contacts_and_their_derivatives():
    """Pressure of a dense solve, derivative of its own differences; q = 0 is ignored."""
    kernel = gc.stack_kernel(BODIES["elastic"], GRID).real.at[0, 0].set(jnp.inf)

    def by(load, solver):
        return gc.solve_contact(kernel, SURFACE.heights, load, solver=solver, rtol=1e-9)

    custom = by(jnp.asarray(LOAD), ProjectedGradient())
    finite = np.where(np.isfinite(kernel), np.asarray(kernel), 0)
    exact = dense_contact(finite, np.asarray(SURFACE.heights), LOAD)
    np.testing.assert_allclose(custom.pressure, exact, atol=1e-8 * exact.max())
    step = 1e-4 * LOAD
    ends = [by(jnp.asarray(LOAD + d), ProjectedGradient()).mean_gap for d in (step, -step)]
    slope = jax.grad(lambda p: by(p, ProjectedGradient()).mean_gap)(jnp.asarray(LOAD))
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), rtol=1e-4)
