"""The fast solver: Douglas-Rachford splitting, Anderson acceleration, nested grids.

One real field z = σ + ρ u carries pressure σ and gap u at once. One step costs one FFT pair:

    x  = (I + ρM)⁻¹ (z + ρh)      in Fourier space; the mean of x is set to the load,
                                  or that of the gap (z - x)/ρ to the wanted gap
    y  = proximal map of the law at v = 2x - z
    z⁺ = z + 2α (y - x)

x obeys the solid and what is prescribed, y obeys the law of contact, and at the fixed point they
agree; until then their gaps differ by (y - x)/ρ, so that one residual measures pressure, load and
gap. The step is a contraction for every kernel with Re M > 0, symmetric or not, and every law
whose pressure falls with the gap: this is what sliding viscoelastic solids need and conjugate
gradients cannot give.

P. L. Lions & B. Mercier, SIAM J. Numer. Anal. 16 (1979) 964, doi:10.1137/0716071.

Inside, the kernel is ρM, lengths are in units of that of pressure over ρ: all is dimensionless.
Large grids find their first digits in single precision, a draft, which moves half as many bytes. A
solve that takes long begins again with the penalty that suits the area found in contact.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Inexact

from .._checks import check_whole
from ..grid import half_shape, multiplicity, resample_spectrum, to_field, to_spectrum
from .anderson import History, accelerate, sums
from .implicit import Prescribed
from .law import AbstractLaw

LARGE = 2**18  # points of a grid worth a draft in single precision
_COARSE_ERROR = 0.02  # of the nested coarse grids, which only give a start
_COLD_PARTICIPATION = 0.05  # ⟨σ⟩²/⟨σ²⟩ expected before anything is known
_HIGHEST = 1e3  # pressure of a start, in what it takes to flatten the stiffest wave
_CYCLE = 2  # steps between accelerations
_EPOCH = 50  # steps before the penalty is chosen anew; then as many as were done


class Iterated(NamedTuple):
    """What a solver returns."""

    pressure: Float[Array, "*shape"]  # of the law [Pa]
    gap: Float[Array, "*shape"]  # at which the law has this pressure [m]
    mismatch: Float[Array, "*shape"]  # pressure of the solid less that of the law [Pa]
    displacement: Float[Array, "*shape"]  # of the solid under its pressure, but for a mean [m]
    error: Float[Array, ""]  # estimated, of the pressure, relative
    gap_error: Float[Array, ""]  # estimated, of the gap, root mean square [m]
    ended: Bool[Array, ""]  # before `max_steps`: at the tolerance or where rounding hides the rest
    num_steps: Array  # on the finest grid
    num_fft_pairs: Float[Array, ""]  # of all grids, coarse ones by their size


class DouglasRachford(eqx.Module):
    """Settings of the splitting. All static.

    **Fields:**

    - `max_steps`: steps allowed on each grid before giving up, and in the draft of a large one;
      they are done in twos.
    - `relaxation`: α [1], between 0 and 1.
    - `memory`: earlier iterates that the acceleration combines; each stores two fields, on a large
      grid three quarters of one.
    - `coarsest`: nesting starts from the first grid with fewer than twice this many points a side.
    """

    max_steps: int = eqx.field(default=4000, static=True)
    relaxation: float = eqx.field(default=0.95, static=True)
    memory: int = eqx.field(default=5, static=True)
    coarsest: int = eqx.field(default=64, static=True)

    def __check_init__(self):
        check_whole("max_steps", self.max_steps, 1)
        check_whole("memory", self.memory, 1)
        check_whole("coarsest", self.coarsest, 4)
        if not isinstance(self.relaxation, float) or not 0 < self.relaxation < 1:
            raise ValueError(f"`relaxation={self.relaxation}` must be a number between 0 and 1.")

    def solve(
        self,
        kernel: Inexact[Array, "*half"],
        heights: Float[Array, "*shape"],
        law: AbstractLaw,
        prescribed: Prescribed,
        rtol: Float[Array, ""],
        start: Float[Array, "*shape"] | None,
    ) -> Iterated:
        """Returns the contact; `start` is a pressure [Pa] to begin from."""
        shape = heights.shape
        # A coarse grid would pull surfaces together that on the fine one stay apart.
        nested = start is None and not law.attracts
        shapes = _nested_shapes(shape, self.coarsest) if nested else [shape]
        heights = heights - jnp.mean(heights)
        spectrum = to_spectrum(heights)
        found, pressure = None, start
        pairs = jnp.asarray(0.5, heights.dtype)
        for level in shapes:
            share = float(np.prod(level) / np.prod(shape))
            finest = level == shape
            waves = spectrum if finest else resample_spectrum(spectrum, shape, level) * share
            found = self._solve_level(
                resample_spectrum(kernel, shape, level),
                heights if finest else to_field(waves, level),
                waves,
                law,
                prescribed,
                pressure,
                rtol if finest else jnp.asarray(_COARSE_ERROR, rtol.dtype),
            )
            pressure = found.pressure
            pairs = pairs + share * (found.num_fft_pairs + (0 if finest else 0.5))
        assert found is not None  # there is at least one grid
        return found._replace(num_fft_pairs=pairs)

    def _solve_level(self, kernel, heights, waves, law, prescribed, guess, rtol) -> Iterated:
        """Solves on one grid, from a pressure on a coarser one or from none.

        `waves` is the spectrum of the heights, whose mean is zero.
        """
        unit = pressure_unit(kernel, heights, prescribed)
        if guess is None:
            share = jnp.asarray(_COLD_PARTICIPATION, heights.dtype)
        else:
            guess = _interpolate(guess, heights.shape) / unit
            low, high = law.in_units(unit, 1.0).bounds
            # A guess of another scale would drown all else.
            stiffest = third_mode(jnp.abs(kernel)) / least_compliance(kernel)
            guess = jnp.clip(guess, low, jnp.minimum(high, _HIGHEST * stiffest))
            if prescribed.pressure is not None:
                # What is missing is spread evenly: a small contact scaled up would be far off.
                mean = prescribed.pressure / unit
                guess = guess + jnp.maximum(mean - jnp.mean(guess), 0)
                guess = to_mean(jnp.clip(guess, low, high), mean, (low, high))
            share = participation(guess)
        penalty = penalty_for(kernel, share, law)
        length = unit / penalty
        kernel, heights, law = penalty * kernel, heights / length, law.in_units(unit, length)
        load, mean_gap = prescribed
        free_mean = load is None
        target = mean_gap / length if free_mean else load / unit

        def at(factor):
            """The splitting and the law with a penalty this many times as large."""
            shift = -factor * target if free_mean else target
            scaled = waves * (factor / length)
            split = _splitting(factor * kernel, scaled, heights.shape, shift, free_mean)
            return split, law.in_units(1.0, 1 / factor)

        z = _start(kernel, heights, law, target, free_mean, guess)
        begun = jnp.asarray(0.0 if guess is None else 1.0, z.dtype)  # FFT pairs
        drafted = jnp.asarray(0)
        if _is_large(z):
            split, near, draft = _to_single((*at(1.0), z))
            draft, drafted = self._draft(split, near.proximal, draft, rtol, _share)
            z, begun = draft.astype(z.dtype), begun + drafted + 0.5

        def begin_again(z, factor):
            """The same pressures and gaps with the penalty for the area in contact by now."""
            split, near = at(factor)
            _, y, gap = _meet(split, near, z)
            change = penalty_for(factor * kernel, participation(y), near)
            return y + change * gap, factor * change

        def epoch(state):
            z, factor, steps, epochs, *_ = state
            z, factor = jax.lax.cond(epochs > 0, begin_again, lambda *same: same, z, factor)
            split, near = at(factor)
            limit = jnp.clip(steps, _EPOCH, self.max_steps - steps)
            last = self._iterate(split, near.proximal, z, rtol, _share, limit)
            steps = steps + last.cycles * _CYCLE
            return last.z, factor, steps, epochs + 1, last.error, last.going_on

        def running(state):
            _, _, steps, *_, going_on = state
            return going_on & (steps < self.max_steps)

        one, none = jnp.ones((), z.dtype), jnp.asarray(0)
        state = (z, one, none, none, one * jnp.inf, jnp.asarray(True))
        state = jax.lax.while_loop(running, epoch, state)
        z, factor, steps, epochs, error, going_on = state
        split, near = at(factor)
        x, y, gap = _meet(split, near, z)
        # Where rounding ended the solve, the residual is noise, most of it out of contact.
        error = jax.lax.cond(
            ~going_on & (error > rtol),
            lambda: jnp.minimum(error, _rounding_error(split, near, x, y, gap)),
            lambda: error,
        )
        pressure = y if free_mean else to_mean(y, target, law.bounds)
        pressure = y if free_mean else to_mean(y, target, law.bounds)
        # The displacement has the stiff waves of the law's pressure and the soft ones of the
        # solid's: each would magnify what is left of the error in the others.
        stiff = to_field(split.filter * to_spectrum(pressure - x), x.shape)
        solid_gap = (z - x + (pressure - x) - stiff) / factor
        held = _slope(near, y - gap)
        offset = root_mean_square(stiff) + root_mean_square(pressure - y)
        gap_error = _gap_error(factor * kernel, held, offset, (1 - held) * (y - x), gap)
        return Iterated(
            pressure=pressure * unit,
            gap=gap * (length / factor),
            mismatch=(x - y) * unit,
            displacement=(solid_gap + heights) * length,
            error=error,
            gap_error=gap_error * (length / factor),
            ended=~going_on,
            num_steps=drafted + steps,
            # An epoch takes one half beside its steps, beginning again 1.5, the last lines 3.5.
            num_fft_pairs=begun + steps + 2.0 * epochs + 2,
        )

    def solve_linear(
        self,
        rtol: Float[Array, ""],
        kernel: Inexact[Array, "*half"],
        weights: Float[Array, "*shape"],
        rhs: Float[Array, "*shape"],
        free_mean: bool,
    ) -> Float[Array, "*shape"]:
        """Returns τ with ε(1 - s)τ + √|s| M √|s| τ = rhs, s the weights and ε their sign.

        The same iteration for a law linearised at a solution, y = s v; `kernel` includes the
        penalty. Unless `free_mean`, τ and rhs are orthogonal to √|s|.
        """
        root, sign = jnp.sqrt(jnp.abs(weights)), jnp.where(weights < 0, -1, 1).astype(rhs.dtype)
        share = jnp.maximum(jnp.mean(root), 1 / root.size)
        split = _splitting(kernel, None, rhs.shape, jnp.zeros_like(rhs), free_mean)

        def law(root, sign, rhs):
            return lambda v: root * sign * (rhs + root * v)

        z = root * rhs
        if _is_large(z):
            near, single, draft = _to_single((split, (root, sign, rhs), z))
            part = share.astype(draft.dtype)
            draft, _ = self._draft(near, law(*single), draft, rtol, lambda *_: part)
            z = draft.astype(z.dtype)
        last = self._iterate(split, law(root, sign, rhs), z, rtol, lambda *_: share, self.max_steps)
        v = 2 * split(last.z) - last.z
        return eqx.error_if(
            sign * (rhs + root * v),
            last.going_on,
            "The linear solve for a derivative of the contact did not converge. Raise "
            "`max_steps` of the solver, or loosen `rtol`.",
        )

    def _draft(self, split: "_Splitting", proximal: Callable, z, rtol, share_of: Callable):
        """Returns the fixed point z to about `rtol` or to rounding, and the number of steps."""
        rtol = rtol.astype(z.dtype)
        last = self._iterate(split, proximal, z, rtol, share_of, self.max_steps, draft=True)
        return last.z, last.cycles * _CYCLE

    def _iterate(
        self,
        split: "_Splitting",
        proximal: Callable,
        z: Float[Array, "*shape"],
        rtol: Float[Array, ""],
        share_of: Callable,
        max_steps: Array | int,
        draft: bool = False,
    ):
        """Returns the last state: z, the estimated relative error, whether it was `going_on`.

        It ends where rounding hides the residual; a `draft` when rounding alone would cause the
        error.
        """
        eps = jnp.finfo(z.dtype).eps
        rounding = 4 * eps * jnp.stack([jnp.ones_like(split.sharpness), split.sharpness])

        def step(z):
            spectrum = to_spectrum(z)
            x = split.shift + to_field(split.filter * spectrum, z.shape)
            y = proximal(2 * x - z)
            return z + (2 * self.relaxation) * (y - x), spectrum, x, y

        def cycle(z):
            image, before, x, y = step(z)
            image, after, *_ = step(image)
            # The spectrum of y - x comes for nothing: steps move z by 2α (y - x).
            defect, stiff = split.powers((after - before) / (2 * self.relaxation))
            size, scale, total, squared = sums(x * x, z * z, jnp.abs(y), y * y)
            unit = jnp.where(size > 0, size, 1)
            share = share_of(total, squared, y.size)
            error = _error(jnp.sqrt(defect / unit), jnp.sqrt(stiff / unit), share)
            # Pressures below the rounding of the gaps cannot be told from zero.
            lost = defect <= (8 * eps) ** 2 * scale
            if draft:
                least, least_stiff = rounding * jnp.sqrt(scale / unit)
                lost |= error <= _error(least, least_stiff, share)
            return image, error, lost

        def running(state):
            return state.going_on & (state.cycles * _CYCLE < max_steps)

        def body(state):
            image, error, lost = cycle(state.z)
            # Steps never raise the residual of a law without attraction, acceleration may: the
            # last image has at most the residual that ended the loop.
            return accelerate(state, image, error, (error > rtol) & ~lost)

        return jax.lax.while_loop(running, body, History.empty(z, self.memory + 1))


class _Splitting(NamedTuple):
    """The map z -> x = (I + ρM)⁻¹(z + ρh) with a mean set, as one filter and one shift."""

    filter: Inexact[Array, "*half"]
    shift: Float[Array, "*shape"]
    stiffness: Float[Array, "*half"]  # 1/ρ|M|, 0 for the mean
    sharpness: Float[Array, ""]  # its root mean square

    def __call__(self, z):
        return self.shift + to_field(self.filter * to_spectrum(z), z.shape)

    def powers(self, spectrum):
        """Sums of squares of the field with this half spectrum, and of 1/ρ|M| times it."""
        power = (spectrum.real**2 + spectrum.imag**2) * _weight(self.shift)
        return sums(power, power * self.stiffness**2)


def _meet(split: _Splitting, law: AbstractLaw, z):
    """The pressures of solid and law, x and y, and the gap at which the law has the latter."""
    x = split(z)
    v = 2 * x - z
    y = law.proximal(v)
    return x, y, y - v


def _splitting(kernel, waves, shape, shift, free_mean: bool) -> _Splitting:
    """Of heights with the spectrum `waves`; `shift` is the mean of x, or if free of x - z."""
    mean = (0,) * kernel.ndim
    filter = (1 / (1 + kernel)).at[mean].set(1 if free_mean else 0)
    stiffness = (1 / jnp.abs(kernel)).at[mean].set(0)
    if waves is not None:
        shift = shift + to_field(filter * waves, shape)
    sharpness = jnp.sqrt(jnp.sum(_weight(shift) * stiffness**2))
    return _Splitting(filter, shift, stiffness, sharpness)


def _weight(field):
    """What a squared mode of the half spectrum of a field adds to the sum of its squares."""
    weight = jnp.asarray(multiplicity(field.shape) / field.size, field.dtype)
    return jnp.broadcast_to(weight, half_shape(field.shape))


def _is_large(field) -> bool:
    """Whether a grid is worth a draft in single precision."""
    return field.size >= LARGE and field.dtype == jnp.float64


def _to_single(tree):
    """The same numbers in single precision."""

    def convert(a):
        single = jnp.complex64 if jnp.iscomplexobj(a) else jnp.float32
        return a.astype(single) if eqx.is_inexact_array(a) else a

    return jax.tree.map(convert, tree)


def _start(kernel, heights, law, target, free_mean: bool, guess):
    """z to begin from: that of a guessed pressure, or without one of points on springs."""
    if guess is None:
        if free_mean or law.attracts:
            return target - heights

        def halve(_, bracket):
            middle = jnp.mean(bracket)
            light = jnp.mean(law.proximal(middle + heights)) < target
            return jnp.where(light, bracket.at[0].set(middle), bracket.at[1].set(middle))

        # Pressed down until they carry the load: else surfaces may start far apart.
        ends = jnp.stack([-2 * jnp.max(heights), target - jnp.min(heights)])
        v = jax.lax.fori_loop(0, 40, halve, ends)[1] + heights
        return 2 * law.proximal(v) - v
    gap = to_field(kernel * to_spectrum(guess), heights.shape) - heights
    gap = gap - jnp.mean(gap)
    if free_mean:
        gap = gap + target
    else:
        weight = jnp.where(jnp.any(guess != 0), jnp.abs(guess), 1)
        gap = gap - jnp.sum(weight * gap) / jnp.sum(weight)
    # The law's own pressure and gap nearest to the guess; in contact, where the gap is but the
    # guess's error, the pressure alone.
    y = law.proximal(guess - gap)
    return jnp.where(guess > jnp.abs(gap), guess, 2 * y - (guess - gap))


def penalty_for(
    kernel: Inexact[Array, "*half"], participation: Float[Array, ""] | float, law: AbstractLaw
) -> Float[Array, ""]:
    """ρ = 1.8 s^0.4/√(|M| at three times the lowest wavenumber × least |M|) [Pa/m].

    Found by measurement: it balances the softest modes, which carry the displacement, against
    the stiffest, which carry the edges of the contact; s is ⟨|σ|⟩²/⟨σ²⟩. For a law that attracts,
    at least twice its steepest rise, so that its proximal map is single-valued.
    """
    long = jnp.abs(third_mode(kernel))
    penalty = 1.8 * participation**0.4 / jnp.sqrt(long * least_compliance(kernel))
    return jax.lax.stop_gradient(jnp.maximum(penalty, 2 * law.steepest_rise))


def _error(residual, stiff, share):
    """Estimated relative error of the pressure.

    With r = y - x, `residual` is ‖r‖/‖x‖ and `stiff` ‖M⁻¹r/ρ‖/‖x‖. On the set of contact P the
    pressure y is off by (PρMP)⁻¹P r - r, and (PMP)⁻¹ is at most PM⁻¹P for a symmetric kernel. The
    factor and the power of the loaded share s were found by measurement on elastic and
    viscoelastic, layered and homogeneous bodies from a thousandth in contact to full contact; see
    `bench_contact.py random`.
    """
    return share**-0.45 * (residual + stiff)


def _rounding_error(split: _Splitting, law: AbstractLaw, x, y, gap):
    """The error of y if the residual is noise: only what the law passes on at a point counts.

    Twice that noise, as it is there or as it is on average, if it happens to be small there.
    """
    slope = _slope(law, y - gap)

    def norm(field):
        defect, stiff = split.powers(to_spectrum(field))
        return jnp.sqrt(defect) + jnp.sqrt(stiff)

    noise = jnp.maximum(norm(slope * (y - x)), jnp.sqrt(jnp.mean(slope**2)) * norm(y - x))
    size = jnp.sqrt(jnp.sum(y * y))
    return 2 * noise / jnp.where(size > 0, size, 1)


def _gap_error(kernel, held, offset, freed, gap):
    """Estimated root mean square error of the gap, in units of pressure over ρ.

    The gap is off by `offset` at points where the law holds it, and what lies between follows.
    There the solid has the pressure -`freed` too much, and yields by ρM times that, though not by
    more than points held at the edges allow: the stiffness of their neighbours' free motion is
    that of the gap's own shape. Factor and powers of the share held were found by measurement; see
    `bench_contact.py random`.
    """
    power = jnp.abs(to_spectrum(gap)) ** 2 * _weight(gap)
    compliance = jnp.abs(kernel)
    stiffness = jnp.where(compliance > 0, 1 / jnp.where(compliance > 0, compliance, 1), 0)
    total, bent = sums(power, power * stiffness)
    allowed = compliance / (1 + compliance * bent / jnp.where(total > 0, total, 1))
    (yielded,) = sums((allowed * jnp.abs(to_spectrum(freed))) ** 2 * _weight(freed))
    share = jnp.maximum(jnp.mean(jnp.abs(held)), 1 / gap.size)
    return 10 * (share**-0.25 * offset + share**-0.5 * jnp.sqrt(yielded / gap.size))


def _slope(law: AbstractLaw, v):
    """dy/dv of the proximal map: 1 where the law holds the gap, 0 where the pressure."""
    return jax.jvp(law.proximal, (v,), (jnp.ones_like(v),))[1]


def root_mean_square(field: Float[Array, "..."]) -> Float[Array, ""]:
    """Returns √⟨f²⟩."""
    return jnp.sqrt(jnp.mean(field**2))


def participation(pressure: Float[Array, "*shape"]) -> Float[Array, ""]:
    """Returns ⟨|σ|⟩²/⟨σ²⟩, a measure of the loaded area fraction [1], at least one point's."""
    total, squared = sums(jnp.abs(pressure), pressure**2)
    return _share(total, squared, pressure.size)


