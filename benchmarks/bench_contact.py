"""Transforms, times and errors of contacts of elastic and viscoelastic bodies.

    python benchmarks/bench_contact.py elastic       compared with Tamaas and ContactMechanics
    python benchmarks/bench_contact.py viscoelastic  FFT pairs, growth with N
    python benchmarks/bench_contact.py observables   friction, area, gap: errors, claims, pairs
    python benchmarks/bench_contact.py grid          errors of grid and times, estimated and true
    python benchmarks/bench_contact.py total         total error against seconds, and Tamaas
    python benchmarks/bench_contact.py random        random scenes: failures, broken claims
    python benchmarks/bench_contact.py default       random scenes: errors at the default rtol
    python benchmarks/bench_contact.py attracted     random scenes that attract: broken claims
    python benchmarks/bench_contact.py hard          small contacts, moduli far apart
    python benchmarks/bench_contact.py stiffness     errors of the stiffness, true and claimed
    python benchmarks/bench_contact.py overhead      wall time over that of the transforms alone
    python benchmarks/bench_contact.py many          many small solves in one program
    python benchmarks/bench_contact.py cylinder      gliding cylinder, exact
    python benchmarks/bench_contact.py kernel        layered contacts, compared with Tamaas
    python benchmarks/bench_contact.py gradient      cost of derivatives
    python benchmarks/bench_contact.py linear        FFT pairs and errors of their linear solves
    python benchmarks/bench_contact.py first         seconds before the first answer
    python benchmarks/bench_contact.py features      the same of parts of a scene
    python benchmarks/bench_contact.py cycle         periodic motion, beside time steps
    python benchmarks/bench_contact.py cycle_times   periodic motion with more and fewer times
    python benchmarks/bench_contact.py transient     transient motion: cost of a step
    python benchmarks/bench_contact.py largest       N = 8192: minutes and memory

One FFT pair is a real transform and its inverse on the full grid; coarse grids count by their size.
Errors are of the pressure, root mean square, against a solution at 1e-10, unless stated. Surface:
H = 0.8, roll-off 4 q0, cut-off (N/8) q0, rms slope 0.1. Bodies, all of reduced modulus 1 Pa at
rest: elastic; `single`, one relaxation time, tenfold; `broad`, 1000-fold over ten decades; `tread`,
the package's at -10 °C; `+coat`, under an elastic coat of modulus 1 Pa, q0 d = 6e-3.
"""

from contact_costs import (
    gradient,
    largest,
    linear,
    many,
    many_on,
    overhead,
    overhead_of,
)
from contact_cycle import cycle, cycle_times
from contact_cylinder import cylinder
from contact_errors import observables, viscoelastic
from contact_first_calls import features, features_of, first, first_of
from contact_grid import grid, total
from contact_peers import elastic, kernel
from contact_random import attracted, default, hard, random
from contact_stiffness import stiffness
from contact_transient import transient
from rows import run


def main():
    run(
        __doc__, elastic, viscoelastic, observables, grid, total, random, default, attracted,
        hard, stiffness, overhead, overhead_of, many, many_on, cylinder, cycle, cycle_times,
        transient, kernel, gradient, linear, first, first_of, features, features_of, largest,
    )  # fmt: skip


if __name__ == "__main__":
    main()
