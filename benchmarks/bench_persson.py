"""Mean-field friction: milliseconds and quadrature error, and the contact solver beside it.

python benchmarks/bench_persson.py speed      a friction curve of 50 velocities, its gradient
python benchmarks/bench_persson.py contact    against contacts of random surfaces
"""

import argparse
import platform
import statistics
import time

import jax
import jax.numpy as jnp
import numpy as np
from rows import keep

import graded_contact as gc

jax.config.update("jax_enable_x64", True)


def tread(share):
    rubber = gc.tyre_tread()
    return gc.Prony(
        equilibrium=rubber.equilibrium * (1 + share),
        strengths=rubber.strengths * (1 + share),
        times=rubber.times * 10 ** (-share),
        poisson=0.49,
    )


def three_treads(thickness):
    layers = tuple(gc.Layer(tread(i / 3), d) for i, d in enumerate(thickness))
    return gc.Stack(layers=layers, base=gc.HalfSpace(tread(1.0)))


def timed(function, *arguments, repeat=15):
    """First call and median of later ones [s]."""
    times = []
    for _ in range(repeat + 1):
        start = time.perf_counter()
        jax.block_until_ready(function(*arguments))
        times.append(time.perf_counter() - start)
    return times[0], statistics.median(times[1:])


def speed(options):
    spectrum = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=63.0, q_roll=250.0, q_high=63e3)
    velocities = jnp.geomspace(1e-6, 30.0, 50)
    thickness = jnp.array([1e-4, 3e-4, 1e-3])

    def curve(thickness, **counts):
        stack = three_treads(thickness)

        def one(velocity):
            found = gc.mean_field_friction(
                stack, spectrum, pressure=4e5, velocity=velocity, **counts
            )
            return found.friction, found.contact_area

        return jax.lax.map(one, velocities)

    value = jax.jit(curve)
    gradient = jax.jit(jax.value_and_grad(lambda d: jnp.sum(curve(d)[0])))
    exact = jax.jit(lambda d: curve(d, num_wavenumbers=192, num_angles=48))(thickness)
    error = max(
        float(np.max(np.abs(a / b - 1))) for a, b in zip(value(thickness), exact, strict=True)
    )
    print("50 velocities, three layers of tread on a half space")
    first, warm = timed(value, thickness)
    first_gradient, warm_gradient = timed(gradient, thickness)
    print(f"curve     first {first:6.2f} s   warm {1e3 * warm:7.1f} ms")
    print(f"gradient  first {first_gradient:6.2f} s   warm {1e3 * warm_gradient:7.1f} ms")
    keep(
        "bench_persson-speed",
        {
            "curve of 50 velocities, first [s]": first,
            "warm [ms]": 1e3 * warm,
            "with gradient, first [s]": first_gradient,
            "with gradient, warm [ms]": 1e3 * warm_gradient,
            "error of the quadrature": error,
        },
    )
    print(f"goal: curve <= 50 ms | reached: {1e3 * warm:.1f} ms")
    print(f"goal: quadrature error <= 1e-6 (against three times the nodes) | reached: {error:.1e}")
    print(f"goal: gradient <= 3 x curve | reached: {warm_gradient / warm:.2f} x")


def contact(options):
    n, cell = options.size, 0.01
    q0 = 2 * np.pi / cell
    spectrum = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=q0, q_roll=4 * q0, q_high=n / 16 * q0)
    grid = gc.Grid((n, n), cell)
    rubber = gc.Prony(1e6, [4e6, 2e7], [1e-2, 1e-4], 0.49)
    bodies = {
        "bare": gc.Stack(base=gc.HalfSpace(rubber)),
        "coated": gc.Stack(
            layers=(gc.Layer(gc.Elastic(4e6, 0.4), 1e-4),), base=gc.HalfSpace(rubber)
        ),
    }
    keys = jax.random.split(jax.random.key(options.seed), options.surfaces)
    surfaces = [gc.random_surface(spectrum, grid, key) for key in keys]
    print(f"# {options.surfaces} surfaces, N = {n}: mean +- standard deviation; none, yp: mean")
    print("# field without correction and with that of Yang and Persson, from the spectrum")
    print(
        f"{'body':7s} {'p [Pa]':>8s} {'v [m/s]':>8s} {'area':>17s} {'none':>7s} {'yp':>7s} "
        f"{'friction':>19s} {'none':>8s} {'yp':>8s}"
    )
    for name, stack in bodies.items():
        for pressure in (3e4, 3e5):
            for velocity in (1e-3, 3e-2, 1.0):
                found = [
                    gc.slide(stack, surface, pressure=pressure, velocity=velocity, rtol=1e-5)
                    for surface in surfaces
                ]
                area = np.array([float(f.contact_area_smooth) for f in found])
                friction = np.array([float(f.friction) for f in found])
                fields = [
                    gc.mean_field_friction(
                        stack, spectrum, pressure=pressure, velocity=velocity, correction=c
                    )
                    for c in ("none", "yang_persson")
                ]
                print(
                    f"{name:7s} {pressure:8.0e} {velocity:8.0e} "
                    f"{area.mean():8.4f} +-{area.std():7.4f} "
                    + " ".join(f"{float(f.contact_area):7.4f}" for f in fields)
                    + f" {friction.mean():9.5f} +-{friction.std():8.5f} "
                    + " ".join(f"{float(f.friction):8.5f}" for f in fields),
                    flush=True,
                )


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    sections = parser.add_subparsers(required=True)
    part = sections.add_parser("speed", help="milliseconds and quadrature error")
    part.set_defaults(run=speed)
    part = sections.add_parser("contact", help="against the contact solver")
    part.add_argument("--size", type=int, default=512)
    part.add_argument("--surfaces", type=int, default=8)
    part.add_argument("--seed", type=int, default=0)
    part.set_defaults(run=contact)
    options = parser.parse_args()
    device = jax.devices()[0].device_kind
    print(f"# graded_contact {gc.__version__}, jax {jax.__version__}, {device}, ", end="")
    print(f"{platform.machine()}, float64")
    options.run(options)


if __name__ == "__main__":
    main()
