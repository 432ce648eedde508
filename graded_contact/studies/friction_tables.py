"""Tables of friction over pressure, velocity and temperature."""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from ..blocks.stack import Stack, check_at_rest
from ..core.checks import Numbers, as_float, check_positive, check_values, short
from ..fields.frequency import velocity_along
from ..mean_field.mean_field import NO_FIELD, mean_field_of
from ..mean_field.refinement import NODES, Nodes, solve_refined
from ..sliding.bodies import TwoBodies
from ..sliding.case import Case
from ..sliding.numerics import numerics_of
from ..sliding.shear import is_coupled
from ..sliding.slide import slide_case
from ..surfaces.spectrum_table import Spectrum
from ..surfaces.surface import Surface
from .dataset import FAILED, NOT_STARTED, package_versions
from .old_sweep import sweep
from .parameter_covariance import Errors, with_standard_error

if TYPE_CHECKING:
    from xarray import Dataset

TableMethod = Literal["contact", "mean_field"]
_ENGINE = ("store", "workers", "client", "progress")  # arguments of `sweep`


def friction_table(
    stack: Stack,
    roughness: Surface | Spectrum | tuple[Numbers, Numbers],
    *,
    pressure: Numbers,
    velocity: Numbers,
    temperature: Numbers | None = None,
    direction: float = 0.0,
    method: TableMethod = "contact",
    errors: Errors | None = None,
    **options: Any,
) -> "Dataset":
    """Returns friction and contact area at every combination of pressure, velocity and temperature.

    `exports.export_friction` writes it for other programs.

    **Arguments:**

    - `stack`: the block, see `Stack`.
    - `roughness`: a `Surface`; for the mean field also what `mean_field_friction` takes.
    - `pressure`: mean pressures [Pa], shape `(pressures,)`.
    - `velocity`: speeds [m/s], shape `(velocities,)`, not negative.
    - `temperature`: of the block, and of a `counterface` [K], shape `(temperatures,)`; None leaves
      the materials unchanged.
    - `direction`: of sliding, from the x axis [rad].
    - `method`: `"contact"`, by `slide`; or `"mean_field"`, by `mean_field_friction`.
    - `errors`: of numbers of the stack, as `propagate` takes them, or None.
    - `options`: further arguments of `slide` or of `mean_field_friction`, such as `shear`; and
      `store`, `workers`, `client` and `progress` of `sweep`.

    **Returns:** an `xarray.Dataset` over temperature (if given), pressure and velocity with
    `friction`, `friction_error`, `contact_area`, `contact_area_error` and `message`. The errors of
    a contact are those of the solver and of the grid; that of the mean field is the error of its
    quadrature. With `errors` there is a `friction_standard_error`, by the mean field the
    `extrapolated_friction`.

    **Raises:** `ValueError` for a refused argument; what `sweep` raises.
    """
    _check_table(stack, roughness, pressure, velocity, direction, method)
    engine = {name: options.pop(name) for name in _ENGINE if name in options}
    axes = {"pressure": pressure, "velocity": velocity}
    if temperature is not None:
        axes = {"temperature": temperature, **axes}
    case = Case(stack, roughness, pressure=0.0, velocity=0.0)  # of no point yet
    # Options belong to the case (shear, heating) or to its computation (rtol).
    of_case = {name: options.pop(name) for name in [*options] if name in vars(case)}
    case = dataclasses.replace(case, **of_case)
    solved = _by_contact if method == "contact" else _by_mean_field

    def numbers(options: dict[str, Any], point: dict[str, Array]) -> dict[str, Any]:
        moving = velocity_along(point["velocity"], direction)

        def at(bodies: TwoBodies) -> dict[str, Any]:
            if temperature is not None:
                bodies = bodies.at(point["temperature"])
            changed: dict[str, Any] = {**point, "velocity": moving, **bodies._asdict()}
            return solved(options, dataclasses.replace(case, **changed))

        return with_standard_error(at, TwoBodies(stack, case.counterface), errors)

    if method == "contact" or isinstance(roughness, Surface):  # its modes are summed
        table = sweep(partial(numbers, options), axes, **engine)
    else:
        table = _field_table(numbers, options, axes, engine)
    table.attrs |= {
        "method": method,
        "conditions": conditions(direction, case.shear, case.heating, method),
        "direction": float(direction),
        **package_versions(),
    }
    return table


