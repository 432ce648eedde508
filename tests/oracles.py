"""Brute-force solutions that share no code with the package."""

import numpy as np
from scipy.optimize import brentq


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


def dense_contact(kernel: np.ndarray, heights: np.ndarray, load: float) -> np.ndarray:
    """Returns the pressures of the contact with mean `load`, by active sets on dense matrices.

    For a trial mean approach the linear complementarity problem is solved by exchanging one
    set of violating points after another (Murty's least-index rule ends it); the approach is
    then found by bracketing.
    """
    n = heights.size
    matrix = dense_operator(kernel, heights.shape)
    # The mean mode of the kernel is zero; a stiffness for it regularises and drops out, since
    # the mean pressure is matched.
    scale = np.max(np.abs(matrix))
    matrix = matrix + scale / n
    h = heights.ravel()

    def pressures(approach):
        active = np.ones(n, bool)
        for _ in range(100 * n):
            p = np.zeros(n)
            p[active] = np.linalg.solve(matrix[np.ix_(active, active)], (h + approach)[active])
            gap = matrix @ p - h - approach
            wrong = (active & (p < 0)) | (~active & (gap < -1e-13 * np.max(np.abs(h))))
            if not wrong.any():
                return p
            # All violators at first, one by one if that cycles.
            if _ < 50:
                active ^= wrong
            else:
                i = int(np.argmax(wrong))
                active[i] = ~active[i]
        raise RuntimeError("the active sets did not settle")

    low, high = -np.max(h), 0.0
    step = np.ptp(h)
    high = low + step
    while pressures(high).mean() < load:
        high += step
    approach = brentq(lambda a: pressures(a).mean() - load, low, high, xtol=1e-300, rtol=8.9e-16)
    p = pressures(approach)
    return (p * load / p.mean()).reshape(heights.shape)
