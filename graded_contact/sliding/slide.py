"""A rough surface sliding on a layered viscoelastic block: steadily, or in periodic motion.

`slide` and `slide_cycle` build a `Case`; `slide_case` solves it.
"""

from collections.abc import Sequence
from typing import Any, cast

from jaxtyping import ScalarLike

from ..blocks.stack import Stack
from ..contacts.law import AbstractLaw, HardWall
from ..core.checks import Numbers
from ..surfaces.surface import Surface
from .case import Case, Heating, Numerics
from .result import CyclicSliding, Sliding, TransientSliding
from .shear import ShearLaw
from .solve.heated import solve_heated
from .solve.isothermal import solve_isothermal
from .solve.transient import solve_transient


def slide(
    stack: Stack,
    surface: Surface,
    *,
    pressure: ScalarLike | None = None,
    mean_gap: ScalarLike | None = None,
    approach: ScalarLike | None = None,
    velocity: Numbers,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    shear: ShearLaw | None = None,
    temperature: ScalarLike | None = None,
    heating: Heating | None = None,
    strain_per_slope: ScalarLike | None = None,
    counterface: Stack | None = None,
    start: Numbers | None = None,
    **numerics: Any,
) -> Sliding:
    """Returns friction, contact area and fields of a rough surface sliding on a block.

    Differentiable in every leaf of `stack`, `surface`, `law` and `shear`, in `pressure`, `mean_gap`
    or `approach`, in `velocity` and `temperature`: `jax.grad(lambda s: slide(s, surface,
    pressure=p, velocity=v).friction)(stack)` is a stack of derivatives. Works under `jit` and
    `vmap`, see `solve_contact`.

    **Arguments:**

    - `stack`: the block, see `Stack`. `stack.at(temperature)` is the block at another temperature.
    - `surface`: the rough surface; heights count into the block.
    - `pressure`: mean pressure σ0 [Pa]; or
    - `mean_gap`: mean of the gap [m], counted from the mean of the heights; or
    - `approach`: of a non-periodic surface [m], see `solve_contact`.
    - `velocity`: of the surface over the block [m/s]: a number (along x) or `(vx, vy)`. Two numbers
      are one velocity, not two speeds as in a scene: for several speeds use `sweep` or
      `jax.lax.map`. At a velocity of 0 (a number, not traced) the block has its relaxed moduli.
    - `shear`: law of the shear stress in the contact, called as shear(pressure, speed,
      temperature), such as `Coulomb`, `ConstantShear` or `PeakedShear`; None for hysteresis alone.
      The traction of a law that is `coupled` moves the surface of the block and so changes the
      pressure; other laws leave it, which is exact for ν = 1/2 on a half space. Of a
      non-periodic surface only `Coulomb` can be coupled.
    - `temperature`: of the contact [K], for a law of shear that varies with it; with `heating` the
      bulk temperature, to which the block is brought, see `Stack.at`.
    - `heating`: conductivities, see `Heating`: the heat of friction then changes the temperature of
      the block under the contact; `.heated` has the temperatures. None for one temperature.
    - `strain_per_slope`: for a block with `materials.StrainSoftening`, as in `mean_field_friction`:
      each wave q has the modulus at the amplitude ε = `strain_per_slope` times the rms slope of the
      surface up to q. None: the amplitude of each material.
    - `counterface`: the body that carries the surface and moves with it, a `Stack` from its surface
      inwards; None for a rigid one. The waves of the pressure rest on it: it has its relaxed moduli
      and loses nothing. It keeps its temperature: pass `counterface.at(...)`; with `heating` it has
      the bulk temperature and is heated, too. If the block is rough and the counterface is smooth,
      exchange them: `stack` is then the smooth body, `counterface` the rough one, and `velocity`
      the rough body's over the smooth one.
    - `law`: of contact.
    - `start`: a pressure field [Pa] to start from, see `solve_contact`.
    - `numerics`: `rtol`, `derivative_rtol`, `solver` and `throw`, see `Numerics`.

    With `throw=False`, `.result` also reports a graded layer whose kernel misses its tolerance; all
    numbers are then NaN.

    **Returns:** friction, areas, errors and the contact itself, see `Sliding`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if kernel or solve fail.
    """
    case = Case(
        stack=stack, surface=surface, pressure=pressure, mean_gap=mean_gap, approach=approach,
        velocity=velocity, law=law, shear=shear, temperature=temperature, heating=heating,
        strain_per_slope=strain_per_slope, counterface=counterface,
    )  # fmt: skip
    return cast(Sliding, slide_case(case, Numerics(**numerics), start=start))


