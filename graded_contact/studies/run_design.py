"""Designs of scenes, run: the mean field decides, contact polishes and verifies."""

import dataclasses
import math
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..core.display import shown
from ..core.memory import DERIVATIVE, check_memory
from ..core.parameters import paths, with_values
from ..files.design_scene import DesignScene
from ..files.results import package_versions
from ..files.scene import RandomSurface
from ..files.schema import within
from ..persson.mean_field import MeanField
from ..response.stack import Stack
from ..roughness.surface import Surface
from .design import Design, minimise
from .design_problem import (
    Progress,
    contact_problem,
    heights_of,
    kept_contact,
    mean_field_of,
    mean_field_problem,
    silent,
)
from .extrapolation import refuse_extrapolated
from .run import scene_memory
from .store import Store, fingerprint

POLISHING_STEPS = 6
POLISHING = 10  # evaluations, about


@shown()
class Candidate(NamedTuple):
    """A block, what the mean field says of it, and the contact solver.

    **Fields:**

    - `stack`: the block.
    - `field`: the mean field at each velocity.
    - `friction`, `contact_area`: by contact [1], shape (surfaces, velocities), of no surface
      perhaps.
    """

    stack: Stack
    field: MeanField
    friction: Float[np.ndarray, "surfaces velocities"]
    contact_area: Float[np.ndarray, "surfaces velocities"]


@shown("design", "polished", "candidates")
class DesignResults(NamedTuple):
    """What a study came to.

    **Fields:**

    - `study`: what was asked.
    - `design`: by the mean field.
    - `polished`: by the contact solver, or None.
    - `candidates`: "before", "designed" and, if polished, "polished".
    """

    study: DesignScene
    design: Design
    polished: Design | None
    candidates: dict[str, Candidate]


def run_design(
    study: DesignScene, *, store: Store | None = None, progress: Progress | None = None
) -> DesignResults:
    """Returns the design that a study asks for, and what verifies it.

    **Arguments:**

    - `study`: what to design.
    - `store`: keeps every evaluation and every verified surface at once: the same study goes on
      from there, another one shares what it has in common with it.
    - `progress`: called with what is being done, and how much of how much is done, after every
      evaluation and solve; what it raises ends the design.

    **Raises:** `ValueError` for bounds and limits that nothing satisfies, a start outside the
    bounds, or a block whose friction comes from where its materials were not measured (more than
    1 %, by mean field, unless [load] has `extrapolate = true`); `RuntimeError` if a contact or the
    mean field is not solved to its tolerance.
    """
    check_design(study)
    say = progress or silent
    own = study.scene.stack
    start = {path: paths(own)[path] for path in study.lower}
    with within("[design]"):
        objective, constraints = mean_field_problem(study)
        design = minimise(
            objective,
            study.lower,
            study.upper,
            start,
            constraints=constraints,
            num_starts=study.starts,
            seed=study.seed,
            store=_evaluations(study, store, "mean-field", study.spectrum),
            progress=lambda i, value: say(f"design, value {value:.4g}", i, study.starts),
        )
    stacks = {"before": own, "designed": with_values(own, design.parameters)}
    say("design", study.starts, study.starts)
    polished = None
    if study.polish:
        polished = _polish(study, design, store, say)
        stacks["polished"] = with_values(own, polished.parameters)
    candidates = {
        name: Candidate(stacks[name], mean_field_of(study, stacks[name]), *verified)
        for name, verified in _verify(study, stacks, store, say).items()
    }
    return DesignResults(study, design, polished, candidates)


def design_memory(study: DesignScene, shape: tuple[int, ...]) -> float:
    """Returns the bytes that the contacts of a study take on a grid of this shape."""
    fields = 2 * study.verify + DERIVATIVE if study.polish else 1
    scene = dataclasses.replace(study.scene, fields="none")
    return scene_memory(scene, shape) + fields * math.prod(shape) * 8


def check_design(study: DesignScene) -> None:
    """Raises `ValueError` for what `run_design` refuses before its first evaluation.

    It is contacts that need more memory than there is, and friction from where the block's
    materials were not measured.
    """
    source, own = study.scene.surface, study.scene.stack
    if study.verify and isinstance(source, RandomSurface):
        with within("[grid]"):
            needed = partial(design_memory, study)
            check_memory("shape", source.grid.shape, needed, "this design")
    rough = study.spectrum if isinstance(study.spectrum, Surface) else source
    assert isinstance(rough, Surface | RandomSurface)
    refuse_extrapolated(
        study.scene, own, rough.grid, lambda: mean_field_of(study, own).extrapolated_friction
    )


def _evaluations(study: DesignScene, store: Store | None, kind: str, *decides: Any) -> Path | None:
    """The file for the evaluations of a search, named by all that decides their values."""
    if store is None:
        return None
    scene = study.scene
    name = fingerprint(
        package_versions(), scene.stack, scene.pressure, scene.velocity, study.objective,
        study.goal, study.relative, study.band, study.stiffness, study.total_thickness,
        scene.graded_solver, sorted(study.lower), *decides,
    )  # fmt: skip
    return store.folder / f"{kind}-{name[:16]}.jsonl"


def _polish(study: DesignScene, design: Design, store: Store | None, say: Progress) -> Design:
    """A few steps from the design, by the contact solver's gradients."""
    done = 0

    def after_evaluation(_: int, value: float) -> None:
        nonlocal done
        done += 1
        say(f"polish, value {value:.4g}", min(done, POLISHING), POLISHING)

    objective, constraints = contact_problem(study, store=store, progress=say)
    scene = study.scene
    decides = (scene.surface, study.verify, scene.solver, scene.tolerance)
    say("polish", 0, POLISHING)
    polished = minimise(
        objective,
        study.lower,
        study.upper,
        design.parameters,
        constraints=constraints,
        num_starts=1,
        max_steps=POLISHING_STEPS,
        store=_evaluations(study, store, "polish", *decides),
        progress=after_evaluation,
    )
    say("polish", POLISHING, POLISHING)
    return polished


def _verify(
    study: DesignScene, stacks: dict[str, Stack], store: Store | None, say: Progress
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Friction and area by contact of each stack, on surfaces that no polishing has seen."""
    empty = np.zeros((0, len(study.scene.velocity)))
    if not study.verify:
        return dict.fromkeys(stacks, (empty, empty))
    found, total = {}, study.verify * len(stacks)
    for name, stack in stacks.items():
        pairs = []
        for i in range(study.verify):
            pairs.append(kept_contact(study, stack, heights_of(study, i), store))
            say("contact", len(found) * study.verify + len(pairs), total)
        friction, area = (np.stack(parts) for parts in zip(*pairs, strict=True))
        found[name] = (friction, area)
    return found
