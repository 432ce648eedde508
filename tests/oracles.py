"""Brute-force solutions that share no code with the package, differences, a rough surface."""

from itertools import pairwise

import jax
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize
from scipy.special import erf

import graded_contact as gc


def rough(shape, size, first=1, last=4, seed=0, rms_slope=0.2) -> gc.Surface:
    """Of `first` to `last` waves a side, self-affine above the middle; nothing is compiled."""
    grid, cell = gc.Grid(shape, size), np.broadcast_to(size, len(shape))
    waves = [np.fft.fftfreq(n, length / n) for n, length in zip(shape, cell, strict=True)]
    q = np.linalg.norm(np.meshgrid(*waves, indexing="ij"), axis=0) * max(cell)
    inside = (q >= first - 1e-9) & (q <= last + 1e-9)
    noise = np.fft.fftn(np.random.default_rng(seed).normal(size=shape))
    noise = noise * inside * np.maximum(q, last / 2) ** (-0.8 - len(shape) / 2)
    slope = 2 * np.pi / max(cell) * np.linalg.norm(q * noise) / noise.size
    return gc.Surface(np.fft.ifftn(noise).real * rms_slope / slope, grid)


def maxwell(omega, equilibrium, strengths, times):
    """E(ω) of a spring beside Maxwell branches."""
    rates = 1j * np.multiply.outer(omega, times)
    return equilibrium + (rates / (1 + rates)) @ np.asarray(strengths)


