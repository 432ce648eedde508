"""Seconds before first answers: the sections `first` and `features`.

Run by `bench_contact.py`. Each first call has a process of its own, in which a minimal splitting is
compiled first: machines differ, ratios less.
"""

import tempfile
import time
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg  # noqa: F401 (JAX imports it with the first linear system)
from contact_scenes import bodies, rough_surface
from rows import goal, in_processes, report, seconds, show

import graded_contact as gc

SPEED = 0.1  # m/s
HEATING = gc.sliding.Heating(conductivity=0.25, diffusivity=1e-7)
SHEAR = gc.sliding.ConstantShear(1e5)
GOALS = {  # times the first call of a minimal splitting, by the points of a side
    64: {
        "slide": 2.5, "gc.jit(value_and_grad)": 5, "attraction": 5,
        "grad of heated": 40, "hessian": 15,
    },
    256: {"slide": 3.5, "gc.jit(value_and_grad)": 9},
}  # fmt: skip


def first(n=256):
    """Seconds before the first answer, without the cache of compiled code and with it."""
    with tempfile.TemporaryDirectory() as folder:
        # The second time with the cache it is filled.
        for cache in ("", folder, folder):
            for _, start in in_processes("first_of", ("separate", "together"), n=n, cache=cache):
                start()


def first_of(way, n=256, cache=""):
    """The same, in this process: `slide` and its gradient in turn, or in one `jit`."""
    if cache:
        jax.config.update("jax_compilation_cache_dir", cache)
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    surface, stack = rough_surface(n), bodies()["tread+coat"]

    def value(stack):
        # JAX stores no program that calls Python, as one `jit` does to throw.
        throw = way == "separate"
        return gc.slide(stack, surface, pressure=0.1, velocity=SPEED, throw=throw).friction

    steps = {"slide": value, "its gradient": jax.grad(value)}
    together = {"both in one jit without throw": jax.jit(jax.value_and_grad(value))}
    for name, step in (steps if way == "separate" else together).items():
        row = {"N": n, "cache": "on disk" if cache else "off", "first call": name}
        show(show_first(row, step, stack))


def features(n=64):
    """First calls: what each part of a scene adds, in programs, operations and seconds."""
    tread, coat, elastic = gc.tyre_tread(), gc.Elastic(6.5e6, 0.49), gc.Elastic(1e6, 0.5)
    for _, start in in_processes("features_of", list(_features(n, tread, coat, elastic)), n=n):
        start()


def features_of(feature, n=64):
    """The same of one feature, in this process."""
    jax.config.update("jax_enable_compilation_cache", False)
    least = seconds(_minimal(n))
    step = _features(n, gc.tyre_tread(), gc.Elastic(6.5e6, 0.49), gc.Elastic(1e6, 0.5))[feature]
    thickness = jnp.asarray(50e-6)
    with tempfile.TemporaryDirectory() as folder:
        jax.config.update("jax_dump_ir_to", folder)
        jax.config.update("jax_include_debug_info_in_dumps", False)
        row = show_first({"N": n, "feature": feature}, step, thickness)
        operations = sum(file.read_text().count(" = ") for file in Path(folder).glob("*.mlir"))
    ratio = row["time [s]"] / least
    report("bench_contact-features", row | {
        "operations": operations, "a minimal splitting [s]": least, "ratio": ratio,
    })  # fmt: skip
    most = GOALS.get(n, {}).get(feature)
    if most is not None:
        goal(f"{feature} at {n}² in {most} x a minimal splitting", f"{ratio:.1f}")


def show_first(row, step, *arguments):
    """Returns a row with programs and seconds of a first call."""
    compiled = []

    def listen(event, seconds, **_):
        if event == "/jax/core/compile/backend_compile_duration":
            compiled.append(seconds)

    jax.monitoring.register_event_duration_secs_listener(listen)
    begun = time.process_time()
    elapsed = seconds(partial(step, *arguments))
    jax.monitoring.clear_event_listeners()
    return row | {
        "programs": len(compiled), "XLA [s]": sum(compiled),
        "of a core [s]": time.process_time() - begun, "time [s]": elapsed,
    }  # fmt: skip


