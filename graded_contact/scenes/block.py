"""Materials and stack of a scene, from its tables [materials.NAME], [[layers]] and [base]."""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import ScalarLike

from ..blocks.bond import AbstractBond, Bond, Film
from ..blocks.profile import Blend
from ..blocks.shapes import AbstractShape, ErrorFunction, Exponential, Linear, PowerLaw, Sinusoidal
from ..blocks.stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack
from ..blocks.tolerance import AbstractGradedSolver
from ..contacts.adhesion import AdhesiveLJ, ExponentialAdhesion
from ..contacts.law import AbstractLaw, HardWall, RepulsiveLJ
from ..core.checks import nearest, within
from ..fields.grid import Grid
from ..materials.library import tyre_tread
from ..materials.material import AbstractMaterial, BulkShear, Elastic, Prony
from ..materials.shift import LAWS, AbstractShift
from ..materials.softening import StrainSoftening
from ..materials.table import Tabulated
from ..readers.decisions import Log
from ..readers.moduli import read_moduli, strain_sweep
from ..readers.recorded_motion import (
    motion_in,
    read_motion,
    read_over_time,
)
from ..readers.units import DIMENSIONS, UNITS
from ..response.layering import Layering
from ..response.riccati import Riccati
from ..sliding.motion.motion import Motion
from ..sliding.motion.periodic import sinusoidal, start_stop
from ..sliding.motion.transient import dwell, listed, ramp, recorded_transient, start
from ..sliding.shear import SHEARS, AbstractShear
from ..studies.parameter_covariance import Errors, check_errors, read_errors
from .schema import Key, TableReader, check_keys, keys_of, kind_of

# What a `kind` makes; its keys are the parameters. `Block` makes those of files.
MATERIALS = {
    "elastic": Elastic,
    "prony": Prony,
    "prony_creep": Prony.from_creep,
    "tyre_tread": tyre_tread,
    "bulk_shear": BulkShear,
    "softened": StrainSoftening,
}
NO_MATERIAL = (
    "Materials are linear and isotropic. The model has no fluid in pores (poroelastic, biphasic), "
    "no large strains (hyperelastic, neo-Hookean, Ogden), no plastic flow and no fibres "
    "(anisotropic)."
)
BASES = {"half_space": HalfSpace, "rigid": Rigid, "free": Free}
KIND_MAKERS = {
    AbstractShift: LAWS,
    AbstractShape: {
        "linear": Linear,
        "sinusoidal": Sinusoidal,
        "exponential": Exponential,
        "power_law": PowerLaw,
        "error_function": ErrorFunction,
    },
    AbstractGradedSolver: {"layering": Layering, "riccati": Riccati},
    AbstractLaw: {
        "hard_wall": HardWall,
        "repulsive_lj": RepulsiveLJ,
        "adhesive_lj": AdhesiveLJ,
        "exponential_adhesion": ExponentialAdhesion,
    },
    AbstractShear: SHEARS,
    Motion: {"sinusoidal": sinusoidal, "start_stop": start_stop, "recorded": read_motion},
    "transient": {
        "start": start,
        "ramp": ramp,
        "dwell": dwell,
        "listed": listed,
    },
}
# Of every material.
ERRORS = Key("errors", os.PathLike, None)
ASSUMED = Key("assumed", list[str], None)


def extremes(values: np.ndarray | float | None) -> list[float]:
    """The lowest and the highest of some values: what holds for both holds in between."""
    return [] if values is None else [float(np.min(values)), float(np.max(values))]