def dense_operator(kernel: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Returns the matrix of p -> irfftn(kernel rfftn(p)), column by column, by direct sums."""
    full = np.zeros(shape, complex)
    half = kernel.shape[-1]
    full[..., :half] = kernel
    for index in np.ndindex(*shape):
        if index[-1] >= half:
            mirror = tuple(-i % n for i, n in zip(index, shape, strict=True))
            full[index] = np.conj(full[mirror])
    full[(0,) * len(shape)] = 0
    green = np.fft.ifftn(full)
    assert np.max(np.abs(green.imag)) <= 1e-12 * np.max(np.abs(green))
    points = list(np.ndindex(*shape))
    matrix = np.empty((len(points), len(points)))
    for j, source in enumerate(points):
        rolled = np.roll(green.real, source, axis=tuple(range(len(shape))))
        matrix[:, j] = rolled.ravel()
    return matrix


def dense_contact(
    kernel: np.ndarray, heights: np.ndarray, load: float, hardness: float = np.inf
) -> np.ndarray:
    """Returns the pressures of the contact with mean `load`, by active sets on dense matrices.

    For a trial mean approach the linear complementarity problem with bounds 0 and `hardness` is
    solved by exchanging one set of violating points after another (Murty's least-index rule ends
    it); the approach is then found by bracketing.
    """
    n = heights.size
    matrix = dense_operator(kernel, heights.shape)
    # The mean mode of the kernel is zero; a stiffness for it regularises and drops out, since
    # the mean pressure is matched.
    scale = np.max(np.abs(matrix))
    matrix = matrix + scale / n
    h = heights.ravel()

    def pressures(approach):
        state = np.zeros(n, int)  # -1: apart, 0: pressed with no gap, 1: at the hardness
        tolerance = 1e-13 * np.max(np.abs(h))
        for attempt in range(100 * n):
            p = np.where(state == 1, hardness if np.isfinite(hardness) else 0, 0.0)
            free = state == 0
            rest = (h + approach - matrix @ p)[free]
            p[free] = np.linalg.solve(matrix[np.ix_(free, free)], rest)
            gap = matrix @ p - h - approach
            better = np.where(free & (p < 0), -1, np.where(free & (p > hardness), 1, state))
            better[(state == -1) & (gap < -tolerance) | (state == 1) & (gap > tolerance)] = 0
            wrong = better != state
            if not wrong.any():
                return p
            # All violators at first, one by one if that cycles.
            if attempt >= 50:
                wrong &= np.arange(n) == np.argmax(wrong)
            state = np.where(wrong, better, state)
        raise RuntimeError("the active sets did not settle")

    low, high = -np.max(h), 0.0
    step = np.ptp(h)
    high = low + step
    while pressures(high).mean() < load:
        high += step
    approach = brentq(lambda a: pressures(a).mean() - load, low, high, xtol=1e-300, rtol=8.9e-16)
    p = pressures(approach)
    return (p * load / p.mean()).reshape(heights.shape)


class AdhesiveLine:
    """A line of points with a Lennard-Jones attraction, as an energy of dense matrices.

    Elastic half space of reduced modulus 1, period 1: E = w·Kw/2 + Σ φ(u), u = ū + w - h, σ = -φ'.
    """

    def __init__(self, heights: np.ndarray, length: float, work: float):
        n = len(heights)
        self.heights = heights - heights.mean()
        self.length, self.scale = length, 8 * work / (3 * length)
        stiffness = np.pi * np.arange(n // 2 + 1)
        columns = stiffness[:, None] * np.fft.rfft(np.eye(n), axis=0)
        self.stiffness = np.fft.irfft(columns, n, axis=0)
        # Displacements have no mean: their coordinates, in an orthonormal basis.
        self.basis = np.linalg.svd(np.eye(n) - 1 / n)[0][:, : n - 1]

    def pressure(self, gap):
        return self.scale * ((self.length / gap) ** 9 - (self.length / gap) ** 3)

    def imbalance(self, gap):
        """The gradient of the energy over displacements: what a state of rest has none of."""
        w = gap - gap.mean() + self.heights
        return self.basis.T @ (self.stiffness @ w - self.pressure(gap))

    def curvature(self, gap):
        """The Hessian of the energy; a stable state has it positive definite."""
        t = self.length / gap
        slope = self.scale / self.length * (9 * t**10 - 3 * t**4)
        return self.basis.T @ (self.stiffness + np.diag(slope)) @ self.basis

    def settle(self, mean_gap: float, gap: np.ndarray) -> np.ndarray:
        """Returns the gaps to which the line falls from `gap`, downhill in energy."""
        unit = self.scale * self.length

        def gap_of(y):
            return mean_gap + self.basis @ y - self.heights

        def energy(y):
            gap = gap_of(y)
            if gap.min() <= 0:
                return np.inf
            t, w = self.length / gap, self.basis @ y
            return (w @ self.stiffness @ w / 2) / unit + np.sum(t**8 / 8 - t**2 / 2)

        start = self.basis.T @ (gap - gap.mean() + self.heights)
        options = dict(gtol=1e-9, maxiter=2000, max_trust_radius=self.length)
        options["initial_trust_radius"] = self.length / 10
        slopes = dict(
            jac=lambda y: self.imbalance(gap_of(y)) / unit,
            hess=lambda y: self.curvature(gap_of(y)) / unit,
        )
        found = minimize(energy, start, method="trust-exact", options=options, **slopes)
        return gap_of(found.x)


def differences(value, arguments, step=1e-5, fixed=(0.0,)):
    """Returns the change of `value` per relative change of each number among its arguments.

    By central differences. Numbers equal to one of `fixed` stay.
    """
    leaves, treedef = jax.tree.flatten(jax.device_get(arguments))
    found = []
    for i, leaf in enumerate(map(np.asarray, leaves)):
        for index in np.ndindex(leaf.shape):
            if leaf[index] in fixed:
                continue
            ends = []
            for change in (step, -step):
                moved = np.array(leaf)
                moved[index] *= 1 + change
                moved = treedef.unflatten([*leaves[:i], moved, *leaves[i + 1 :]])
                ends.append(float(value(*moved)))
            found.append((ends[0] - ends[1]) / (2 * step))
    return found


def elasticities(function, arguments, step=1e-5, fixed=(0.0,)):
    """Returns pairs of the same changes by the gradient and by central differences.

    One program gives both, so that one is compiled.
    """
    both = jax.jit(jax.value_and_grad(function, tuple(range(len(arguments)))))
    arguments = jax.device_get(arguments)  # in NumPy, where what follows compiles nothing
    gradient = jax.device_get(both(*arguments)[1])
    slopes = [
        float(slope[index] * leaf[index])
        for leaf, slope in zip(*map(jax.tree.leaves, (arguments, gradient)), strict=True)
        for index in np.ndindex(leaf.shape)
        if leaf[index] not in fixed
    ]
    changes = differences(lambda *moved: both(*moved)[0], arguments, step, fixed)
    return list(zip(slopes, changes, strict=True))


def persson(sums, edges, slowing=lambda area: 0.45 + 0.55 * area**2):
    """Area and friction of Persson's theory from its differential equations, by SciPy.

    `sums(q)` returns the rates over log q, in complete contact, of the variance of the pressure
    over σ0² and of the friction, which are smooth between the `edges`.
    """

    def area_at(spread):
        return erf(1 / np.sqrt(2 * spread)) if spread > 0 else 1.0

    def rates(y, state):
        (spreading, loss), area = sums(np.exp(y)), area_at(state[0])
        return [slowing(area) * spreading, slowing(area) * area * loss]

    state = [0.0, 0.0]
    for piece in pairwise(np.log(edges)):
        state = solve_ivp(rates, piece, state, "DOP853", rtol=1e-10, atol=1e-15).y[:, -1]
    return area_at(state[0]), state[1]


def gauss_over_angles():
    """cos φ and weights over all directions, by Gauss's rule on parts that shrink towards 90°."""
    ends = np.pi / 2 * (1 - np.append(0.5 ** np.arange(26), 0))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = np.diff(ends)[:, None] / 2
    cosine = np.cos(ends[:-1, None] + half * (1 + nodes))
    return cosine.ravel(), (4 * half * weights).ravel()
