"""Four points of the figures by other methods: the paper's own, and steps in time.

    python examples/paper/two_methods.py [--small]

The thinnest and the thickest coat at σ0/E_r0 = 0.1 and 0.3, fewest waves. First residuals molecular
dynamics (RMD) on the law of the paper, the repulsive part of Lennard-Jones, to its tolerance of
1e-4, beside Douglas-Rachford on the same law and on the hard wall.

Then, with fewer waves, sliding from rest in steps of time, without the steady solver: M_zz at each
wavenumber is written as a glassy part and branches that creep with given times, by
nonnegative least squares, so that an implicit Euler step is an elastic contact. Waves across the
sliding (q_x = 0), which would creep for hours, are at rest from the start. The error is of first
order in the step: extrapolated from two.
"""

import time
from functools import partial
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import nnls
from system import (
    CLOSE_UP,
    Q0,
    VELOCITY,
    coated,
    read,
    relaxed,
    tread,
)
from system import surface as surface_of

import graded_contact as gc
from graded_contact.contacts.solver.rmd import ResidualDynamics
from graded_contact.fields.grid import derivative, to_field, to_spectrum, wavenumber, wavevector

RANGE = 0.01  # of the law, over the rms height
TIMES = np.geomspace(1e-6, 1e2, 33)  # s


def points(size):
    return product((size.depths[0], size.depths[-1]), CLOSE_UP)


def report(name, found, seconds, best):
    print(
        f"    {name:34s} friction {float(found.friction):.6f} "
        f"({float(found.friction / best.friction) - 1:+.1e}), area "
        f"{float(found.contact_area):.4f} "
        f"({float(found.contact_area - best.contact_area):+.1e}), "
        f"{float(found.num_fft_pairs):8.0f} FFT pairs, {seconds:7.1f} s"
        f"{'' if found.result == gc.contacts.RESULTS.successful else ', NOT CONVERGED'}",
        flush=True,
    )


def dynamics(size):
    cutoff = size.cutoffs[0]
    surface = surface_of(cutoff, size)
    rms = float(gc.surfaces.statistics(surface).rms_height)
    print(f"RMD and Douglas-Rachford, q1/q0 = {cutoff}, N = {surface.grid.shape[0]}")
    for depth, ratio in points(size):
        rubber = tread()
        load = ratio * relaxed(rubber)
        law = gc.RepulsiveLJ(RANGE * rms, load)
        slide = partial(
            gc.slide, coated(rubber, depth / Q0), surface, pressure=load, velocity=VELOCITY,
            throw=False,
        )  # fmt: skip
        print(f"  q0 d = {depth:.3g}, σ0/E_r0 = {ratio}; in brackets against rtol = 1e-8")
        for name, of in (("hard wall", gc.HardWall()), ("Lennard-Jones", law)):
            best = slide(law=of, rtol=1e-8)
            ways = {"Douglas-Rachford, rtol = 1e-3": {"rtol": 1e-3}}
            if name != "hard wall":
                ways["RMD, 1e-4"] = {"rtol": 1e-4, "solver": ResidualDynamics()}
            for way, settings in ways.items():
                run = partial(slide, law=of, **settings)
                jax.block_until_ready(run(rtol=0.5))  # compiles
                start = time.perf_counter()
                found = jax.block_until_ready(run())
                report(f"{name}: {way}", found, time.perf_counter() - start, best)


# Steps in time ------------------------------------------------------------------------------


def branches(stack, cell):
    """M(q, ω) = J_g + Σ J_k/(1 + iω t_k): J_g and all J_k [m/Pa] on the half spectrum.

    Printed is the largest misfit at the frequencies that sliding excites.
    """
    q = np.asarray(wavenumber(cell)).round(6)
    each, place = np.unique(q, return_inverse=True)
    omega = np.geomspace(VELOCITY * Q0 / 4, 4 * VELOCITY * each[-1], 60)
    creep = 1 / (1 + 1j * omega[:, None] * TIMES)
    columns = np.concatenate([np.ones((len(omega), 1)), creep], axis=1)
    at = jax.jit(jax.vmap(lambda q: gc.surface_compliance(stack, q, jnp.asarray(omega))))
    wanted = np.asarray(at(jnp.asarray(each[1:])))
    found, misfit = np.zeros((len(each), len(TIMES) + 1)), 0.0
    for i, m in enumerate(wanted):
        weighted = columns / np.abs(m)[:, None]
        target = m / np.abs(m)
        stacked = np.concatenate([weighted.real, weighted.imag])
        # NNLS likes columns of equal size.
        unit = np.abs(m).mean()
        solution, _ = nnls(stacked * unit, np.concatenate([target.real, target.imag]))
        found[i + 1] = solution * unit
        misfit = max(misfit, np.max(np.abs(columns @ found[i + 1] / m - 1)))
    print(f"    M_zz by {len(TIMES)} branches: within {misfit:.1e}")
    return jnp.asarray(found[place.reshape(q.shape)])


