"""How many transforms, how long and how exact: contact of elastic and viscoelastic bodies.

One row per body, grid and tolerance:

- `pairs`: FFT pairs (forward and back), coarse grids counted by their size;
- `seconds`: warm wall time of `slide`, kernel and observables included, median of `--repeat`
  (what the first call of a body takes, compilation included, stands above its rows);
- `x fft`: wall time over that of as many bare FFT pairs in a `lax` loop, timed in the same run;
- `err σ`: root-mean-square error of the pressure against a solution at 1e-10, relative;
- `err μ`, `err A`: relative errors of friction (absolute for elastic bodies) and smooth area.

Surface: Gaussian phases, H = 0.8, roll-off 4 q0, cut-off (N/8) q0, rms slope 0.1. The tread is the
package's, 30 K colder than its reference; the coat is elastic with the relaxed modulus of the
tread, q0 d = 6.3e-3 (100 µm on a cell of 10 cm, the paper's thickest). Run from the repository:

    python benchmarks/bench_contact.py --sizes 256 512 1024
"""

import argparse
import platform
import resource
import statistics
import time
from functools import partial

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

import graded_contact as gc  # noqa: E402

CELL = 0.1  # m
Q0 = 2 * np.pi / CELL


def bodies() -> dict[str, tuple[gc.Stack, float, tuple[float, ...]]]:
    """Name -> (stack, velocity [m/s], pressures over the relaxed reduced modulus)."""
    tread = gc.tyre_tread().at(263.15)
    relaxed = gc.Elastic(tread.equilibrium, 0.5)
    coat = gc.Layer(relaxed, 6.3e-3 / Q0)
    return {
        "elastic": (gc.Stack(base=gc.HalfSpace(relaxed)), 0.0, (0.01, 0.1)),
        "coated tread": (gc.Stack(layers=(coat,), base=gc.HalfSpace(tread)), 0.1, (0.01, 0.1)),
        "bare tread": (gc.Stack(base=gc.HalfSpace(tread)), 0.1, (0.01, 0.1)),
    }


def rough_surface(n: int) -> gc.Surface:
    grid = gc.Grid((n, n), CELL)
    spectrum = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=n / 8 * Q0)
    return gc.rescale(gc.random_surface(spectrum, grid, jax.random.key(0)), rms_slope=0.1)


@partial(jax.jit, static_argnames="count")
def transform_pairs(field, count: int):
    def pair(_, f):
        return jnp.fft.irfftn(jnp.fft.rfftn(f), f.shape)

    return jax.lax.fori_loop(0, count, pair, field)


def timed(function, repeat: int) -> float:
    """Median time of a call that was made before [s]."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        jax.block_until_ready(function())
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[256, 512, 1024])
    parser.add_argument("--tolerances", type=float, nargs="+", default=[1e-4, 1e-6, 1e-8])
    parser.add_argument("--bodies", nargs="+", default=list(bodies()), choices=list(bodies()))
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()

    device = jax.devices()[0]
    print(f"# graded_contact {gc.__version__}, jax {jax.__version__}, numpy {np.__version__}")
    python = platform.python_version()
    print(f"# {device.device_kind} ({platform.machine()}), float64, python {python}")
    print(
        f"{'body':14s} {'p/E_r0':>6s} {'N':>5s} {'rtol':>6s} {'pairs':>7s} {'steps':>5s} "
        f"{'seconds':>8s} {'x fft':>6s} {'err σ':>8s} {'err μ':>8s} {'err A':>8s} "
        f"{'μ':>8s} {'A/A0':>7s}"
    )
    for n in options.sizes:
        surface = rough_surface(n)
        count = max(4, 2 * (2048 // n) ** 2)
        jax.block_until_ready(transform_pairs(surface.heights, count))
        bare = timed(lambda s=surface, c=count: transform_pairs(s.heights, c), 3) / count
        print(f"# N = {n}: one FFT pair in a loop takes {1e3 * bare:.3g} ms")
        for name in options.bodies:
            stack, velocity, loads = bodies()[name]
            young = float(gc.tyre_tread().equilibrium)
            for load in loads:
                run = partial(
                    gc.slide, stack, surface, pressure=load * young / 0.75, velocity=velocity
                )
                start = time.perf_counter()
                best = jax.block_until_ready(run(rtol=1e-10))
                first = time.perf_counter() - start
                print(f"# {name}, p/E_r0 = {load:g}: first call, to 1e-10, {first:.2f} s")
                for rtol in options.tolerances:
                    found = run(rtol=rtol)
                    seconds = timed(lambda r=run, t=rtol: r(rtol=t), options.repeat)
                    sigma = jnp.linalg.norm(found.pressure - best.pressure)
                    sigma /= jnp.linalg.norm(best.pressure)
                    unit = best.friction if best.friction > 1e-9 else 1.0
                    mu = abs(found.friction - best.friction) / unit
                    area = abs(found.contact_area_smooth / best.contact_area_smooth - 1)
                    pairs = float(found.num_fft_pairs)
                    print(
                        f"{name:14s} {load:6.3g} {n:5d} {rtol:6.0e} {pairs:7.1f} "
                        f"{int(found.contact.num_steps):5d} {seconds:8.3f} "
                        f"{seconds / (pairs * bare):6.2f} {sigma:8.1e} {mu:8.1e} {area:8.1e} "
                        f"{found.friction:8.5f} {found.contact_area_smooth:7.4f}",
                        flush=True,
                    )
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(f"# N = {n}: peak memory of the process so far {peak:.2f} GiB")


if __name__ == "__main__":
    main()
