"""The search for a design: by the mean field, and by contact where that is not good enough."""

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Literal

import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import liquid_in
from ..core.checks import Numbers, within
from ..core.memory import DERIVATIVE, check_memory
from ..core.parameters import paths, with_values
from ..studies.search import Constraints, Design, NothingAllowed, Objective, minimise
from ..studies.store import Store
from ..surfaces.surface import Surface
from .design_quantities import (
    BY_MEAN_FIELD,
    Quantities,
    Values,
    block_margins,
    contact_quantities,
    has_mean_field,
    margins_of,
    mean_field_quantities,
    objective_of,
)
from .design_scene import DesignScene
from .plan import fields_in_memory
from .surface_source import RandomSurface

STARTS = 8  # of the mean field
CONTACT_STARTS = 4  # friction by contact has more minima than by mean field
CONTACT_STEPS = 30
CONTACT_RTOL = 1e-4  # of a search: contacts have errors of this size
ROOM = 0.05  # relative difference up to which a design keeps a goal or a limit

Method = Literal["response", "mean field", "contact"]
Progress = Callable[[str, int, int], None]


def mean_field_problem(study: DesignScene) -> tuple[Objective, Constraints]:
    """Returns the objective and the constraints of a design, as functions of parameters.

    Both are for `minimise`, or any other search: they take a dict of numbers by path. The objective
    gives a pair of its number and the margins of the limits that the mean field knows.
    """
    own = study.scene.stack
    before = mean_field_quantities(study, own) if study.relative else {}

    def objective(values: Values) -> tuple[Float[Array, ""], dict[str, Array]]:
        stack = with_values(own, values)
        found = mean_field_quantities(study, stack) if study.quantities else {}
        return objective_of(study, stack, found, before), margins_of(study, found)

    return objective, partial(block_margins, study)


def contact_problem(
    study: DesignScene, surfaces: list[Surface], before: Mapping[str, Numbers]
) -> Objective:
    """Returns objective and limits of a design by contact, as a function for `minimise`.

    **Arguments:**

    - `surfaces`: over which quantities are averaged.
    - `before`: the quantities of the scene's own block, for a `ratio`.
    """

    def objective(values: Values) -> tuple[Float[Array, ""], dict[str, Array]]:
        stack = with_values(study.scene.stack, values)
        found = contact_quantities(study, stack, surfaces)
        return objective_of(study, stack, found, before), margins_of(study, found)

    return objective


def search_design(
    study: DesignScene, surfaces: Callable[[], list[Surface]],
    contacts: Callable[[Values], Quantities], store: Store | None, say: Progress,
) -> tuple[Design, Method, str]:  # fmt: skip
    """Returns the design, what found it, and why that did.

    **Arguments:**

    - `study`, `store`: as in `run_design`.
    - `surfaces`: gives those of a search by contact.
    - `contacts`: gives the quantities on these surfaces, by the values of the parameters.
    - `say`: shows the progress.
    """
    own, design = study.scene.stack, None
    start = {path: paths(own)[path] for path in study.lower}
    given = {"lower": study.lower, "upper": study.upper, "seed": study.seed, "store": store}
    reason, enough = not_in_mean_field(study), _contact_not_needed(study)
    with within("[design]"):
        if has_mean_field(study) or not study.quantities:
            objective, constraints = mean_field_problem(study)
            count = study.starts or STARTS
            try:
                design = minimise(
                    objective, start=start, constraints=constraints, num_starts=count,
                    progress=lambda i, value: say(f"design, value {value:.4g}", i, count), **given,
                )  # fmt: skip
            except NothingAllowed:
                if enough and not reason and not study.polish:
                    raise
            say("design", count, count)
        if design is None:
            reason = reason or "the mean field finds no block within the limits"
        elif not reason:
            if enough:
                return design, "mean field" if study.quantities else "response", enough
            off = _disagreement(study, start, design.parameters, contacts)
            if off <= ROOM:
                return design, "mean field", f"contact agrees with it within {100 * off:.2g} %"
            reason = f"the mean field is {100 * off:.2g} % off"
        count = study.starts or CONTACT_STARTS
        before = contacts(start) if study.relative else {}
        found = minimise(
            contact_problem(study, surfaces(), before), constraints=partial(block_margins, study),
            start=start if design is None else design.parameters, num_starts=count,
            rtol=CONTACT_RTOL, max_steps=CONTACT_STEPS,
            progress=lambda i, value: say(f"design by contact, value {value:.4g}", i, count),
            **given,
        )  # fmt: skip
    say("design by contact", count, count)
    return found, "contact", reason


def not_in_mean_field(study: DesignScene) -> str | None:
    """Returns why contact must go on, if that is known before any search."""
    if study.scene.motion is not None:
        return "the mean field has no motion in time"
    if study.quantities and not has_mean_field(study):
        return "the mean field needs a periodic surface"
    unknown = [name.replace("_", " ") for name in study.quantities if name not in BY_MEAN_FIELD]
    return f"the mean field has no {' and no '.join(unknown)}" if unknown else None


def _contact_not_needed(study: DesignScene) -> str | None:
    """Why the design of the mean field stays without a look at contact, if it does."""
    if not study.quantities:
        return "a loss tangent needs no contact"
    if study.polish:
        return "contact polishes its design"
    if liquid_in(study.scene.stack) and study.grid.ndim == 2:
        return "contacts refuse a liquid"
    try:
        check_design_memory(study, searched=True)
    except ValueError:
        return "a contact does not fit into the memory"
    return None


def _disagreement(
    study: DesignScene, start: Values, found: Values, contacts: Callable[[Values], Quantities]
) -> float:
    """The largest relative difference of the mean field from contact at its design."""
    own, off = study.scene.stack, 0.0
    by_field = [mean_field_quantities(study, with_values(own, at)) for at in (found, start)]
    by_contact = [contacts(found), contacts(start)]
    limited = {quantity for quantity, *_ in study.limits or ()}
    for name in study.quantities:
        field, contact = (np.array([q[name] for q in pair]) for pair in (by_field, by_contact))
        if name not in limited and (study.goal is None or study.relative):
            field, contact = field[:1] / field[1:], contact[:1] / contact[1:]
        off = max(off, float(np.max(np.abs(field[0] / contact[0] - 1))))
    return off


def check_design_memory(study: DesignScene, *, searched: bool) -> None:
    """Raises `ValueError` if contacts of a study, or a search by them, need too much memory."""
    fields = design_fields(study, searched=searched)
    with within("[grid]"):
        check_memory("shape", "this design", fields, study.grid.shape)


def design_fields(study: DesignScene, *, searched: bool) -> float:
    """Returns how many fields of the size of its surface contacts take, or a search by them."""
    scene, source = study.scene, study.scene.surface
    seeds = (source.seeds or 1) if isinstance(source, RandomSurface) else 1
    count = max(seeds, study.verify if study.polish else 0)
    fields = scene.num_times * (2 * count + DERIVATIVE) if searched else 1
    return fields + fields_in_memory(dataclasses.replace(scene, fields="none"))