def _features(n, tread, coat, elastic):
    """The steps by name, of the thickness of a coat [m]."""
    size = 8e-3
    q0 = 2 * np.pi / size
    spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=q0, q_roll=4 * q0, q_high=n // 8 * q0)
    road = gc.random_surface(spectrum, gc.Grid((n, n), size), jax.random.key(0))
    spacing = float(road.grid.spacing[0])

    def block(d, layers=1, bond=None):
        how = {} if bond is None else {"bond": bond}
        coats = tuple(gc.Layer(coat, d, **how) for _ in range(layers))
        return gc.Stack(layers=coats, base=gc.HalfSpace(tread))

    def slide(d, **how):
        layers, bond = how.pop("layers", 1), how.pop("bond", None)
        given = {"pressure": 4e5, "velocity": SPEED, "throw": False} | how
        return gc.slide(block(d, layers, bond), road, **given)

    def friction(d, **how):
        return slide(d, **how).friction

    def heated(d):
        warm = gc.Stack(layers=(gc.Layer(tread, d),), base=gc.HalfSpace(tread))
        how = {"temperature": 293.15, "shear": SHEAR, "heating": HEATING, "throw": False}
        return gc.slide(warm, road, pressure=4e5, velocity=SPEED, **how).friction

    def attraction(d):
        law = gc.contacts.ExponentialAdhesion(0.02, 5e-6)
        soft = gc.Stack(layers=(gc.Layer(elastic, d),), base=gc.HalfSpace(elastic))
        return gc.slide(soft, road, pressure=1e4, velocity=0.0, law=law).contact_area

    def tension(d):
        sliding = slide(d, shear=SHEAR)
        depths = np.linspace(0, 2e-4, 6)
        return gc.contact_stress(sliding, block(d), depths).largest("tension").value

    def cycle(d):
        moved = 2 * spacing * np.sin(2 * np.pi * np.arange(16) / 16)
        how = {"displacement": moved, "period": 1.0, "pressure": 4e5, "throw": False}
        return gc.slide_cycle(block(d), road, **how).mean_friction

    def history(d):
        how = {"times": np.linspace(0.01, 0.1, 10), "pressure": 4e5, "throw": False}
        moved = spacing / 2 * np.arange(10)
        return gc.slide_history(block(d), road, displacement=moved, **how).friction[-1]

    def total_error(d):
        return slide(d).friction_error

    bond = gc.Bond(shear=1e11)
    ways = {
        "slide": friction,
        "three layers": partial(friction, layers=3),
        "twelve layers": partial(friction, layers=12),
        "a bond": partial(friction, bond=bond),
        "two bodies": partial(friction, counter=gc.Stack(base=gc.HalfSpace(coat))),
        "shear": partial(friction, shear=SHEAR),
        "coupled shear": partial(friction, shear=gc.sliding.Coulomb(0.5)),
        "total error": total_error, "attraction": attraction, "tension at six depths": tension,
        "cycle of 16 times": cycle, "history of 10 steps": history,
        "heated": heated,
    }  # fmt: skip
    slopes = ("slide", "a bond", "tension at six depths", "cycle of 16 times", "heated")
    derived = {"grad" if k == "slide" else f"grad of {k}": jax.grad(ways[k]) for k in slopes}
    return ways | derived | {
        "gc.jit(value_and_grad)": gc.jit(jax.value_and_grad(friction)),
        "gc.jit(hessian)": gc.jit(jax.hessian(friction)), "hessian": jax.hessian(friction),
        "gc.jit(vmap of 4)": gc.jit(lambda d: jax.vmap(friction)(d * jnp.arange(1, 5))),
    }  # fmt: skip


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