class Block:
    """The materials of a scene, and the stack that is made of them.

    **Fields:**

    - `materials`: by name, those that were read; `names` are all.
    - `errors`: of the numbers of some of them, by name.
    - `notes`: what was understood of tables of moduli, of a recorded motion and load.
    - `assumed`: those of them that neither a file nor the scene states; each is a warning.
    - `reader`: converts the tables.
    """

    def __init__(self, folder: Path):
        self.materials: dict[str, AbstractMaterial] = {}
        self.names: list[str] = []
        self.errors: dict[str, Errors] = {}
        self.notes: list[str] = []
        self.assumed: list[str] = []
        self.reader = TableReader(folder, KIND_MAKERS, {
            AbstractMaterial: self._named, AbstractBond: self._bond,
        })  # fmt: skip

    def read_materials(self, tables: Mapping[str, Any], temperature: np.ndarray | None) -> None:
        """Makes the materials of [materials], each of which may use those above it."""
        kinds = {**MATERIALS, "tabulated": self.tabulated, "strain_sweep": self.strain_sweep}
        self.names = [*tables]  # to tell a material further down from one that is not there
        # A material may use those above it: the order of the file counts.
        for name, table in tables.items():
            understood, assumed = len(self.notes), len(self.assumed)
            place = f"[materials.{name}]"
            kind, entries = kind_of(place, table, kinds, NO_MATERIAL)
            keys = keys_of(kinds[kind])
            found, known = self.reader.arguments(place, entries, keys, (ERRORS, ASSUMED))
            with within(place):
                self.materials[name] = kinds[kind](**found)
            if "errors" in known:
                with within(f"{place} `errors`:"):
                    self.errors[name] = read_errors(known["errors"])
                    with within(f"`path={known['errors']}`:"):
                        check_errors(self.errors[name], self.materials[name])
            self.assumed += known.get("assumed", [])
            self.notes[understood:] = [f"{name}: {note}" for note in self.notes[understood:]]
            self.assumed[assumed:] = [f"{name}: {note}" for note in self.assumed[assumed:]]
        # Refused here, by name, before a solve meets a temperature below a law's limit.
        for name, material in self.materials.items():
            for at in extremes(temperature):
                with within(f"[load] `temperature`, of [materials.{name}]:"):
                    material.at(at)

    def stack(
        self,
        tables: Sequence[dict[str, Any]],
        below: dict[str, Any],
        graded_solver: AbstractGradedSolver | None,
        owner: str = "",
    ) -> Stack:
        """Returns the stack of the tables [[layers]] and [base]; `owner` as "counterface."."""
        layers = [self._layer(f"[{owner}layers[{i}]]", table) for i, table in enumerate(tables)]
        place = f"[{owner}base]"
        base = self.reader.build_kind(place, below, BASES)
        with within(place):
            return Stack(layers=layers, base=base, graded_solver=graded_solver)

    def _layer(self, place: str, table: dict[str, Any]) -> Layer | GradedLayer:
        check_keys(place, table, [key.name for key in (*keys_of(Layer), *keys_of(Blend))])
        # A layer is graded if it names a material at its bottom or top.
        if "bottom" not in table and "top" not in table:
            return self.reader.build(place, table, Layer)
        if "material" in table:
            raise ValueError(f"{place} has `material` and also `bottom` or `top`: remove one.")
        rest, profile = self.reader.arguments(place, table, keys_of(GradedLayer), keys_of(Blend))
        with within(place):
            return GradedLayer(profile=Blend(**profile), **rest)

    def _bond(self, place: str, key: str, table: Any) -> Bond | Film:
        place = f"{place[:-1]}.{key}]"
        check_keys(place, table, [key.name for key in (*keys_of(Bond), *keys_of(Film))])
        # A bond is a film if it names a material.
        return self.reader.build(place, table, Film if "material" in table else Bond)

    def _named(self, place: str, key: str, value: Any) -> AbstractMaterial:
        name = self.reader.value(place, Key(key, str), value)
        if name in self.materials:
            return self.materials[name]
        known = f"is not in [materials]; {nearest(name, self.materials)}"
        reason = f"must stand below [materials.{name}]." if name in self.names else known
        raise ValueError(f"{place} `{key}` = {name!r} {reason}")

    def tabulated(
        self,
        path: os.PathLike,
        columns: dict[Literal[tuple(DIMENSIONS)], object] | None = None,
        units: dict[Literal[tuple(UNITS)], object] | None = None,
        deformation: str | None = None,
        sheet: str | None = None,
        step: str | None = None,
        poisson: ScalarLike = 0.5,
        shift: AbstractShift | None = None,
    ) -> Tabulated:
        """Returns the material of a table of moduli; its history goes to the notes.

        **Arguments:**

        - `path`: of the table, text or Excel.
        - `columns`: names of quantities and their columns, by name or by number from 1.
        - `units`: of the columns, if the table does not state them.
        - `deformation`: "tension" or "shear"; moduli in shear become Young's moduli.
        - `sheet`: of a workbook.
        - `step`: of a test with several steps.
        - `poisson`: Poisson's ratio [1].
        - `shift`: time-temperature shift.
        """
        options = {"columns": columns, "units": units, "sheet": sheet, "step": step}
        found = read_moduli(
            path, kind="frequency", deformation=deformation, poisson=poisson, **options
        )
        self.notes += found.history
        self.assumed += found.assumed
        return Tabulated(*found.table(), poisson, shift=shift)

    def strain_sweep(
        self,
        material: AbstractMaterial,
        path: os.PathLike,
        columns: dict[Literal[tuple(DIMENSIONS)], object] | None = None,
        units: dict[Literal[tuple(UNITS)], object] | None = None,
        sheet: str | None = None,
        step: str | None = None,
        amplitude: ScalarLike = 0.0,
    ) -> StrainSoftening:
        """Returns a material that softens as a strain sweep; its history goes to the notes.

        **Arguments:**

        - `material`: at small strain.
        - `path`: of the strain sweep, text or Excel.
        - `columns`, `units`, `sheet`, `step`: as of kind "tabulated".
        - `amplitude`: strain amplitude of the modulus [1], 0 for the smallest of the sweep.
        """
        sweep = strain_sweep(path, columns, units, sheet, step)
        self.notes += sweep.history
        self.assumed += sweep.assumed
        soft = StrainSoftening.from_sweep(material, sweep.abscissa, sweep.values)
        return dataclasses.replace(soft, amplitude=amplitude)

    def recorded(
        self,
        path: os.PathLike,
        period: ScalarLike,
        num_times: int | None = None,
        grid: Grid | None = None,
    ) -> Motion:
        """Returns the motion of a table, as `read_motion`; its history goes to the notes."""
        motion, log = motion_in(path, period, num_times, grid)
        self.take(log, "motion")
        return motion

    def recorded_transient(self, path: os.PathLike, grid: Grid) -> Motion:
        """Returns the motion of a table that need not close, as `recorded_transient`.

        **Arguments:**

        - `path`: of the table, see `read_motion`; its first time is the time 0 of the motion.
        """
        times, displacement, log = read_over_time(path, "displacements")
        self.take(log, "motion")
        return recorded_transient(times, displacement, grid)

    def take(self, log: Log, owner: str) -> None:
        """Adds the sentences of a reading to the notes."""
        self.notes += [f"{owner}: {sentence}" for sentence in log.history]
        self.assumed += [f"{owner}: {sentence}" for sentence in log.assumed]
