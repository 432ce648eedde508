"""A sliding contact on four devices and on one, told as JSON: run by `test_devices.py`.

Its shape falls into no equal parts where that can happen: half spectra and coarse grids. With the
address of a coordinator, the number of processes and that of this one: the friction over them.
"""

import json
import re
import sys

import jax
import numpy as np

import graded_contact as gc
from graded_contact.core import anderson

jax.config.update("jax_enable_x64", True)
if sys.argv[1:]:
    jax.distributed.initialize(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))

anderson.SAMPLED_FROM = 0  # rows are sampled, as on large grids
SHAPE, RTOL = (36, 50), 1e-9
FIRST = 2 * np.pi / 1e-2
SPECTRUM = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=FIRST, q_roll=3 * FIRST, q_high=12 * FIRST)
BLOCK = gc.Stack(
    layers=(gc.Layer(gc.Elastic(6.5e6, 0.49), 2e-4),),
    base=gc.HalfSpace(gc.Prony(1e6, [9e6], [1e-3], 0.5)),
)
SOLVER = gc.contacts.DouglasRachford(coarsest=18, newton=False)
NUMBERS = ("friction", "contact_area", "energy_imbalance", "mean_gap")


def draw(devices) -> gc.Surface:
    return gc.random_surface(SPECTRUM, gc.Grid(SHAPE, 1e-2, devices), jax.random.key(0))


@jax.jit
def friction(block, surface):
    """The friction and its contact."""
    found = gc.slide(block, surface, pressure=2e5, velocity=0.5, rtol=RTOL, solver=SOLVER)
    return found.friction, found


derivatives = jax.jit(jax.value_and_grad(friction, (0, 1), has_aux=True))


def largest_exchanges(program) -> dict[str, int]:
    """Bytes of the largest result of each kind of collective operation."""
    size = {"pred": 1, "s32": 4, "f32": 4, "c64": 8, "s64": 8, "u64": 8, "f64": 8, "c128": 16}
    kinds = "all-gather|all-to-all|all-reduce|collective-permute|reduce-scatter"
    largest = {}
    for result, kind in re.findall(rf"= (.*?) ({kinds})(?:-start)?\(", program.as_text()):
        arrays = re.findall(r"(\w+)\[([\d,]*)\]", result)
        total = sum(size[t] * int(np.prod([int(n) for n in s.split(",") if n])) for t, s in arrays)
        largest[kind] = max(largest.get(kind, 0), total)
    return largest


def distance(many, one) -> float:
    """The largest difference, over the largest number."""
    many, one = (
        np.concatenate([np.ravel(np.asarray(x)) for x in jax.tree.leaves(t)]) for t in (many, one)
    )
    return float(np.nanmax(np.abs(many - one)) / np.nanmax(np.abs(one)))


def curves(surface, found):
    waves = gc.sliding.cumulative_friction(found)
    finer = gc.surfaces.resample(surface, (24, 30))
    return waves.friction, gc.surfaces.radial_spectrum(surface)[1], finer.heights


def refusal(make) -> str:
    try:
        make()
    except ValueError as error:
        return str(error)
    return ""


def compare():
    surfaces = [draw(jax.devices()), draw(None)]
    programs = [derivatives.lower(BLOCK, surface).compile() for surface in surfaces]
    solved = [program(BLOCK, s) for program, s in zip(programs, surfaces, strict=True)]
    found, slopes = zip(*solved, strict=True)
    many, one = contacts = [contact for _, contact in found]
    pairs = {
        "surface": [surface.heights for surface in surfaces],
        "pressure": [many.pressure, one.pressure],
        "by block": [by_block.layers for by_block, _ in slopes],
        "by heights": [by_surface.heights for _, by_surface in slopes],
    }
    for i, name in enumerate(("cumulative", "spectrum", "resampled")):
        pairs[name] = [curves(*each)[i] for each in zip(surfaces, contacts, strict=True)]
    fields = [pair[0] for name, pair in pairs.items() if name in ("surface", "pressure")]
    told = {
        "distances": {name: distance(*pair) for name, pair in pairs.items()},
        "numbers": [list(map(float, s.compute(*NUMBERS))) for s in contacts],
        "fft pairs": [float(s.num_fft_pairs) for s in contacts],
        "shards": [[shard.data.shape for shard in field.addressable_shards] for field in fields],
        "exchanged": largest_exchanges(programs[0]),
        "temporaries": [p.memory_analysis().temp_size_in_bytes for p in programs],
        "refused": [
            refusal(lambda: gc.Grid((66, 64), 1.0, jax.devices())),
            refusal(lambda: gc.Grid((64,), 1.0, jax.devices())),
            refusal(lambda: gc.Surface(one.gap.at[20, 3].set(np.nan), surfaces[0].grid)),
        ],
    }
    print(json.dumps(told))


def over_processes():
    value, _ = friction(BLOCK, draw(jax.devices()))
    print(json.dumps((jax.process_count(), float(value))))


if __name__ == "__main__":
    over_processes() if sys.argv[1:] else compare()
