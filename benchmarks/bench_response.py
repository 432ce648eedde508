"""Errors and times of the surface compliance M_zz, its derivatives and its kernel on a grid.

    python benchmarks/bench_response.py hard         errors on 20,000 random stacks
    python benchmarks/bench_response.py derivatives  errors of derivatives
    python benchmarks/bench_response.py speed        kernels in FFT pairs

Errors are against mpmath at 100 digits, on the same doubles (`exact_stacks.py`); the package is
compared with the paper's 3×3 recursion (`paper_recursion.py`). Random stacks: 1 to 300 layers on a
half space, a rigid base or none; q d from 1e-12 to 1e8, of the stack or of each single layer;
moduli over twelve decades; loss tangents up to 10; ν from -0.9 to 1/2, with 1/2 and 1/2 - 1e-12
frequent; complex ν from passive bulk and shear moduli.
"""

import multiprocessing
import sys
import time
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from exact_stacks import (
    cases_of,
    change_with_digits,
    exact_slope_by_frequency,
    exact_slopes,
    exact_value,
    random_stacks,
)
from paper_recursion import paper_compliance
from rows import goal, report, run, timed

import graded_contact as gc

BASES = {"half space": None, "rigid": gc.Rigid(), "free": gc.Free()}
# Each count is compiled once.
COUNTS = (1, 2, 3, 4, 5, 8, 16, 30, 64, 128, 300)
KINDS = {"elastic": 0.2, "lossy": 0.6, "complex ν": 0.2}


def run_oracle(function, cases, processes):
    """function(case) of all cases as one array, in parallel, with progress on stderr."""
    results, start = [], time.perf_counter()
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for result in pool.imap(function, cases, chunksize=10):
            results.append(result)
            if len(results) % 1000 == 0:
                passed = time.perf_counter() - start
                print(f"  {len(results)} of {len(cases)}, {passed:.0f} s", file=sys.stderr)
    return np.array(results)


def relative_error(values, exact):
    """|value - exact|/|exact|, with `exact` as pairs of doubles in the last axis."""
    with np.errstate(all="ignore"):
        real = (np.real(values) - exact[..., 0]) - exact[..., 1]
        imag = (np.imag(values) - exact[..., 2]) - exact[..., 3]
        return np.hypot(real, imag) / np.hypot(exact[..., 0], exact[..., 2])


def compliance(base, q, d, e, nu, base_e, base_nu):
    """The package's M_zz of one stack."""
    below = (base_e, base_nu) if base == "half space" else BASES[base]
    return gc.layered_compliance(q, d, e, nu, below)


@partial(jax.jit, static_argnums=0)
def compliances(base, *group):
    return jax.vmap(partial(compliance, base))(*group)


