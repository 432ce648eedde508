"""Measured moduli or compliances, and isotherms of them, checked and prepared for a fit."""

import dataclasses
from collections.abc import Sequence
from typing import Any, Literal, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import (
    Numbers,
    as_float,
    as_numbers,
    as_scalar,
    check_positive,
    check_rows,
    check_shape,
    check_type,
    check_values,
    is_concrete,
    short,
    within,
)
from ..core.compilation import compiled
from ..core.display import shown
from ..materials.measured import Measured
from ..materials.shift import check_kelvin
from .shifts import Isotherms, LawKind

Loss = Literal["linear", "soft_l1"]
ModuliKind = Literal["frequency", "relaxation", "creep"]
Unknowns = Float[Array, " unknowns"]
Isotherm = tuple[Numbers, Numbers, Numbers]


@shown()
class Observations(eqx.Module):
    """Measured values, and parameters that are known before the fit.

    **Fields:**

    - `x`: angular frequencies [rad/s] or times [s], shape `(points,)`.
    - `values`: storage and loss modulus [Pa], or one channel of moduli [Pa] or compliances
      [1/Pa]; shape `(channels, points)`; 1 where nothing was measured.
    - `weights`: of the squared log residuals [1], shape `(channels, points)`.
    - `equilibrium`: E_eq [Pa] where it is known.
    - `kind`: the measurement. Static.
    - `isotherms`: the temperatures, if shifts are unknown.
    - `scale`: log residual [1] from which on values count linearly, or None.
    """

    x: Float[Array, " points"]
    values: Float[Array, "channels points"]
    weights: Float[Array, "channels points"]
    equilibrium: Float[Array, ""] | None
    kind: ModuliKind = eqx.field(static=True)
    isotherms: Isotherms | None = None
    scale: Float[Array, ""] | None = None

    @property
    def num_extras(self) -> int:
        """The number of unknowns of strengths without a time."""
        return int(self.equilibrium is None)

    @property
    def num_shifts(self) -> int:
        """The number of unknowns of shifts, the last ones."""
        return sum(self.isotherms.counts) if self.isotherms else 0


def observe(
    kind: Any,
    x: Numbers,
    values: Numbers,
    weights: tuple[Numbers, Numbers],
    equilibrium: Numbers | None = None,
) -> Observations:
    """Returns the observations, checked. Values that are NaN count as not measured.

    Arguments as in `fit_prony`.
    """
    check_type("kind", kind, *get_args(ModuliKind))
    x = as_float(x, "x")
    if x.dtype != jnp.float64:
        raise ValueError(
            f"`x` is {x.dtype}: series over many decades are fitted in double precision. "
            "Call `jax.config.update('jax_enable_x64', True)` before creating arrays."
        )
    check_rows(1, x=x)
    if kind == "frequency":
        check_positive("x", x, "[rad/s]")
        modulus = as_numbers(values, "values")
        parts = {"values.real": modulus.real, "values.imag": modulus.imag}
    else:
        check_values("x", x, "it must be zero or a positive number [s]", at_least=0)
        parts = {"values": values}
    if equilibrium is not None:
        if kind == "creep":
            raise ValueError("`equilibrium` must be None for creep: it is fitted.")
        equilibrium = as_float(equilibrium, "equilibrium")
        allowed = "it must be zero or a positive number [Pa]"
        check_values("equilibrium", equilibrium, allowed, at_least=0)
    channels = zip(parts.items(), weights, strict=False)
    measured = [_channel(*part, weight, x) for part, weight in channels]
    rows, sizes = (jnp.stack(parts) for parts in zip(*measured, strict=True))
    data = Observations(x, rows, sizes, equilibrium, kind)
    if concrete(data):
        _check_content(data)
    return data


def concrete(data: Observations) -> bool:
    """Returns whether all numbers of the observations are concrete."""
    return all(is_concrete(leaf) for leaf in jax.tree.leaves(data))


def _channel(name, values, weight, x):
    """Values and weights of a channel; where the weight is 0 the value is 1."""
    values, weight = as_float(values, name), as_float(weight, f"weight of {name}")
    check_shape(name, values, x.shape)
    if weight.ndim:
        check_shape(f"weight of {name}", weight, x.shape)
    check_values(f"weight of {name}", weight, "it must be zero or positive", at_least=0)
    values, weights = _without_gaps(values, weight)
    allowed = "it must be positive; NaN, or a weight of 0, leaves it out"
    check_values(name, values, allowed, above=0)
    return values, weights


