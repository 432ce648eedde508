"""Persson's multiscale mean-field theory of friction and contact area, for any stack.

At the magnification ζ = q/q_low, the contact has the roughness up to the wavenumber q and no finer
roughness. If the contact were complete, every wave h_q of a surface with the velocity v would add
the pressure h_q/M, M = M_zz(q, -q·v), and the variance V of the pressure about its mean σ0 would
grow by

    dV = C q dq ∫dφ |1/M|²  =  ¼ C q³ dq ∫dφ |E_eff(q, q v cos φ)|²,

E_eff = 2/(q M) being `effective_modulus`. With a lay C depends on the direction of q. Roughness
C_own of the block moves with the block, excites no frequency, and adds C_own q dq ∫dφ |1/M(q, 0)|²
to dV. A counterface that carries the track adds its M(q, 0) to M, and under C_own its M(q, -q·v),
whose loss is friction, too. In partial contact the pressure spreads by diffusion that ends where it
reaches zero (`diffusion.py`), which leaves the contact area

    A(q) = erf(σ0/√(2V))          (Persson's erf(1/(2√G)), G = V/(2σ0²)),

and the mean square pressure grows by A dV: the power spectrum of the pressure is the share A of
that in complete contact. Friction is the dissipation of this pressure,

    dμ = A C q dq ∫dφ q cos φ Im(1/M)/σ0  =  ½ A C q³ dq ∫dφ cos φ Im E_eff(q, q v cos φ)/σ0,

which at A = 1 is the exact friction of complete contact. A correction slows the diffusion, dV' = S
dV: V' replaces V in the area, and A S replaces A in the friction.

Shear in the contact adds ∫τ_f(σ) P(σ) dσ/σ0, P being the density of the pressure.

Sources: B. N. J. Persson, J. Chem. Phys. 115 (2001) 3840, doi:10.1063/1.1388626; layered solids:
M. Scaraggi, B. N. J. Persson, arXiv:1506.06955. Signs, factors and the stack's M in place of the
half space's are derived from complete contact.
"""

import dataclasses
from functools import partial
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ..blocks.stack import Stack, check_at_rest
from ..contacts.law import HardWall
from ..core.checks import (
    Numbers,
    as_float,
    as_scalar,
    check_positive,
    check_rows,
    check_tolerance,
    check_type,
    check_values,
    check_whole,
    is_concrete,
    short,
    within,
)
from ..core.compilation import compiled
from ..core.derivative import still
from ..core.display import shown
from ..fields.devices import required
from ..fields.frequency import as_velocity, direction_and_speed
from ..materials.shift import HOTTEST, as_temperature
from ..materials.softening import as_strain_per_slope
from ..response.grading import check_profiles
from ..sliding.case import Case, Heating
from ..sliding.shear import ShearLaw, shear_stress
from ..surfaces.spectrum import CutoffCurve, SelfAffine
from ..surfaces.spectrum_table import Spectrum, SpectrumTable
from .diffusion import Correction, area, density, mean_in_contact
from .heating_by_scale import HeatedScales, between_scales, find_rises
from .quadrature import FieldInputs, Rules, end_frequencies, integrate, smooth_edges

RTOL = 1e-4
NO_FIELD = (
    "The mean field did not reach `rtol` or steady temperatures, or is not finite (as with a "
    "modulus of 0)"
)
_NOT_REACHED = f"{NO_FIELD}. Raise `num_wavenumbers` and `num_angles`, or `rtol`."


