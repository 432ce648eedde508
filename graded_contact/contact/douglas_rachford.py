"""The fast solver: the splitting of `splitting.py` on nested grids, and its second gear.

Coarse grids find a start for finer ones; what is done on each is in `epochs.py`.
"""

from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..core.checks import check_whole, is_concrete
from .epochs import Plan, approach, found, gear_up, scenes
from .law import AbstractLaw
from .linear import LinearSplitting
from .newton_steps import takes_newton_steps
from .solver import AbstractContactSolver, Iterated, LinearSolver, Prescribed
from .splitting import check_relaxation

# All within 2 % of the fewest FFT pairs of `bench_contact.py viscoelastic`.
_COARSENING = 4  # from a grid to the next; by 2 takes more pairs, and more programs to compile
_GEARED_FROM = 1 / 16  # of the points: grids that Newton steps are for
_GEARED_UP_TO = 2**21  # points: they take more memory than is planned for larger ones
_FEW = 100  # steps on coarse grids and in drafts, where Newton steps follow
_STEPS, _MOST, _POINTS = 4000, 64_000, 2**16  # steps allowed on a grid of so many points
_MEMORY_AT_GAP = 2  # of given mean gaps; with 5 some loads diverged above an area of 0.99


class DouglasRachford(AbstractContactSolver):
    """Settings of the splitting. All static, but for `linear`.

    **Fields:**

    - `max_steps`: steps allowed on each grid before giving up, and in the draft of a large one;
      they are done in twos, and a Newton step counts by its FFT pairs. None for 4000, on grids of
      fewer than 2¹⁶ points for as many as cost the same, up to 64,000.
    - `relaxation`: α [1], between 0 and 1.
    - `memory`: earlier iterates that the acceleration combines, at a given mean gap two at most;
      each stores two fields, on a large grid three quarters of one.
    - `coarsest`: nesting starts from the first grid with fewer than twice this many points a side.
    - `linear`: finds derivatives, see `AbstractContactSolver`.
    - `keep`: called with the pressure [Pa] on the finest grid now and then while a solve goes on.
    """

    max_steps: int | None = eqx.field(default=None, static=True)
    relaxation: float = eqx.field(default=0.95, static=True)
    memory: int = eqx.field(default=5, static=True)
    coarsest: int = eqx.field(default=64, static=True)
    linear: LinearSolver = LinearSplitting()
    keep: Callable[[Array], None] | None = None
    finds_unstable: ClassVar[bool] = True

    def __check_init__(self):
        if self.max_steps is not None:
            check_whole("max_steps", self.max_steps, 1)
        check_whole("memory", self.memory, 1)
        check_whole("coarsest", self.coarsest, 4)
        check_relaxation(self.relaxation)

    def solve(
        self,
        kernel: Inexact[Array, "*half"],
        heights: Float[Array, "*shape"],
        law: AbstractLaw,
        prescribed: Prescribed,
        *,
        rtol: Float[Array, ""],
        start: Float[Array, "*shape"] | None,
    ) -> Iterated:
        """Returns the contact; `start` is a pressure [Pa] to begin from."""
        # A coarse grid would pull surfaces together that on the fine one stay apart.
        nested = start is None and not law.attracts
        shapes = _nested_shapes(heights.shape, self.coarsest) if nested else [heights.shape]
        reached = None
        for scene in scenes(kernel, heights, prescribed, shapes):
            plan = self._plan(scene.heights.shape, heights.shape, law, prescribed)
            # Outside `jit` Newton steps are compiled when the first solve needs them.
            in_parts = plan.geared and is_concrete(heights)
            before = start if reached is None else reached
            problem, state = approach(scene, law, prescribed, before, rtol, plan, in_parts)
            if in_parts and state.slow:
                state = gear_up(problem, state, rtol, plan)
            reached = problem, state
        assert reached is not None  # there is at least one grid
        return found(*reached)

    def _plan(self, level, shape, law: AbstractLaw, prescribed: Prescribed) -> Plan:
        points, share = int(np.prod(level)), float(np.prod(level) / np.prod(shape))
        finest = level == shape
        helped = takes_newton_steps(law) and prescribed.gap is None
        geared = helped and share >= _GEARED_FROM and points <= _GEARED_UP_TO
        alone = not helped or (finest and not geared)
        most = self.max_steps or _steps_of(points)
        few = most if alone else min(_FEW, most)
        keep = self.keep if finest else None
        limits = few, most if geared else few
        # At a given gap near full contact the load drifts, and long memories run away with it.
        memory = self.memory if prescribed.gap is None else min(self.memory, _MEMORY_AT_GAP)
        return Plan(share, finest, helped, geared, *limits, self.relaxation, memory, keep)


def _nested_shapes(shape: tuple[int, ...], coarsest: int) -> list[tuple[int, ...]]:
    shapes = [shape]
    while (points := min(shapes[0])) >= 2 * coarsest:
        factor = min(_COARSENING, points // coarsest)
        shapes.insert(0, tuple(-(-n // factor) for n in shapes[0]))
    return shapes


def _steps_of(points: int) -> int:
    return min(_STEPS * max(_POINTS // points, 1), _MOST)
