"""Built-in materials, each with the status of its numbers."""

import numpy as np

from .material import Prony
from .shift import WLF

# Three Cole-Cole / Havriliak-Negami processes (glass, intermediate, slow filler tail) of a filled
# SBR tread, written as 18 Maxwell branches and rounded to three digits. Synthetic.
_TREAD_EQUILIBRIUM = 6.51e6  # Pa
_TREAD_TIMES = np.array(
    [1.98e-14, 2.07e-13, 1.94e-12, 1.64e-11, 1.2e-10, 9.42e-10, 8.62e-9, 8.77e-8, 9.38e-7,
     9.5e-6, 9.27e-5, 8.95e-4, 8.42e-3, 7.73e-2, 7.01e-1, 6.38, 58.5, 592.0]
)  # s  # fmt: skip
_TREAD_STRENGTHS = np.array(
    [1.12e8, 2.16e8, 4.33e8, 6.95e8, 6.05e8, 2.56e8, 8.14e7, 2.61e7, 1.03e7,
     5.25e6, 3.08e6, 2.08e6, 1.6e6, 1.28e6, 9.92e5, 7.25e5, 5.02e5, 3.84e5]
)  # Pa  # fmt: skip


def tyre_tread(poisson: float = 0.5) -> Prony:
    """Returns a synthetic, representative filled-SBR tyre tread at 20 °C (293.15 K).

    These numbers were composed, not measured: they have the magnitudes of a filled SBR tread
    (E from 6.51 MPa to 2.46 GPa over 16 decades of relaxation time, loss tangent 0.08 to 0.14
    between 0.1 Hz and 1 kHz, 0.87 at its maximum near 95 MHz) and are no particular compound.
    For work on a real one, use its measured moduli.

    Temperature: WLF with c1 = 4.57, c2 = 113.6 K about 298.15 K, the constants of SBR with
    23.5 % styrene (J. D. Ferry, Viscoelastic Properties of Polymers, 3rd ed., Wiley 1980,
    table 11-II), rewritten about 293.15 K. `tyre_tread().at(268.15)` is the tread at -5 °C.

    **Arguments:**

    - `poisson`: Poisson's ratio ν [1], -1 < ν <= 1/2.

    **Returns:** the material, with its law of temperature.
    """
    shift = WLF(c1=4.57, c2=113.6, reference=298.15).rebased(293.15)
    return Prony(_TREAD_EQUILIBRIUM, _TREAD_STRENGTHS, _TREAD_TIMES, poisson, shift)
