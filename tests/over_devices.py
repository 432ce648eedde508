"""The mean square pressure of a contact over several processes, printed: run by `test_devices.py`.

Arguments: the address of a coordinator, the number of processes and the index of this one.
"""

import sys

import jax
import numpy as np

import graded_contact as gc

if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    jax.distributed.initialize(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))

FIRST = 2 * np.pi / 1e-2
SPECTRUM = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=FIRST, q_roll=2 * FIRST, q_high=4 * FIRST)
BLOCK = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [9e6], [1e-3], 0.5)))

SOLVER = gc.contacts.DouglasRachford(newton=False)


@jax.jit
def mean_square(surface):
    kernel = gc.stack_kernel(BLOCK, surface.grid, 0.5)
    contact = gc.solve_contact(kernel, surface.heights, 2e5, rtol=1e-4, solver=SOLVER)
    return jax.numpy.mean(contact.pressure**2)


def draw(devices):
    return gc.random_surface(SPECTRUM, gc.Grid((8, 12), 1e-2, devices), jax.random.key(0))


if __name__ == "__main__":
    print(jax.process_count(), mean_square(draw(jax.devices())))
