"""Random stacks of layers, and their compliance M_zz in mpmath.

The state-space form of elasticity, u' = A u, gives exp(A z) layer by layer. Many digits compensate
for growing exponentials, nothing is truncated, and the package shares no code with this file. Both
take the same doubles as input. With gmpy2 installed mpmath is two to three times as fast.
"""

import mpmath as mp
import numpy as np

# Up to 35 of them are lost in the thinnest free films.
DIGITS = 100


def exact_compliance(q, layers, base):
    """M_zz of layers (d, E, ν), surface first, on "rigid", "free" or (E, ν), in mpmath.

    With ζ = q z out of the body, (t, s) = (-iσ_L, σ_3)/q and (U, w) = (-iw_L, w_3) have real
    equations. Two columns span the states that the base allows; they are carried upwards and made
    (1, C) again after each layer.
    """
    q, layers = _number(q), [tuple(map(_number, layer)) for layer in layers]
    if base == "rigid":
        columns = [(1, 0, 0, 0), (0, 1, 0, 0)]
    elif base == "free":
        columns = [(0, 0, 1, 0), (0, 0, 0, 1)]
    else:
        a = _generator(*map(_number, base))
        # The states that decay downwards: (A + 1)² u, as (A - 1)² (A + 1)² = 0.
        columns = [(1, 0, 0, 0), (0, 1, 0, 0)]
        for _ in range(2):
            columns = [_sum(_slope(a, u), u) for u in columns]
    for d, e, nu in reversed(layers):
        x = q * d
        columns = _normalised([_carried(_generator(e, nu), x, u) for u in columns])
    return _normalised(columns)[1][3] / q


def _number(value):
    value = mp.mpmathify(value)
    return value.real if value.imag == 0 else value


def _generator(e, nu):
    """The coefficients ν/(1 - ν), E/(1 - ν²), 1/μ and 1/(λ + 2μ) of `_slope`."""
    return (
        nu / (1 - nu),
        e / (1 - nu * nu),
        2 * (1 + nu) / e,
        (1 + nu) * (1 - 2 * nu) / (e * (1 - nu)),
    )


def _slope(generator, state):
    k, stiffness, shear, normal = generator
    t, s, u, w = state
    return stiffness * u - k * s, t, shear * t - w, normal * s + k * u


def _sum(a, b):
    return tuple(x + y for x, y in zip(a, b, strict=True))


def _carried(a, x, state):
    """exp(A x) u = [cosh x + A sinh x + N (x sinh x + A (x cosh x - sinh x))/2] u, N = A² - 1."""
    up = mp.exp(x)
    cosh, sinh = (up + 1 / up) / 2, (up - 1 / up) / 2
    even, odd = x * sinh / 2, (x * cosh - sinh) / 2
    n = tuple(v - u for v, u in zip(_slope(a, _slope(a, state)), state, strict=True))
    sloped = _slope(a, tuple(sinh * u + odd * v for u, v in zip(state, n, strict=True)))
    return tuple(cosh * u + even * v + s for u, v, s in zip(state, n, sloped, strict=True))


def _normalised(columns):
    """Other columns of the same span, with (1, 0) and (0, 1) for their (t, s)."""
    (t1, s1, u1, w1), (t2, s2, u2, w2) = columns
    if (t1, s1, t2, s2) == (0, 0, 0, 0):
        return columns
    det = t1 * s2 - t2 * s1
    return [
        (1, 0, (u1 * s2 - u2 * s1) / det, (w1 * s2 - w2 * s1) / det),
        (0, 1, (u2 * t1 - u1 * t2) / det, (w2 * t1 - w1 * t2) / det),
    ]


def _four_doubles(value):
    """Real and imaginary part, each as the sum of two doubles."""
    parts = []
    for part in (mp.re(value), mp.im(value)):
        high = float(part)
        parts += [high, float(part - high)]
    return parts


def exact_value(case):
    """M_zz of `(q, layers, base)` to twice double precision."""
    with mp.workdps(DIGITS):
        return _four_doubles(exact_compliance(*case))


def change_with_digits(case):
    """What twice as many digits change in the oracle, relative."""
    with mp.workdps(DIGITS):
        value = exact_compliance(*case)
    with mp.workdps(2 * DIGITS):
        return float(abs(exact_compliance(*case) / value - 1))


def random_stacks(rng, size, num_layers, kind):
    """Arrays q `(size,)`, d, E, ν `(size, num_layers)` and E, ν of a half space `(size,)`.

    `kind` is "elastic", "lossy" (complex E) or "complex ν" (both, from passive K and G).
    """
    q = 10 ** rng.uniform(-2, 8, size)
    share = rng.lognormal(0, 2, (size, num_layers))
    whole = 10 ** rng.uniform(-12, 8, (size, 1)) * share / share.sum(1, keepdims=True)
    each = 10 ** rng.uniform(-12, 8, (size, num_layers))
    d = np.where(rng.random((size, 1)) < 0.5, whole, each) / q[:, None]

    shape = (size, num_layers + 1)  # the half space is the last
    e = 10 ** rng.uniform(-6, 6, shape) * 10 ** rng.uniform(0, 9, (size, 1))
    nu = rng.uniform(-0.9, 0.5, shape)
    special = [
        (0.15, 0.5),
        (0.10, 0.5 - 1e-12),
        (0.10, 0.5 - 10 ** rng.uniform(-15, -1, shape)),
        (0.05, 0.0),
        (0.05, -0.9),
    ]
    pick = rng.random(shape)
    for share, value in special:
        nu = np.where(pick < share, value, nu)
        pick = np.where(pick < share, 1, pick - share)
    # Every third stack has one Poisson's ratio: only then is a thin incompressible one as stiff
    # as q² d³.
    nu = np.where(rng.random((size, 1)) < 1 / 3, nu[:, :1], nu)
    loss = 10 ** rng.uniform(-3, 1, shape)
    loss = np.where(rng.random(shape) < 0.1, 10.0, loss)
    loss = np.where(rng.random(shape) < 0.1, 0.0, loss)
    if kind == "lossy":
        e = e * (1 + 1j * loss) / np.abs(1 + 1j * loss)
    elif kind == "complex ν":
        nu = np.minimum(nu, 0.5 - 1e-12)
        shear = e * (1 + 1j * loss) / np.abs(1 + 1j * loss)
        bulk = 2 * e * (1 + nu) / (3 * (1 - 2 * nu))
        # The bulk loses less than the shear, from nothing to as much.
        bulk = bulk * (1 + 1j * loss * 10 ** rng.uniform(-4, 0, shape))
        ratio = shear / (3 * bulk)
        e, nu = 3 * shear / (1 + ratio), (1 - 2 * ratio) / (2 * (1 + ratio))
    return q, d, e[:, :-1], nu[:, :-1], e[:, -1], nu[:, -1]


def cases_of(group, base):
    """The stacks of arrays, one by one, as the oracle takes them."""
    q, d, e, nu, base_e, base_nu = (a.tolist() for a in group)
    for i in range(len(q)):
        below = (base_e[i], base_nu[i]) if base == "half space" else base
        yield q[i], list(zip(d[i], e[i], nu[i], strict=True)), below