@shown()
class MeanField(eqx.Module):
    """Friction and contact area, at full magnification and as functions of it.

    **Fields:**

    - `friction`: force opposing the motion over the load [1], with all roughness; hysteresis and
      shear together.
    - `pressure_friction`: the part that the pressure exerts on slopes [1], lost in the block.
    - `shear_friction`: the part from shear in the contact [1]; 0 without `shear`.
    - `contact_area`: fraction of the nominal area in contact [1], with all roughness.
    - `against_cutoff`: with roughness up to each of `n` cut-offs only; friction there may ring by
      1e-3 of the whole where few nodes resolve it.
    - `stress_variance`: V' [Pa²], how far the pressure has spread at each cut-off, shape `(n,)`.
    - `pressure`: the mean pressure σ0 [Pa].
    - `extrapolated_friction`: share of the hysteresis from frequencies at which a material of the
      stack was not measured [1], to about 1 % by the quadrature; see `coverage`.
    - `error`: estimated relative error of friction and area by the quadrature [1]: what every
      second wavenumber and every second angle change.
    - `heated`: temperatures of the scales, see `mean_field/heating_by_scale.py`, or None.
    """

    friction: Float[Array, ""]
    pressure_friction: Float[Array, ""]
    shear_friction: Float[Array, ""]
    contact_area: Float[Array, ""]
    against_cutoff: CutoffCurve
    stress_variance: Float[Array, " n"]
    pressure: Float[Array, ""]
    extrapolated_friction: Float[Array, ""]
    error: Float[Array, ""]
    heated: HeatedScales | None = None


def mean_field_friction(
    stack: Stack,
    spectrum: Spectrum,
    *,
    pressure: Numbers,
    velocity: Numbers,
    own_roughness: Spectrum | None = None,
    strain_per_slope: ScalarLike | None = None,
    correction: Correction = "yang_persson",
    num_wavenumbers: int = 80,
    num_angles: int = 20,
    rtol: float = RTOL,
    shear: ShearLaw | None = None,
    temperature: ScalarLike | None = None,
    heating: Heating | None = None,
    counterface: Stack | None = None,
    throw: bool = True,
) -> MeanField:
    """Returns friction and contact area of a rough surface sliding on a stack, by Persson's theory.

    Differentiable in every leaf of `stack`, `spectrum`, `shear` and `heating`, in `pressure`,
    `velocity` and `temperature`; works under `jit` and `vmap`. A friction curve by `jax.lax.map`
    is faster on a CPU than by `vmap`, because the data of one velocity stay in the cache.

    **Arguments:**

    - `stack`: the block, see `Stack`. `stack.at(temperature)` is the block at another temperature.
    - `spectrum`: roughness of the track, as a `SelfAffine`, isotropic or with a lay, or as a
      `SpectrumTable`, such as `isotropic_spectrum` of a surface.
    - `pressure`: mean pressure σ0 [Pa].
    - `velocity`: of the surface over the block [m/s]: a number (along x) or `(vx, vy)`.
    - `own_roughness`: roughness of the block itself, which moves with it, as above. It reduces the
      area like the roughness of a track at rest: it excites no frequency of the block and
      dissipates nothing there; a counterface dissipates under it.
    - `strain_per_slope`: for a block with `materials.StrainSoftening`. The modulus at each q is
      that at the amplitude ε = `strain_per_slope` times the rms slope of the track up to q, the
      factor [1] being of order 1. None: the amplitude of each material.
    - `correction`: how partial contact slows the diffusion: `"none"` (Persson 2001) or
      `"yang_persson"`, see `mean_field/diffusion.py`.
    - `num_wavenumbers`: intervals of the quadrature in q, shared by the smooth pieces of the
      spectrum and rounded up to multiples of 4 on each.
    - `num_angles`: intervals between the directions along and across the velocity, an even number.
    - `rtol`: largest acceptable `error` [1]. Both numbers of intervals are doubled until it is met,
      at most three times; inside `jit` and `vmap`, where they are fixed, they stay as given.
    - `shear`, `temperature`: law of the shear stress in the contact and its temperature [K], as in
      `slide`; with `heating` the bulk temperature, to which the block is brought.
    - `heating`: conductivities, see `sliding.Heating`: each scale then has the modulus at the
      temperature that the heat of friction causes there, see `heating_by_scale.py`; `.heated` has
      the temperatures. None for one temperature.
    - `counterface`: the body that carries the track and moves with it, as in `slide`, or None.
    - `throw`: whether to raise if `rtol` is exceeded; otherwise check `.error`.

    **Returns:** friction and contact area at every cut-off, see `MeanField`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if `rtol` is not reached.
    """
    check_tolerance("rtol", rtol, as_scalar(pressure, "pressure"))
    if temperature is not None:
        temperature = as_temperature(temperature)
    if strain_per_slope is not None:
        strain_per_slope = as_strain_per_slope(strain_per_slope, (stack, counterface))
    load = as_scalar(pressure, "pressure")
    field = FieldInputs(
        stack, spectrum, own_roughness, load, as_velocity(velocity), strain_per_slope, counterface
    )
    field = _checked(field, shear, temperature, heating)
    for factor in (1, 2, 4, 8):
        rules = _quadrature_rules(field, correction, factor * num_wavenumbers, factor * num_angles)
        found, heated = _by_quadrature(rules, (field, shear, temperature), heating)
        solution = _assembled(found, field.pressure, heated)
        # Inside `jit` the error is not known. An infinite one is not of the quadrature.
        error = np.asarray(solution.error) if is_concrete(solution.error) else np.inf
        if not np.any((error > rtol) & (error < np.inf)):
            break
    return reached(solution, rtol) if throw else solution