def slide_cycle(
    stack: Stack,
    surface: Surface,
    *,
    displacement: Numbers,
    period: ScalarLike,
    pressure: Numbers | None = None,
    mean_gap: Numbers | None = None,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    shear: ShearLaw | None = None,
    temperature: ScalarLike | None = None,
    heating: Heating | None = None,
    counterface: Stack | None = None,
    block_surface: Surface | None = None,
    start: Numbers | None = None,
    **numerics: Any,
) -> CyclicSliding:
    """Returns friction, contact area and fields of a surface in periodic motion on a block.

    The periodic state, which a repeated motion approaches. Differentiable in every leaf of `stack`,
    `surface`, `law` and `shear`, in the motion and in the prescribed load or gap; works under `jit`
    and `vmap`.

    **Arguments:**

    - `stack`: the block, see `Stack`. `stack.at(temperature)` is the block at another temperature.
    - `surface`: the rough surface; heights count into the block.
    - `displacement`: s [m] of the surface at equally spaced times of a period, shape `(nt,)` (along
      x) or `(nt, 2)`, nt at least 4; see `sinusoidal`, `start_stop`, `recorded`. Over a
      period the surface may advance by whole cells; their number follows from the last step, which
      must be like its neighbours.
    - `period`: T [s].
    - `pressure`: mean pressure σ0 [Pa], a number or one at each time; or
    - `mean_gap`: mean of the gap [m], a number or one at each time, counted from the mean of the
      heights; of periodic surfaces only.
    - `law`: of contact; it has no history.
    - `shear`, `temperature`: as in `slide`. The law holds at the pressure and the speed of each
      time, and the traction has the direction of the motion. At rest there is none.
    - `heating`: as in `slide`, by the mean heat of the cycle: the block and the shear have the
      temperature of steady sliding at the mean speed and load, with the mean power of the cycle.
      What varies within the cycle is left out, see `solve_heated`.
    - `counterface`: as in `slide`. Where the pressure under the surface varies, the counterface has
      its moduli at the frequencies of the period, and loses power, `counterface_power`.
    - `block_surface`: the heights of the block itself, which rest on it; heights count out of the
      block, so that both heights add up. At s = 0 the points of the two grids coincide.
    - `start`, `numerics`: as in `slide`.

    **Returns:** friction and areas over time, works, errors and the contact, see `CyclicSliding`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if kernel or solve fail.
    """
    case = Case(
        stack=stack, surface=surface, displacement=displacement, period=period, pressure=pressure,
        mean_gap=mean_gap, law=law, shear=shear, temperature=temperature, heating=heating,
        counterface=counterface, block_surface=block_surface,
    )  # fmt: skip
    return cast(CyclicSliding, slide_case(case, Numerics(**numerics), start=start))


def slide_transient(
    stack: Stack,
    surface: Surface,
    *,
    times: Numbers,
    displacement: Numbers,
    pressure: Numbers | None = None,
    mean_gap: Numbers | None = None,
    approach: Numbers | None = None,
    law: AbstractLaw = HardWall(),  # noqa: B008 (immutable)
    shear: ShearLaw | None = None,
    temperature: ScalarLike | None = None,
    counterface: Stack | None = None,
    block_surface: Surface | None = None,
    fields_at: Sequence[int] = (-1,),
    **numerics: Any,
) -> TransientSliding:
    """Returns friction, contact area and fields of a surface in a transient motion.

    Start from rest, dwell, braking, steps of the load, unloading. Before t = 0 nothing touches; in
    the first step the pressure grows from 0. Differentiable in every leaf of `stack`, `surface`,
    `law` and `shear`, in times and motion and in the prescribed load, gap or approach; works under
    `jit` and `vmap`.

    **Arguments:**

    - `stack`: the block; it may flow (`equilibrium` 0). Tables of moduli are refused: fit them.
    - `surface`: the rough surface; heights count into the block. Around a
      non-periodic surface (`periodic=False`) nothing acts; the bodies remember its whole path
      without copies, in fields of twice its length along each axis.
    - `times`: ends of the steps [s], shape `(nt,)`, positive and ascending. Steps may differ: where
      all rests, each may be a fixed part of the time so far. While the surface moves, a step leads
      it by about half a spacing of the grid at most.
    - `displacement`: s [m] of the surface at these times since t = 0, shape `(nt,)` (along x) or
      `(nt, 2)`; see `start`, `ramp`, `dwell`.
    - `pressure`: mean pressure σ0 [Pa], a number or one at each time; or
    - `mean_gap`: mean of the gap [m], a number or one at each time, counted from the mean of the
      heights; of periodic surfaces only; or
    - `approach`: of a non-periodic surface [m], a number or one at each time: how far it moved into
      the block since its first touch. In the first step it grows from the first touch.
    - `law`: of contact; it has no history.
    - `shear`, `temperature`: as in `slide`. The law holds at the pressure of each time and the mean
      speed of its step, and the traction has the direction of that step. At rest there is none.
      Coulomb traction is solved with the contact. Other coupled laws act on the previous contact at
      the speed of this step.
    - `counterface`, `block_surface`: as in `slide_cycle`; the counterface has its memory, too.
    - `fields_at`: numbers of the steps whose fields are kept, at least one; -1 is the last.
    - `numerics`: `rtol`, `derivative_rtol`, `solver` and `throw`, see `Numerics`.

    **Returns:** friction, areas and works over time, errors, and fields, see `TransientSliding`.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if a step fails.
    """
    case = Case(
        stack=stack, surface=surface, displacement=displacement, times=times, pressure=pressure,
        mean_gap=mean_gap, approach=approach, law=law, shear=shear, temperature=temperature,
        counterface=counterface, block_surface=block_surface,
    )  # fmt: skip
    found = slide_case(case, Numerics(**numerics), fields_at=fields_at)
    return cast(TransientSliding, found)


def slide_case(
    case: Case,
    how: Numerics = Numerics(),  # noqa: B008 (immutable)
    *,
    start: Numbers | None = None,
    fields_at: Sequence[int] = (-1,),
) -> Sliding | CyclicSliding | TransientSliding:
    """Returns the contact of a case: a `Sliding`, a `CyclicSliding` or a `TransientSliding`.

    **Arguments:**

    - `case`: block, surface, load and motion.
    - `how`: tolerance and solvers.
    - `start`: a pressure field [Pa] to start from, see `solve_contact`.
    - `fields_at`: steps of a transient motion whose fields are stored, see `slide_transient`.

    **Returns:** friction, areas, errors and the contact itself.

    **Raises:** `ValueError` for a refused number; `RuntimeError` if kernel or solve fail.
    """
    how = how.of(case.bodies, case.surface, case.block_surface)
    if case.times is not None:
        return solve_transient(case, how, fields_at)
    if case.heating is not None:
        return solve_heated(case, how, start)
    return solve_isothermal(case, how, start)