@compiled
def _without_gaps(values: Array, weight: Array) -> tuple[Array, Array]:
    weights = jnp.where(jnp.isnan(values), 0, weight)
    return jnp.where(weights > 0, values, 1), weights


def _check_content(data):
    counts = np.sum(np.asarray(data.weights) > 0, axis=1)
    if np.sum(counts) < 2:
        raise ValueError(
            f"`values` holds {np.sum(counts)} measured value(s) of a weight above 0; at least 2 "
            "are needed."
        )
    if counts[0] == 0 and data.equilibrium is None:
        raise ValueError(
            "`equilibrium=None` cannot be fitted to a loss modulus alone, which does not depend "
            "on it. Give it, or 0 for a liquid."
        )
    if not np.any(np.asarray(data.x) > 0):
        raise ValueError("`x` has no time above 0.")


# Isotherms --------------------------------------------------------------------------------------


def joined_curves(
    isotherms: Measured | Sequence[Measured | Isotherm], kind: Any, law: Any,
    stds: tuple[float, float], reference: Any, weights: tuple[Numbers, Numbers],
    equilibrium: Numbers | None,
) -> Observations:  # fmt: skip
    """Returns the data, checked and sorted by temperature; arguments as in `master_curve`."""
    check_type("law", law, *get_args(LawKind))
    if isinstance(isotherms, Measured):
        isotherms = isotherms.isotherms()
    curves = [_curve(i, isotherm, kind) for i, isotherm in enumerate(isotherms)]
    if len(curves) < 2:
        raise ValueError(f"`isotherms` holds {len(curves)}; at least 2 are needed.")
    curves.sort(key=lambda curve: curve[1])
    kinds, kelvin, x, values = zip(*curves, strict=True)
    if len(set(kinds)) > 1:
        raise ValueError("`isotherms` are of different kinds; all must be measured alike.")
    temperatures, coldest, hottest = np.array(kelvin), kelvin[0], kelvin[-1]
    check_kelvin("temperature", temperatures)
    for twice in temperatures[1:][np.diff(temperatures) <= 0]:
        raise ValueError(f"`isotherms` has {twice:g} K twice: join these first.")
    middle = len(curves) // 2
    if reference is not None:
        as_scalar(reference, "reference")
        measured = f"isotherms are from {coldest:g} to {hottest:g} K"
        allowed = f"{measured}. With `shift_std=0` take `material.at(temperature)` of the result"
        check_values("reference", reference, allowed, at_least=coldest - 1, at_most=hottest + 1)
        middle = int(np.argmin(np.abs(temperatures - float(reference))))
    data = observe(kinds[0], jnp.concatenate(x), jnp.concatenate(values), weights, equilibrium)
    known = Isotherms(
        group=jnp.asarray(np.repeat(np.arange(len(x)), [len(points) for points in x])),
        temperatures=jnp.asarray(temperatures),
        penalty=jnp.zeros(2),
        reference=middle,
        law=law,
        stds=stds,
    )
    return dataclasses.replace(data, isotherms=known)


def _curve(number, isotherm, kind) -> tuple[Any, ...]:
    """Kind, temperature, x and values of an isotherm."""
    name = f"isotherms[{number}]"
    if isinstance(isotherm, Measured):
        if isotherm.deformation != "tension" or isotherm.temperature is None:
            raise ValueError(
                f"`{name}` from {isotherm.path} must be in tension and have a temperature: read "
                "the file with `poisson` and `temperature`."
            )
        kind = isotherm.kind
        isotherm = (np.mean(isotherm.temperature), isotherm.abscissa, isotherm.values)
    if not isinstance(isotherm, Sequence) or len(isotherm) != 3:
        raise ValueError(f"`{name}={short(isotherm)}` must be `(temperature, x, values)`.")
    temperature, x, values = isotherm
    x, values = as_float(x, "x"), as_numbers(values, "values")
    with within(f"`{name}`:"):
        check_rows(1, x=x, values=values)
    return kind, float(temperature), x, values
