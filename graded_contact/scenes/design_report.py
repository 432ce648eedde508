"""The results of a design as text, and as numbers for a file."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..core.parameters import paths
from ..core.warnings import EXTRAPOLATED
from .run_design import DesignResults, band_tangents, limited_modulus, total_thickness


def report(results: DesignResults) -> str:
    """Returns a table of before and after, and the runs that led there, as text.

    Contact is given as mean ± standard deviation over the surfaces. A friction that the design does
    not reach, see `missed`, is reported below the table.
    """
    from pandas import DataFrame  # takes a third of a second to import

    table = DataFrame.from_dict(_rows(results), orient="index", columns=[*results.candidates])
    texts = [table.to_string(), *missed(results)]
    texts += ["", f"objective {results.study.objective}, by mean field", results.design.report()]
    if results.polished is not None:
        texts += ["", "the same, polished by contact", results.polished.report()]
    return "\n".join(texts)


def _rows(results: DesignResults) -> dict[str, list[str]]:
    """The rows of the table: a text for each candidate."""
    study, candidates = results.study, list(results.candidates.values())
    rows: dict[str, list[str]] = {}

    def add(label: str, values: Iterable[Any], digits: int = 5) -> None:
        rows[label] = [f"{float(value):.{digits}g}" for value in values]

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
        shares = [float(c.field.extrapolated_friction[i]) for c in candidates]
        if max(shares) > EXTRAPOLATED:
            add(f"friction not measured {at}", shares, 2)
        for name in ("friction", "contact_area"):
            label = f"{name.replace('_', ' ')} {at}"
            add(f"{label}, mean field", (getattr(c.field, name)[i] for c in candidates), 4)
            solved = [getattr(c, name)[:, i] for c in candidates]
            # One surface has no standard deviation.
            if study.verify == 1:
                add(f"{label}, contact, one surface, spread unknown", map(np.mean, solved), 4)
            elif study.verify:
                rows[f"{label}, contact"] = [
                    f"{values.mean():.4g} ± {values.std(ddof=1):.2g}" for values in solved
                ]
    return rows


def missed(results: DesignResults) -> list[str]:
    """Returns a sentence for each velocity at which the last candidate misses `target` or `ratio`.

    It is judged by contact if there are surfaces, otherwise by the mean field; to 5 % and twice the
    standard error of the mean, and to 1 %.
    """
    study, last = results.study, list(results.candidates.values())[-1]
    if study.goal is None:
        return []
    friction, own = (
        c.friction if study.verify else np.asarray(c.field.friction)[None]
        for c in (last, results.candidates["before"])
    )
    share = friction / own if study.relative else friction
    # Of means: surface by surface a small friction before would weigh too much.
    reached = np.mean(friction, axis=0) / (np.mean(own, axis=0) if study.relative else 1)
    room = 0.05 if study.verify else 0.01
    error = 0 if len(share) < 2 else np.std(share, axis=0, ddof=1) / np.sqrt(len(share))
    allowed = room * study.goal + 2 * error
    by, kind = "contact" if study.verify else "mean field", "ratio" if study.relative else "target"
    return [
        f"{kind} missed at {v:g} m/s: {got:.3g} of {goal:.3g}, by {by}"
        for v, got, goal, most in zip(
            study.scene.velocity, reached, study.goal, allowed, strict=True
        )
        if not abs(got - goal) <= most
    ]


def designed_values(results: DesignResults) -> dict[str, Any]:
    """Returns all numbers of the last candidate by path, as lists and numbers for a JSON file.

    `with_values(stack, ...)` of the scene's stack and these is the designed stack.
    """
    known = paths(list(results.candidates.values())[-1].stack)
    whole = {path: leaf for path, leaf in known.items() if path.rpartition("[")[0] not in known}
    return {path: np.asarray(leaf).tolist() for path, leaf in whole.items()}
