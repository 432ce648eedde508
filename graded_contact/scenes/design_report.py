"""The results of a design as text, and as numbers for a file."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from jaxtyping import Float

from ..core.parameters import paths
from ..sliding.doubts import EXTRAPOLATED
from .design_quantities import BY_MEAN_FIELD, band_tangents, limited_modulus, total_thickness
from .design_scene import LIMITED
from .design_search import ROOM
from .run_design import Candidate, DesignResults

ROOM_BY_MEAN_FIELD = 0.01  # it has no scatter


def report(results: DesignResults) -> str:
    """Returns a table of before and after, and the runs that led there, as text.

    Contact is given as mean ± standard deviation over the surfaces. A goal or limit that the design
    misses, see `missed`, is reported below the table.
    """
    from pandas import DataFrame  # takes a third of a second to import

    table = DataFrame.from_dict(_rows(results), orient="index", columns=[*results.candidates])
    texts = [table.to_string(), *missed(results)]
    if results.method == "contact" and not results.study.verify:
        texts.append("Contact is on the surfaces of the search: `verify` draws others.")
    objective = results.study.objective
    sign = " (value: its negative)" if objective.startswith("maximise") else ""
    by = f"searched by {results.method}, because {results.reason}"
    texts += ["", f"objective {objective}{sign}; {by}", results.design.report()]
    if results.polished is not None:
        texts += ["", "the same, polished by contact", results.polished.report()]
    return "\n".join(texts)


def _rows(results: DesignResults) -> dict[str, list[str]]:
    """The rows of the table: a text for each candidate."""
    study, candidates = results.study, list(results.candidates.values())
    rows: dict[str, list[str]] = {}

    def add(label: str, values: Iterable[Any], digits: int = 5) -> None:
        rows[label] = [f"{float(value):.{digits}g}" for value in values]

    def add_contact(label: str, solved: list[np.ndarray]) -> None:
        # One surface has no standard deviation.
        if study.verify == 1:
            add(f"{label}, contact, one surface, spread unknown", map(np.mean, solved), 4)
        elif study.verify:
            rows[f"{label}, contact"] = [
                f"{values.mean():.4g} ± {values.std(ddof=1):.2g}" for values in solved
            ]
        elif len(solved[0]):
            add(f"{label}, contact", map(np.mean, solved), 4)

    for path in study.lower:
        add(path, (paths(c.stack)[path] for c in candidates))
    if study.total_thickness is not None:
        add("all layers [m]", (total_thickness(c.stack) for c in candidates))
    if study.stiffness is not None:
        add("|effective modulus| [Pa]", (limited_modulus(study, c.stack) for c in candidates))
    for i, v in enumerate(study.scene.velocity):
        at = f"at {v:g} m/s"
        if study.band is not None:
            bands = [band_tangents(study, c.stack)[i] for c in candidates]
            add(f"loss tangent {at}, max/min", (b.max() / b.min() for b in bands), 4)
        fields = [c.field for c in candidates if c.field is not None]
        shares = [float(field.extrapolated_friction[i]) for field in fields]
        if max(shares, default=0) > EXTRAPOLATED:
            add(f"friction not measured {at}", shares, 2)
        for name in candidates[0].contacts:
            label = f"{name.replace('_', ' ')} {LIMITED.get(name, '[1]').replace('[1]', '')} {at}"
            label = " ".join(label.split())
            if name in BY_MEAN_FIELD and fields:
                add(f"{label}, mean field", (getattr(field, name)[i] for field in fields), 4)
            add_contact(label, [c.contacts[name][:, i] for c in candidates])
    if study.quantity == "friction_ratio":
        ratios = [c.contacts["friction"][:, 0] / c.contacts["friction"][:, 1] for c in candidates]
        add_contact("friction ratio", ratios)
    return rows


def missed(results: DesignResults) -> list[str]:
    """Returns a sentence for each velocity at which the last candidate misses a goal or a limit.

    It is judged by contact if there is one, otherwise by the mean field; to 5 % and twice the
    standard error of the mean, and to 1 %.
    """
    study, last = results.study, list(results.candidates.values())[-1]
    sentences = []
    if study.goal is not None:
        by, found = _judged(last, "friction")
        own = _judged(results.candidates["before"], "friction")[1] if study.relative else found**0
        # Of means: surface by surface a small friction before would weigh too much.
        reached, kind = np.mean(found, 0) / np.mean(own, 0), "ratio" if study.relative else "target"
        off = np.abs(reached - study.goal) - _room(by, study.goal, found / own)
        for i in np.flatnonzero(~(off <= 0)):
            got, goal = f"{reached[i]:.3g}", f"{study.goal[i]:.3g}"
            at = f"{study.scene.velocity[i]:g} m/s"
            sentences.append(f"{kind} missed at {at}: {got} of {goal}, by {by}")
    for name, end, limit in study.limits or ():
        by, found = _judged(last, name)
        beyond = (np.mean(found, 0) - limit) * (1 if end == "max" else -1)
        for i in np.flatnonzero(~(beyond <= _room(by, limit, found))):
            most = "most" if end == "max" else "least"
            got = f"{np.mean(found, 0)[i]:.3g} of at {most} {limit:.3g}"
            at = f"{study.scene.velocity[i]:g} m/s"
            sentences.append(f"{name.replace('_', ' ')} missed at {at}: {got}, by {by}")
    return sentences


def _judged(
    candidate: Candidate, name: str
) -> tuple[str, Float[np.ndarray, "surfaces velocities"]]:
    """By what a candidate is judged, and the values of a quantity."""
    if len(candidate.contacts[name]):
        return "contact", candidate.contacts[name]
    return "mean field", np.asarray(getattr(candidate.field, name))[None]


def _room(by: str, goal: Any, values: np.ndarray) -> Any:
    """How far a mean may be from a goal or beyond a limit."""
    error = 0 if len(values) < 2 else np.std(values, axis=0, ddof=1) / np.sqrt(len(values))
    return (ROOM if by == "contact" else ROOM_BY_MEAN_FIELD) * goal + 2 * error


def designed_values(results: DesignResults) -> dict[str, Any]:
    """Returns all numbers of the last candidate by path, as lists and numbers for a JSON file.

    `with_values(stack, ...)` of the scene's stack and these is the designed stack.
    """
    known = paths(list(results.candidates.values())[-1].stack)
    whole = {path: leaf for path, leaf in known.items() if path.rpartition("[")[0] not in known}
    return {path: np.asarray(leaf).tolist() for path, leaf in whole.items()}
