"""The results of a design: the blocks before and after, as text and as numbers."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..blocks.stack import Stack
from ..core.display import shown, with_error
from ..core.parameters import paths
from ..core.quantities import in_brackets
from ..mean_field.mean_field import MeanField
from ..sliding.numbers.checks import EXTRAPOLATED
from ..studies.search import Design
from .limits import BY_MEAN_FIELD, CRITERIA
from .objectives import band_tangents
from .search import ROOM
from .table import DesignScene

ROOM_BY_MEAN_FIELD = 0.01  # it has no scatter
NO_ERROR = (
    "A stress has no estimated error: it is the largest at the points of the grid, and rises on "
    "finer grids."
)


@shown()
class Candidate(NamedTuple):
    """A block, its mean field and its contacts.

    **Fields:**

    - `stack`: the block.
    - `field`: the mean field at each velocity; None for a motion or a window.
    - `contacts`: by name "friction", "contact_area" [1] and what else the study limits or searches
      for, each of shape (surfaces, velocities). Without verification there are no surfaces, or
      after a search by contact one row, the mean over its surfaces.
    - `warnings`: what makes the contacts of the verification doubtful, in sentences.
    """

    stack: Stack
    field: MeanField | None
    contacts: dict[str, np.ndarray]
    warnings: tuple[str, ...] = ()

    def judged(self, name: str) -> tuple[str, Float[np.ndarray, "surfaces velocities"]]:
        """Returns by what the block is judged, and the values of a criterion."""
        if len(self.contacts[name]):
            return "contact", self.contacts[name]
        return "mean field", np.asarray(getattr(self.field, name))[None]


@shown("method", "reason", "design", "candidates")
class DesignResults(NamedTuple):
    """The design of a scene, and the contacts that verify it.

    **Fields:**

    - `study`: the scene and its table [design].
    - `design`: what the search found.
    - `candidates`: "before" and "designed".
    - `method`: what the search evaluated last: "response", "mean field" or "contact".
    - `reason`: of the method, one sentence.
    """

    study: DesignScene
    design: Design
    candidates: dict[str, Candidate]
    method: str = "mean field"
    reason: str = ""

    def report(self) -> str:
        """Returns a table of before and after, and the runs that led there, as text.

        Contact is given as mean ± standard deviation over the surfaces. Below the table are the
        warnings of the contacts, and the goals and limits that the design misses, see `missed`.
        """
        from pandas import DataFrame  # takes a third of a second to import

        rows = dict(_table_rows(self.study, [*self.candidates.values()]))
        table = DataFrame.from_dict(rows, orient="index", columns=[*self.candidates])
        texts = [table.to_string()]
        if self.study.verify > 1:
            spread = f"±: standard deviation over {self.study.verify} surfaces"
            texts.append(f"{spread}; the error of a contact, as by the grid, is no part of it.")
        if any(CRITERIA[name].of_stress for name in self.study.criteria):
            texts.append(NO_ERROR)
        for name, candidate in self.candidates.items():
            texts += [f"Contact, {name}: {sentence}" for sentence in candidate.warnings]
        texts += self.missed()
        if self.method == "contact" and not self.study.verify:
            texts.append("Contact is on the surfaces of the search: `verify` draws others.")
        objective = self.study.objective
        sign = " (value: its negative)" if objective.name.startswith("maximise") else ""
        by = f"searched by {self.method}, because {self.reason}"
        texts += ["", f"objective {objective.name}{sign}; {by}", self.design.report()]
        return "\n".join(texts)

    def missed(self) -> list[str]:
        """Returns a sentence for each velocity at which the design misses a goal or a limit.

        It is judged by contact if there is one, otherwise by the mean field; to 5 % and twice the
        standard error of the mean, and to 1 %.
        """
        study, sentences = self.study, []
        before, last = self.candidates["before"], self.candidates["designed"]

        def judge(what, by, samples, reached, off, asked, words="", unit="1", factor=1.0):
            error = 0 if len(samples) < 2 else np.std(samples, 0, ddof=1) / np.sqrt(len(samples))
            room = (ROOM if by == "contact" else ROOM_BY_MEAN_FIELD) * asked + 2 * error
            for v, x, goal, kept in zip(
                study.scene.velocity, reached, asked, off <= room, strict=True
            ):
                if not kept:  # nor is a NaN
                    number = f"{factor * x:.3g} {unit}".removesuffix(" 1")
                    sentences.append(
                        f"{what} missed at {v:g} m/s: {number} of {words or f'{goal:.3g}'}, by {by}"
                    )

        objective = study.objective
        if objective.goal is not None:
            by, found = last.judged("friction")
            own = before.judged("friction")[1] if objective.relative else found**0
            # Of means: surface by surface a small friction before would weigh too much.
            reached = np.mean(found, 0) / np.mean(own, 0)
            goal = objective.goal
            kind = "ratio" if objective.relative else "target"
            judge(kind, by, found / own, reached, np.abs(reached - goal), goal)
        for limit in study.limits:
            by, found = last.judged(limit.criterion)
            reached, asked = np.mean(found, 0), np.full(found.shape[1], limit.value)
            about, beyond = CRITERIA[limit.criterion], -limit.margins(reached) * asked
            shown_in = about.shown_in(limit.value)
            judge(about.label, by, found, reached, beyond, asked, limit.words, *shown_in)
        return sentences

    def values(self) -> dict[str, Any]:
        """Returns all numbers of the design by path, as lists and numbers for a JSON file.

        `with_values(stack, ...)` of the scene's stack and these is the designed stack.
        """
        known = paths(self.candidates["designed"].stack)
        whole = {path: leaf for path, leaf in known.items() if path.rpartition("[")[0] not in known}
        return {path: np.asarray(leaf).tolist() for path, leaf in whole.items()}


def _table_rows(study: DesignScene, candidates: list[Candidate]) -> Iterator[tuple[str, list[str]]]:
    """The rows of the table: a label, and a text for each candidate."""
    scene, objective = study.scene, study.objective
    stacks = [candidate.stack for candidate in candidates]
    fields = [candidate.field for candidate in candidates if candidate.field is not None]

    def row(label: str, values: Iterable[Any], digits: int = 5) -> tuple[str, list[str]]:
        return label, [f"{float(value):.{digits}g}" for value in values]

    def contact_rows(label: str, solved: list[np.ndarray]) -> Iterator[tuple[str, list[str]]]:
        # One surface has no standard deviation.
        if study.verify == 1:
            yield row(f"{label}, contact, one surface, spread unknown", map(np.mean, solved), 4)
        elif study.verify:
            texts = [with_error(values.mean(), values.std(ddof=1)) for values in solved]
            yield f"{label}, contact", texts
        elif len(solved[0]):
            yield row(f"{label}, contact", map(np.mean, solved), 4)

    for path in study.parameters:
        yield row(path, (paths(stack)[path] for stack in stacks))
    limited = [study.limits.of_block(stack) for stack in stacks]
    for label in limited[0]:
        yield row(label, (rows[label] for rows in limited))
    for i, v in enumerate(scene.velocity):
        at = f"at {v:g} m/s"
        if objective.band:
            bands = [band_tangents(stack, objective.band, scene.velocity)[i] for stack in stacks]
            yield row(f"loss tangent {at}, max/min", (b.max() / b.min() for b in bands), 4)
        shares = [float(field.extrapolated_friction[i]) for field in fields]
        if max(shares, default=0) > EXTRAPOLATED:
            yield row(f"friction not measured {at}", shares, 2)
        for name, about in CRITERIA.items():
            if name not in candidates[0].contacts:
                continue
            solved = [c.contacts[name][:, i] for c in candidates]
            values = [getattr(f, name)[i] for f in fields] if name in BY_MEAN_FIELD else []
            sizes = np.abs(np.concatenate([*solved, np.ravel(values)]))
            unit, factor = about.shown_in(np.max(sizes, initial=0.0))
            label = f"{about.label}{in_brackets(unit)} {at}"
            if values:
                yield row(f"{label}, mean field", [factor * v for v in values], 4)
            yield from contact_rows(label, [factor * values for values in solved])
            if about.of_stress and len(solved[0]):
                depths = [1e6 * c.contacts[f"{name}_depth"][:, i] for c in candidates]
                yield from contact_rows(f"depth of the largest {about.label} [µm] {at}", depths)
    if objective.name.endswith("friction_ratio"):
        ratios = [c.contacts["friction"][:, 0] / c.contacts["friction"][:, 1] for c in candidates]
        yield from contact_rows("friction ratio", ratios)
