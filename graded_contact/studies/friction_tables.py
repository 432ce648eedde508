"""Tables of friction over pressure, velocity and temperature."""

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import jax.numpy as jnp
import numpy as np
from jax import Array

from ..blocks.stack import Stack, check_at_rest
from ..core.checks import Numbers, as_float, check_positive, check_types, check_values, short
from ..fields.frequency import velocity_along
from ..mean_field.mean_field import mean_field_of
from ..sliding.case import Case
from ..sliding.numerics import numerics_of
from ..surfaces.spectrum import SelfAffine
from ..surfaces.surface import Surface
from .dataset import package_versions
from .sweep import sweep

if TYPE_CHECKING:
    from xarray import Dataset

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
    - `slide_options`, `mean_field_options`: further arguments of these functions, without those
      that `slide` has for a start.
    - `engine`: `store`, `workers`, `client` and `progress` of `sweep`.

    **Returns:** an `xarray.Dataset` over temperature (if given), pressure and velocity with
    `friction`, `friction_error`, `contact_area`, `contact_area_error` and `message`. The errors of
    a contact are those of the solver and of the grid; that of the mean field is the error of its
    quadrature. With `"both"` the numbers of the mean field are `mean_field.friction` and so on.

    **Raises:** `ValueError` for a refused argument; what `sweep` raises.
    """
    if method != "mean_field" and not isinstance(roughness, Surface):
        raise ValueError(f"`roughness={short(roughness)}` must be a `Surface` for a contact.")
    if method != "contact" and isinstance(roughness, Surface) and not roughness.periodic:
        raise ValueError(
            f"`method={method!r}` is refused: a window has no mean field; use 'contact'."
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

    plain = Case(stack, roughness, pressure=0.0, velocity=0.0)  # of no point yet
    # Arguments of `slide` belong to the case (shear, heating) or to its computation (solver).
    of_case = {name: value for name, value in slide_options.items() if name in vars(plain)}
    of_numerics = {name: slide_options[name] for name in slide_options if name not in of_case}
    numerics, _ = numerics_of("slide", {**of_numerics, "throw": False})
    contact = dataclasses.replace(plain, **of_case)

    def numbers(point: dict[str, Array]) -> dict[str, Any]:
        at: dict[str, Any] = {**point, "velocity": velocity_along(point["velocity"], direction)}
        if temperature is not None:
            at["stack"] = stack.at(point["temperature"])
        theory, found = {}, {}
        if method != "contact":
            field = mean_field_of(dataclasses.replace(plain, **at), **mean_field_options)
            theory = dict(
                friction=field.friction, friction_error=field.error * jnp.abs(field.friction),
                contact_area=field.contact_area,
                contact_area_error=field.error * field.contact_area,
            )  # fmt: skip
        if method != "mean_field":
            s = dataclasses.replace(contact, **at).solve(numerics)
            names = ("friction", "friction_error", "contact_area", "contact_area_error")
            found = dict(zip(names, s.compute(*names), strict=True), result=s.result)
        return {**found, "mean_field": theory} if method == "both" else found or theory

    table = sweep(numbers, axes, **engine)
    table.attrs |= {"method": method, "direction": float(direction), **package_versions()}
    return table