@partial(jax.jit, static_argnames=("num_steps",))
def stepped(surface, creep, at_rest, load, step, num_steps):
    """Friction and area over the last quarter of the steps, from a block that was never loaded."""
    cell = surface.grid
    times = jnp.asarray(TIMES)
    along = wavevector(cell)[0]
    moving = along != 0
    kernel = creep[..., 0] + jnp.sum(creep[..., 1:] * step / (times + step), axis=-1)
    kernel = jnp.where(moving, kernel, at_rest).at[0, 0].set(0)
    kept, gained = times / (times + step), creep[..., 1:] * step / (times + step)
    # Seen from the surface, the material moves back by v times the step.
    carried = jnp.where(moving, jnp.exp(1j * along * VELOCITY * step), 0)

    def advance(state, _):
        crept, start = state
        pushed = carried[..., None] * crept
        memory = to_field(jnp.sum(kept * pushed, axis=-1), cell.shape)
        contact = gc.solve_contact(
            kernel, surface.heights - memory, load, rtol=1e-5, start=start, throw=False
        )
        crept = kept * pushed + gained * to_spectrum(contact.pressure)[..., None]
        slope = derivative(contact.displacement + memory, cell, 0)
        friction = -jnp.mean(contact.pressure * slope) / load
        area = jnp.mean(contact.pressure > 0, dtype=friction.dtype)
        return (crept, contact.pressure), (friction, area, contact.num_fft_pairs)

    first = gc.solve_contact(kernel, surface.heights, load, rtol=1e-5, throw=False).pressure
    start = jnp.zeros(gained.shape, complex)
    _, (friction, area, pairs) = jax.lax.scan(advance, (start, first), length=num_steps)
    last = num_steps // 4
    return jnp.mean(friction[-last:]), jnp.mean(area[-last:]), jnp.sum(pairs)


def in_time(size, cutoff, passes, steps):
    surface = surface_of(cutoff, size)
    print(
        f"steps in time, q1/q0 = {cutoff}, N = {surface.grid.shape[0]}, sliding over {passes:g} "
        f"cells in {steps[0]} and {steps[1]} steps each"
    )
    duration = 2 * np.pi / Q0 / VELOCITY
    for depth, ratio in points(size):
        rubber = tread()
        load = ratio * relaxed(rubber)
        stack = coated(rubber, depth / Q0)
        print(f"  q0 d = {depth:.3g}, σ0/E_r0 = {ratio}")
        creep = branches(stack, surface.grid)
        at_rest = gc.stack_kernel(stack, surface.grid, 0.0).real
        start = time.perf_counter()
        found = [
            stepped(surface, creep, at_rest, load, duration / n, int(passes * n)) for n in steps
        ]
        pairs, seconds = float(found[1][2]), time.perf_counter() - start
        coarse, fine = (np.array(one[:2]) for one in found)
        ratio_of = steps[1] / steps[0]
        friction, area = (ratio_of * fine - coarse) / (ratio_of - 1)
        steady = gc.slide(stack, surface, pressure=load, velocity=VELOCITY, rtol=1e-6)
        print(
            f"    friction {fine[0]:.6f}, extrapolated {friction:.6f}, steady solver "
            f"{float(steady.friction):.6f} ({friction / float(steady.friction) - 1:+.1e}); area "
            f"{area:.4f}, {float(steady.contact_area):.4f} "
            f"({area - float(steady.contact_area):+.1e}); {pairs:.0f} FFT pairs, "
            f"{seconds:.0f} s, against {float(steady.num_fft_pairs):.0f}",
            flush=True,
        )


def main():
    given, size = read(__doc__)
    dynamics(size)
    if given.small:
        in_time(size, 8, 2, (64, 128))
    else:
        # As thick to the shortest wave as the coats of the paper are.
        waves = 32
        thick = tuple(d * size.cutoffs[0] / waves for d in size.depths)
        in_time(size._replace(depths=thick), waves, 4, (256, 512))


if __name__ == "__main__":
    main()
