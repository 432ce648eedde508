"""The system of the paper: one rubber, one coat, one roughness with three cut-offs.

M. Scaraggi & D. Comingio, "Rough contact mechanics for graded bulk rheology: The role of
small-scale wavelengths on rubber friction". What it leaves open or contradicts is chosen here:

- The tread is not tabulated: `gc.tyre_tread` at -5 °C, and ν = 1/2.
- The stated slopes (0.077, 0.095, 0.11) do not belong to the stated rms height of 0.16 mm, which
  with H = 0.8 gives 0.128, 0.150, 0.176. The spectra here have a slope of 0.11 with all waves.
- The thickness is "from q0 d = 0.63e-4" in the text and 0.63e-3 in the figures: 10 µm here.
"""

import argparse
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

import graded_contact as gc

jax.config.update("jax_enable_x64", True)
rcParams.update(gc.plot.STYLE)

Q0, HURST, SLOPE = 63.0, 0.8, 0.11  # longest wave [1/m], Hurst exponent, rms slope of all waves
VELOCITY, POISSON = 0.1, 0.5  # m/s, 1
POINTS_PER_WAVE = 8  # of the shortest
CUTOFFS = (256, 512, 1024)  # q1/q0
DEPTHS = (0.63e-3, 3.2e-3, 4.4e-3, 6.3e-3)  # q0 d
PRESSURES = (0.01, 0.02, 0.04, 0.07, 0.1, 0.17, 0.3, 0.5)  # σ0/E_r0
CLOSE_UP = (0.1, 0.3)  # pressures of the figure against the thickness


def tread() -> gc.Prony:
    """Returns the rubber of the block."""
    return gc.tyre_tread(POISSON).at(268.15)


def coated(rubber: gc.Prony, thickness) -> gc.Stack:
    """Returns the rubber under an elastic coat of its own relaxed modulus; thickness in m."""
    coat = gc.Elastic(rubber.equilibrium, POISSON)
    return gc.Stack(layers=(gc.Layer(coat, thickness),), base=gc.HalfSpace(rubber))


def spectrum(cutoff: int, all_waves: int = CUTOFFS[-1]) -> gc.SelfAffine:
    """Returns C(q) up to `cutoff` q0, equal for all cut-offs below it; `SLOPE` is of all waves."""

    def up_to(cutoff, **amplitude):
        return gc.SelfAffine(hurst=HURST, q_low=Q0, q_roll=4 * Q0, q_high=cutoff * Q0, **amplitude)

    inside = jnp.asarray(2 * Q0)
    ratio = up_to(all_waves, rms_slope=SLOPE).density(inside)
    return up_to(cutoff, rms_height=jnp.sqrt(ratio / up_to(cutoff, rms_height=1.0).density(inside)))


def surface(cutoff: int, all_waves: int, seed: int) -> gc.Surface:
    """Returns a random surface; equal seeds have equal waves below every cut-off."""
    grid = gc.Grid((POINTS_PER_WAVE * cutoff,) * 2, 2 * np.pi / Q0)
    return gc.random_surface(spectrum(cutoff, all_waves), grid, jax.random.key(seed))


def panels(count: int, width: float = 7.6, height: float = 3.2, rows: int = 1):
    """Returns a figure and its panels."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, count // rows, squeeze=False).ravel()


def save(figure: Figure, folder: Path, name: str) -> None:
    """Writes a figure as PNG."""
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name}.png")
    print(f"wrote {folder / name}.png")


def parser_of(doc: str | None) -> argparse.ArgumentParser:
    """Returns the parser of a script with the option --output."""
    parser = argparse.ArgumentParser(description=(doc or "").partition("\n")[0])
    parser.add_argument("--output", type=Path, default=Path("paper"), help="folder of the figures")
    return parser
