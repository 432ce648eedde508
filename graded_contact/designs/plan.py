"""A design that is ready to run: the mean field searches, contact goes on and verifies.

mean field ─ minimise ─> designed ── exact enough? ── yes ──┐
                             └─ no ─> contacts ─ minimise ─>┤
                                                  before ───┴─> contact on unseen surfaces ─> report
"""

import dataclasses
from functools import cache, partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import Stack
from ..core.parameters import with_values
from ..scenes.plan import cost_text
from ..scenes.scene_checks import refuse_liquids
from ..scenes.surface_source import RandomSurface
from ..sliding.result import warnings_of
from ..studies.dataset import NOT_STARTED
from ..studies.old_sweep import sweep
from ..studies.store import Store
from ..surfaces.surface import Surface
from .limits import BY_MEAN_FIELD
from .problem import by_contact, criteria_in, design_contact, design_mean_field
from .results import Candidate, DesignResults
from .search import (
    CONTACT_STARTS,
    Progress,
    check_design_memory,
    design_fields,
    not_in_mean_field,
    search_design,
)
from .table import DesignScene

CONTACT_EVALUATIONS = 10  # of a start, approximately


@dataclasses.dataclass(frozen=True, eq=False)
class DesignPlan:
    """A design that is ready to run; `print` shows what it takes, and what makes it doubtful.

    **Fields:**

    - `study`: what to design, see `read_design`.
    """

    study: DesignScene

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes every number doubtful: of a surface from a file, assumed, or a wrong unit."""
        study = self.study
        return *getattr(study.spectrum, "warnings", ()), *study.scene.assumed, *study.doubts

    @property
    def num_solves(self) -> int:
        """Contacts of the search, which are seldom needless, and of the verification."""
        study, num_velocities = self.study, self.study.scene.velocity.size
        num_solves = 2 * study.verify * num_velocities
        if study.criteria:  # each evaluation has a derivative, which takes another solve
            starts = study.starts or CONTACT_STARTS
            num_solves += study.seeds * num_velocities * starts * 2 * CONTACT_EVALUATIONS
        return num_solves

    def __str__(self) -> str:
        study, num_solves = self.study, self.num_solves
        fields = design_fields(study, searched=bool(study.criteria)) if num_solves else 0.0
        # Without a search the number is known; a search often needs fewer.
        told = f"at most about {num_solves}" if study.criteria else num_solves
        return cost_text(study.grid.shape, fields, told, self.warnings)

    def run(self, *, store: Store | None = None, progress: Progress | None = None) -> DesignResults:
        """Returns the design of a scene, and the contacts that verify it.

        The mean field searches if it knows the objective. Contact goes on from its design, one
        program for a step, in three cases: the mean field does not know the objective or a limit,
        finds nothing within the limits, or is more than 5 % off at its design. What counts is the
        change from the block of the scene, or the value itself if there is a `target` or a limit.

        **Arguments:**

        - `store`: stores every evaluation and every contact at once. The same study continues from
          there; another study uses the entries that both have in common.
        - `progress`: called with the current step, the number done and the total, after every
          evaluation and solve. An exception in it ends the design.

        **Returns:** the design, with `report()`.

        **Raises:** `ValueError` for bounds and limits that nothing satisfies; `RuntimeError` if a
        contact or the mean field is not solved to its tolerance.
        """
        study, say = self.study, progress or (lambda *_: None)
        program = cache(lambda: by_contact(study))  # surfaces are drawn when they are needed
        contacts = lambda values: program()(values)  # noqa: E731
        design, method, reason = search_design(study, contacts, store, say)
        candidates = {}
        for name, values in (("before", study.start), ("designed", design.parameters)):
            stack = with_values(study.scene.stack, values)
            field = design_mean_field(study, stack) if study.has_mean_field else None
            warnings = ()
            if study.verify or method != "contact":
                solved, warnings = _verified(study, stack, store, partial(say, f"contact, {name}"))
            else:
                solved = {key: np.asarray(value)[None] for key, value in contacts(values).items()}
            candidates[name] = Candidate(stack, field, solved, warnings)
        return DesignResults(study, design, candidates, method, reason)


def plan_design(study: DesignScene) -> DesignPlan:
    """Returns a design that is ready to run; nothing is searched.

    **Arguments:**

    - `study`: what to design, see `read_design`.

    **Returns:** the plan; `plan_design(study).run()` gives the results.

    **Raises:** `ValueError` for contacts that need more memory than is free, or a liquid at rest.
    """
    kept = study.limits.stiffness
    searched = bool(not_in_mean_field(study))
    contacts = searched or study.verify > 0
    if contacts:
        check_design_memory(study, searched=searched)
    # The mean field of a spectrum has no waves at rest; contacts and a surface's modes have.
    on_grid = contacts or isinstance(study.spectrum, Surface)
    at_rest = (on_grid and study.grid.ndim == 2) or study.scene.motion is not None
    if at_rest or (kept is not None and kept.omega == 0):
        refuse_liquids(study.scene)
    return DesignPlan(study)


def _verified(
    study: DesignScene, stack: Stack, store: Store | None, say: Any
) -> tuple[dict[str, Float[np.ndarray, "surfaces velocities"]], tuple[str, ...]]:
    """The criteria by contacts of a stack on `verify` unseen surfaces, and what makes them
    doubtful; from the store or for it.
    """
    source, velocity = study.scene.surface, study.scene.velocity
    if not study.verify:
        names = dict.fromkeys((*BY_MEAN_FIELD, *study.criteria))
        return {name: np.zeros((0, len(velocity))) for name in names}, ()
    assert isinstance(source, RandomSurface)
    keys = jax.random.split(jax.random.key(source.seed), study.verify)

    def solved(point: dict[str, Any]) -> dict[str, dict[str, Array]]:
        surface = source.of_key(keys[point["surface"]])
        found = design_contact(study, stack, surface, point["velocity"])
        numbers = dict(zip(found.numbers, found.compute(*found.numbers), strict=True))
        return {"criteria": criteria_in(study, stack, found), "numbers": numbers}

    axes = {"surface": np.arange(study.verify), "velocity": velocity}
    found = sweep(solved, axes, store=store, progress=say)
    ends = found["message"].values
    if np.any(ends == NOT_STARTED):  # `sweep` returns what it has after an interruption
        raise KeyboardInterrupt
    if np.any(ends != ""):
        raise RuntimeError(ends[ends != ""][0])
    numbers = {str(name): variable.values for name, variable in found.data_vars.items()}
    known = lambda name: numbers.get(f"numbers.{name}", 0.0)  # noqa: E731
    warnings = warnings_of(known, study.scene.kind)
    head = "criteria."
    criteria = {n.removeprefix(head): of for n, of in numbers.items() if n.startswith(head)}
    return criteria, tuple(warning.sentence for warning in warnings)
