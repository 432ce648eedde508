"""Whether a load is below the pull-off of a contact, so that no equilibrium exists.

The acceleration of the splitting keeps the iterates near the point where the equilibrium was lost.
Without it they part, but by the load alone in each step, which is small where few points touch. So
the mean gap is moved by more, as if these points alone held the load:

    z⁺ = z + 2α (y - x) + g ⟨y - x⟩,        g = 0.1 over the share of points that touch.

Once no gap is stable by itself and the law pulls less than the load, the gap opens without end. The
steps begin at full contact: where surfaces part from there, unloading reaches no equilibrium. Of 42
wavy lines at random tensions none parted that another start held; from the start of the solve 5
did.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool

from ..operators.operator import Field, root_mean_square
from .abstract_solver import run_steps, slope
from .splitting import Splitting

RELEASED_FROM = 200  # steps without an end, after which a load is tried
_GAIN, _LARGEST_GAIN = 0.1, 300.0  # with a gain of 1 spheres part at any load
_SETTLED = 1e-3  # difference of the pressures of solid and law near an equilibrium, over theirs


class Release(NamedTuple):
    """State of the steps."""

    z: Field
    num_steps: Array
    parted: Bool[Array, ""]
    settled: Bool[Array, ""]


class Releasing(eqx.Module):
    """The steps, for `run_steps`."""

    splitting: Splitting

    def init(self, start: Field) -> Release:
        no = jnp.asarray(False)
        return Release(start, jnp.asarray(0), no, no)

    def step(self, state: Release) -> Release:
        solid, proximal, z = self.splitting.solid, self.splitting.proximal, state.z
        x = self.splitting.shift + solid.resolve(z)
        v = 2 * x - z
        y, s = proximal(v), slope(proximal, v)
        excess = jnp.mean(y) - jnp.mean(x)
        touching = jnp.maximum(jnp.mean(jnp.abs(s)), _GAIN / _LARGEST_GAIN)
        parted = jnp.all(s <= 0) & (excess > 0)
        settled = root_mean_square(y - x) <= _SETTLED * root_mean_square(x)
        z = z + 2 * self.splitting.relaxation * (y - x) + _GAIN / touching * excess
        return Release(z, state.num_steps + 1, parted, settled)

    def done(self, state: Release) -> Bool[Array, ""]:
        return state.parted | state.settled


def let_part(splitting: Splitting, start: Field, max_steps: Array) -> Release:
    """Returns where surfaces are that are let go from a start, after so many steps at most."""
    return run_steps(Releasing(splitting), start, max_steps)
