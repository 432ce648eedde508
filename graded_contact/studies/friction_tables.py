"""Tables of friction over pressure, velocity and temperature."""

import dataclasses
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from ..blocks.stack import Stack, check_at_rest
from ..core.checks import Numbers, as_float, check_positive, check_types, check_values, short
from ..fields.frequency import velocity_along
from ..mean_field.mean_field import mean_field_of
from ..sliding.case import Case
from ..sliding.numerics import numerics_of
from ..sliding.shear import is_coupled
from ..sliding.slide import solve
from ..surfaces.spectrum import SelfAffine
from ..surfaces.surface import Surface
from .dataset import package_versions
from .parameter_covariance import Errors, with_standard_error
from .sweep import sweep

if TYPE_CHECKING:
    from xarray import Dataset

ENGINE = ("store", "workers", "client", "units", "progress")  # of `sweep`
Method = Literal["contact", "mean_field", "both"]


@check_types
def friction_table(
    stack: Stack,
    roughness: Surface | SelfAffine | tuple[Numbers, Numbers],
    *,
    pressure: Numbers,
    velocity: Numbers,
    temperature: Numbers | None = None,
    direction: float = 0.0,
    method: Method = "contact",
    slide_options: Mapping[str, Any] = MappingProxyType({}),
    mean_field_options: Mapping[str, Any] = MappingProxyType({}),
    errors: Errors | None = None,
    **engine: Any,
) -> "Dataset":
    """Returns friction and contact area at every combination of pressure, velocity and temperature.

    `exports.export_friction` writes it for other programs.

    **Arguments:**

    - `stack`: the block, see `Stack`.
    - `roughness`: a `Surface`; for the mean field alone also what `mean_field_friction` takes.
    - `pressure`: mean pressures [Pa], shape `(pressures,)`.
    - `velocity`: speeds [m/s], shape `(velocities,)`, not negative.
    - `temperature`: of the block [K], shape `(temperatures,)`; None leaves the materials unchanged.
    - `direction`: of sliding, from the x axis [rad].
    - `method`: `"contact"`, by `slide`; `"mean_field"`, by `mean_field_friction`; or `"both"`.
    - `slide_options`: further arguments of `slide`, without those for a start. Those of the case,
      such as `shear`, hold for the mean field, too.
    - `mean_field_options`: further arguments of `mean_field_friction`.
    - `errors`: of numbers of the stack, as `propagate` takes them, or None.
    - `engine`: `store`, `workers`, `client` and `progress` of `sweep`.

    **Returns:** an `xarray.Dataset` over temperature (if given), pressure and velocity with
    `friction`, `friction_error`, `contact_area`, `contact_area_error` and `message`. The errors of
    a contact are those of the solver and of the grid; that of the mean field is the error of its
    quadrature. With `errors` there is a `friction_standard_error`. With `"both"` the numbers of the
    mean field are `mean_field.friction` and so on, with `mean_field.message`.

    **Raises:** `ValueError` for a refused argument; what `sweep` raises.
    """
    if method != "mean_field" and not isinstance(roughness, Surface):
        raise ValueError(f"`roughness={short(roughness)}` must be a `Surface` for a contact.")
    if method != "contact" and isinstance(roughness, Surface) and not roughness.periodic:
        raise ValueError(
            f"`method={method!r}` is refused: a window has no mean field; use 'contact'."
        )
    if unknown := [name for name in engine if name not in ENGINE]:
        raise TypeError(
            f"friction_table has no argument `{unknown[0]}`: give one of `slide` in "
            "`slide_options`, and one of `mean_field_friction` in `mean_field_options`."
        )
    check_values("direction", direction, "an angle [rad] must be finite")
    check_positive("pressure", as_float(pressure, "pressure"), "[Pa]")
    check_values("velocity", as_float(velocity), "a speed [m/s] is not negative", at_least=0)
    # `sweep` traces temperatures, behind which a liquid is not seen.
    on_grid = isinstance(roughness, Surface) and roughness.grid.ndim == 2
    if on_grid or not np.all(np.asarray(velocity)):
        check_at_rest(stack)
    axes = {"pressure": pressure, "velocity": velocity}
    if temperature is not None:
        axes = {"temperature": temperature, **axes}

    case = Case(stack, roughness, pressure=0.0, velocity=0.0)  # of no point yet
    # Arguments of `slide` belong to the case (shear, heating) or to its computation (solver).
    of_case = {name: value for name, value in slide_options.items() if name in vars(case)}
    of_numerics = {name: slide_options[name] for name in slide_options if name not in of_case}
    numerics, _ = numerics_of("slide", {**of_numerics, "throw": False})
    case = dataclasses.replace(case, **of_case)

    def solved(point: dict[str, Array], by: Method, block: Stack) -> dict[str, Any]:
        warm = block if temperature is None else block.at(point["temperature"])
        moving = velocity_along(point["velocity"], direction)
        at: dict[str, Any] = {**point, "velocity": moving, "stack": warm}
        if by == "contact":
            s = solve(dataclasses.replace(case, **at), numerics)
            names = ("friction", "friction_error", "contact_area", "contact_area_error")
            return dict(zip(names, s.compute(*names), strict=True), result=s.result)
        field = mean_field_of(dataclasses.replace(case, **at), **mean_field_options)
        return dict(
            friction=field.friction, friction_error=field.error * jnp.abs(field.friction),
            contact_area=field.contact_area,
            contact_area_error=field.error * field.contact_area,
        )  # fmt: skip

    def table_by(by: Method) -> "Dataset":
        def numbers(point):
            return with_standard_error(partial(solved, point, by), stack, errors)

        return sweep(numbers, axes, **engine)

    # One after the other: a point that fails by one method has the numbers of the other. The mean
    # field comes first: what it refuses is refused before any contact is solved.
    theory = None if method == "contact" else table_by("mean_field")
    contacts = None if method == "mean_field" else table_by("contact")
    table = contacts if theory is None else theory if contacts is None else beside(contacts, theory)
    assert table is not None
    given = of_case | (dict(mean_field_options) if method == "mean_field" else {})
    shear, heating = (given.get(name) for name in ("shear", "heating"))
    table.attrs |= {
        "method": method,
        "conditions": conditions(direction, shear, heating, method),
        "direction": float(direction),
        **package_versions(),
    }
    return table


def beside(contacts: "Dataset", theory: "Dataset") -> "Dataset":
    """Returns a table of contacts with the numbers of the mean field as `mean_field.friction`."""
    return contacts.assign({f"mean_field.{name}": theory[name] for name in theory.data_vars})


def conditions(direction: float, shear: Any, heating: Any, method: str) -> str:
    """Returns in a sentence what a table of friction holds for."""
    parts = [
        f"Steady sliding at {direction:g} rad from the x axis",
        "no shear in the contact" if shear is None else f"shear in the contact: {_spelt(shear)}",
        "no heat of friction" if heating is None else "with the heat of friction",
    ]
    if is_coupled(shear) and method != "contact":
        parts.append("the mean field leaves out that the traction moves the surface")
    return "; ".join(parts)


def _spelt(shear: Any) -> str:
    """A law of shear with its numbers."""
    if not dataclasses.is_dataclass(shear):
        return short(shear)
    values = [(f.name, getattr(shear, f.name)) for f in dataclasses.fields(shear)]
    plain = [(n, f"{float(v):g}" if eqx.is_array_like(v) else short(v)) for n, v in values]
    return f"{type(shear).__name__}({', '.join(f'{name}={text}' for name, text in plain)})"