def paper_compliances(base, *group):
    """The paper's M_zz of the stacks; NaN where a matrix is singular in floating point."""
    q, d, e, nu, *below = group
    on = tuple(below) if base == "half space" else base
    try:
        with np.errstate(all="ignore"):
            return paper_compliance(q, 0.0, d.T, e.T, nu.T, on)
    except np.linalg.LinAlgError:
        # One singular matrix stops the whole batch.
        if len(q) == 1:
            return np.array([np.nan])
        halves = (slice(None, len(q) // 2), slice(len(q) // 2, None))
        return np.concatenate([paper_compliances(base, *(a[h] for a in group)) for h in halves])


# hard ---------------------------------------------------------------------------------------


def hard(count=20000, seed=0, processes=2):
    """Errors on random stacks."""
    rng = np.random.default_rng(seed)
    cells = [(b, n, k) for b in BASES for n in COUNTS for k in KINDS]
    chances = np.array([KINDS[k] for _, _, k in cells]) / (len(BASES) * len(COUNTS))
    sizes = rng.multinomial(count, chances / chances.sum())
    cells = [(*cell, m) for cell, m in zip(cells, sizes, strict=True) if m > 0]
    groups = [random_stacks(rng, m, n, kind) for _, n, kind, m in cells]
    cases = [
        case
        for (base, *_), group in zip(cells, groups, strict=True)
        for case in cases_of(group, base)
    ]
    start = time.perf_counter()
    exact = run_oracle(exact_value, cases, processes)
    print(f"# oracle: {len(cases)} stacks in {time.perf_counter() - start:.0f} s")
    some = cases[:: max(1, len(cases) // 200)]
    change = np.max(run_oracle(change_with_digits, some, processes))
    print(f"# twice as many digits change {len(some)} of them by at most {change:.0e}")

    ours, theirs = [], []
    for (base, _, _, _), group in zip(cells, groups, strict=True):
        ours.append(np.asarray(compliances(base, *group)))
        theirs.append(paper_compliances(base, *group))
    ours = relative_error(np.concatenate(ours), exact)
    theirs = relative_error(np.concatenate(theirs), exact)
    labels = [np.repeat(np.array(column), sizes[sizes > 0]) for column in zip(*cells, strict=True)]

    sets = [("all", np.full(len(ours), True))]
    for label, names in zip(labels, (BASES, COUNTS, KINDS), strict=False):
        sets += [
            (f"{name} layers" if names is COUNTS else name, label == name)
            for name in names
            if np.any(label == name)
        ]
    for name, some in sets:
        finite = theirs[some & np.isfinite(theirs)]
        report("bench_response-hard", {
            "stacks": name, "number": int(np.sum(some)), **quantiles("error", ours[some]),
            **quantiles("error of the 3x3 recursion", finite),
            "not finite there": float(1 - len(finite) / np.sum(some)),
            "no digit there": float(np.mean(~(theirs[some] < 0.1))),
        })  # fmt: skip
    above = np.sum(~(ours <= 1e-14))
    goal("worst <= 1e-14", f"{np.max(ours):.1e}; {above} of {len(ours)} above it")


# derivatives --------------------------------------------------------------------------------

PARAMETERS = ("q", "d", "E", "ν")
# Up to four layers are unrolled in the package, more are scanned.
DERIVATIVE_CELLS = ((1, "lossy"), (3, "elastic"), (3, "lossy"), (8, "lossy"), (30, "lossy"))
DEAD = 1e-4


def derivatives(count=600, seed=0, processes=2):
    """Errors of derivatives."""
    rng = np.random.default_rng(seed)
    cells = [(base, *cell) for base in BASES for cell in DERIVATIVE_CELLS]
    size = -(-count // len(cells))
    groups = [random_stacks(rng, size, n, kind) for _, n, kind in cells]
    # Half of them the uppermost: deep layers are often not seen at all.
    chosen = [rng.integers(n, size=size) * rng.integers(2, size=size) for _, n, _ in cells]
    cases = [
        (*case, int(j))
        for (base, *_), group, layer in zip(cells, groups, chosen, strict=True)
        for case, j in zip(cases_of(group, base), layer, strict=True)
    ]
    exact = run_oracle(exact_slopes, cases, processes)
    modes = {"grad": reverse_slopes, "jvp": forward_slopes}
    found = {mode: [] for mode in modes}
    units = []
    for (base, *_), group, layer in zip(cells, groups, chosen, strict=True):
        for mode, function in modes.items():
            found[mode].append(function(base, group, layer))
        units.append(natural_units(base, group, layer))
    unit = np.concatenate(units)
    print(f"\n{len(cases)} stacks; an ill-conditioned derivative p ∂M/∂p is below {DEAD:g} M")
    worst = 0.0
    for mode, values in found.items():
        worst = max(worst, derivative_rows(PARAMETERS, mode, np.concatenate(values), exact, unit))
    worst = max(worst, by_frequency(count, processes, rng))
    goal("worst <= 1e-11", f"{worst:.1e}")


def derivative_rows(names, mode, values, exact, unit):
    """Reports a row per parameter and returns the worst error of well-conditioned derivatives."""
    size = np.hypot(exact[..., 0], exact[..., 2])
    itself = relative_error(values, exact)
    with np.errstate(all="ignore"):
        larger = itself * size / np.maximum(size, unit)
    # A derivative that underflows, by a layer that is not seen, has no digit and needs none.
    larger = np.where(size < 1e-290, 0, larger)
    alive = size > DEAD * unit
    for i, name in enumerate(names):
        some = alive[:, i]
        report("bench_response-derivatives", {
            "by": name, "mode": mode, **quantiles("relative error", itself[some, i]),
            "ill-conditioned, left out": float(np.mean(~some)),
            **quantiles("error over M/p or itself", larger[:, i]),
        })  # fmt: skip
    return np.max(itself[alive])


def reverse_slopes(base, group, layer):
    """By q and by d, E, ν of the chosen layers, complex, from `vjp`, shape (stacks, 4)."""
    by_q, *rest = map(np.asarray, _pulled(base, *group))
    return np.stack([by_q, *(np.take_along_axis(r, layer[:, None], 1)[:, 0] for r in rest)], 1)


@partial(jax.jit, static_argnums=0)
def _pulled(base, *group):
    def of_one(q, d, e, nu, *below):
        value, pull = jax.vjp(lambda *p: compliance(base, *p, *below), q, d, e, nu)
        parts = pull(jnp.ones_like(value))
        if jnp.iscomplexobj(value):
            # Cotangents of real parameters are real: 1 asks for Re M, -i for Im M.
            imag = pull(jnp.full_like(value, -1j))
            parts = [
                p if jnp.iscomplexobj(p) else jax.lax.complex(p, i)
                for p, i in zip(parts, imag, strict=True)
            ]
        return parts

    return jax.vmap(of_one)(*group)


def forward_slopes(base, group, layer):
    """As `reverse_slopes`, from `jvp`."""
    return np.asarray(_pushed(base, layer, *group))


@partial(jax.jit, static_argnums=0)
def _pushed(base, layer, *group):
    def of_one(j, q, d, e, nu, *below):
        arguments = (q, d, e, nu)
        moved = (jnp.ones_like(q), *((jnp.arange(d.size) == j).astype(p.dtype) for p in (d, e, nu)))

        def slope(choice):
            tangents = tuple(jnp.where(choice == i, m, 0) for i, m in enumerate(moved))
            return jax.jvp(lambda *p: compliance(base, *p, *below), arguments, tangents)[1]

        return jax.vmap(slope)(jnp.arange(4))

    return jax.vmap(of_one)(layer, *group)


def natural_units(base, group, layer):
    """|M/p| for p = q and d, E of the chosen layers, and |M| for ν."""
    q, d, e, *_ = group
    value = np.abs(compliances(base, *group))
    rows = np.arange(len(q))
    return np.stack([value / q, value / d[rows, layer], value / np.abs(e[rows, layer]), value], 1)


def by_frequency(count, processes, rng):
    """Reports errors of derivatives by ω of stacks of Prony layers, and returns the worst."""
    cells = [(base, num_layers) for base in BASES for num_layers in (3, 8)]
    size, branches = -(-count // len(cells)), 3
    groups, cases = [], []
    for base, num_layers in cells:
        q, d, _, nu, _, base_nu = random_stacks(rng, size, num_layers, "elastic")
        shape = (size, num_layers + 1)
        equilibrium = 10 ** rng.uniform(0, 9, (size, 1)) * 10 ** rng.uniform(-3, 3, shape)
        strengths = equilibrium[..., None] * 10 ** rng.uniform(-2, 3, (*shape, branches))
        times = 10 ** rng.uniform(-6, 2, (*shape, branches))
        omega = 10 ** rng.uniform(-2, 6, size)
        nu = np.concatenate([nu, base_nu[:, None]], 1)
        groups.append((q, omega, d, equilibrium, strengths, times, nu))
        cases += [_prony_case(base, *(a[i].tolist() for a in groups[-1])) for i in range(size)]
    exact = run_oracle(exact_slope_by_frequency, cases, processes)
    omega = np.concatenate([group[1] for group in groups])
    unit = np.hypot(exact[:, 0], exact[:, 2]) / omega
    worst = 0.0
    for mode in ("grad", "jvp"):
        found = [
            np.asarray(slope_by_frequency(base, mode, *group))
            for (base, _), group in zip(cells, groups, strict=True)
        ]
        found = np.concatenate(found)[:, None]
        worst = max(worst, derivative_rows("ω", mode, found, exact[:, None, 4:], unit[:, None]))
    return worst


def _prony_case(base, q, omega, d, equilibrium, strengths, times, nu):
    parts = list(zip(equilibrium, strengths, times, nu, strict=True))
    layers = [(thickness, *part) for thickness, part in zip(d, parts, strict=False)]
    return q, omega, layers, parts[-1] if base == "half space" else base


@partial(jax.jit, static_argnums=(0, 1))
def slope_by_frequency(base, mode, *inputs):
    def of_one(q, omega, d, *moduli):
        parts = [gc.Prony(*(m[i] for m in moduli)) for i in range(len(d) + 1)]
        below = gc.HalfSpace(parts[-1]) if base == "half space" else BASES[base]
        layers = tuple(gc.Layer(p, d[i]) for i, p in enumerate(parts[:-1]))
        stack = gc.Stack(layers=layers, base=below)

        def value(omega):
            return gc.surface_compliance(stack, q, omega)

        if mode == "jvp":
            return jax.jvp(value, (omega,), (jnp.ones_like(omega),))[1]
        real, imag = (
            jax.grad(lambda w, p=part: p(value(w)))(omega) for part in (jnp.real, jnp.imag)
        )
        return jax.lax.complex(real, imag)

    return jax.vmap(of_one)(*inputs)


# speed --------------------------------------------------------------------------------------

CELL, VELOCITY = 0.1, 0.1  # m, m/s


def rubber(share):
    """A tread between soft and slow (share 0) and stiff and fast (1), real ν."""
    tread = gc.tyre_tread()
    return gc.Prony(
        equilibrium=tread.equilibrium * (1 + share),
        strengths=tread.strengths * (1 + 3 * share),
        times=tread.times * 10 ** (-2 * share),
        poisson=0.45 + 0.05 * share,
    )


def layered(num_layers):
    """A millimetre of layers on a half space; one layer of it is 0.1 mm."""
    share = (np.arange(num_layers) + 0.5) / num_layers
    thickness = np.full(num_layers, 1e-3 / num_layers) if num_layers > 1 else [1e-4]
    layers = tuple(gc.Layer(rubber(s), d) for s, d in zip(share, thickness, strict=True))
    return gc.Stack(layers=layers, base=gc.HalfSpace(rubber(1.0)))


def graded():
    profile = gc.Blend(rubber(1.0), rubber(0.0), gc.shapes.Linear())
    return gc.Stack(layers=(gc.GradedLayer(profile, 1e-3),), base=gc.HalfSpace(rubber(1.0)))


# Name -> (stack, goal in FFT pairs at N = 2048)
BODIES = {
    "1 layer": (lambda: layered(1), None),
    "3 layers": (lambda: layered(3), 1),
    "30 layers": (lambda: layered(30), 8),
    "300 layers": (lambda: layered(300), None),
    "graded 1e-9": (graded, 4),
}


def speed(sizes=(1024, 2048, 4096), bodies=tuple(BODIES), repeat=5, points=4000):
    """Kernels in FFT pairs: of one rfft2 and irfft2 of the grid in a loop.

    The error is the worst of random points against `surface_compliance`.
    """
    for n in sizes:
        grid = gc.Grid((n, n), CELL)
        bare = transform_pair(n)
        print(f"# N = {n}: one FFT pair {1e3 * bare:.3g} ms")
        for name in bodies:
            make, most = BODIES[name]
            stack = make()
            run = partial(gc.stack_kernel, stack, grid, VELOCITY)
            start = time.perf_counter()
            kernel = np.asarray(run())
            first = time.perf_counter() - start
            warm = timed(run, repeat)
            error = kernel_error(stack, grid, kernel, points)
            report("bench_response-speed", {
                "body": name, "N": n, "first call [s]": first, "warm [s]": warm,
                "over an FFT pair": warm / bare, "error": float(error),
            })  # fmt: skip
            if n == 2048 and most:
                goal(f"{name}: <= {most} FFT pairs", f"{warm / bare:.2f}")


def transform_pair(n):
    count = max(4, 2 * (2048 // n) ** 2)

    @jax.jit
    def pairs(field):
        one = lambda _, f: jnp.fft.irfft2(jnp.fft.rfft2(f), f.shape)  # noqa: E731
        return jax.lax.fori_loop(0, count, one, field)

    field = jax.random.normal(jax.random.key(0), (n, n))
    jax.block_until_ready(pairs(field))
    return timed(partial(pairs, field), 3) / count


def kernel_error(stack, grid, kernel, num_points):
    """The worst relative error at random points off the Nyquist lines and off q = 0."""
    n = grid.shape[0]
    rng = np.random.default_rng(0)
    i, j = rng.integers(1 - n // 2, n // 2, num_points), rng.integers(1, n // 2, num_points)
    qx, qy = (2 * np.pi / CELL * k for k in (i, j))
    rtol = 1e-12 if any(isinstance(layer, gc.GradedLayer) for layer in stack.layers) else None
    expected = gc.surface_compliance(stack, np.hypot(qx, qy), -qx * VELOCITY, rtol=rtol)
    return np.max(np.abs(kernel[i, j] / np.asarray(expected) - 1))


# Common -------------------------------------------------------------------------------------


def quantiles(name, errors):
    """The worst, the 99.9 % quantile and the median."""
    some = errors if len(errors) else np.full(1, np.nan)
    return {
        f"{name}: worst": float(np.max(some)),
        f"{name}: 99.9 %": float(np.quantile(some, 0.999)),
        f"{name}: median": float(np.median(some)),
    }


if __name__ == "__main__":
    run(__doc__, hard, derivatives, speed)
