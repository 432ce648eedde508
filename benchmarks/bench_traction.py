"""What a traction that moves the surface changes on rough layered blocks.

    python benchmarks/bench_traction.py

Blocks slide under Coulomb's law with and without coupling on 128² points. The benchmark prints the
force beyond f, the contact area, the largest pressure, the force lost in the block and at the
interface, the FFT pairs, and the seconds of a solve whose programs are compiled.
"""

import time

import jax
import numpy as np

import graded_contact as gc
from graded_contact.sliding import Coulomb

CELL, PRESSURE, VELOCITY = 4e-3, 2e5, 0.1
Q0 = 2 * np.pi / CELL
HEAD = "block | f | coupled | force - f | area | peak [MPa] | block | interface | pairs | seconds"


def blocks() -> dict[str, gc.Stack]:
    base = gc.HalfSpace(gc.tyre_tread())
    coated = lambda *coat: gc.Stack(layers=(gc.Layer(*coat),), base=base)  # noqa: E731
    bonded = gc.Layer(gc.Prony(1e6, [9e6], [1e-3], 0.5), 2e-4)
    return {
        "tyre tread": gc.Stack(base=base),
        "soft coat": coated(gc.Elastic(6.5e6, 0.49), 5e-5),
        "stiff coat": coated(gc.Elastic(3e8, 0.35), 2e-5),
        "foam": gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [4e6], [1e-3], 0.2))),
        "bonded rubber": gc.Stack(layers=(bonded,), base=gc.Rigid()),
    }


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    spectrum = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=Q0, q_roll=2 * Q0, q_high=16 * Q0)
    road = gc.random_surface(spectrum, gc.Grid((128, 128), CELL), jax.random.key(0))
    print(HEAD)
    for name, block in blocks().items():
        for f in (0.5, 1.0):
            for coupled in (False, True):
                line(name, block, road, f, coupled)


def line(name: str, block: gc.Stack, road: gc.Surface, f: float, coupled: bool) -> None:
    shear = Coulomb(f, coupled=coupled)
    given = dict(pressure=PRESSURE, velocity=VELOCITY, shear=shear, rtol=1e-7)
    words = f"{name} | {f:g} | {'yes' if coupled else 'no'} | "
    try:
        gc.slide(block, road, **given)
    except ValueError as error:
        print(f"{words}{error}")
        return
    began = time.perf_counter()
    s = jax.block_until_ready(gc.slide(block, road, **given))
    seconds = time.perf_counter() - began
    lost = s.block_friction if coupled else s.hysteresis_friction
    print(
        f"{words}{s.friction - f:+.4f} | {s.contact_area:.4f} | {np.max(s.pressure) / 1e6:.2f} | "
        f"{lost:.4f} | {s.friction - lost:.4f} | {s.num_fft_pairs:.0f} | {seconds:.2f}"
    )


if __name__ == "__main__":
    main()
