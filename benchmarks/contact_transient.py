"""What a step of a transient solve costs, and where it goes; section `transient` of
`bench_contact.py`.

A coated tread dwells over five decades of time and then slides: half of the steps each.
"""

import time

import jax
import jax.numpy as jnp
import numpy as np
from contact_scenes import bodies, rough_surface
from rows import goal, report

import graded_contact as gc
from graded_contact.fields.grid import to_field, to_spectrum
from graded_contact.sliding import dwell, ramp
from graded_contact.sliding.numerics import Numerics
from graded_contact.sliding.transient.steps import Advance
from graded_contact.sliding.transient.waves import TransientWaves


def transient(size=256, steps=500, load=0.05):
    """Cost of a step: FFT pairs, contact, nodes, numbers."""
    surface, stack = rough_surface(size), bodies()["tread+coat"]
    way = steps // 2 * float(surface.grid.spacing[0]) / 2
    motion = dwell(1.0, steps - steps // 2, first=1e-5)
    motion = motion.then(ramp(0.1, way / 0.1, num_times=steps // 2))
    given = dict(times=motion.times, displacement=motion.displacement, pressure=load)
    seconds, found = _of(lambda: gc.slide_transient(stack, surface, **given), 2)
    pairs = np.asarray(found.recorded["step_num_fft_pairs"])
    report("bench_contact-transient", {
        "N": size, "steps": steps, "p/E_r": load, "CPU [s]": seconds,
        "pairs of the first ten": pairs[:10].mean(), "pairs after": pairs[10:].mean(),
        "a step [ms]": 1e3 * seconds / steps, "its nodes [ms]": 1e3 * _of_nodes(found),
        "a pair [ms]": 1e3 * _of_pair(surface.heights), "friction": float(found.friction[-1]),
        "area": float(found.contact_area[-1]), "memory": float(found.problem.creeps[0].error),
    })  # fmt: skip
    goal(
        "256², five decades, 500 steps: at most 12 pairs a step after the first ten, 40 s",
        f"{pairs[10:].mean():.1f} pairs, {seconds * 500 / steps:.0f} CPU seconds for 500 steps",
    )


def _of(run, count):
    """The least CPU seconds of so many runs, and what they return."""
    best = np.inf
    for _ in range(count):
        start = time.process_time()
        found = jax.block_until_ready(run())
        best = min(best, time.process_time() - start)
    return best, found


def _of_nodes(found):
    problem = found.problem
    advance, creep = Advance(problem, TransientWaves(problem), Numerics()), problem.creeps[0]
    past = advance.init(1).pasts[0]
    rows = jnp.stack([creep.now[0, 0], creep.whole[0, 0], creep.aged[0]])
    factors = jnp.exp(creep.nodes * problem.times[0])

    class Given:
        tables = (rows,)
        decay = from_old = from_new = factors

    run = jax.jit(lambda past: advance._known(0, past, Given))
    return _of(lambda: run(past), 8)[0]


def _of_pair(field):
    run = jax.jit(lambda f: to_field(jnp.sqrt(to_spectrum(f)), f.shape))
    return _of(lambda: run(field), 8)[0]
