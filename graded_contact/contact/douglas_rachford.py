"""The fast solver: Douglas-Rachford splitting, Anderson acceleration, nested grids.

One real field z = σ + ρ u carries pressure σ and gap u at once. One step costs one FFT pair:

    x  = (I + ρM)⁻¹ (z + ρh)      in Fourier space; the mean of x is set to the load
    y  = proximal map of the law at 2x - z
    z⁺ = z + 2α (y - x)

x obeys the solid and the load, y obeys the law of contact, and at the fixed point they agree.
The step is a contraction for every kernel with Re M > 0, symmetric or not: this is what sliding
viscoelastic solids need and conjugate gradients cannot give. The mean gap never appears.

P. L. Lions & B. Mercier, SIAM J. Numer. Anal. 16 (1979) 964, doi:10.1137/0716071;
D. G. Anderson, J. ACM 12 (1965) 547, doi:10.1145/321296.321305.

Inside, pressures are in units of the load and the kernel is ρM: everything is dimensionless.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Inexact

from ..grid import resample_spectrum, to_field, to_spectrum
from .law import HardWall

# The relative error of the pressure is 4 to 18 times the residual ‖x - y‖/‖y‖ (measured over
# elastic and viscoelastic, bare and coated bodies; `benchmarks/bench_contact.py` shows it).
ERROR_PER_RESIDUAL = 10.0
_COARSE_RESIDUAL = 1e-2  # of the nested coarse grids, which only give a start
_CYCLE = 2  # steps between accelerations
_COLD_PARTICIPATION = 0.05  # ⟨σ⟩²/⟨σ²⟩ expected before anything is known


class Iterated(NamedTuple):
    """What `DouglasRachford.solve` returns; pressures in units of the load."""

    pressure: Float[Array, "*shape"]
    residual: Float[Array, ""]
    num_steps: Array  # on the finest grid
    num_fft_pairs: Float[Array, ""]  # of all grids, in units of one on the finest


class DouglasRachford(eqx.Module):
    """Settings of the splitting. All static.

    **Fields:**

    - `max_steps`: steps allowed on each grid before giving up.
    - `relaxation`: α [1], between 0 and 1.
    - `memory`: earlier iterates that the acceleration combines; it stores 2 (memory + 1) fields.
    - `coarsest`: nesting starts from the first grid with fewer than twice this many points a side.
    """

    max_steps: int = eqx.field(default=4000, static=True)
    relaxation: float = eqx.field(default=0.95, static=True)
    memory: int = eqx.field(default=3, static=True)
    coarsest: int = eqx.field(default=64, static=True)

    def __check_init__(self):
        if self.max_steps < 1 or self.memory < 1 or self.coarsest < 4:
            raise ValueError(
                f"`max_steps={self.max_steps}`, `memory={self.memory}` and "
                f"`coarsest={self.coarsest}` must be at least 1, 1 and 4."
            )
        if not 0 < self.relaxation < 1:
            raise ValueError(f"`relaxation={self.relaxation}` must lie between 0 and 1.")

    def solve(
        self,
        kernel: Inexact[Array, "*half"],
        heights: Float[Array, "*shape"],
        load: Float[Array, ""],
        law: HardWall,
        rtol: Float[Array, ""],
        start: Float[Array, "*shape"] | None,
    ) -> Iterated:
        """Returns the pressure in units of the load; `start` is a pressure [Pa] to begin from."""
        shape = heights.shape
        shapes = [shape] if start is not None else _nested_shapes(shape, self.coarsest)
        spectrum = to_spectrum(heights / load)
        pressure = None if start is None else start / load
        steps, residual = jnp.asarray(0), jnp.asarray(jnp.inf, heights.dtype)
        pairs = jnp.asarray(0.5, heights.dtype)
        for level in shapes:
            share = float(np.prod(level) / np.prod(shape))
            overhead = 2.5 if pressure is None else 3.5
            pressure, steps, residual = self._solve_level(
                resample_spectrum(kernel, shape, level),
                to_field(resample_spectrum(spectrum, shape, level) * share, level),
                pressure,
                law,
                rtol / ERROR_PER_RESIDUAL if level == shape else _COARSE_RESIDUAL,
            )
            pairs = pairs + share * (steps + overhead)
        assert pressure is not None  # there is at least one grid
        return Iterated(pressure, residual, steps, pairs)

    def _solve_level(self, kernel, heights, guess, law, tolerance):
        """Returns pressure, steps and residual on one grid, from a guess on a coarser one."""
        if guess is None:
            penalty = _penalty(kernel, _COLD_PARTICIPATION)
            # A uniform pressure, and the gap it leaves but for its mean.
            z = 1 - penalty * (heights - jnp.mean(heights))
        else:
            guess = jnp.maximum(_interpolate(guess, heights.shape), 0)
            guess = guess / jnp.mean(guess)
            penalty = _penalty(kernel, 1 / jnp.mean(guess**2))
            gap = penalty * (to_field(kernel * to_spectrum(guess), heights.shape) - heights)
            gap = gap - jnp.mean(guess * gap)
            z = jnp.where(guess > 0, guess, jnp.maximum(gap, 0))
        split = _splitting(penalty * kernel, penalty * heights, mean=1.0)
        z, steps, residual = self._iterate(split, law.proximal, z, tolerance)
        y = law.proximal(2 * split(z) - z)
        return y / jnp.mean(y), steps, residual

    def solve_linear(
        self,
        rtol: Float[Array, ""],
        kernel: Inexact[Array, "*half"],
        contact: Bool[Array, "*shape"],
        rhs: Float[Array, "*shape"],
    ) -> Float[Array, "*shape"]:
        """Returns s, zero off `contact` and of zero mean, with M s = rhs + const on `contact`.

        The same iteration with a fixed set of contact: the law's map becomes a mask.
        """
        penalty = _penalty(kernel, jnp.mean(contact, dtype=rhs.dtype))
        split = _splitting(penalty * kernel, penalty * rhs, mean=0.0)
        z, _, residual = self._iterate(
            split, lambda v: jnp.where(contact, v, 0), split.shift, rtol / ERROR_PER_RESIDUAL
        )
        s = jnp.where(contact, 2 * split(z) - z, 0)
        return eqx.error_if(
            s,
            residual > rtol / ERROR_PER_RESIDUAL,
            "The linear solve for a derivative of the contact did not converge. Raise "
            "`max_steps` of the solver, or loosen `rtol`.",
        )

    def _iterate(self, split: "_Splitting", proximal: Callable, z, tolerance):
        """Returns the fixed point z, the number of steps and the last residual ‖x - y‖/‖y‖."""

        def step(z):
            x = split(z)
            y = proximal(2 * x - z)
            return z + (2 * self.relaxation) * (y - x), x, y

        def cycle(z):
            for _ in range(_CYCLE - 1):
                z, _, _ = step(z)
            z, x, y = step(z)
            defect, size = _dot(y - x, y - x), _dot(y, y)
            # A zero solution has no size; its residual is zero too.
            return z, jnp.sqrt(defect / jnp.where(size > 0, size, 1))

        def running(state):
            return (state.residual > tolerance) & (state.cycles * _CYCLE < self.max_steps)

        def body(state):
            image, residual = cycle(state.z)
            return _accelerate(state, image, residual)

        state = jax.lax.while_loop(running, body, _History.empty(z, self.memory + 1))
        return state.z, state.cycles * _CYCLE, state.residual


class _Splitting(NamedTuple):
    """The map z -> x = (I + ρM)⁻¹(z + ρh) with the mean set, as one filter and one shift."""

    filter: Inexact[Array, "*half"]
    shift: Float[Array, "*shape"]

    def __call__(self, z):
        return self.shift + to_field(self.filter * to_spectrum(z), z.shape)


def _splitting(kernel, heights, mean: float) -> _Splitting:
    filter = (1 / (1 + kernel)).at[(0,) * kernel.ndim].set(0)
    return _Splitting(filter, mean + to_field(filter * to_spectrum(heights), heights.shape))


def _penalty(kernel, participation):
    """ρ = 2 s^(1/3)/√(|M| at three times the lowest wavenumber × least |M|) [Pa/m].

    Found by measurement: it balances the softest modes, which carry the displacement, against
    the stiffest, which carry the edges of the contact; s is ⟨σ⟩²/⟨σ²⟩.
    """
    size = jnp.abs(kernel)
    low = size[(3,) + (0,) * (kernel.ndim - 1)]
    least = jnp.min(jnp.where(_is_mean_mode(kernel.shape), jnp.inf, size))
    return jax.lax.stop_gradient(2 * jnp.cbrt(participation) / jnp.sqrt(low * least))


def _is_mean_mode(shape):
    mask = np.zeros(shape, bool)
    mask[(0,) * len(shape)] = True
    return mask


class _History(eqx.Module):
    """State of the acceleration: the last images T(z), their changes T(z) - z, and products."""

    z: Float[Array, "*shape"]
    images: Float[Array, "m *shape"]
    changes: Float[Array, "m *shape"]
    products: Float[Array, "m m"]
    count: Array
    best: Float[Array, ""]
    cycles: Array
    residual: Float[Array, ""]

    @classmethod
    def empty(cls, z, m: int) -> "_History":
        fields = jnp.zeros((m, *z.shape), z.dtype)
        none, infinite = jnp.asarray(0), jnp.asarray(jnp.inf, z.dtype)
        return cls(z, fields, fields, jnp.zeros((m, m), z.dtype), none, infinite, none, infinite)


def _accelerate(state: _History, image, residual) -> _History:
    """Anderson's step: the affine combination of stored images whose changes nearly cancel."""
    m = len(state.products)
    change = image - state.z
    size = _dot(change, change)
    # A change five times the least so far means that the history misleads: forget it.
    forget = size > 25 * state.best
    count = jnp.where(forget, 1, jnp.minimum(state.count + 1, m))
    slot = state.cycles % m
    images, changes = state.images.at[slot].set(image), state.changes.at[slot].set(change)
    # Sums of products fuse into single passes; a matrix product of the history does not.
    row = jnp.stack([_dot(changes[i], change) for i in range(m)])
    products = state.products.at[slot, :].set(row).at[:, slot].set(row)
    used = (slot - jnp.arange(m)) % m < count
    gram = jnp.where(used[:, None] & used[None, :], products, 0) / jnp.where(size > 0, size, 1)
    ridge = 32 * jnp.finfo(size.dtype).eps ** 0.75
    gram = gram + jnp.diag(jnp.where(used, ridge * jnp.diag(gram), 1))
    weights = jnp.linalg.solve(gram, used.astype(size.dtype))
    weights = weights / jnp.sum(weights)
    latest = (jnp.arange(m) == slot).astype(size.dtype)
    weights = jnp.where(jnp.all(jnp.isfinite(weights)), weights, latest)
    return _History(
        z=jnp.asarray(sum(weights[i] * images[i] for i in range(m))),
        images=images,
        changes=changes,
        products=products,
        count=count,
        best=jnp.where(forget, size, jnp.minimum(state.best, size)),
        cycles=state.cycles + 1,
        residual=residual,
    )


def _dot(a, b):
    return jnp.sum(a * b)


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
