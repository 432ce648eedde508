"""Errors and times of contacts.

    python benchmarks/bench_contact.py elastic   compared with Tamaas and ContactMechanics
    python benchmarks/bench_contact.py kernel    layered contacts, compared with Tamaas
    python benchmarks/bench_contact.py grid      errors of grid and times, estimated and true
    python benchmarks/bench_contact.py total     total error against seconds, and Tamaas
    python benchmarks/bench_contact.py random    random scenes: failures, broken claims
    python benchmarks/bench_contact.py hard      small contacts, moduli far apart
    python benchmarks/bench_contact.py gradient  cost of derivatives
    python benchmarks/bench_contact.py first     seconds before the first answer
    python benchmarks/bench_contact.py largest   N = 8192: minutes and memory

One FFT pair is a real transform and its inverse on the full grid; coarse grids count by their size.
Errors are of the pressure, root mean square, against a solution at 1e-10, unless stated. Surface:
H = 0.8, roll-off 4 q0, cut-off (N/8) q0, rms slope 0.1. Bodies, all of reduced modulus 1 Pa at
rest: elastic; `single`, one relaxation time, tenfold; `broad`, 1000-fold over ten decades; `tread`,
the package's at -10 °C; `+coat`, under an elastic coat of modulus 1 Pa, q0 d = 6e-3.
"""

from contact_costs import gradient, largest
from contact_first_calls import first, first_of
from contact_grid import grid, total
from contact_peers import elastic, kernel
from contact_random import hard, random
from rows import run

if __name__ == "__main__":
    run(__doc__, elastic, kernel, grid, total, random, hard, gradient, first, first_of, largest)
