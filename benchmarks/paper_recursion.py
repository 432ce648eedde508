"""The recursion of the paper in NumPy: 3×3 matrices, vectorised.

Scaraggi & Comingio, eqs. the.slab.matrix, graded.stepped, final and bulk.old, with the slab
matrices M1 to M4 of their appendix A for ν = ν0 (at each frequency, that is, by correspondence).
These formulas have no misprint: the misprints are in the ν0 forms, in the closed forms and in the
differential equations (`docs/theory/response.md`). Nothing is rearranged, so that the errors are
those of the printed formulas in double precision. z is out of the body, as in the paper.
"""

import numpy as np


def paper_compliance(qx, qy, thickness, modulus, poisson, base):
    """Returns M_zz [m/Pa], complex, of the shape to which the wavevector and moduli broadcast.

    `thickness`, `modulus` and `poisson` hold one entry per layer, surface first, each a number or
    an array that broadcasts with `qx` and `qy`; `base` is "rigid", "free" or `(modulus, poisson)`.
    """
    layers = list(zip(thickness, modulus, poisson, strict=True))[::-1]
    if isinstance(base, tuple):
        below, reduced_below = bulk(qx, qy, base[1]), _reduced(*base)
    else:
        d, e, nu = layers.pop(0)
        m1, m2, m3, m4 = slab(qx * d, qy * d, nu)
        below = _right_divide(m3, m1) if base == "rigid" else _right_divide(m4, m2)
        reduced_below = _reduced(e, nu)
    for d, e, nu in layers:
        m1, m2, m3, m4 = slab(qx * d, qy * d, nu)
        reduced = _reduced(e, nu)
        below = np.asarray(reduced / reduced_below)[..., None, None] * below
        below = _right_divide(m3 + m4 @ below, m1 + m2 @ below)
        reduced_below = reduced
    return below[..., 2, 2] * 2 / (np.hypot(qx, qy) * reduced_below)


def slab(x, y, nu):
    """Returns M1, M2, M3, M4, shape `(..., 3, 3)`, for the wavevector times d, `(x, y)`."""
    q2 = x**2 + y**2
    q = np.sqrt(q2)
    t, p = np.tanh(q), 1 - nu
    minus, plus = q - (2 * p - 1) * t, q + (2 * p - 1) * t
    m1 = _matrix(
        [x * x * t, x * y * t, -1j * x * minus],
        [x * y * t, y * y * t, -1j * y * minus],
        [-1j * x * plus, -1j * y * plus, -q2 * t],
    )
    m1 = np.eye(3) + m1 / _entry(2 * q * p)
    m2 = _matrix(
        [(q + t) * x * x + p * t * y * y, x * y * (q + nu * t), -1j * x * q2 * t],
        [x * y * (q + nu * t), p * t * x * x + (q + t) * y * y, -1j * y * q2 * t],
        [-1j * x * q2 * t, -1j * y * q2 * t, -q2 * (q - t)],
    )
    m3 = _matrix(
        [4 * p * t * q2 + (q - t) * x * x, x * y * (q - t), -1j * x * q2 * t],
        [x * y * (q - t), 4 * p * t * q2 + (q - t) * y * y, -1j * y * q2 * t],
        [-1j * x * q2 * t, -1j * y * q2 * t, -q2 * (q + t - 4 * p * t)],
    )
    return m1, m2 / _entry(q2), m3 / _entry((2 * q * p) ** 2), np.swapaxes(m1, -1, -2)


def bulk(qx, qy, nu):
    """Returns the half space's matrix in units of 2/(E_r q), shape `(..., 3, 3)`."""
    q, p = np.hypot(qx, qy), 1 - nu
    x, y = qx / q, qy / q
    share, g = nu / p, (1 - 2 * nu) / (2 * p)
    return _matrix(
        [1 + share * y * y, -share * x * y, -1j * g * x],
        [-share * x * y, 1 + share * x * x, -1j * g * y],
        [1j * g * x, 1j * g * y, 1],
    )


def _reduced(modulus, poisson):
    return modulus / (1 - poisson**2)


def _entry(value):
    return np.asarray(value)[..., None, None]


def _matrix(*rows):
    shape = np.broadcast_shapes(*(np.shape(value) for row in rows for value in row))
    matrix = np.empty((*shape, 3, 3), complex)
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            matrix[..., i, j] = value
    return matrix


def _right_divide(a, b):
    """a b⁻¹"""
    return np.swapaxes(np.linalg.solve(np.swapaxes(b, -1, -2), np.swapaxes(a, -1, -2)), -1, -2)
