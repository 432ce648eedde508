"""Isotherms as they are given, checked and joined for a fit."""

from collections.abc import Sequence
from typing import Any, get_args

import jax.numpy as jnp
import numpy as np

from ..core.checks import Numbers, as_float, as_numbers, check_positive, check_values, is_concrete
from ..files.moduli.points import Measured
from .observations import observe
from .series import Kind
from .shifted_observations import (
    Isotherms,
    LawKind,
)

COLDEST = 100.0  # K, below which all temperatures of a set are thought to be in °C
Isotherm = tuple[Numbers, Numbers, Numbers]


def check_law(law: str) -> None:
    """Raises `ValueError` unless `law` names one of the laws that isotherms are shifted by."""
    if law not in get_args(LawKind):
        raise ValueError(f"`law={law!r}` is refused: use one of {get_args(LawKind)}.")


def size_of(name: str, value: Any) -> float:
    """Returns how far shifts are expected to depart, checked."""
    if not is_concrete(value):
        raise ValueError(f"`{name}` must be a number: it decides what is fitted.")
    check_values(name, value, "it must be zero or positive", at_least=0)
    return float(value)


def isotherms_of(
    isotherms: Measured | Sequence[Measured | Isotherm],
    kind: Any,
    law: Any,
    sizes: tuple[float, float],
    reference: Any,
    channels: tuple[Numbers, Numbers],
    **known: Numbers | None,
) -> Isotherms:
    """Returns the data, checked and sorted by temperature; arguments as in `master_curve`."""
    check_law(law)
    if kind not in get_args(Kind):
        raise ValueError(f"`kind={kind!r}` is refused: use one of {get_args(Kind)}.")
    if isinstance(isotherms, Measured):
        isotherms = isotherms.isotherms()
    curves = [_curve(i, isotherm, kind) for i, isotherm in enumerate(isotherms)]
    if len(curves) < 2:
        raise ValueError(f"`isotherms` holds {len(curves)}; at least 2 are needed.")
    kind = curves[0][0]
    if any(other != kind for other, *_ in curves):
        raise ValueError("`isotherms` are of different kinds; all must be measured alike.")
    curves.sort(key=lambda curve: curve[1])
    temperatures = np.array([temperature for _, temperature, _, _ in curves])
    check_positive("temperature", temperatures, "[K]")
    if float(temperatures[-1]) < COLDEST:
        raise ValueError(
            f"`isotherms` has temperatures up to {float(temperatures[-1]):g}; they are in kelvin."
        )
    twice = np.flatnonzero(np.diff(temperatures) <= 0)
    if len(twice):
        raise ValueError(f"`isotherms` holds {temperatures[twice[0]]:g} K twice: join those first.")
    x = jnp.concatenate([x for *_, x, _ in curves])
    values = jnp.concatenate([values for *_, values in curves])
    if kind == "frequency":
        parts = {
            "modulus.real": (values.real, channels[0]),
            "modulus.imag": (values.imag, channels[1]),
        }
    else:
        parts = {"modulus" if kind == "relaxation" else "compliance": (values, channels[0])}
    middle = len(curves) // 2
    if reference is not None:
        coldest, hottest = temperatures[[0, -1]]
        allowed = f"isotherms are from {coldest:g} to {hottest:g} K"
        check_values("reference", reference, allowed, at_least=coldest - 1, at_most=hottest + 1)
        middle = int(np.argmin(np.abs(temperatures - float(reference))))
    observations = observe(kind, x, parts, times=None, **known)
    if observations.flows:
        raise ValueError("`equilibrium=0` is not available for creep at several temperatures.")
    return Isotherms(
        observations=observations,
        group=jnp.repeat(jnp.arange(len(curves)), np.array([len(x) for *_, x, _ in curves])),
        temperatures=jnp.asarray(temperatures),
        penalty=jnp.zeros(2),
        reference=middle,
        law=law,
        departs=sizes[0] > 0,
        lifts=sizes[1] > 0,
    )


def _curve(number, isotherm, kind) -> tuple[Any, ...]:
    """Kind, temperature, x and values of an isotherm."""
    if isinstance(isotherm, Measured):
        missing = ["`poisson`"] if isotherm.deformation != "tension" else []
        missing += ["`temperature`"] if isotherm.temperature is None else []
        if missing or isotherm.temperature is None:
            raise ValueError(
                f"`isotherms[{number}]` from {isotherm.path} must be in tension and have a "
                f"temperature: read the file with {' and '.join(missing)}."
            )
        kind = isotherm.kind
        isotherm = (np.mean(isotherm.temperature), isotherm.abscissa, isotherm.values)
    temperature, x, values = isotherm
    if not is_concrete(temperature):
        raise ValueError(f"`isotherms[{number}]` must have a temperature that is known.")
    x, values = as_float(x, "x"), as_numbers(values, "values")
    if x.ndim != 1 or x.shape != values.shape:
        raise ValueError(
            f"`isotherms[{number}]` has x of shape {x.shape} and values of {values.shape}; two "
            "one-dimensional arrays of equal length are needed."
        )
    return kind, float(temperature), x, values
