"""What a design came to, as text and numbers."""

from typing import Any

import numpy as np
from jaxtyping import Float

from ..core.parameters import paths
from ..core.warnings import EXTRAPOLATED
from ..files.design_scene import DesignScene
from ..persson.isotropic import LAST_COSINE
from ..persson.mean_field import MeanField
from ..response.stack import materials_of
from ..rheology.tabulated import Tabulated
from .design_problem import band_tangents, modulus_kept, total_thickness
from .run_design import DesignResults

CURVE_POINTS = 41


def report(results: DesignResults) -> str:
    """Returns a table of before and after, and the runs that led there, as text.

    Contact is given as mean ± standard deviation over the surfaces. A friction that was wanted and
    is not reached, see `missed`, is said below the table.
    """
    lines = _rows(results)
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    texts = []
    for label, *cells in lines:
        padded = (cell.rjust(width) for cell, width in zip(cells, widths[1:], strict=True))
        texts.append("  ".join([label.ljust(widths[0]), *padded]).rstrip())
    texts += missed(results)
    texts += ["", f"objective {results.study.objective}, by mean field", results.design.report()]
    if results.polished is not None:
        texts += ["", "the same, polished by contact", results.polished.report()]
    return "\n".join(texts)


def missed(results: DesignResults) -> list[str]:
    """Returns a sentence for each velocity at which the last candidate misses what was wanted.

    It is judged by contact where there are surfaces, otherwise by the mean field; to 5 % and twice
    the standard error of the mean, and to 1 %.
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
        f"{kind} missed at {v:g} m/s: {got:.3g} of {wanted:.3g}, by {by}"
        for v, got, wanted, most in zip(
            study.scene.velocity, reached, study.goal, allowed, strict=True
        )
        if not abs(got - wanted) <= most
    ]


def designed_values(results: DesignResults) -> dict[str, Any]:
    """Returns all numbers of the last candidate by path, as lists and numbers for a JSON file.

    `with_values(stack, ...)` of the scene's stack and these is the designed stack.
    """
    known = paths(list(results.candidates.values())[-1].stack)
    whole = {path: leaf for path, leaf in known.items() if path.rpartition("[")[0] not in known}
    return {path: np.asarray(leaf).tolist() for path, leaf in whole.items()}


def curve_velocities(study: DesignScene, field: MeanField) -> Float[np.ndarray, " velocities"]:
    """Returns velocities [m/s] for a curve about those of the study, and where tables end, in them.

    **Arguments:**

    - `study`: what is designed.
    - `field`: of its block, whose waves are excited.
    """
    first, last = study.scene.velocity.min() / 100, study.scene.velocity.max() * 100
    waves = np.asarray(field.against_cutoff.cutoff).reshape(-1)[[0, -1]]
    for material in materials_of(study.scene.stack):
        if isinstance(material, Tabulated) and material.extrapolate == "refuse":
            first = max(first, float(material.omega[0]) / (waves[0] * LAST_COSINE))
            last = min(last, float(material.omega[-1]) / waves[1])
    return np.geomspace(first, last, CURVE_POINTS)


def _rows(results: DesignResults) -> list[tuple[str, ...]]:
    """A head, and a row for every quantity with a column per candidate."""
    study, candidates = results.study, results.candidates
    lines: list[tuple[str, ...]] = [("", *candidates)]

    def add(label: str, texts: list[str]) -> None:
        lines.append((label, *texts))

    for path in study.lower:
        add(path, [f"{paths(c.stack)[path]:.5g}" for c in candidates.values()])
    if study.total_thickness is not None:
        add("all layers [m]", [f"{total_thickness(c.stack):.5g}" for c in candidates.values()])
    if study.stiffness is not None:
        moduli = [modulus_kept(study, c.stack) for c in candidates.values()]
        add("|effective modulus| [Pa]", [f"{modulus:.5g}" for modulus in moduli])
    for i, v in enumerate(study.scene.velocity):
        if study.band is not None:
            bands = [band_tangents(study, c.stack)[i] for c in candidates.values()]
            add(f"loss tangent at {v:g} m/s, max/min", [f"{b.max() / b.min():.4g}" for b in bands])
        shares = [float(c.field.extrapolated_friction[i]) for c in candidates.values()]
        if max(shares) > EXTRAPOLATED:
            add(f"friction not measured at {v:g} m/s", [f"{share:.2g}" for share in shares])
        for name in ("friction", "contact_area"):
            label = f"{name.replace('_', ' ')} at {v:g} m/s"
            fields = [getattr(c.field, name)[i] for c in candidates.values()]
            add(f"{label}, mean field", [f"{value:.4g}" for value in fields])
            if study.verify:
                solved = [getattr(c, name)[:, i] for c in candidates.values()]
                alone = ", one surface, spread unknown" if study.verify == 1 else ""
                add(f"{label}, contact{alone}", list(map(_mean_and_spread, solved)))
    return lines


def _mean_and_spread(values: Float[np.ndarray, " surfaces"]) -> str:
    spread = f" ± {values.std(ddof=1):.2g}" if len(values) > 1 else ""
    return f"{values.mean():.4g}{spread}"