def _check_table(
    stack: Stack, roughness: Any, pressure: Numbers, velocity: Numbers, direction: float,
    method: TableMethod,
) -> None:  # fmt: skip
    """Raises `ValueError` for what no table has."""
    is_surface = isinstance(roughness, Surface)
    if method == "contact" and not is_surface:
        raise ValueError(f"`roughness={short(roughness)}` must be a `Surface` for a contact.")
    if method == "mean_field" and is_surface and not roughness.periodic:
        raise ValueError(
            "`method='mean_field'` is refused: a window has no mean field; use 'contact'."
        )
    check_values("direction", direction, "an angle [rad] must be finite")
    check_positive("pressure", as_float(pressure, "pressure"), "[Pa]")
    check_values("velocity", as_float(velocity), "a speed [m/s] is not negative", at_least=0)
    # `sweep` traces temperatures, behind which a liquid is not seen.
    if (is_surface and roughness.grid.ndim == 2) or not np.all(np.asarray(velocity)):
        check_at_rest(stack)


def _field_table(
    numbers: Callable[..., Any], options: dict[str, Any], axes: dict[str, Any],
    engine: dict[str, Any],
) -> "Dataset":  # fmt: skip
    """The table by mean field; points that miss their tolerance are computed with more nodes."""
    table = None

    def solve(nodes: Nodes) -> "tuple[Dataset, Any]":
        nonlocal table
        program = partial(numbers, options | nodes._asdict())
        if table is None:
            table = sweep(program, axes, **engine)
        else:
            missed = _missed(table)
            points = [
                {str(name): table[name].values[i] for name, i in zip(missed.dims, at, strict=True)}
                for at in np.argwhere(missed.values)
            ]
            table = _replaced(table, missed.values, sweep(program, points, **engine))
        interrupted = bool(np.any(table["message"] == NOT_STARTED))
        return table, _missed(table).values & (not interrupted)

    first = Nodes(*(options.get(name, count) for name, count in NODES._asdict().items()))
    found, last = solve_refined(solve, first)
    times = last.num_angles // first.num_angles
    told = f"{NO_FIELD}, also with {times} times the nodes of its quadrature."
    message = found["message"].where(~_missed(found) | (times == 1), FAILED + told)
    return found.assign(message=message)


def _missed(table: "Dataset") -> Any:
    """Which points have no mean field."""
    return table["message"].str.startswith(FAILED + NO_FIELD)


def _replaced(table: "Dataset", where: np.ndarray, again: "Dataset") -> "Dataset":
    """The table with the numbers of some of its points replaced."""
    for name, found in again.data_vars.items():
        old = table[name].values
        new = old.astype(np.promote_types(old.dtype, found.dtype))  # messages may be longer
        new[where] = found.values
        table[name] = table[name].copy(data=new)
    return table


def _by_contact(options: dict[str, Any], case: Case) -> dict[str, Any]:
    numerics, _ = numerics_of("friction_table", {**options, "throw": False})
    found = slide_case(case, numerics)
    names = ("friction", "friction_error", "contact_area", "contact_area_error")
    return dict(zip(names, found.compute(*names), strict=True), result=found.result)


def _by_mean_field(options: dict[str, Any], case: Case) -> dict[str, Any]:
    field = mean_field_of(case, **options)
    return {
        "friction": field.friction, "friction_error": field.error * jnp.abs(field.friction),
        "contact_area": field.contact_area, "contact_area_error": field.error * field.contact_area,
        "extrapolated_friction": field.extrapolated_friction,
    }  # fmt: skip


def conditions(direction: float, shear: Any, heating: Any, method: TableMethod) -> str:
    """Returns in a sentence what a table of friction holds for."""
    parts = [
        f"Steady sliding at {direction:g} rad from the x axis",
        "no shear in the contact" if shear is None else f"shear in the contact: {_spelt(shear)}",
        "no heat of friction" if heating is None else "with the heat of friction",
    ]
    if is_coupled(shear) and method == "mean_field":
        parts.append("the mean field leaves out that the traction moves the surface")
    return "; ".join(parts)


def _spelt(shear: Any) -> str:
    """A law of shear with its numbers."""
    if not dataclasses.is_dataclass(shear):
        return short(shear)
    values = [(f.name, getattr(shear, f.name)) for f in dataclasses.fields(shear)]
    plain = [(n, f"{float(v):g}" if eqx.is_array_like(v) else short(v)) for n, v in values]
    return f"{type(shear).__name__}({', '.join(f'{name}={text}' for name, text in plain)})"
