"""Waves in layered solids by transfer matrices in mpmath, sharing no formula with the package.

z is out of the body and counted from the surface, as in the state-space form of elasticity: the
state (σ_13, σ_23, σ_33, w_1, w_2, w_3) obeys state' = A state. Growing exponentials are met with
digits. Fields are handed back in the axes of the package.
"""

import mpmath as mp


def generator(qx, qy, modulus, poisson):
    """A; every entry is regular at ν = 1/2."""
    i, p = mp.mpc(0, 1), 1 - poisson
    mu = modulus / (2 * (1 + poisson))
    k, b, eta = poisson / p, (1 + poisson) / p, (1 - 2 * poisson) / (2 * mu * p)
    square = qx * qx + qy * qy
    return mp.matrix(
        [
            [0, 0, -i * qx * k, mu * (square + b * qx * qx), mu * b * qx * qy, 0],
            [0, 0, -i * qy * k, mu * b * qx * qy, mu * (square + b * qy * qy), 0],
            [-i * qx, -i * qy, 0, 0, 0, 0],
            [1 / mu, 0, 0, 0, 0, -i * qx],
            [0, 1 / mu, 0, 0, 0, -i * qy],
            [0, 0, eta, -i * qx * k, -i * qy * k, 0],
        ]
    )


def propagator(a, q, d):
    """exp(A d), from (A² - q²)² = 0."""
    one = mp.eye(6)
    n = a * a - q * q * one
    cosh, sinh = mp.cosh(q * d), mp.sinh(q * d)
    odd = one * (sinh / q) + n * (d * cosh / (2 * q * q) - sinh / (2 * q**3))
    return cosh * one + n * (d * sinh / (2 * q)) + a * odd


def fields(qx, qy, layers, base, traction, depths):
    """[(displacement, stress)] at `depths`, each `(z, layer)` with `len(layers)` for the base.

    `layers` are (d, E, ν) from the surface downwards; `base` is "rigid", "free" or (E, ν).
    """
    deepest = max([float(z) for z, _ in depths] + [float(sum(d for d, _, _ in layers))])
    with mp.workdps(60 + int(2 * deepest * float(mp.hypot(qx, qy)))):
        number = mp.mpmathify
        qx, qy = number(qx), number(qy)
        q = mp.sqrt(qx * qx + qy * qy)
        layers = [tuple(map(number, layer)) for layer in layers]
        generators = [generator(qx, qy, e, nu) for _, e, nu in layers]
        if base == "rigid":
            subspace = mp.eye(6)[:, 0:3]
        elif base == "free":
            subspace = mp.eye(6)[:, 3:6]
        else:
            base = tuple(map(number, base))
            generators.append(generator(qx, qy, *base))
            # The states that decay downwards: (A - q)² (A + q)² = 0.
            plus = generators[-1] + q * mp.eye(6)
            subspace = (plus * plus)[:, 3:6]
        bottoms = [subspace]
        for (d, _, _), a in zip(layers[::-1], generators[: len(layers)][::-1], strict=True):
            bottoms.append(propagator(a, q, d) * bottoms[-1])
        flip = [1, 1, -1]
        load = mp.matrix([f * number(t) for f, t in zip(flip, traction, strict=True)])
        amplitudes = mp.lu_solve(bottoms[-1][0:3, :], load)
        tops = [sum((d for d, _, _ in layers[:k]), mp.mpf(0)) for k in range(len(layers) + 1)]
        found = []
        for z, k in depths:
            # From the lower face of layer k upwards; from the upper face of the base downwards.
            below = tops[min(k + 1, len(layers))]
            state = bottoms[max(len(layers) - 1 - k, 0)] * amplitudes
            state = propagator(generators[k], q, below - number(z)) * state
            moduli = layers[k][1:] if k < len(layers) else base
            found.append(_in_package_axes(qx, qy, moduli, generators[k], state, flip))
        return found


def _in_package_axes(qx, qy, moduli, a, state, flip):
    mu = moduli[0] / (2 * (1 + moduli[1]))
    slope = (a * state)[5]
    w, i = state[3:6], mp.mpc(0, 1)
    mean = state[2] - 2 * mu * slope  # λ tr ε
    shear = i * mu * (qx * w[1] + qy * w[0])
    stress = [
        [mean + 2 * mu * i * qx * w[0], shear, state[0]],
        [shear, mean + 2 * mu * i * qy * w[1], state[1]],
        [state[0], state[1], state[2]],
    ]
    return (
        [complex(f * x) for f, x in zip(flip, w, strict=True)],
        [[complex(flip[m] * flip[n] * stress[m][n]) for n in range(3)] for m in range(3)],
    )
