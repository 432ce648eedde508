"""What a tribometer's number contains: hysteresis, shear and heat, each switched on in turn.

python benchmarks/bench_measurement.py friction   the parts over velocity and temperature
python benchmarks/bench_measurement.py cost       what each part adds to friction and to a solve
python benchmarks/bench_measurement.py traction   what changes if the shear moves the surface

The built-in tread slides on a self-affine road. The road has the waves that a grid of 128² points
resolves, so that mean field and contact see the same one. The shear law and the thermal numbers are
examples, not measurements.
"""

import time

import jax
import jax.numpy as jnp
import numpy as np
from rows import report, run

import graded_contact as gc

POINTS, EDGE, PRESSURE = 128, 2e-3, 4e5  # 1, m, Pa
Q0 = 2 * np.pi / EDGE
ROAD = gc.SelfAffine(rms_slope=0.4, hurst=0.8, q_low=Q0, q_roll=3 * Q0, q_high=POINTS / 8 * Q0)
TREAD = gc.tyre_tread()
BLOCK = gc.Stack(base=gc.HalfSpace(TREAD))
SHEAR = gc.sliding.PeakedShear(peak=2e6, velocity=1e-2, steepness=0.1, shift=TREAD.shift)
HEATING = gc.sliding.Heating(conductivity=0.3, diffusivity=1.5e-7, counterface_conductivity=1.5)
TEMPERATURES = (-20, 0, 20, 40, 60, 80)  # °C
VELOCITIES = np.geomspace(1e-6, 30, 31)  # m/s
SOLVED = ((-20, 20, 80), (1e-6, 1e-4, 1e-2, 1e-1, 1.0, 5.0, 30.0))  # by contact, °C and m/s
MEASURED = (20, 1.0)  # of the table of costs


def under(material, thickness):
    """The tread under a coat."""
    return gc.Stack(layers=(gc.Layer(material, thickness),), base=BLOCK.base)


def road():
    return gc.random_surface(ROAD, gc.Grid((POINTS, POINTS), EDGE), jax.random.key(0))


def parts(found) -> dict[str, float]:
    area = found.contact_area
    heated = getattr(found, "heated", None)
    return {
        "hysteresis [1]": float(found.hysteresis_friction),
        "shear [1]": float(found.shear_friction),
        "friction [1]": float(found.friction),
        "contact area [1]": float(area),
        "rise of the surface [K]": 0.0 if heated is None else float(heated.surface_rise),
    }


def by_mean_field(celsius: float, velocity, **how):
    block = BLOCK.at(celsius + 273.15)
    return gc.mean_field_friction(block, ROAD, pressure=PRESSURE, velocity=velocity, **how)


def by_contact(surface, celsius: float, velocity: float, **how):
    """The block is shifted by `heating`, or here."""
    block = BLOCK if "heating" in how else BLOCK.at(celsius + 273.15)
    return gc.slide(block, surface, pressure=PRESSURE, velocity=velocity, **how)


def friction():
    """Hysteresis, shear and heat from -20 °C to 80 °C and from 1 µm/s to 30 m/s."""

    def keep(model, celsius, velocity, numbers):
        scene = {"model": model, "temperature [C]": float(celsius), "velocity [m/s]": velocity}
        report("bench_measurement-friction", scene | numbers)

    for celsius in TEMPERATURES:
        sheared = {"shear": SHEAR, "temperature": celsius + 273.15}

        def one(velocity, celsius=celsius, sheared=sheared):
            return by_mean_field(celsius, velocity, **sheared)

        found = jax.lax.map(one, jnp.asarray(VELOCITIES))
        for i, velocity in enumerate(VELOCITIES):
            numbers = parts(jax.tree.map(lambda leaf, i=i: leaf[i], found))
            keep("mean field", celsius, float(velocity), numbers)
    surface = road()
    for celsius in SOLVED[0]:
        sheared = {"shear": SHEAR, "temperature": celsius + 273.15}
        for velocity in SOLVED[1]:
            found = by_contact(surface, celsius, velocity, **sheared)
            keep("contact", celsius, velocity, parts(found))
            found = by_contact(surface, celsius, velocity, heating=HEATING, **sheared)
            keep("contact, heated", celsius, velocity, parts(found))


def cost():
    """What each part adds at 20 °C and 1 m/s; seconds of the processor of a compiled call."""
    celsius, velocity = MEASURED
    surface, sheared = road(), {"shear": SHEAR, "temperature": celsius + 273.15}

    def contact(**how):
        return lambda: by_contact(surface, celsius, velocity, **how)

    cases = {
        "hysteresis, mean field": lambda: by_mean_field(celsius, velocity),
        "and shear, mean field": lambda: by_mean_field(celsius, velocity, **sheared),
        "hysteresis, contact": contact(),
        "and shear, contact": contact(**sheared),
        "and heating, contact": contact(heating=HEATING, **sheared),
    }
    for name, solve in cases.items():
        found = jax.block_until_ready(solve())
        float(found.friction)
        start = time.process_time()
        found = solve()
        float(found.friction)
        seconds = time.process_time() - start
        report(
            "bench_measurement-cost",
            {"parts": name} | parts(found) | {"processor time [s]": seconds},
        )


def traction():
    """The parts at 20 °C with and without the coupling of traction and pressure."""
    surface = road()
    blocks = {
        "tread": BLOCK,
        "soft coat, ν 0.40": under(gc.Elastic(6e6, 0.40), 2e-5),
        "stiff coat, ν 0.35": under(gc.Elastic(1e8, 0.35), 1e-5),
    }
    for name, block in blocks.items():
        for velocity in (1e-3, 1e-1, 10.0):
            for coupled in (False, True):
                law = gc.sliding.PeakedShear(
                    peak=2e6, velocity=1e-2, steepness=0.1, shift=TREAD.shift, coupled=coupled
                )
                found = gc.slide(
                    block.at(293.15), surface, pressure=PRESSURE, velocity=velocity,
                    shear=law, temperature=293.15,
                )  # fmt: skip
                lost = found.block_friction if coupled else found.hysteresis_friction
                report("bench_measurement-traction", {
                    "block": name, "velocity [m/s]": velocity,
                    "coupled": "yes" if coupled else "no",
                    "slopes [1]": float(found.hysteresis_friction),
                    "shear [1]": float(found.shear_friction), "friction [1]": float(found.friction),
                    "lost in the block [1]": float(lost),
                    "contact area [1]": float(found.contact_area),
                    "FFT pairs": float(found.num_fft_pairs),
                })  # fmt: skip


if __name__ == "__main__":
    run(__doc__, friction, cost, traction)
