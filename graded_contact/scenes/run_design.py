"""Designs of scenes, run: the mean field searches, contact goes on, polishes and verifies.

mean field ─ minimise ─> designed ── exact enough? ── yes ──┐
                             └─ no ─> contacts ─ minimise ─>┤ polish ─> polished ─> contact on
                                                  before ───┘           unseen surfaces ─> report
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import Stack
from ..core.compilation import jit
from ..core.display import shown
from ..core.parameters import paths, with_values
from ..mean_field.mean_field import MeanField
from ..studies.dataset import NOT_STARTED
from ..studies.search import Design, minimise
from ..studies.store import Store
from ..studies.sweep import sweep
from ..surfaces.surface import Surface
from .design_quantities import (
    BY_MEAN_FIELD,
    OF_CONTACT,
    Quantities,
    Values,
    block_margins,
    contact_at,
    contact_quantities,
    design_mean_field,
    has_mean_field,
    search_surfaces,
)
from .design_scene import DesignScene
from .design_search import (
    Method,
    Progress,
    check_design_memory,
    contact_problem,
    not_in_mean_field,
    search_design,
)
from .scene_checks import refuse_liquids
from .surface_source import RandomSurface
from .theory import refuse_extrapolated

POLISHING_STEPS = 6
POLISHING = 10  # approximate number of evaluations


@shown()
class Candidate(NamedTuple):
    """A block, its mean field and its contacts.

    **Fields:**

    - `stack`: the block.
    - `field`: the mean field at each velocity; None for a motion or a window.
    - `contacts`: by name "friction", "contact_area" [1] and what else the study limits or searches
      for, each of shape (surfaces, velocities). Without verification there are no surfaces, or
      after a search by contact one row, the mean over its surfaces.
    """

    stack: Stack
    field: MeanField | None
    contacts: dict[str, np.ndarray]


@shown("method", "reason", "design", "polished", "candidates")
class DesignResults(NamedTuple):
    """The design of a scene, and the contacts that verify it.

    **Fields:**

    - `study`: the scene and its table [design].
    - `design`: what the search found.
    - `polished`: by the contact solver on other surfaces, or None.
    - `candidates`: "before", "designed" and, if polished, "polished".
    - `method`: what the search evaluated last: "response", "mean field" or "contact".
    - `reason`: of the method, one sentence.
    """

    study: DesignScene
    design: Design
    polished: Design | None
    candidates: dict[str, Candidate]
    method: Method = "mean field"
    reason: str = ""


def run_design(
    study: DesignScene, *, store: Store | None = None, progress: Progress | None = None
) -> DesignResults:
    """Returns the design of a scene, and the contacts that verify it.

    The mean field searches if it knows the objective. Contact goes on from its design, one program
    for a step, in three cases: the mean field does not know the objective or a limit, finds nothing
    within the limits, or is more than 5 % off at its design. What counts is the change from the
    block of the scene, or the value itself if there is a `target` or a limit.

    **Arguments:**

    - `study`: what to design.
    - `store`: stores every evaluation and every contact at once. The same study continues from
      there; another study uses the entries that both have in common.
    - `progress`: called with the current step, the number done and the total, after every
      evaluation and solve. An exception in it ends the design.

    **Raises:** `ValueError` for bounds and limits that nothing satisfies, a start outside the
    bounds, or a block with friction from frequencies at which its materials were not measured (more
    than 1 %, by mean field, unless [load] has `extrapolate = true`); `RuntimeError` if a contact or
    the mean field is not solved to its tolerance.
    """
    check_design(study)
    own, say = study.scene.stack, progress or (lambda *_: None)
    surfaces = cache(lambda: search_surfaces(study))  # drawn when they are needed
    # Of the values of the parameters: one program for all blocks.
    program = jit(lambda values: contact_quantities(study, with_values(own, values), surfaces()))

    def contacts(values: Values) -> Quantities:
        surfaces()  # not inside the program, which would keep them
        return program(values)

    design, method, reason = search_design(study, surfaces, contacts, store, say)
    start = {path: paths(own)[path] for path in study.lower}
    found = {"before": start, "designed": design.parameters}
    polished = None
    if study.polish:
        polished = _polish(study, design, store, say)
        found["polished"] = polished.parameters
    candidates = {}
    for name, values in found.items():
        stack = with_values(own, values)
        field = design_mean_field(study, stack) if has_mean_field(study) else None
        if study.verify or method != "contact":
            solved = _verified(study, stack, 0, store, partial(say, f"contact, {name}"))
        else:
            solved = {key: np.asarray(value)[None] for key, value in contacts(values).items()}
        candidates[name] = Candidate(stack, field, solved)
    return DesignResults(study, design, polished, candidates, method, reason)


def check_design(study: DesignScene) -> None:
    """Raises `ValueError` for what `run_design` refuses before its first evaluation.

    These are contacts that need more memory than is free, friction from frequencies at which the
    block's materials were not measured, and a liquid under waves at rest.
    """
    own = study.scene.stack
    searched = bool(study.polish or not_in_mean_field(study))
    by_contact = searched or study.verify > 0
    if by_contact:
        check_design_memory(study, searched=searched)
    # The mean field of a spectrum has no waves at rest; contacts and a surface's modes have.
    on_grid = by_contact or isinstance(study.spectrum, Surface)
    stiffness_at_rest = study.stiffness is not None and study.stiffness.omega == 0
    at_rest = (on_grid and study.grid.ndim == 2) or study.scene.motion is not None
    if at_rest or stiffness_at_rest:
        refuse_liquids(study.scene)
    if has_mean_field(study):
        refuse_extrapolated(
            study.scene, own, study.grid,
            lambda: design_mean_field(study, own).extrapolated_friction,
        )  # fmt: skip


def _polish(study: DesignScene, design: Design, store: Store | None, say: Progress) -> Design:
    """A few steps from the design, by the contact solver's gradients on surfaces of their own."""
    count, done = study.verify, 0
    # Other surfaces than those of the verification, which the search must not have seen.
    surfaces = [_unseen(study, count + i) for i in range(count)]
    solved = _verified(study, study.scene.stack, count, store, partial(say, "polish, before"))
    before = {name: np.mean(values, axis=0) for name, values in solved.items()}

    def after_evaluation(_: int, value: float) -> None:
        nonlocal done
        done += 1
        say(f"polish, value {value:.4g}", min(done, POLISHING), POLISHING)

    say("polish", 0, POLISHING)
    polished = minimise(
        contact_problem(study, surfaces, before), study.lower, study.upper, design.parameters,
        constraints=partial(block_margins, study), num_starts=1, max_steps=POLISHING_STEPS,
        store=store, progress=after_evaluation,
    )  # fmt: skip
    say("polish", POLISHING, POLISHING)
    return polished


