"""Scenes that design their block: the table [design], by mean field, verified by contact.

The mean field decides, in milliseconds; the contact solver says what the design does on surfaces
that no one has designed for, and polishes it on others. Besides the tables of a scene
(`studies/scene.py`), with one pressure, `direction` 0 and positive velocities:

    [design]              `objective` = "maximise_friction" or "minimise_friction" (geometric mean
                          over the velocities), "friction" with `target`, or `ratio` to the friction
                          of the scene's own block (a number, or one per velocity), or
                          "flat_loss_tangent" with `q_from`, `q_to`. Limits: `stiffness` = {q,
                          omega, within}, which keeps |effective_modulus| there within a fraction of
                          the scene's own block, and `total_thickness` of all layers. `starts`,
                          `seed`; `verify` = number of random surfaces for contact solves;
                          `polish` = true for a few steps by the contact solver's gradients on as
                          many others
    [design.parameters]   "layers[0].thickness" = [lower, upper], ...: paths as in
                          `studies/parameters.py`; the scene's own value lies between
"""

import dataclasses
import math
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import Numbers, as_float, check_poisson, check_positive, check_values
from .._memory import DERIVATIVE, check_memory
from ..caveats import EXTRAPOLATED
from ..files.results import package_versions
from ..files.toml import Table, nearest, parse_toml, short, within
from ..grid import Grid
from ..persson.isotropic import LAST_COSINE
from ..persson.mean_field import MeanField
from ..response.compliance import effective_modulus
from ..response.stack import Stack, materials_of
from ..rheology.tabulated import Tabulated
from ..sliding import slide
from ..spectrum import SelfAffine
from ..surface import Surface, random_surface
from .design import Constraints, Design, Objective, minimise
from .objectives import distance, friction_curve, loss_tangent, ripple
from .parameters import paths, with_values
from .scene import (
    RandomSurface,
    Scene,
    build_surface,
    parse_scene,
    refuse_extrapolated,
    scene_memory,
)
from .store import Point, Store, fingerprint

KEYS = (
    "objective", "target", "ratio", "q_from", "q_to", "stiffness", "total_thickness",
    "parameters", "starts", "seed", "verify", "polish",
)  # fmt: skip
# The keys that belong to one objective only.
OBJECTIVES = {
    "maximise_friction": (),
    "minimise_friction": (),
    "friction": ("target", "ratio"),
    "flat_loss_tangent": ("q_from", "q_to"),
}
POLISHING_STEPS = 6
POLISHING = 10  # evaluations, about
CURVE_POINTS = 41
WAVES = 65  # of a band whose loss tangent is to be flat

Progress = Callable[[str, int, int], None]
Values = dict[str, Float[Array, "..."]]


class Stiffness(NamedTuple):
    """Keeps |effective_modulus| at `q` [rad/m], `omega` [rad/s] within a fraction."""

    q: float
    omega: float
    within: float


@dataclasses.dataclass(frozen=True, eq=False)
class Study:
    """What to design, as a scene with a table [design] says.

    **Fields:**

    - `scene`: block to begin with, roughness, pressure, velocities.
    - `spectrum`: roughness that the mean field sees: a spectrum, or the modes of a file's surface.
    - `objective`: one of `OBJECTIVES`.
    - `wanted`: friction [1] at each velocity, or None; if `relative`, over the friction before.
    - `band`: wavenumbers [rad/m] between which the loss tangent is to be flat, or None.
    - `stiffness`, `total_thickness` [m]: limits, or None.
    - `lower`, `upper`: bounds of the parameters by path.
    - `starts`, `seed`: of `minimise`.
    - `verify`: number of surfaces for contact solves.
    - `polish`: whether to go on with the contact solver.
    """

    scene: Scene
    spectrum: SelfAffine | Surface
    objective: str
    wanted: Float[np.ndarray, " velocities"] | None
    relative: bool
    band: tuple[float, float] | None
    stiffness: Stiffness | None
    total_thickness: float | None
    lower: dict[str, float]
    upper: dict[str, float]
    starts: int
    seed: int
    verify: int
    polish: bool


