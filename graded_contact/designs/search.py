"""The search for a design: by the mean field, and by contact where that is not good enough."""

import dataclasses
from collections.abc import Callable

import numpy as np

from ..blocks.stack import liquid_in
from ..core.checks import within
from ..core.memory import DERIVATIVE, check_memory
from ..core.parameters import with_values
from ..scenes.plan import fields_in_memory
from ..studies.search import Design, NothingAllowed, minimise
from ..studies.store import Store
from .limits import BY_MEAN_FIELD, CRITERIA, Criteria
from .problem import Parameters, criteria_of, design_problem
from .table import DesignScene

MEAN_FIELD_STARTS = 8  # of the mean field
CONTACT_STARTS = 4  # friction by contact has more minima than by mean field
CONTACT_STEPS = 30
CONTACT_RTOL = 1e-4  # of a search: contacts have errors of this size
STRESS = 40  # fields of a stress at one depth, and of its derivative
ROOM = 0.05  # relative difference up to which a design keeps a goal or a limit

Contacts = Callable[[Parameters], Criteria]
Progress = Callable[[str, int, int], None]


def search_design(
    study: DesignScene, contacts: Contacts, store: Store | None, say: Progress
) -> tuple[Design, str, str]:
    """Returns the design, what found it ("response", "mean field" or "contact"), and why that did.

    **Arguments:**

    - `study`, `store`: as in `DesignPlan.run`.
    - `contacts`: gives the criteria by contact, see `by_contact`.
    - `say`: shows the progress.
    """
    reason, enough = not_in_mean_field(study), _contact_not_needed(study)
    relative, design = study.objective.relative, None

    def searched(what, starts, start, before, surfaces=None, **options):
        objective, constraints = design_problem(study, before, surfaces)
        count = study.starts or starts
        found = minimise(
            objective, *study.bounds, start, constraints=constraints, num_starts=count,
            seed=study.seed, store=store, **options,
            progress=lambda i, value: say(f"{what}, value {value:.4g}", i, count),
        )  # fmt: skip
        say(what, count, count)
        return found

    with within("[design]"):
        if study.has_mean_field or not study.criteria:
            before = criteria_of(study, study.scene.stack) if relative else {}
            try:
                design = searched("design", MEAN_FIELD_STARTS, study.start, before)
            except NothingAllowed:
                if enough and not reason:
                    raise
        if design is None:
            reason = reason or "the mean field finds no block within the limits"
        elif not reason:
            if enough:
                return design, "mean field" if study.criteria else "response", enough
            off, what = _disagreement(study, design.parameters, contacts)
            if off <= ROOM:
                reason = f"contact agrees with it within {100 * off:.2g} %{what}"
                return design, "mean field", reason
            reason = f"the mean field is {100 * off:.2g} % off{what}"
        start = study.start if design is None else design.parameters
        before = contacts(study.start) if relative else {}
        found = searched(
            "design by contact", CONTACT_STARTS, start, before, study.surfaces,
            rtol=CONTACT_RTOL, max_steps=CONTACT_STEPS,
        )  # fmt: skip
    return found, "contact", reason


def not_in_mean_field(study: DesignScene) -> str | None:
    """Returns why contact must go on, if that is known before any search."""
    if study.scene.motion is not None:
        return "the mean field has no motion in time"
    if study.criteria and study.scene.shear is not None:
        return "designs by the mean field have no shear in the contact"
    if study.criteria and not study.has_mean_field:
        return "the mean field needs a periodic surface"
    unknown = [name.replace("_", " ") for name in study.criteria if name not in BY_MEAN_FIELD]
    return f"the mean field has no {' and no '.join(unknown)}" if unknown else None


def _contact_not_needed(study: DesignScene) -> str | None:
    """Why the design of the mean field stays without a look at contact, if it does."""
    if not study.criteria:
        return "a loss tangent needs no contact"
    if liquid_in(study.scene.stack) and study.grid.ndim == 2:
        return "contacts refuse a liquid"
    try:
        check_design_memory(study, searched=True)
    except ValueError:
        return "a contact does not fit into the memory"
    return None


def _disagreement(
    study: DesignScene, designed: Parameters, contacts: Contacts
) -> tuple[float, str]:
    """The largest relative difference of the mean field from contact at its design, and of what:
    of the change from the block of the scene, or of the value itself where a goal or a limit is
    one.
    """
    own, worst, pair = study.scene.stack, (0.0, ""), (designed, study.start)
    by_field = [criteria_of(study, with_values(own, values)) for values in pair]
    by_contact = [contacts(values) for values in pair]
    by_value = {limit.criterion for limit in study.limits}
    if study.objective.goal is not None and not study.objective.relative:
        by_value.add("friction")
    for name in study.criteria:
        field, contact = (np.array([found[name] for found in of]) for of in (by_field, by_contact))
        what = ""
        if name not in by_value:
            what = " in the change from the block of the scene"
            field, contact = field[:1] / field[1:], contact[:1] / contact[1:]
        worst = max(worst, (float(np.max(np.abs(field[0] / contact[0] - 1))), what))
    return worst


def check_design_memory(study: DesignScene, *, searched: bool) -> None:
    """Raises `ValueError` if contacts of a study, or a search by them, need too much memory."""
    with within("[grid]"):
        fields = design_fields(study, searched=searched)
        check_memory("shape", "this design", fields, study.grid.shape)


def design_fields(study: DesignScene, *, searched: bool) -> float:
    """Returns how many fields of the size of its surface contacts take, or a search by them."""
    scene = dataclasses.replace(study.scene, fields="none")
    fields = scene.num_times * (2 * study.seeds + DERIVATIVE) if searched else 1
    fields += STRESS if any(CRITERIA[name].of_stress for name in study.criteria) else 0
    return fields + fields_in_memory(scene)
