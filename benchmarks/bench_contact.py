"""How many transforms, how long and how exact: contact of elastic and viscoelastic bodies.

    python benchmarks/bench_contact.py elastic       beside Tamaas and ContactMechanics
    python benchmarks/bench_contact.py viscoelastic  FFT pairs, growth with N, the paper's method
    python benchmarks/bench_contact.py observables   friction, area, gap: errors, claims, pairs
    python benchmarks/bench_contact.py random        random scenes: any failure, any false claim?
    python benchmarks/bench_contact.py hard          small contacts, moduli far apart
    python benchmarks/bench_contact.py overhead      wall time over that of the transforms alone
    python benchmarks/bench_contact.py many          many small solves in one program
    python benchmarks/bench_contact.py cylinder      gliding cylinder, exact
    python benchmarks/bench_contact.py kernel        layered contacts as Tamaas finds them
    python benchmarks/bench_contact.py gradient      cost of derivatives
    python benchmarks/bench_contact.py largest       N = 8192: minutes and memory

One FFT pair is a real transform forth and back on the full grid; coarse grids count by their size.
Errors are of the pressure, root mean square, against a solution at 1e-10, unless stated. Surface:
H = 0.8, roll-off 4 q0, cut-off (N/8) q0, rms slope 0.1. Bodies, all of reduced modulus 1 Pa at
rest: elastic; `single`, one relaxation time, tenfold; `broad`, 1000-fold over ten decades; `tread`,
the package's at -10 °C; `+coat`, under an elastic coat of modulus 1 Pa, q0 d = 6e-3.
"""

import argparse
import importlib

import jax

jax.config.update("jax_enable_x64", True)

# Peers are imported only by the sections that need them.
SECTIONS = {
    "elastic": ("contact_peers", "beside Tamaas and ContactMechanics"),
    "viscoelastic": ("contact_viscoelastic", "FFT pairs, growth with N, the paper's method"),
    "observables": ("contact_observables", "friction, area and gap: errors, claims, pairs"),
    "random": ("contact_random", "random scenes"),
    "hard": ("contact_hard", "small contacts, moduli far apart"),
    "overhead": ("contact_costs", "wall time over that of the transforms alone"),
    "overhead_of": ("contact_costs", "the same with one backend, in this process"),
    "many": ("contact_costs", "many small solves in one program"),
    "many_on": ("contact_costs", "the same on so many cores, in this process"),
    "cylinder": ("contact_cylinder", "gliding cylinder, exact"),
    "kernel": ("contact_peers", "layered contacts as Tamaas finds them"),
    "gradient": ("contact_costs", "cost of derivatives"),
    "largest": ("contact_costs", "N = 8192: minutes and memory"),
}
LOADS = [0.01, 0.1, 0.3]
PEERS = ["tamaas", "ContactMechanics"]
VISCOELASTIC = [
    "elastic", "single", "single+coat", "tread", "tread+coat", "broad", "broad+coat",
]  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    sections = parser.add_subparsers(dest="section", required=True)
    parts = {name: sections.add_parser(name, help=text) for name, (_, text) in SECTIONS.items()}

    def many(names, option, kind, default, **more):
        for name in names:
            parts[name].add_argument(option, type=kind, nargs="*", default=default, **more)

    def one(name, option, kind, default, **more):
        parts[name].add_argument(option, type=kind, default=default, **more)

    many(["elastic"], "--sizes", int, [256, 512, 1024])
    many(["elastic"], "--targets", float, [1e-4, 1e-8], help="true errors to compare at")
    many(["elastic"], "--peers", str, PEERS, choices=PEERS)
    one("elastic", "--tamaas-up-to", int, 1024, help="largest N for it")
    one("elastic", "--mechanics-up-to", int, 512, help="largest N for ContactMechanics")
    one("elastic", "--tries", int, 3, help="runs of a peer in search of equal error")
    one("elastic", "--repeat", int, 5)

    many(["viscoelastic"], "--sizes", int, [256, 512, 1024, 2048])
    many(["viscoelastic"], "--bodies", str, VISCOELASTIC, choices=VISCOELASTIC)
    many(["viscoelastic"], "--dynamics-sizes", int, [128], help="N for the paper's method")
    many(["viscoelastic"], "--ranges", float, [0.1, 0.01], help="of its law, over the rms height")
    one("viscoelastic", "--dynamics-steps", int, 100_000)
    parts["viscoelastic"].add_argument(
        "--uniform-mass", action="store_true", help="plain molecular dynamics"
    )

    many(["observables"], "--sizes", int, [128, 256, 512])
    many(["observables"], "--bodies", str, VISCOELASTIC, choices=VISCOELASTIC)
    parts["observables"].add_argument("--gradients", action="store_true", help="of friction too")

    one("random", "--count", int, 500)
    one("random", "--seed", int, 0)
    one("hard", "--size", int, 128)
    one("hard", "--count", int, 0, help="random scenes in place of the tables")
    one("hard", "--seed", int, 0)

    many(["overhead", "overhead_of"], "--sizes", int, [256, 512, 1024, 2048])
    many(["overhead"], "--backends", str, ["xla", "ducc0"])
    parts["overhead_of"].add_argument("backend", choices=["xla", "ducc0"])
    many(["many", "many_on"], "--sizes", int, [64, 128, 256])
    many(["many"], "--cores", int, [1, 2])
    parts["many_on"].add_argument("cores", type=int)
    for name in ("many", "many_on"):
        one(name, "--count", int, 200)
    for name in ("overhead", "overhead_of", "gradient"):
        one(name, "--repeat", int, 3)

    many(["cylinder"], "--points", int, [16, 32, 64, 128], help="to a half-width at rest")
    many(["cylinder"], "--speeds", float, [0.01, 0.1, 1, 3, 10, 100], help="τv over that")

    many(["kernel"], "--sizes", int, [128, 256])
    many(["gradient"], "--sizes", int, [512, 1024])
    many(["gradient"], "--bodies", str, ["single", "tread+coat"], choices=VISCOELASTIC)
    many(["elastic", "viscoelastic", "observables"], "--loads", float, LOADS)
    many(["kernel", "gradient"], "--loads", float, [0.01, 0.1])

    one("largest", "--size", int, 8192)
    one("largest", "--velocity", float, 0.1)
    many(["largest"], "--loads", float, [0.1])

    options = parser.parse_args()
    module, _ = SECTIONS[options.section]
    getattr(importlib.import_module(module), options.section)(options)


if __name__ == "__main__":
    main()