def mean_field_of(case: Case, spectrum: Spectrum, **options: Any) -> MeanField:
    """Returns the mean field of a case of steady sliding.

    **Arguments:**

    - `case`: with a pressure and a velocity.
    - `spectrum`: of its surface, see `mean_field_friction`.
    - `options`: arguments of `mean_field_friction`, also in place of numbers of the case.

    **Raises:** `ValueError` for a case with another law of contact than a hard wall.
    """
    if not isinstance(case.law, HardWall) or case.law.hardness is not None:
        raise ValueError(f"`law={short(case.law)}` is refused: the mean field is of a hard wall.")
    names = (
        "pressure", "velocity", "shear", "temperature", "heating", "strain_per_slope",
        "counterface",
    )  # fmt: skip
    given: dict[str, Any] = {name: getattr(case, name) for name in names} | options
    return mean_field_friction(case.stack, spectrum, **given)


def _checked(field: FieldInputs, shear, temperature, heating) -> FieldInputs:
    """The inputs of a mean field, checked; with `heating` at the bulk temperature."""
    stack, pressure = field.stack, field.pressure
    if field.counterface is not None:
        with within("`counterface`:"):
            check_at_rest(field.counterface)
    check_positive("pressure", pressure, "[Pa]")
    # Early, so that a bad law is named before anything is compiled.
    shear_stress(shear, field.velocity, temperature)
    # On input the value is unknown if the pressure is traced.
    load = jnp.where(pressure > 0, pressure, jnp.nan)
    check_type("spectrum", field.spectrum, SelfAffine, SpectrumTable)
    check_type("own_roughness", field.own, SelfAffine, SpectrumTable, type(None))
    if heating is not None:
        if any(jnp.ndim(number) for number in vars(heating).values()):
            raise ValueError(
                "`heating` has numbers for each layer; in the mean field both bodies are half "
                "spaces: give one `conductivity`, `diffusivity` and `counterface_conductivity`."
            )
        if field.counterface is not None and field.own is not None:
            raise ValueError(
                "`heating` is refused with `own_roughness` and a `counterface`, which then "
                "takes a part of the heat, which is not followed."
            )
        stack = stack.at(temperature)
    return dataclasses.replace(field, stack=stack, pressure=load)


@compiled
def _assembled(found, load, heated) -> MeanField:
    q, x, friction, error, share, sheared = found
    return MeanField(
        friction=friction[-1] + sheared[-1],
        pressure_friction=friction[-1],
        shear_friction=sheared[-1],
        contact_area=area(x[-1]),
        against_cutoff=CutoffCurve(q, friction + sheared, area(x)),
        stress_variance=x * load * load,
        pressure=load,
        extrapolated_friction=share,
        error=error,
        heated=heated,
    )


