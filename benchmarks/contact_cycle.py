"""Periodic motion: errors and pairs beside time steps, moduli far apart, claims; section `cycle`.

Run by `bench_contact.py`. Profiles on a half space with one relaxation time, or thirteen over six
decades; steps in time have an internal variable and are exact for displacements that vary linearly
in a step, over as many periods as make the state periodic. Counts of points are odd there, as steps
move waves on Nyquist lines in another way.
"""

import itertools
import time

import jax
import jax.numpy as jnp
import numpy as np
from rows import report

import graded_contact as gc
from graded_contact.sliding import sinusoidal, slide_cycle, start_stop
from graded_contact.sliding.motion import periodic
from graded_contact.sliding.motion.periodic import CHOSEN_STEP, LARGEST_STEP

SIZE = 1.0
_CLOSEST = 1e-10


def cycle(count=60, seed=0):
    """Periodic motion: beside time steps, contrast by load by motion, claims of random cycles."""
    against_steps()
    far_apart()
    random_cycles(count, seed)


def profile(num_points, cut, seed=0, rms=0.02):
    """Heights with the first `cut` waves, amplitudes as k^-1.3."""
    k, waves = np.arange(1, cut + 1), np.zeros(num_points // 2 + 1, complex)
    waves[1 : cut + 1] = k**-1.3 * np.exp(2j * np.pi * np.random.default_rng(seed).random(cut))
    heights = np.fft.irfft(waves, num_points)
    return gc.Surface(heights * rms / heights.std(), gc.Grid((num_points,), SIZE))


def half_space(contrast, times):
    """Modulus 1 Pa at rest, `contrast` at speed."""
    strengths = np.full(len(times), (contrast - 1) / len(times))
    return gc.Stack(base=gc.HalfSpace(gc.Prony(1.0, strengths, times, poisson=0.0)))


def by_steps(surface, contrast, tau, displacement, period, load, num_cycles):
    """Work of the last of some cycles [J/m²], and the pressures there, by steps in time.

    Waves of the branch's stretch r relax as τ ṙ = w - r, and σ = q/2 (w + E1 (w - r)): a step is an
    elastic contact of the heights less the stored stretch. In the frame of the surface each step of
    the surface moves the material back. With w linear in a step of τ x,
    r' = e r + (m - e) w + (1 - m) w', e = exp(-x), m = (1 - e)/x.
    """
    n, num_times = surface.grid.shape[0], len(displacement)
    step, branch = period / num_times, contrast - 1
    q = 2 * np.pi * np.arange(n // 2 + 1) / SIZE
    left = np.exp(-step / tau)
    mean = (1 - left) * tau / step
    stiff = 1 + mean * branch
    kernel = 2 / (np.maximum(q, 1) * stiff)
    moved = np.asarray(displacement) - np.roll(displacement, 1)
    odd = 1j * np.where(np.arange(len(q)) < n / 2, q, 0)

    def advance(state, by):
        remembered, start = state
        pushed = jnp.fft.irfft(jnp.exp(1j * q * by) * remembered, n)
        memory = branch / stiff * pushed
        found = gc.solve_contact(kernel, surface.heights - memory, load, rtol=1e-8, start=start)
        w = found.displacement + memory
        slope = jnp.fft.irfft(odd * jnp.fft.rfft(w), n)
        stretch = pushed + (1 - mean) * w
        remembered = jnp.fft.rfft(left * stretch + (mean - left) * w)
        traction = -jnp.mean(found.pressure * slope)
        return (remembered, found.pressure), (traction, found.pressure)

    @jax.jit
    def one_cycle(state):
        return jax.lax.scan(advance, state, jnp.asarray(moved))

    state = (jnp.zeros(len(q), complex), jnp.full(n, load))
    for _ in range(num_cycles):
        state, (traction, pressure) = one_cycle(state)
    speed = np.fft.irfft(1j * np.arange(num_times // 2 + 1) * np.fft.rfft(displacement), num_times)
    return float(np.mean(traction * speed) * 2 * np.pi), np.asarray(pressure)


def against_steps(num_points=33, counts=(64, 128, 256)):
    """Space-time cycles and time steps of the same motion."""
    surface, stack = profile(num_points, 8), half_space(10, [0.05])
    amplitude, load = 0.2, 0.05
    finest = sinusoidal(2 * amplitude, 1.0, 1024)
    job = dict(period=1.0, pressure=load)
    best = slide_cycle(stack, surface, displacement=finest.displacement, rtol=_CLOSEST, **job)
    for num_times in counts:
        moved = sinusoidal(2 * amplitude, 1.0, num_times).displacement
        every = 1024 // num_times
        start = time.process_time()
        found = slide_cycle(stack, surface, displacement=moved, rtol=1e-8, **job)
        pressure = np.asarray(found.pressure)
        seconds = time.process_time() - start
        start = time.process_time()
        work, stepped = by_steps(surface, 10, 0.05, np.asarray(moved), 1.0, load, 4)
        seconds_of_steps = time.process_time() - start
        row = {
            "times": num_times,
            "pairs": round(float(found.contact.num_fft_pairs)),
            "work off": f"{abs(found.work / best.work - 1):.1e}",
            "pressure off": f"{off(pressure, best.pressure[::every]):.1e}",
            "CPU s": f"{seconds:.1f}",
            "work of steps off": f"{abs(work / best.work - 1):.1e}",
            "pressure of steps off": f"{off(stepped, best.pressure[::every]):.1e}",
            "CPU s of steps": f"{seconds_of_steps:.1f}",
        }
        report("bench_contact-cycle-steps", row)


def cycle_times(num_points=64, steps=(4.0, 2.0, 1.0, 0.5)):
    """Mean and peak friction off by the largest step from one time to the next, in spacings."""
    periodic.LARGEST_STEP = np.inf  # what a cycle refuses is measured, too
    grid = gc.Grid((num_points,), SIZE)
    for name, make in (
        ("sine", lambda count: sinusoidal(0.4, 1.0, count, grid)),
        ("stop and go", lambda count: start_stop(0.4, 0.25, 0.25, count, grid)),
    ):
        enough = make(None).num_times
        for points, tau in itertools.product((4, 8), (0.05, 0.005)):
            surface = profile(num_points, num_points // points, rms=0.01)
            stack, found = half_space(7, [tau, tau / 30]), {}
            counts = {step: 2 * round(enough * CHOSEN_STEP / step / 2) for step in steps}
            for step, count in (counts | {0: 4 * enough}).items():
                found[step] = slide_cycle(
                    stack, surface, displacement=make(count).displacement, period=1.0,
                    pressure=0.05, rtol=1e-7,
                )  # fmt: skip
            row = {"motion": name, "points per wave": points, "relaxation [s]": tau}
            for step, part in itertools.product(steps, ("mean", "peak")):
                at, best = (float(getattr(found[i], f"{part}_friction")) for i in (step, 0))
                row[f"{part} off at {step:g}"] = f"{abs(at / best - 1):.1e}"
            report("bench_contact-cycle-times", row)


def off(pressure, expected):
    """Relative difference of pressures, root mean square."""
    return float(np.sqrt(np.mean((pressure - expected) ** 2) / np.mean(np.asarray(expected) ** 2)))


def far_apart(num_points=128, num_times=256, rtol=1e-6):
    """FFT pairs to 1e-6 by contrast, load and motion: thirteen times over six decades."""
    surface = profile(num_points, 16)
    sine, stops = sinusoidal(0.6, 1.0, num_times), start_stop(0.5, 0.25, 0.25, num_times)
    for contrast in (10, 100, 1000):
        stack = half_space(contrast, np.logspace(-4, 2, 13))
        for name, moving in (("sine", sine), ("stop and go", stops)):
            for load in (0.3, 0.03, 0.003):
                found = slide_cycle(
                    stack, surface, displacement=moving.displacement, period=1.0, pressure=load,
                    rtol=rtol,
                )  # fmt: skip
                row = {
                    "contrast": contrast,
                    "motion": name,
                    "load/E": load,
                    "area": f"{jnp.mean(found.contact_area):.3f}",
                    "pairs": round(float(found.contact.num_fft_pairs)),
                    "error": f"{found.contact.error:.0e}",
                    "mean friction": f"{found.mean_friction:.6f}",
                    "peak friction": f"{found.peak_friction:.6f}",
                }
                report("bench_contact-cycle-contrast", row)


def random_cycles(count, seed, num_times=48):
    """Claims of mean and peak friction and of the pressure against solutions at 1e-10.

    Each cycle by its load and by the mean gaps that follow; a fifth of them in two dimensions.
    """
    rng, claims, broken, failed, ratios = np.random.default_rng(seed), 0, 0, {}, []
    for i in range(count):
        surface, stack, job, load = random_cycle(rng, num_times)
        given = {"pressure": load}
        for by in ("pressure", "mean_gap"):
            best = slide_cycle(stack, surface, rtol=_CLOSEST, throw=False, **given, **job)
            if best.result != gc.contacts.RESULTS.successful:
                failed[by] = failed.get(by, 0) + 1
                break
            tolerance = 10 ** rng.uniform(-5, -1.5)
            found = slide_cycle(stack, surface, rtol=tolerance, throw=False, **given, **job)
            if found.result != gc.contacts.RESULTS.successful:
                failed[by] = failed.get(by, 0) + 1
                break
            for true, claim in true_and_claimed(found, best):
                claims += 1
                if true > 1e-9:
                    ratios.append(claim / true)
                if true > claim + 1e-9:
                    broken += 1
                    print(f"  {true:.1e}, claimed {claim:.1e}: {by}, cycle {i}")
            if jnp.min(jnp.abs(best.mean_gap)) < 1e-6 * jnp.std(surface.heights):
                break  # in full contact no load follows from the gap
            given = {"mean_gap": best.mean_gap}
    low, middle, high = np.percentile(ratios, (1, 50, 99))
    row = {
        "cycles": count,
        "did not converge": sum(failed.values()),
        "by their gap": failed.get("mean_gap", 0),
        "claims": claims,
        "broken": broken,
        "claim/true 1 %": f"{low:.1f}",
        "median": f"{middle:.1f}",
        "99 %": f"{high:.0f}",
    }
    report("bench_contact-cycle-random", row)


def random_cycle(rng, num_times):
    """A surface, a block, the motion and law of `slide_cycle`, and a load over time."""
    seed, cut = int(rng.integers(1000)), int(rng.integers(2, 12))
    surface = profile(48, cut, seed)
    if rng.random() < 0.2:
        q0 = 2 * np.pi / SIZE
        spectrum = gc.SelfAffine(
            rms_slope=0.2, hurst=0.8, q_low=q0, q_roll=1.5 * q0, q_high=min(cut, 5) * q0
        )
        surface = gc.random_surface(spectrum, gc.Grid((12, 12), SIZE), jax.random.key(seed))
    contrast = 10 ** rng.uniform(0.1, 2)
    stack = half_space(contrast, 10 ** np.sort(rng.uniform(-4, 1, 6)))
    t = 2 * np.pi * np.arange(num_times) / num_times
    moved = sum(rng.normal() / k**2 * np.sin(k * t + rng.uniform(0, 2 * np.pi)) for k in (1, 2, 3))
    moved, along = rng.uniform(0.02, 0.3) * moved, rng.integers(-1, 2) * t / (2 * np.pi)
    while periodic.Motion(moved + along, 1.0).largest_step(surface.grid) > LARGEST_STEP:
        moved = moved / 2
    load = 10 ** rng.uniform(-3, 0) * (1 + rng.uniform(0, 0.8) * np.sin(t + rng.uniform(0, 6)))
    mean = float(np.mean(load))
    laws = (gc.HardWall(), gc.HardWall(), gc.contacts.RepulsiveLJ(2e-3, mean))
    period = 10 ** rng.uniform(-2, 2)
    job = dict(displacement=moved + along, period=period, law=laws[rng.integers(3)])
    return surface, stack, job, load


def true_and_claimed(found, best):
    """True and claimed errors of the pressure, and of mean and peak friction."""
    pairs = [(off(found.pressure, best.pressure), float(found.contact.error))]
    for name in ("mean_friction", "peak_friction"):
        wrong = abs(float(getattr(found, name)) - float(getattr(best, name)))
        pairs.append((wrong, float(getattr(found, f"{name}_error"))))
    return pairs