def _share(total, squared, count: int):
    """The participation, from sums of |σ| and σ² over `count` points."""
    return jnp.maximum(total**2 / jnp.where(squared > 0, squared, 1), 1) / count


def third_mode(kernel: Inexact[Array, "*half"]) -> Inexact[Array, ""]:
    """Returns the kernel of the long waves: at three times the lowest wavenumber along x."""
    return kernel[(3,) + (0,) * (kernel.ndim - 1)]


def least_compliance(kernel: Inexact[Array, "*half"]) -> Float[Array, ""]:
    """Returns the least |M| of any wave."""
    return jnp.min(jnp.abs(kernel).at[(0,) * kernel.ndim].set(jnp.inf))


def pressure_unit(kernel, heights, prescribed: Prescribed):
    """A typical pressure: the prescribed one, and what flattens the longest waves."""
    length = jnp.std(heights) + (0 if prescribed.gap is None else jnp.abs(prescribed.gap))
    unit = length / jnp.abs(third_mode(kernel))
    unit = unit + (0 if prescribed.pressure is None else jnp.abs(prescribed.pressure))
    return jnp.where(unit > 0, unit, 1)


def to_mean(pressure, mean, bounds):
    """Scales a pressure to a mean within its bounds; one without upper bound simply by a factor."""
    low, high = bounds
    room = (pressure - low) * (1 - (pressure - low) / (high - low))
    # Where no point has room, all at a bound, evenly.
    room = jnp.where(jnp.any(room > 0), room, 1)
    return pressure + room * ((mean - jnp.mean(pressure)) / jnp.mean(room))


def _nested_shapes(shape: tuple[int, ...], coarsest: int) -> list[tuple[int, ...]]:
    shapes = [shape]
    while min(shapes[0]) >= 2 * coarsest:
        shapes.insert(0, tuple(-(-n // 2) for n in shapes[0]))
    return shapes


def _interpolate(field: Float[Array, "..."], shape: tuple[int, ...]) -> Float[Array, "*shape"]:
    """Returns a periodic field linearly interpolated on a finer grid of the same cell."""
    for axis, (n, m) in enumerate(zip(field.shape, shape, strict=True)):
        if n == m:
            continue
        position = np.arange(m) * (n / m)
        left = np.floor(position).astype(int)
        weight = (position - left).reshape([-1 if i == axis else 1 for i in range(field.ndim)])
        weight = jnp.asarray(weight, field.dtype)
        right = jnp.take(field, (left + 1) % n, axis)
        field = jnp.take(field, left, axis) * (1 - weight) + right * weight
    return field
