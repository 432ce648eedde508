"""Seconds of first calls: the section `first`.

Run by `bench_contact.py`. Each first call has a process of its own, in which a minimal splitting is
compiled first: machines differ, ratios less.
"""

import time
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg  # noqa: F401 (JAX imports it with the first linear system)
from contact_scenes import bodies, rough_surface
from rows import in_processes, report, seconds

import graded_contact as gc

SPEED = 0.1  # m/s


CALLS = ("slide", "gradient", "value_and_grad", "total_error", "attraction")


def first(n=64, calls=CALLS):
    """Seconds of first calls, and their ratio to a minimal splitting, without a cache."""
    for _, start in in_processes("first_of", calls, n=n):
        start()


def first_of(call, n=64):
    """The same of one call, in this process."""
    jax.config.update("jax_enable_compilation_cache", False)
    least, compiled = seconds(_minimal(n)), []

    def listen(event, seconds, **_):
        if event == "/jax/core/compile/backend_compile_duration":
            compiled.append(seconds)

    function = _calls(n)[call]
    jax.monitoring.register_event_duration_secs_listener(listen)
    begun = time.process_time()
    elapsed = seconds(function)
    report("bench_contact-first", {
        "call": call, "N": n, "programs": len(compiled),
        "of a core [s]": time.process_time() - begun, "time [s]": elapsed,
        "a minimal splitting [s]": least, "ratio": elapsed / least,
    })  # fmt: skip


def _calls(n):
    """Functions by the names of the calls."""
    surface, stack = rough_surface(n), bodies()["tread+coat"]

    def friction(stack):
        return gc.slide(stack, surface, pressure=0.1, velocity=SPEED).friction

    def total_error():
        return gc.slide(stack, surface, pressure=0.1, velocity=SPEED).friction_error

    def attraction():
        law, elastic = gc.contacts.ExponentialAdhesion(1e-2, 1e-5), bodies()["elastic"]
        return gc.slide(elastic, surface, pressure=0.01, velocity=0.0, law=law).contact_area

    return {
        "slide": partial(friction, stack),
        "gradient": partial(jax.grad(friction), stack),
        "value_and_grad": partial(gc.jit(jax.value_and_grad(friction)), stack),
        "total_error": total_error,
        "attraction": attraction,
    }


def _minimal(n):
    """A first call of the least that solves a contact: a splitting on one grid, accelerated."""
    r = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n))
    kernel = (1 / np.where(r > 0, r, 1)) / (1 + 0.3j * np.sign(np.fft.fftfreq(n)[:, None]))
    filter_ = jnp.asarray(1 / (1 + kernel)).at[0, 0].set(0)
    heights, load, memory = jax.random.normal(jax.random.key(0), (n, n)), 0.3, 5

    @jax.jit
    def solve(heights, filter_):
        smooth = lambda z: jnp.fft.irfft2(filter_ * jnp.fft.rfft2(z), s=(n, n))  # noqa: E731
        shift = smooth(heights) + load

        def step(z):
            x = shift + smooth(z)
            y = jnp.maximum(2 * x - z, 0)
            return z + 1.9 * (y - x), jnp.linalg.norm(y - x) / jnp.linalg.norm(x)

        def cycle(state):
            z, images, changes, k, _ = state
            image, error = step(step(z)[0])
            change = image - z
            images, changes = images.at[k % memory].set(image), changes.at[k % memory].set(change)
            rows = (changes - change).reshape(memory, -1)
            matrix = rows @ rows.T + 1e-12 * jnp.sum(change**2) * jnp.eye(memory)
            weights = jnp.linalg.solve(matrix, -rows @ change.ravel())
            return image + jnp.tensordot(weights, images - image, 1), images, changes, k + 1, error

        none = jnp.zeros((memory, n, n))
        start = jnp.full((n, n), load), none, none, 0, jnp.inf
        return jax.lax.while_loop(lambda s: (s[4] > 1e-6) & (s[3] < 500), cycle, start)[0]

    jax.block_until_ready(heights)
    return partial(solve, heights, filter_)