def reached(solution: MeanField, rtol: float = RTOL) -> MeanField:
    """Returns one or several mean fields; raises `RuntimeError` for an error above `rtol`."""
    if not is_concrete(solution.error):
        good = jnp.all(solution.error <= rtol)
        return required(solution, good, partial(eqx.error_if, msg=_NOT_REACHED))
    if not np.all(np.asarray(solution.error) <= rtol):  # so that NaN fails
        raise RuntimeError(_NOT_REACHED)
    return solution


def _quadrature_rules(field, correction, num_wavenumbers, num_angles) -> Rules:
    check_whole("num_wavenumbers", num_wavenumbers, 4)
    check_whole("num_angles", num_angles, 4)
    if num_angles % 2:
        raise ValueError(f"`num_angles={num_angles}` must be even.")
    num_pieces = len(smooth_edges(field.spectrum)) - 1
    num_pieces += 0 if field.own is None else len(smooth_edges(field.own))
    per_piece = 4 * -(-num_wavenumbers // (4 * num_pieces))
    return Rules(correction, per_piece, num_angles)


def _by_quadrature(rules: Rules, given, heating: Heating | None):
    """The results of `_integrated`, and the temperatures of the scales."""
    field = given[0]
    # Profiles and tables may have no answer at the frequencies of the quadrature.
    speed, ends = end_frequencies(field.spectrum, field.velocity)
    if is_concrete(speed) and np.asarray(speed) == 0:
        check_at_rest(field.stack)
    check_profiles(field.stack, ends)
    if field.counterface is not None:
        check_profiles(
            field.counterface, jnp.append(0.0, ends) if field.own is not None else 0 * ends
        )
    if heating is None:
        return _integrated(rules, given), None

    def power(given, rises):
        q, x, friction, _, _, sheared = _integrated(rules, given, rises)
        speed = jnp.abs(direction_and_speed(given[0].velocity)[1])
        load = given[0].pressure * speed
        return q, x, load * friction, load * sheared[-1], speed

    rises, change, reached = find_rises(power, heating, given, still(HOTTEST - given[2]))
    q, x, friction, error, *rest = _integrated(rules, given, rises)
    scales = HeatedScales(rises[0], between_scales(rises[1:], q), change)
    return (q, x, friction, jnp.where(reached, error, jnp.inf), *rest), scales


def _integrated(rules: Rules, given, rises=None):
    """Wavenumbers, diffusion, hysteresis, its error and extrapolated share, and shear."""
    (field, shear, temperature), scales = given, None
    if rises is not None:
        # The first temperature is at the surface, where shear acts.
        scales, temperature = temperature + rises[1:], temperature + rises[0]
    q, x, *found = integrate(field, rules, scales)
    return q, x, *found, _sheared(field.pressure, field.velocity, shear, temperature, x)


@compiled
def _sheared(pressure, velocity, shear, temperature, x):
    """Friction by shear up to each cut-off [1]."""
    stress = shear_stress(shear, velocity, temperature)
    if stress is None:
        return jnp.zeros_like(x)
    return area(x) * mean_in_contact(lambda sigma: stress(sigma * pressure), x) / pressure


def pressure_distribution(mean_field: MeanField, stress: Numbers) -> Float[Array, "n m"]:
    """Returns the probability density P(σ, ζ) [1/Pa] of the pressure in contact.

    Its integral over σ is the contact area; the rest of the nominal area carries no pressure.

    **Arguments:**

    - `mean_field`: a result of `mean_field_friction`.
    - `stress`: σ [Pa], not negative, shape `(m,)`.

    **Returns:** P, shape `(n, m)`, a row for each cut-off. Where no roughness is seen yet
    all of P lies at σ0, and the row is 0.
    """
    stress = as_float(stress, "stress")
    check_rows(1, stress=stress)
    check_values("stress", stress, "a stress [Pa] is zero or positive", at_least=0)
    mean = mean_field.pressure
    # Twice a division: the square of a pressure may leave the range of float32.
    x = mean_field.stress_variance / mean / mean
    return density(x[:, None], (stress / mean)[None, :]) / mean
