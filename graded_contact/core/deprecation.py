"""Names of 1.0.0rc1: moved ones work until version 2, others end in an error with the new one."""

import importlib
import warnings
from collections.abc import Callable

# They stood in another room, and `graded_contact.NAME` finds them all.
_ROOM_CHANGED = {
    "distance", "friction_curve", "loss_tangent", "ripple", "paths", "with_values", "Heating",
    "heat_source", "heat_depths", "flash_temperature", "contact_stiffness",
    "contact_conductance", "gap_flow", "GapFlow", "area_against_cutoff", "cumulative_friction",
    "Coulomb", "ConstantShear", "PeakedShear", "AbstractShear", "MeanField",
    "pressure_distribution", "CutoffCurve", "friction_table", "export_friction", "PronyFit",
    "MasterCurve", "export_prony", "read_errors",
}  # fmt: skip
_NEW_NAMES = {
    "Run": "`graded_contact.studies.Descent`",
    "friction_between": "removed: read `MeanField.against_cutoff`",
    "run_scene": "`graded_contact.plan(scene).run(store=...)`",
    "fit_relaxation": '`graded_contact.fit_prony(t, E, kind="relaxation")`',
    "fit_creep": '`graded_contact.fit_prony(t, J, kind="creep")`',
    "plot_outline": "removed: `plot.plot_sliding` draws the outline, too",
    "checkpointed": "removed: `sweep`, searches and scenes continue after a kill",
    "ObservableTarget": "removed: `rtol` is the only tolerance of a contact",
    # Arguments and fields.
    **dict.fromkeys(
        ("friction_rtol", "target"), "removed: `rtol` is the only tolerance of a contact"
    ),
    "graded_solver": "a field of the block: `Stack(..., graded_solver=...)`",
    **dict.fromkeys(("contact_area_corrected", "contact_area_smooth"), "`contact_area`"),
    **dict.fromkeys(
        ("storage_weight", "loss_weight", "weight"), "`weights`, a pair: of E' and of E''"
    ),
    **dict.fromkeys(
        ("within", "huber"), "removed: `fitting.wild_values` and `fitting.without` leave points out"
    ),
    **dict.fromkeys(
        ("slide_options", "mean_field_options"), "arguments of their own, such as `shear`"
    ),
}


def has_moved(old: str, new: str) -> None:
    """Warns that a name has moved; the old one works until version 2."""
    warnings.warn(
        f"`{old}` is `{new}` now; the old name goes in version 2.", FutureWarning, stacklevel=3
    )


def since_rc1(name: str) -> str:
    """Returns what a name of 1.0.0rc1 is now, as an error ends; nothing for another name."""
    return f"; since 1.0.0 it is {_NEW_NAMES[name]}" if name in _NEW_NAMES else ""


def missing(module: str, name: str) -> AttributeError:
    """Returns the error of a name that a module does not have; it tells the new one.

    So does a warning: `from graded_contact import run_scene` hides the text of the error.
    """
    told = since_rc1(name)
    text = f"module {module!r} has no attribute {name!r}{told}"
    if told:
        warnings.warn(text, FutureWarning, stacklevel=3)
    return AttributeError(text, name=name)


def old_names(module: str) -> Callable[[str], object]:
    """Returns the `__getattr__` of a room that had other names in 1.0.0rc1."""

    def find(name: str) -> object:
        if name not in _ROOM_CHANGED:
            raise missing(module, name)
        package = module.partition(".")[0]
        has_moved(f"{module}.{name}", f"{package}.{name}")
        return getattr(importlib.import_module(package), name)

    return find