def _unseen(study: DesignScene, index: Any) -> Surface:
    """One of the surfaces for verification, or after these one of those for polishing."""
    source = study.scene.surface
    assert isinstance(source, RandomSurface)
    keys = jax.random.split(jax.random.key(source.seed), 2 * study.verify)
    return source.of_key(keys[index])


def _verified(
    study: DesignScene, stack: Stack, first: int, store: Store | None, say: Callable
) -> dict[str, Float[np.ndarray, "surfaces velocities"]]:
    """What contacts of a stack on `verify` surfaces give, from the store or for it."""
    names = dict.fromkeys((*BY_MEAN_FIELD, *study.quantities))
    velocity = study.scene.velocity
    if not study.verify:
        return {name: np.zeros((0, len(velocity))) for name in names}

    def solved(point: dict[str, Any]) -> dict[str, Array]:
        found = contact_at(study, stack, _unseen(study, point["surface"]), point["velocity"])
        return {name: OF_CONTACT[name](found) for name in names}

    axes = {"surface": first + np.arange(study.verify), "velocity": velocity}
    found = sweep(solved, axes, store=store, progress=say)
    ends = found["message"].values
    if np.any(ends == NOT_STARTED):  # `sweep` returns what it has after an interruption
        raise KeyboardInterrupt
    if np.any(ends != ""):
        raise RuntimeError(ends[ends != ""][0])
    return {name: found[name].values for name in names}