class Candidate(NamedTuple):
    """A block, what the mean field says of it, and the contact solver.

    **Fields:**

    - `stack`: the block.
    - `field`: the mean field at each velocity.
    - `friction`, `contact_area`: by contact, shape (surfaces, velocities); without surfaces empty.
    """

    stack: Stack
    field: MeanField
    friction: Float[np.ndarray, "surfaces velocities"]
    contact_area: Float[np.ndarray, "surfaces velocities"]


class DesignResults(NamedTuple):
    """What a study came to.

    **Fields:**

    - `study`: what was asked.
    - `design`: by the mean field.
    - `polished`: by the contact solver, or None.
    - `candidates`: "before", "designed" and, if polished, "polished".
    """

    study: Study
    design: Design
    polished: Design | None
    candidates: dict[str, Candidate]


def read_design(path: str | os.PathLike) -> Study:
    """Returns the study that a TOML file describes; see the module's text for its keys.

    A missing file raises `FileNotFoundError`; whatever is wrong in it `ValueError`, naming the
    table and the key.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    with within(f"{path}:"):
        return parse_design(path.read_text(encoding="utf-8"), path.parent)


def parse_design(text: str, folder: str | os.PathLike = ".") -> Study:
    """Returns the study that a TOML text describes; its paths are relative to `folder`."""
    scene = parse_scene(text, folder)
    with within("[design]"):
        check_positive("velocity", scene.velocity, "[m/s]")
        if len(scene.pressure) > 1 or scene.direction != 0:
            raise ValueError("needs one `pressure`, and `direction` = 0, in [load].")
    document = parse_toml(text)
    if "design" not in document:
        raise ValueError("The scene lacks the table [design].")
    table = Table("[design]", document["design"], KEYS)
    lower, upper = _bounds(table, scene.stack)
    verify, polish = table.whole("verify", 0), table.get("polish", False)
    if verify and not isinstance(scene.surface, RandomSurface):
        raise ValueError('[design] `verify` needs a [surface] of kind "self_affine".')
    if not isinstance(polish, bool):
        raise ValueError(f"[design] `polish` = {short(polish)} must be true or false.")
    objective = _objective(table)
    if polish and (verify < 1 or objective == "flat_loss_tangent"):
        raise ValueError("[design] `polish` needs `verify` surfaces and an objective of friction.")
    with within(table.place):
        check_values("verify", verify, "it must not be negative", at_least=0)
    source = scene.surface
    return Study(
        scene=scene,
        spectrum=source.spectrum if isinstance(source, RandomSurface) else build_surface(scene),
        objective=objective,
        wanted=_wanted(table, len(scene.velocity)) if objective == "friction" else None,
        relative="ratio" in document["design"],
        band=_band(table) if objective == "flat_loss_tangent" else None,
        stiffness=_stiffness(table),
        total_thickness=_positive(table, "total_thickness", "[m]"),
        lower=lower,
        upper=upper,
        starts=table.whole("starts", 8),
        seed=table.whole("seed", 0),
        verify=verify,
        polish=polish,
    )


def mean_field_problem(study: Study) -> tuple[Objective, Constraints | None]:
    """Returns what the design makes least, and its constraints, as functions of parameters.

    Both are for `minimise`, or any other search: they take a dict of numbers by path.
    """
    stack = study.scene.stack
    if study.band is not None:

        def objective(values: Values) -> Float[Array, ""]:
            tangents = _band_tangents(study, with_values(stack, values))
            return jnp.mean(jnp.stack([ripple(tangent) for tangent in tangents]))

    else:
        before = _mean_field(study, stack).friction

        def objective(values: Values) -> Float[Array, ""]:
            return _goal(study, _mean_field(study, with_values(stack, values)).friction, before)

    return objective, _constraints(study)


def contact_problem(
    study: Study, *, store: Store | None = None, progress: Progress | None = None
) -> tuple[Objective, Constraints | None]:
    """Returns the same of the friction by contact, meaned over the surfaces for polishing.

    `store` and `progress` are as in `run_design`.
    """
    stack, say = study.scene.stack, progress or _silent
    fields, friction_before = [], []
    for i in range(study.verify):
        say("polish, before", i, study.verify)
        fields.append(_heights(study, study.verify + i))
        friction_before.append(_kept_contact(study, stack, fields[-1], store)[0])
    heights, before = jnp.stack(fields), np.mean(friction_before, axis=0)

    def objective(values: Values) -> Float[Array, ""]:
        changed = with_values(stack, values)
        friction = jax.lax.map(lambda h: _contact(study, changed, h)[0], heights)
        return _goal(study, jnp.mean(friction, axis=0), before)

    return objective, _constraints(study)


def run_design(
    study: Study, *, store: Store | None = None, progress: Progress | None = None
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
    say = progress or _silent
    own = study.scene.stack
    rough = study.spectrum if isinstance(study.spectrum, Surface) else study.scene.surface
    assert isinstance(rough, Surface | RandomSurface)
    refuse_extrapolated(
        study.scene, rough.grid, lambda: _mean_field(study, own).extrapolated_friction
    )
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
        name: Candidate(stacks[name], _mean_field(study, stacks[name]), *verified)
        for name, verified in _verify(study, stacks, store, say).items()
    }
    return DesignResults(study, design, polished, candidates)


def design_memory(study: Study, shape: tuple[int, ...]) -> float:
    """Returns the bytes that the contacts of a study take on a grid of this shape."""
    fields = 2 * study.verify + DERIVATIVE if study.polish else 1
    scene = dataclasses.replace(study.scene, keep="none")
    return scene_memory(scene, shape) + fields * math.prod(shape) * 8


def check_design(study: Study) -> None:
    """Raises `ValueError` if the contacts of a study need more memory than there is."""
    source = study.scene.surface
    if study.verify and isinstance(source, RandomSurface):
        with within("[grid]"):
            needed = partial(design_memory, study)
            check_memory("shape", source.grid.shape, needed, "this design")


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
    if study.wanted is None:
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
    allowed = room * study.wanted + 2 * error
    by, kind = "contact" if study.verify else "mean field", "ratio" if study.relative else "target"
    return [
        f"{kind} missed at {v:g} m/s: {got:.3g} of {wanted:.3g}, by {by}"
        for v, got, wanted, most in zip(
            study.scene.velocity, reached, study.wanted, allowed, strict=True
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


def curve_velocities(study: Study, field: MeanField) -> Float[np.ndarray, " velocities"]:
    """Returns velocities [m/s] for a curve about those of the study, and where tables end, in them.

    **Arguments:**

    - `study`: what is designed.
    - `field`: of its block, whose waves are excited.
    """
    first, last = study.scene.velocity.min() / 100, study.scene.velocity.max() * 100
    waves = np.asarray(field.wavenumber).reshape(-1)[[0, -1]]
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
        add("all layers [m]", [f"{_total(c.stack):.5g}" for c in candidates.values()])
    if study.stiffness is not None:
        moduli = [_modulus(study.stiffness, c.stack) for c in candidates.values()]
        add("|effective modulus| [Pa]", [f"{modulus:.5g}" for modulus in moduli])
    for i, v in enumerate(study.scene.velocity):
        if study.band is not None:
            bands = [_band_tangents(study, c.stack)[i] for c in candidates.values()]
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


@eqx.filter_jit
def _mean_field(study: Study, stack: Stack) -> MeanField:
    scene = study.scene
    return friction_curve(
        stack, study.spectrum, pressure=scene.pressure[0], velocities=scene.velocity
    )


def _goal(study: Study, friction: Array, before: Numbers) -> Float[Array, ""]:
    """What is to be small, of the friction at each velocity and of that before."""
    if study.wanted is not None:
        wanted = study.wanted * (as_float(before) if study.relative else 1)
        # 1 where it is reached: a value whose relative changes mean something.
        return jnp.exp(distance(friction, wanted))
    mean = jnp.exp(jnp.mean(jnp.log(friction)))
    return mean if study.objective == "minimise_friction" else -mean


def _band_tangents(study: Study, stack: Stack) -> list[Float[Array, " waves"]]:
    """The loss tangent over the band, at each velocity."""
    assert study.band is not None
    q = np.geomspace(*study.band, WAVES)
    return [loss_tangent(stack, q, v) for v in study.scene.velocity]


def _constraints(study: Study) -> Constraints | None:
    own, stiffness, limit = study.scene.stack, study.stiffness, study.total_thickness
    if stiffness is None and limit is None:
        return None

    def constraints(values: Values) -> Float[Array, " limits"]:
        stack, parts = with_values(own, values), []
        if stiffness is not None:
            change = _modulus(stiffness, stack) / _modulus(stiffness, own) - 1
            parts += [stiffness.within - change, stiffness.within + change]
        if limit is not None:
            parts.append(1 - _total(stack) / limit)
        return jnp.stack(parts)

    return constraints


def _modulus(stiffness: Stiffness, stack: Stack) -> Float[Array, ""]:
    return jnp.abs(effective_modulus(stack, stiffness.q, stiffness.omega))


def _total(stack: Stack) -> Float[Array, ""]:
    return sum((layer.thickness for layer in stack.layers), start=jnp.zeros(()))


def _silent(text: str, done: int, total: int) -> None:
    """Says nothing of the progress."""


def _heights(study: Study, index: int) -> Float[Array, "nx ny"]:
    """Heights of one of the surfaces for verification, or after these of one for polishing."""
    source = study.scene.surface
    assert isinstance(source, RandomSurface)
    key = jax.random.split(jax.random.key(source.seed), 2 * study.verify)[index]
    return random_surface(source.spectrum, source.grid, key, amplitudes=source.amplitudes).heights


def _evaluations(study: Study, store: Store | None, kind: str, *decides: Any) -> Path | None:
    """The file for the evaluations of a search, named by all that decides their values."""
    if store is None:
        return None
    scene = study.scene
    name = fingerprint(
        package_versions(), scene.stack, scene.pressure, scene.velocity, study.objective,
        study.wanted, study.relative, study.band, study.stiffness, study.total_thickness,
        sorted(study.lower), *decides,
    )  # fmt: skip
    return store.folder / f"{kind}-{name[:16]}.jsonl"


def _kept_contact(
    study: Study, stack: Stack, heights: Array, store: Store | None
) -> tuple[np.ndarray, np.ndarray]:
    """Friction and area of a stack on a surface, from the store or for it."""
    scene = study.scene
    parts = (stack, heights, scene.pressure, scene.velocity, scene.solver, scene.rtol)
    assert isinstance(scene.surface, RandomSurface)
    name = fingerprint(package_versions(), "friction and area", scene.surface.grid, *parts)
    kept = None if store is None else store.read(name)
    if kept is None:
        friction, area = map(np.asarray, _contact(study, stack, heights))
        kept = Point({"friction": friction, "contact_area": area}, "", {})
        if store is not None:
            store.write(name, kept)
    return kept.values["friction"], kept.values["contact_area"]


@eqx.filter_jit
def _contact(study: Study, stack: Stack, heights: Array) -> tuple[Array, Array]:
    """Friction and sub-pixel area by contact, at each velocity."""
    scene = study.scene
    assert isinstance(scene.surface, RandomSurface)
    grid: Grid = scene.surface.grid

    def one(velocity: Array) -> tuple[Array, Array]:
        found = slide(
            stack,
            Surface(heights, grid),
            pressure=scene.pressure[0],
            velocity=velocity,
            solver=scene.solver,
            rtol=scene.rtol,
        )
        return found.friction, found.contact_area_smooth

    return jax.lax.map(one, jnp.asarray(scene.velocity))


def _polish(study: Study, design: Design, store: Store | None, say: Progress) -> Design:
    """A few steps from the design, by the contact solver's gradients."""
    done = 0

    def after_evaluation(_: int, value: float) -> None:
        nonlocal done
        done += 1
        say(f"polish, value {value:.4g}", min(done, POLISHING), POLISHING)

    objective, constraints = contact_problem(study, store=store, progress=say)
    scene = study.scene
    decides = (scene.surface, study.verify, scene.solver, scene.rtol)
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
    study: Study, stacks: dict[str, Stack], store: Store | None, say: Progress
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Friction and area by contact of each stack, on surfaces that no polishing has seen."""
    empty = np.zeros((0, len(study.scene.velocity)))
    if not study.verify:
        return dict.fromkeys(stacks, (empty, empty))
    found, total = {}, study.verify * len(stacks)
    for name, stack in stacks.items():
        pairs = []
        for i in range(study.verify):
            pairs.append(_kept_contact(study, stack, _heights(study, i), store))
            say("contact", len(found) * study.verify + len(pairs), total)
        friction, area = (np.stack(parts) for parts in zip(*pairs, strict=True))
        found[name] = (friction, area)
    return found


def _bounds(table: Table, stack: Stack) -> tuple[dict[str, float], dict[str, float]]:
    content = table.get("parameters")
    lower, upper = {}, {}
    if not isinstance(content, dict) or not content:
        raise ValueError(
            '[design.parameters] must hold parameters, such as "layers[0].thickness" = [1e-5, '
            f"1e-3], got {short(content)}."
        )
    parameters = Table("[design.parameters]", content, content)
    with within(parameters.place):
        for path in content:
            ends = parameters.numbers(path)
            if len(ends) != 2 or not 0 < ends[0] <= ends[1] < np.inf:
                raise ValueError(
                    f"{path!r} = {short(content[path])} must be [lower, upper], positive and in "
                    "this order."
                )
            lower[path], upper[path] = ends
            if path.endswith("poisson"):
                check_poisson(path, ends[1])
        with_values(stack, lower)  # refuses unknown paths
    return lower, upper


def _objective(table: Table) -> str:
    objective = table.text("objective")
    if objective not in OBJECTIVES:
        raise ValueError(
            f"[design] `objective` = {objective!r} is not known; {nearest(objective, OBJECTIVES)}"
        )
    for other, keys in OBJECTIVES.items():
        for key in keys:
            if key in table.content and other != objective:
                raise ValueError(f'[design] `{key}` belongs to the objective "{other}".')
    return objective


def _wanted(table: Table, num_velocities: int) -> Float[np.ndarray, " velocities"]:
    if ("target" in table.content) == ("ratio" in table.content):
        raise ValueError('[design] "friction" takes either `target` or `ratio`.')
    key = "target" if "target" in table.content else "ratio"
    wanted = np.array(table.numbers(key))
    if len(wanted) not in (1, num_velocities):
        raise ValueError(
            f"[design] `{key}` has {len(wanted)} numbers; one, or one for each of the "
            f"{num_velocities} velocities, is needed."
        )
    with within(table.place):
        check_positive(key, wanted, "[1]")
    return np.broadcast_to(wanted, num_velocities)


def _positive(table: Table, key: str, unit: str) -> float | None:
    value: Any = table.number(key, None)
    if value is not None:
        with within(table.place):
            check_positive(key, value, unit)
    return value


def _band(table: Table) -> tuple[float, float]:
    band = table.number("q_from"), table.number("q_to")
    if not 0 < band[0] < band[1]:
        raise ValueError(
            f"[design] `q_from` = {band[0]:g}, `q_to` = {band[1]:g} must be positive [rad/m] and "
            "in this order."
        )
    return band


def _stiffness(table: Table) -> Stiffness | None:
    if "stiffness" not in table.content:
        return None
    inner = Table("[design] `stiffness`", table.get("stiffness"), Stiffness._fields)
    found = Stiffness(*(inner.number(key) for key in Stiffness._fields))
    with within(inner.place):
        check_positive("q", found.q, "[rad/m]")
        check_values("omega", found.omega, "a frequency [rad/s] is not negative", at_least=0)
        check_positive("within", found.within, "[1]")
    return found
